"""A rod is the same rod wherever it lies; its geometric stiffness and its static compliance are exact."""

from typing import Any

import numpy as np
import pytest
import scipy.linalg
import xarray as xr

from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.structure.fe import beam
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from tests.analytic.beam_models import BENDING, RECIPE, build, held_rows, order
from tests.analytic.beam_solutions import PAPER_ROD, cantilever_compliance

POSES: dict[str, dict[str, Any]] = {
    "turned": {"position": [0.1, -0.2, 0.3], "rotation_vector": [0.4, -1.1, 0.7]},
    "upright": {"position": [0.0, 0.0, 0.0], "axes": {"x": [0, 0, 1], "y": [1, 0, 0]}},
    # a kilometre away, where 1e-16 of the place is 1e-10 of a millimetre
    "far": {"position": [600.0, -700.0, 400.0], "rotation_vector": [0.4, -1.1, 0.7]},
}
#: a rod without any symmetry that would leave shapes open: other stiffness in each plane, a ball next to the axis
ROD: dict[str, Any] = RECIPE | {
    "theory": "timoshenko",
    "torsion": "quadratic",
    "section": {"type": "rectangle", "width": 0.02, "height": 0.013},
    "end_section": {"type": "rectangle", "width": 0.012, "height": 0.01},
    "masses": {"ball": {"x": 0.24, "mass": 0.3, "com": [0.01, 0.002, -0.003], "inertia": [6e-5, 8e-5, 9e-5]}},
}
#: what solvers leave of frequencies: matrices agree to 1e-13 (below), and the stiffness, scaled to a unit diagonal, has
#: the condition 1.3e4, which times eps is 3e-12 in their squares; some thirty times that
FREQUENCY = 5e-11
#: and of shapes, relative to the largest component: the same over the least relative gap of eigenvalues, 0.12
SHAPE = 5e-10


def reduced(reference: str, count: int, pose: dict[str, Any] | None = None) -> xr.Dataset:
    rod = kind.build(ROD | ({"pose": pose} if pose else {}))
    return bundle.build(rod, solve(rod, reference, count))


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("reference, count", [("free-free", 8), ("craig-bampton", 12)])
def test_the_bundle_is_the_same_in_the_rods_own_frames(reference: str, count: int, pose: str) -> None:
    here, there = reduced(reference, count), reduced(reference, count, POSES[pose])
    np.testing.assert_allclose(there["frequency"], here["frequency"], rtol=FREQUENCY)
    # named frames: z along the rod, whatever the mesh frame; a mode may come with the other sign
    signs = _signs(here, there)
    for name in ("frame_translation_shape", "frame_rotation_shape"):
        a, b = (_in_frames(data, name) for data in (here, there))
        np.testing.assert_allclose(b * signs, a, rtol=0.0, atol=SHAPE * np.abs(a).max())
    for name in ("compliance_full", "compliance_share"):
        # lengths between nodes a kilometre away have 1e-13 m of rounding on 0.02 m
        np.testing.assert_allclose(there[name], here[name], rtol=1e-9, atol=1e-9 * float(abs(here[name]).max()))


@pytest.mark.parametrize("pose", ["turned", "upright"])
def test_invariants_turn_and_shift_with_the_rod(pose: str) -> None:
    here, there = reduced("craig-bampton", 12), reduced("craig-bampton", 12, POSES[pose])
    position = np.array(POSES[pose]["position"])
    R = there["frame_rotation"].values[0] @ here["frame_rotation"].values[0].T
    signs = _signs(here, there)
    mass = float(here["mass"])
    assert float(there["mass"]) == pytest.approx(mass, rel=1e-14)
    first = R @ here["first_moment"].values
    np.testing.assert_allclose(there["first_moment"], first + mass * position, rtol=1e-12)
    second = R @ here["second_moment"].values @ R.T
    second += np.outer(first, position) + np.outer(position, first) + mass * np.outer(position, position)
    np.testing.assert_allclose(there["second_moment"], second, rtol=1e-12, atol=1e-14)
    modal = R @ here["modal_first_moment"].values * signs
    _close(there["modal_first_moment"].values, modal)
    moment = np.einsum("ka,lb,abj->klj", R, R, here["position_mode_moment"].values) * signs
    _close(there["position_mode_moment"].values, moment + position[:, None, None] * modal)
    pairs = np.einsum("ka,lb,abij->klij", R, R, here["mode_mode_moment"].values) * np.outer(signs, signs)
    _close(there["mode_mode_moment"].values, pairs)


