"""Geometric stiffness: buckling loads, a stretched rod, what a rigid rotation costs; static compliance."""

from typing import Any

import numpy as np
import pytest
import scipy.linalg
import xarray as xr

from flexclear.pipeline.structure.fe import beam
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import BENDING, RECIPE, build, held_rows, order
from tests.analytic.beam_solutions import PAPER_ROD, cantilever_compliance

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


def reduced(reference: str, count: int | None, interfaces: tuple[str, ...] = ("bottom", "top")) -> xr.Dataset:
    rod = kind.build(RECIPE)
    return bundle.build(rod, solve(rod, reference, count, interfaces))


def relative(found: np.ndarray) -> np.ndarray:
    exact = cantilever_compliance(PAPER_ROD)
    return np.abs(found - exact) / np.sqrt(np.outer(exact.diagonal(), exact.diagonal()))


@pytest.mark.parametrize("count", [6, 8, 13, None])
def test_craig_bampton_has_the_exact_compliance_with_any_number_of_normal_modes(count: int | None) -> None:
    """L/EA, L^3/3EI, L/GJ, L/EI and their coupling; Hermite cubics are exact for end loads."""
    assert relative(compliance(reduced("craig-bampton", count), "top")).max() < SOLVED


def test_craig_bampton_body_frame_follows_its_first_interface() -> None:
    for first, second in (("bottom", "top"), ("top", "bottom")):
        data = reduced("craig-bampton", 13, (first, second))
        assert not data["frame_translation_shape"].sel(frame=first).values.any()
        assert not data["frame_rotation_shape"].sel(frame=first).values.any()
        assert np.abs(data["frame_translation_shape"].sel(frame=second).values).max() > 0.1
