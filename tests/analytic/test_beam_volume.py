"""Invariants of a rod with everything - taper, shear, quadratic twist, pose, ball - against a cloud of mass points.

The cloud moves by the element's functions written out again here, from the solution's unknowns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import rotation_vector_to_matrix
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import RECIPE
from tests.analytic.beam_solutions import PAPER_ROD
from tests.analytic.clouds import Cloud, same_energy, same_integrals

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


def cloud(theory: str, modes: xr.Dataset) -> Cloud:
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
    return Cloud(np.array(masses), place, np.einsum("kl,pln->kpn", R, np.array(shapes)))


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


@pytest.fixture(scope="module", params=list(RECIPES))
def body(request: pytest.FixtureRequest) -> tuple[xr.Dataset, Cloud]:
    rod = kind.build(RECIPES[request.param])
    modes = solve(rod, "craig-bampton", 14)
    return bundle.build(rod, modes), cloud(request.param, modes)


def test_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_integrals(*body, PAPER_ROD.length)


def test_kinetic_energy_of_any_motion_is_that_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_energy(*body)


def test_modal_mass_is_one(body: tuple[xr.Dataset, Cloud]) -> None:
    mass = np.einsum("kkij->ij", body[0]["mode_mode_moment"].values)
    # two routes to the same matrix: assembled and summed over slices; vectors are normalised to about 1e-13
    np.testing.assert_allclose(mass, np.eye(len(mass)), rtol=0.0, atol=1e-11)