def _close(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=SHAPE * np.abs(expected).max())


def _in_frames(data: xr.Dataset, name: str) -> np.ndarray:
    return np.einsum("fka,fkj->faj", data["frame_rotation"].values, data[name].values)


def _signs(here: xr.Dataset, there: xr.Dataset) -> np.ndarray:
    a, b = (
        np.concatenate([_in_frames(d, "frame_translation_shape"), 0.1 * _in_frames(d, "frame_rotation_shape")])
        for d in (here, there)
    )
    return np.sign(np.einsum("faj,faj->j", a, b))


@pytest.mark.parametrize("theory", ["rayleigh", "timoshenko"])
def test_matrices_turn_with_the_rod(theory: str) -> None:
    recipe = ROD | {"theory": theory}
    here, there = (beam.assemble(kind.build(r)) for r in (recipe, recipe | {"pose": POSES["far"]}))
    R = rotation_vector_to_matrix(np.array(POSES["far"]["rotation_vector"]))
    turn = np.eye(here.size)
    for start in range(0, here.nodal_size, 3):
        turn[start : start + 3, start : start + 3] = R
    for a, b in ((here.stiffness, there.stiffness), (here.mass, there.mass)):
        expected = turn @ a.toarray() @ turn.T
        scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
        # the places of the nodes play no part, so the kilometre costs no digit
        assert (np.abs(b.toarray() - expected) <= 1e-14 * np.abs(expected).max() + 1e-13 * scale).all()


# NAFEMS FV2, pin-ended double cross, in-plane: eight arms of 5 m, 125 x 125 mm, E = 200 GPa, 8000 kg/m^3
ARM: dict[str, Any] = {
    "theory": "euler-bernoulli",
    "shape": {"type": "straight-beam", "length": 5.0},
    "material": {"density": 8000.0, "youngs_modulus": 2e11, "poisson": 0.3},
    "section": {"type": "rectangle", "width": 0.125, "height": 0.125},
    "frames": {"centre": {"x": 0.0}, "pin": {"x": 5.0}},
}
#: analytical values [Hz] of inextensible arms, and how often each comes
FV2 = ((11.33624602646386, 1), (17.70937984816896, 7), (45.34498410585544, 1), (57.38973374330916, 7))


def double_cross(elements: int, *, centre_held: bool) -> np.ndarray:
    """The sixteen lowest in-plane frequencies [Hz] of eight arms, 45 deg apart, one node in common."""
    arms = [
        kind.build(ARM | {"elements": elements, "pose": {"rotation_vector": [0.0, 0.0, k * np.pi / 4.0]}})
        for k in range(8)
    ]
    plane = np.array([0, 1, 5])
    size = 3 + 8 * 3 * elements
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for k, arm in enumerate(arms):
        found = beam.assemble(arm)
        own = (6 * np.arange(elements + 1)[:, None] + plane).ravel()
        place = np.concatenate([np.arange(3), 3 + 3 * elements * k + np.arange(3 * elements)])
        for total, part in ((K, found.stiffness), (M, found.mass)):
            total[np.ix_(place, place)] += part.toarray()[np.ix_(own, own)]
    held = [3 + 3 * elements * (k + 1) - 3 + axis for k in range(8) for axis in (0, 1)]
    free = np.setdiff1d(np.arange(size), held + ([0, 1] if centre_held else []))
    values = scipy.linalg.eigvalsh(K[np.ix_(free, free)], M[np.ix_(free, free)])[:16]
    return np.sqrt(values) / (2.0 * np.pi)


