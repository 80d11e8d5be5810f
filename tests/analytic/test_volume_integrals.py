"""Invariants of bodies, and their energy, against clouds of mass points, by brute force.

A rod with everything - taper, shear, quadratic twist, pose, ball - moves by the element's functions written out again
here, from the solution's unknowns; a solid by quadrature over its curved cells.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.structure.fe.solid.elements import shape_functions
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from tests.analytic import solid_models
from tests.analytic.beam_models import RECIPE
from tests.analytic.beam_solutions import PAPER_ROD

ELEMENTS = 4
START, END = (0.02, 0.013), (0.012, 0.01)
POSITION, TURN = np.array([0.1, -0.2, 0.3]), np.array([0.4, -1.1, 0.7])
MASS, COM, INERTIA = 0.3, np.array([0.01, 0.002, -0.003]), np.array([6e-5, 8e-5, 9e-5])
RECIPES: dict[str, dict[str, Any]] = {
    theory: RECIPE
    | {
        "elements": ELEMENTS,
        "theory": theory,
        "torsion": "quadratic",
        "extension": "quadratic",
        "section": {"type": "rectangle", "width": START[0], "height": START[1]},
        "end_section": {"type": "rectangle", "width": END[0], "height": END[1]},
        "pose": {"position": POSITION.tolist(), "rotation_vector": TURN.tolist()},
        "masses": {"ball": {"x": 0.24, "mass": MASS, "com": COM.tolist(), "inertia": INERTIA.tolist()}},
    }
    for theory in ("rayleigh", "timoshenko")
}
#: frames of a thick solid rod [m] hold their faces rigidly, or by their means
TIES, THICK = ("rigid", "mean"), 0.04


@dataclass(frozen=True)
class Cloud:
    """Mass points [kg] (p,), places [m] (3, p), shapes per modal coordinate (3, p, n); length of the body [m]."""

    mass: np.ndarray
    place: np.ndarray
    shape: np.ndarray
    length: float


def rod_cloud(theory: str, modes: xr.Dataset) -> Cloud:
    """Six Gauss points along each cell, two by two over the section; six points for the ball."""
    R = rotation_vector_to_matrix(TURN)
    h = PAPER_ROD.length / ELEMENTS
    node, weight = np.polynomial.legendre.leggauss(6)
    masses, places, shapes = [], [], []
    for cell in range(ELEMENTS):
        for s, w in zip(0.5 * (1.0 + node), 0.5 * weight, strict=True):
            fraction = (cell + s) / ELEMENTS
            width, height = (a + fraction * (b - a) for a, b in zip(START, END, strict=True))
            move, turn = section_motion(theory, modes, R, cell, float(s), h)
            for y in (-0.5, 0.5):
                for z in (-0.5, 0.5):
                    arm = np.array([0.0, y * width / np.sqrt(3.0), z * height / np.sqrt(3.0)])
                    masses.append(PAPER_ROD.density * width * height / 4.0 * w * h)
                    places.append(np.array([(cell + s) * h, 0.0, 0.0]) + arm)
                    shapes.append(move + np.cross(turn, arm, axisa=0, axisc=0))
    move, turn = section_motion(theory, modes, R, ELEMENTS - 1, 1.0, h)
    spread = 0.5 * INERTIA.sum() - INERTIA
    for k in range(3):
        for side in (-1.0, 1.0):
            arm = COM + side * np.sqrt(3.0 * spread[k] / MASS) * np.eye(3)[k]
            masses.append(MASS / 6.0)
            places.append(np.array([PAPER_ROD.length, 0.0, 0.0]) + arm)
            shapes.append(move + np.cross(turn, arm, axisa=0, axisc=0))
    place = POSITION[:, None] + R @ np.array(places).T
    return Cloud(np.array(masses), place, np.einsum("kl,pln->kpn", R, np.array(shapes)), PAPER_ROD.length)


def section_motion(
    theory: str, modes: xr.Dataset, R: np.ndarray, cell: int, s: float, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Translation and rotation (3, n) of a section, rod axes, from the unknowns of its cell."""
    vector = modes["vector"].values
    nodal = 6 * (ELEMENTS + 1)
    ends = vector[6 * cell : 6 * cell + 12].reshape(2, 2, 3, -1)
    (u1, r1), (u2, r2) = np.einsum("lk,abln->abkn", R, ends)
    inside = vector[nodal:].reshape(ELEMENTS, -1, vector.shape[1])[cell]
    two, three = 4.0 * s * (1.0 - s), 8.0 * s * (1.0 - s) * (2.0 * s - 1.0)
    u, r = (1.0 - s) * u1 + s * u2, (1.0 - s) * r1 + s * r2
    u[0] += two * inside[0]
    r[0] += two * inside[1]
    if theory == "timoshenko":
        u[1] += two * inside[2] + three * inside[3]
        r[2] += two * inside[4]
        u[2] += two * inside[5] + three * inside[6]
        r[1] += two * inside[7]
        return u, r
    cubic = [1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, h * (s**3 - s**2)]
    slope = [(6 * s**2 - 6 * s) / h, 1 - 4 * s + 3 * s**2, (6 * s - 6 * s**2) / h, 3 * s**2 - 2 * s]
    for k, turn, sign in ((1, 2, 1.0), (2, 1, -1.0)):
        values = [u1[k], sign * r1[turn], u2[k], sign * r2[turn]]
        u[k] = sum(a * b for a, b in zip(cubic, values, strict=True))
        r[turn] = sign * sum(a * b for a, b in zip(slope, values, strict=True))
    return u, r


