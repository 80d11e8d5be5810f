"""The bundle's invariants against a brute-force cloud of mass points over the whole volume."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve

MESHES = Path(__file__).parents[2] / "meshes"
CASES = [
    ("actuated_rod", "free-free", 13),
    ("actuated_rod", "fixed-fixed", 7),
    ("actuated_rod", "craig-bampton", 13),
    ("actuated_rod", "craig-bampton", None),
    ("actuated_rod_square_inertia", "free-free", 7),
    ("actuated_rod_square_inertia", "craig-bampton", 13),
]


@dataclass(frozen=True)
class Cloud:
    """Mass points [kg] (p,), their places [m] (3, p) and their shapes per modal coordinate (3, p, n)."""

    mass: np.ndarray
    place: np.ndarray
    shape: np.ndarray


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


def close(found: np.ndarray, expected: np.ndarray, scale: np.ndarray | float) -> None:
    # both sums add some thousand terms: eps * sqrt(1e4) of the largest, with a margin
    np.testing.assert_array_less(np.abs(found - expected), 1e-12 * np.broadcast_to(scale, expected.shape))


def test_rigid_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    data, points = body
    mass = points.mass.sum()
    close(data["mass"].values, mass, mass)
    close(data["first_moment"].values, points.place @ points.mass, mass * 0.24)
    close(data["second_moment"].values, (points.place * points.mass) @ points.place.T, mass * 0.24**2)


def test_modal_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    data, points = body
    mass, X, S = points.mass, points.place, points.shape
    weighted = S * mass[:, None]
    # Cauchy-Schwarz: a mass-normalised shape has int rho S <= sqrt(m), int rho X S <= sqrt(int rho X^2)
    size = np.sqrt(mass.sum())
    close(data["modal_first_moment"].values, weighted.sum(axis=1), size)
    close(data["position_mode_moment"].values, np.einsum("kp,lpj->klj", X, weighted), size * 0.24)
    close(data["mode_mode_moment"].values, np.einsum("kpi,lpj->klij", S, weighted, optimize=True), 1.0)


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