def test_nafems_fv2_double_cross_of_eight_turned_rods() -> None:
    expected = np.repeat([f for f, _ in FV2], [n for _, n in FV2])
    # inextensible arms hold their centre; 0.1 % for the first cluster with 4 elements per arm, for both with 8:
    # (beta h)^4 / 1440 is 6.5e-4 and 4.2e-4 there
    np.testing.assert_allclose(double_cross(4, centre_held=True)[:8], expected[:8], rtol=1e-3)
    np.testing.assert_allclose(double_cross(8, centre_held=True), expected, rtol=1e-3)
    # 0.01 % takes 12: 8e-5 is left
    np.testing.assert_allclose(double_cross(12, centre_held=True), expected, rtol=1e-4)
    # real arms stretch: in each cluster of seven the two modes in which the centre moves are lower
    free = double_cross(8, centre_held=False) / double_cross(8, centre_held=True)
    assert np.flatnonzero(np.abs(free - 1.0) > 1e-3).tolist() == [1, 2, 9, 10]
    assert free.max() < 1.0 + 1e-9


@pytest.mark.parametrize("reference, count", [("craig-bampton", 12), ("pinned-pinned", 8)])
def test_a_turned_frame_is_another_name_for_the_same_section(reference: str, count: int) -> None:
    """Pins across a rod: the frames' axes change, the shapes and frequencies do not."""
    across = {name: frame | {"axes": {"z": [0, 0, 1], "x": [1, 0, 0]}} for name, frame in ROD["frames"].items()}
    along, turned = (kind.build(ROD | {"frames": frames}) for frames in (ROD["frames"], across))
    here, there = (bundle.build(rod, solve(rod, reference, count)) for rod in (along, turned))
    assert np.array_equal(turned["frame_rotation"].values[0], np.eye(3))  # the axes given are the mesh frame's
    np.testing.assert_allclose(there["frequency"], here["frequency"], rtol=FREQUENCY)
    # shapes have components of the mesh frame; they agree but for signs, as far as the eigensolver knows them
    for name in ("frame_translation_shape", "frame_rotation_shape"):
        size = np.abs(here[name].values).max()
        np.testing.assert_allclose(np.abs(there[name].values), np.abs(here[name].values), rtol=0, atol=1e-7 * size)


# Geometric stiffness: buckling loads ---------------------------------------------------------------------------------

EI = PAPER_ROD.youngs_modulus * PAPER_ROD.second_moment
#: effective length over length, Euler's cases
EULER = {"CF": 2.0, "PP": 1.0, "CP": 0.699155660, "CC": 0.5}


def plane(matrix: Any, ends: str, system: beam.Beam) -> np.ndarray:
    """One plane of bending, with its ends held."""
    rows = held_rows(system, BENDING, ends)
    return np.asarray(matrix.toarray()[np.ix_(rows, rows)])


def critical_load(elements: int, ends: str, **changes: Any) -> float:
    """Smallest compressive force [N] at which the rod's plane loses its stiffness."""
    rod = build(elements=elements, **changes)
    found = beam.assemble(rod)
    unit = beam.geometric_stiffness(rod, np.ones(elements))
    K, S = (plane(matrix, ends, found) for matrix in (found.stiffness, unit))
    # K x = P S x: the stiffness of a compression P is -P S
    return float(1.0 / scipy.linalg.eigvalsh(S, K)[-1])


@pytest.mark.parametrize("ends", EULER)
def test_euler_loads_are_met_from_above_at_order_four(ends: str) -> None:
    exact = np.pi**2 * EI / (EULER[ends] * PAPER_ROD.length) ** 2
    elements = [4, 8, 16]
    error = np.array([critical_load(n, ends) / exact - 1.0 for n in elements])
    assert error.min() > 0.0
    # (k h)^4 / 720 with k h = 2 pi / 16 of clamped ends is 3e-5; the next order turns the slope by 0.08
    assert error[-1] < 1e-4
    np.testing.assert_allclose(order(elements, error), 4.0, atol=0.2)