def displacements(mesh: xr.Dataset, modes: xr.Dataset) -> np.ndarray:
    """Of all nodes, shape (nodes, 3, n): free nodes in their order, then six numbers of each rigid frame."""
    x, vectors = mesh["node_position"].values, modes["vector"].values
    rigid = np.flatnonzero(mesh["frame_tie"].values == "rigid")
    tied = {int(k): mesh["tie_node"].values[mesh["tie_frame"].values == k] for k in rigid}
    free = np.setdiff1d(np.arange(len(x)), np.concatenate([np.empty(0, dtype=int), *tied.values()]))
    u = np.zeros((len(x), 3, vectors.shape[1]))
    u[free] = vectors[: 3 * free.size].reshape(-1, 3, vectors.shape[1])
    for n, (k, nodes) in enumerate(tied.items()):
        frame = vectors[3 * free.size + 6 * n :][:6]
        r = x[nodes] - mesh["frame_position"].values[k]
        u[nodes] = frame[:3] + np.cross(frame[3:].T[None], r[:, None]).transpose(0, 2, 1)
    return u


def solid_cloud(mesh: xr.Dataset, u: np.ndarray) -> Cloud:
    points, weight = solid_models.gauss(6)
    value, gradient = shape_functions("hex27", points)
    x, cells = mesh["node_position"].values, mesh["cell_node"].values
    J = np.einsum("cai,qaj->cqij", x[cells], gradient)
    mass = 2740.0 * np.linalg.det(J) * weight
    place = np.einsum("cai,qa->icq", x[cells], value)
    shape = np.einsum("cain,qa->icqn", u[cells], value, optimize=True)
    return Cloud(mass.ravel(), place.reshape(3, -1), shape.reshape(3, mass.size, -1), THICK)


@pytest.fixture(scope="module", params=[*RECIPES, *TIES])
def body(request: pytest.FixtureRequest) -> tuple[xr.Dataset, Cloud]:
    """A rod, or a thick solid of few cells: five points per direction integrate the mass of 27-node cells exactly."""
    if request.param in RECIPES:
        rod = kind.build(RECIPES[request.param])
        modes = solve(rod, "craig-bampton", 14)
        return bundle.build(rod, modes), rod_cloud(request.param, modes)
    recipe = solid_models.rod("hex27", (3, 1, 1), request.param)
    recipe["shape"] |= {"length": THICK}
    mesh = solid_models.build(recipe)
    modes = solve(mesh, "craig-bampton", 12)
    return bundle.build(mesh, modes), solid_cloud(mesh, displacements(mesh, modes))


