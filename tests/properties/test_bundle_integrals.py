"""The bundle's invariants against a brute-force cloud of mass points over the whole volume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.clouds import Cloud, same_energy, same_integrals

MESHES = Path(__file__).parents[2] / "meshes"
CASES = [
    ("actuated_rod", "free-free", 13),
    ("actuated_rod", "fixed-fixed", 7),
    ("actuated_rod", "craig-bampton", 13),
    ("actuated_rod", "craig-bampton", None),
    ("actuated_rod_square_inertia", "free-free", 7),
    ("actuated_rod_square_inertia", "craig-bampton", 13),
]


def circle_points(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (2, p) and areas (p,), exact for polynomials up to degree three: Gauss in r^2, equal angles."""
    node, weight = np.polynomial.legendre.leggauss(2)
    r = radius * np.sqrt(0.5 * (1.0 + node))
    angle = 2.0 * np.pi * (np.arange(5) + 0.3) / 5.0
    points = np.stack([np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel()])
    return points, np.repeat(0.5 * weight * np.pi * radius**2 / 5.0, 5)


def square_points(side: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and areas of a square, Gauss in both directions."""
    node, weight = np.polynomial.legendre.leggauss(2)
    y, z = np.meshgrid(0.5 * side * node, 0.5 * side * node)
    return np.stack([y.ravel(), z.ravel()]), (0.25 * side**2 * np.outer(weight, weight)).ravel()


def cloud(rod: xr.Dataset, data: xr.Dataset) -> Cloud:
    """Points of the body, moved by the textbook element shapes between the nodes' values."""
    area = float(rod["area"][0])
    square = rod.attrs["inertia_section"] == "equal-area-square"
    section, areas = square_points(area**0.5) if square else circle_points((area / np.pi) ** 0.5)
    node, weight = np.polynomial.legendre.leggauss(5)
    x, density = rod["node_position"].values[:, 0], float(rod["density"][0])
    masses, places, shapes = [], [], []
    for start, stop in rod["cell_node"].values:
        h = x[stop] - x[start]
        for s, w in zip(0.5 * (1.0 + node), 0.5 * weight, strict=True):
            translation, rotation = element_motion(data, start, stop, float(s), h)
            for (y, z), part in zip(section.T, areas, strict=True):
                masses.append(density * part * w * h)
                places.append([x[start] + s * h, y, z])
                shapes.append(translation + np.cross(rotation, [0.0, y, z], axisa=0, axisc=0))
    return Cloud(np.array(masses), np.array(places).T, np.array(shapes).transpose(1, 0, 2))


def element_motion(data: xr.Dataset, start: int, stop: int, s: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Translation and rotation (3, n) of the section at s in [0, 1] of a cell of length h."""
    u, r = data["shape_translation"].values, data["shape_rotation"].values
    cubic = [1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, h * (s**3 - s**2)]
    slope = [(6 * s**2 - 6 * s) / h, 1 - 4 * s + 3 * s**2, (6 * s - 6 * s**2) / h, 3 * s**2 - 2 * s]
    in_y = [u[start, 1], r[start, 2], u[stop, 1], r[stop, 2]]
    in_z = [u[start, 2], -r[start, 1], u[stop, 2], -r[stop, 1]]
    v, w = (sum(a * b for a, b in zip(cubic, values, strict=True)) for values in (in_y, in_z))
    v_x, w_x = (sum(a * b for a, b in zip(slope, values, strict=True)) for values in (in_y, in_z))
    axial, twist = ((1 - s) * values[start] + s * values[stop] for values in (u[:, 0], r[:, 0]))
    return np.stack([axial, v, w]), np.stack([twist, -np.asarray(w_x), v_x])


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(str, case)))
def body(request: pytest.FixtureRequest) -> tuple[xr.Dataset, Cloud]:
    recipe, reference, count = request.param
    rod = kind.build(read_recipe(MESHES / f"{recipe}.toml"))
    data = bundle.build(rod, solve(rod, reference, count))
    return data, cloud(rod, data)


def test_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_integrals(*body, 0.24)


def test_kinetic_energy_of_any_motion_is_that_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_energy(*body)


def test_modal_mass_is_one_and_the_trace_of_the_moments(body: tuple[xr.Dataset, Cloud]) -> None:
    data, _ = body
    trace = np.einsum("kkij->ij", data["mode_mode_moment"].values)
    np.testing.assert_array_equal(data["modal_mass"].values, trace)
    # modes of the complete basis are combined through a mass matrix of condition 1e4: eps times that is 2.2e-12
    np.testing.assert_allclose(trace, np.eye(data.sizes["mode"]), rtol=0.0, atol=2.2e-12)


def test_stiffness_is_the_square_of_the_frequencies(body: tuple[xr.Dataset, Cloud]) -> None:
    data, _ = body
    omega = 2.0 * np.pi * data["frequency"].values
    np.testing.assert_array_equal(data["modal_stiffness"].values, np.diag(omega**2))
    assert np.all(np.diff(data["frequency"].values) >= -1e-6 * omega[1:])


def test_frames_ride_on_their_nodes(body: tuple[xr.Dataset, Cloud]) -> None:
    data, _ = body
    assert list(data["frame"].values) == ["bottom", "at_60mm", "at_120mm", "top"]
    for name, node in zip(data["frame"].values, (0, 3, 6, 12), strict=True):
        place = data.sel(frame=name)
        np.testing.assert_array_equal(place["frame_position"], data["node_position"][node])
        np.testing.assert_array_equal(place["frame_translation_shape"], data["shape_translation"][node])
        np.testing.assert_array_equal(place["frame_rotation_shape"], data["shape_rotation"][node])
        R = place["frame_rotation"].values
        np.testing.assert_array_equal(R @ R.T, np.eye(3))
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_array_equal(R[:, 2], [1.0, 0.0, 0.0])  # z of a frame along the rod
        np.testing.assert_array_equal(R[:, 0], [0.0, 1.0, 0.0])


@pytest.mark.parametrize("count", [7, 8, 13, None])
def test_free_free_modes_carry_no_momentum(count: int | None) -> None:
    """Mean axes: no linear momentum, and no angular momentum about any point."""
    rod = kind.build(read_recipe(MESHES / "actuated_rod.toml"))
    data = bundle.build(rod, solve(rod, "free-free", count))
    scale = np.sqrt(float(data["mass"]))
    assert np.abs(data["modal_first_moment"].values).max() < 1e-13 * scale
    P = data["position_mode_moment"].values
    assert np.abs(P - P.transpose(1, 0, 2)).max() < 1e-13 * scale * 0.24