def test_shear_lowers_the_euler_load_as_engesser_says() -> None:
    """P = P_E / (1 + P_E / kappa G A) when the axial force follows the axis: geometric work in v'."""
    section = {"type": "circle", "radius": PAPER_ROD.radius, "shear_coefficient": 0.1}
    found = critical_load(16, "PP", theory="timoshenko", section=section)
    euler = np.pi**2 * EI / PAPER_ROD.length**2
    exact = euler / (1.0 + euler / (0.1 * PAPER_ROD.shear_modulus * PAPER_ROD.area))
    # as above with k h = pi / 16: 2e-6
    assert found == pytest.approx(exact, rel=1e-5)
    assert exact < 0.96 * euler


def test_a_cantilever_buckles_under_its_own_weight() -> None:
    """At q L^3 = 7.8373 EI (Timoshenko & Gere, sec. 2.12); the force varies from cell to cell."""
    elements = 64
    rod = build(elements=elements)
    found = beam.assemble(rod)
    weight_above = 1.0 - (np.arange(elements) + 0.5) / elements
    unit = beam.geometric_stiffness(rod, weight_above)
    K, S = (plane(matrix, "CF", found) for matrix in (found.stiffness, unit))
    load = 1.0 / scipy.linalg.eigvalsh(S, K)[-1]
    # the force is constant in each cell: second order, 64 cells leave 1e-4
    assert load * PAPER_ROD.length**2 / EI == pytest.approx(7.8373, rel=2e-4)


def test_it_turns_with_the_rod_and_ignores_translations() -> None:
    turned = build(elements=6, pose={"rotation_vector": [0.4, -1.1, 0.7]}, theory="timoshenko")
    straight = build(elements=6, theory="timoshenko")
    force = np.linspace(-3.0, 5.0, 6)
    found = beam.assemble(turned)
    G = beam.geometric_stiffness(turned, force)
    assert np.abs(G @ beam.rigid_vectors(found)[:, :3]).max() < 1e-11  # entries are 36 / 30 N / h, about 1e2
    values = [np.linalg.eigvalsh(beam.geometric_stiffness(rod, force).toarray()) for rod in (turned, straight)]
    np.testing.assert_allclose(*values, atol=1e-11)


# Static compliance of the reduced rod at its joints: what each basis can and cannot give ----------------------------


def compliance(data: xr.Dataset, frame: str) -> np.ndarray:
    """Displacement and rotation per force and moment at a frame, shape (6, 6), body frame held."""
    place = data.sel(frame=frame)
    shapes = np.concatenate([place["frame_translation_shape"].values, place["frame_rotation_shape"].values])
    return shapes @ np.linalg.solve(data["modal_stiffness"].values, shapes.T)


#: relative error of a compliance from modes: the eigenvalues of all of them span 1.2e6, and the softest is known to eps
#: times that, 2.6e-10; forty times that
SOLVED = 1e-8


def reduced_rod(reference: str, count: int | None, interfaces: tuple[str, ...] = ("bottom", "top")) -> xr.Dataset:
    rod = kind.build(RECIPE)
    return bundle.build(rod, solve(rod, reference, count, interfaces))


def relative(found: np.ndarray) -> np.ndarray:
    exact = cantilever_compliance(PAPER_ROD)
    return np.abs(found - exact) / np.sqrt(np.outer(exact.diagonal(), exact.diagonal()))


@pytest.mark.parametrize("count", [6, 8, 13, None])
def test_craig_bampton_has_the_exact_compliance_with_any_number_of_normal_modes(count: int | None) -> None:
    """L/EA, L^3/3EI, L/GJ, L/EI and their coupling; Hermite cubics are exact for end loads."""
    assert relative(compliance(reduced_rod("craig-bampton", count), "top")).max() < SOLVED


def test_craig_bampton_body_frame_follows_its_first_interface() -> None:
    for first, second in (("bottom", "top"), ("top", "bottom")):
        data = reduced_rod("craig-bampton", 13, (first, second))
        assert not data["frame_translation_shape"].sel(frame=first).values.any()
        assert not data["frame_rotation_shape"].sel(frame=first).values.any()
        assert np.abs(data["frame_translation_shape"].sel(frame=second).values).max() > 0.1