def test_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    data, points = body
    mass, X, S, length = points.mass, points.place, points.shape, points.length
    weighted, total = S * mass[:, None], float(mass.sum())
    # Cauchy-Schwarz: a mass-normalised shape has int rho S <= sqrt(m), int rho X S <= sqrt(int rho X^2)
    size = np.sqrt(total)
    expected: dict[str, tuple[np.ndarray, float]] = {
        "mass": (np.array(total), total),
        "first_moment": (X @ mass, total * length),
        "second_moment": ((X * mass) @ X.T, total * length**2),
        "modal_first_moment": (weighted.sum(axis=1), size),
        "position_mode_moment": (np.einsum("kp,lpj->klj", X, weighted), size * length),
        "mode_mode_moment": (np.einsum("kpi,lpj->klij", S, weighted, optimize=True), 1.0),
    }
    for name, (values, scale) in expected.items():
        # both sums add some thousand terms: eps * sqrt(1e4) of the largest, with a margin
        np.testing.assert_allclose(data[name].values, values, rtol=0.0, atol=1e-12 * scale, err_msg=name)


def test_kinetic_energy_of_any_motion_is_that_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    """Velocity, spin, deformation and its rate at random; every coupling term of the body is in it."""
    data, points = body
    n = data.sizes["mode"]
    random = np.random.default_rng(20190702)
    for _ in range(5):
        v, omega = random.normal(size=3), 10.0 * random.normal(size=3)
        q, rate = 1e-3 * random.normal(size=n), random.normal(size=n)
        r = points.place + points.shape @ q
        velocity = v[:, None] + np.cross(omega, r, axisb=0, axisc=0) + points.shape @ rate
        expected = 0.5 * float(points.mass @ (velocity**2).sum(axis=0))
        assert kinetic(data, v, omega, q, rate) == pytest.approx(expected, rel=1e-10)


def kinetic(data: xr.Dataset, v: np.ndarray, omega: np.ndarray, q: np.ndarray, rate: np.ndarray) -> float:
    """Kinetic energy from the bundle alone, body axes."""
    P, F = data["position_mode_moment"].values, data["mode_mode_moment"].values
    first = data["first_moment"].values + data["modal_first_moment"].values @ q
    first_rate = data["modal_first_moment"].values @ rate
    second = data["second_moment"].values + P @ q + (P @ q).T + np.einsum("klij,i,j->kl", F, q, q)
    # int rho r_k rdot_l
    mixed = P @ rate + np.einsum("klij,i,j->kl", F, q, rate)
    inertia = np.trace(second) * np.eye(3) - second
    spin = np.array([mixed[1, 2] - mixed[2, 1], mixed[2, 0] - mixed[0, 2], mixed[0, 1] - mixed[1, 0]])
    energy = 0.5 * float(data["mass"]) * v @ v + v @ np.cross(omega, first) + v @ first_rate
    return float(energy + 0.5 * omega @ inertia @ omega + omega @ spin + 0.5 * rate @ data["modal_mass"].values @ rate)


@pytest.mark.parametrize("body", TIES, indirect=True, scope="module")
def test_frames_move_as_their_nodes_do(body: tuple[xr.Dataset, Cloud]) -> None:
    """Forces on a frame do the work of tractions with the same resultant: mean of the face by area."""
    data, _ = body
    top = data.sel(frame="top")
    np.testing.assert_allclose(top["frame_position"].values, [THICK, 0.0, 0.0], atol=1e-12)
    face = np.abs(data["node_position"].values[:, 0] - THICK) < 1e-9
    moved = data["shape_translation"].values[face]
    low, high = moved.min(axis=0), moved.max(axis=0)
    # the frame's motion lies among those of the face; constraint modes move it by much more than rounding
    inside = top["frame_translation_shape"].values
    assert np.all((inside >= low - 1e-9) & (inside <= high + 1e-9))
    assert np.abs(inside).max() > 1.0
