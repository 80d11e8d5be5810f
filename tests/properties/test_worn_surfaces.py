"""Worn surfaces: depths by direction, and the work of the normal force against the change of the gap."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from flexclear.dynamics.contact.surfaces import profile
from flexclear.dynamics.contact.surfaces.separation import across, nested
from flexclear.dynamics.specialise.symbols import Indexed
from flexclear.dynamics.vectors import Matrix, Vector, cross, dot
from flexclear.study.wear import directions, spread_over_arcs

CLEARANCE, RADIUS = 1e-4, 1e-2
SIZES = SimpleNamespace(clearance=CLEARANCE, radius=RADIUS)
SPIN = {1: np.array([0.0, 0.0, 1.0]), 18: np.array([0.3, -0.5, 0.8])}


def shapes(bands: int) -> list[np.ndarray]:
    """Depths of both surfaces of a pin or a ball, of micrometres, smooth in the direction."""
    x, y, z = directions(bands, 36).T
    outer = 1e-5 * (1.0 + x * y + 0.5 * z * x) + 3e-6 * (x**3 - 3.0 * x * y**2)
    inner = 8e-6 * (1.0 + y + z**2 - x * z)
    return [one.reshape(bands, 36) for one in (outer, inner)]


def separated(depths: list[np.ndarray], p: np.ndarray, turn: np.ndarray, rates: tuple = ()) -> profile.Worn:
    """The separation of a pin or a ball at p in a fixed frame, turned by a rotation vector; rates: of both."""
    made = [profile.numbers(one) for one in depths]
    v, omega = (Vector(one.tolist()) for one in rates or (np.zeros(3), np.zeros(3)))
    R = Rotation.from_rotvec(turn).as_matrix()
    still = SimpleNamespace(R_WB=Matrix(np.eye(3).ravel().tolist()), omega=Vector([0.0] * 3))
    turned = SimpleNamespace(R_WB=Matrix(R.ravel().tolist()), omega=omega)
    p, flat = Vector(p.tolist()), len(depths[0]) == 1
    z = still.R_WB.column(2)
    near = nested(CLEARANCE, across(z, p), across(z, v)) if flat else nested(CLEARANCE, p, v)
    numbers = [Indexed(one.__getitem__) for _, one in made]
    return profile.separate((made[0][0], *numbers), SIZES, (still, turned), near, v)


@pytest.mark.parametrize("bands", [1, 18])
def test_force_and_moment_do_the_work_of_the_gap(bands: int) -> None:
    """Central differences of the gap over position and orientation, at random poses, against force and moment."""
    random, depths = np.random.default_rng(bands), shapes(bands)
    plane = np.array([1.0, 1.0, 0.0 if bands == 1 else 1.0])
    for _ in range(10):
        p, turn = plane * random.normal(size=3), random.normal() * SPIN[bands]
        p *= 1.1 * CLEARANCE / np.linalg.norm(p)
        v, spin = plane * random.normal(size=3), random.normal() * SPIN[bands]
        one = separated(depths, p, turn, (v, spin))
        n, arm, steep = one.separation.normal, one.arm, one.steepness
        # the power of a force of 1 N along the normal and of its moment, per unit of the gap's slope
        moment = cross(arm, n) - one.moment
        power = steep * (dot(n, v.tolist()) + dot(moment, spin.tolist()))
        assert one.separation.approach == pytest.approx(power, rel=1e-10, abs=1e-12)
        h = 1e-9 / np.linalg.norm(v)
        rate = SPIN[bands] * (spin @ SPIN[bands]) / (SPIN[bands] @ SPIN[bands])
        gaps = [separated(depths, p + s * h * v, turn + s * h * rate).separation.gap for s in (1.0, -1.0)]
        # steps of 1e-5 of the clearance: (1e-5)^2, and rounding of the gap, 1e-20 m over 1e-9 m
        assert (gaps[1] - gaps[0]) / (2.0 * h) == pytest.approx(one.separation.approach, rel=1e-5, abs=1e-8)


def test_a_pins_depth_is_the_periodic_spline_through_its_sectors() -> None:
    (outer, _), (halvings, numbers) = shapes(1), profile.numbers(shapes(1)[0])
    angle = 2.0 * np.pi * (np.arange(37) + 0.5) / 36
    spline = CubicSpline(angle, np.append(outer[0], outer[0, 0]), bc_type="periodic")
    for at in np.linspace(-3.1, 3.1, 23):
        value, _ = profile._depth(Indexed(numbers.__getitem__), halvings, Vector([np.cos(at), np.sin(at), 0.0]))
        expected = spline(at + 2.0 * np.pi if at < angle[0] else at)
        assert value == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("bands", [1, 18])
def test_constant_depths_are_a_larger_clearance(bands: int) -> None:
    depths = [np.full((bands, 36), depth) for depth in (1e-5, 2e-5)]
    p = np.array([0.5, -0.7, 0.0 if bands == 1 else 0.4]) * CLEARANCE
    one = separated(depths, p, 0.3 * SPIN[bands], (np.ones(3), np.ones(3)))
    distance = np.linalg.norm(p)
    assert one.separation.gap == pytest.approx(CLEARANCE + 3e-5 - distance, rel=1e-14)
    assert one.separation.normal == pytest.approx(p / distance, rel=1e-14)
    assert one.steepness == pytest.approx(1.0, rel=1e-14)
    assert one.moment == pytest.approx(np.zeros(3), abs=1e-16)


def test_work_in_one_direction_is_spread_over_the_arc_of_overlap() -> None:
    """A circle pressed into a larger one by d overlaps it where (c + d) cos(angle) > c; the overlap is the weight."""
    depth, fine = 2e-5, np.zeros((1, 360 * 4))
    fine[0, 90 * 4 : 90 * 4 + 2] = 1.0
    spread = spread_over_arcs(fine, np.zeros((1, 360)), CLEARANCE, depth)[0]
    angle = np.radians(np.arange(360) + 0.5 - 90.25)
    overlap = np.maximum(0.0, (CLEARANCE + depth) * np.cos(angle) - CLEARANCE)
    assert spread.sum() == pytest.approx(2.0, rel=1e-14)
    # both fine directions are within 1/8 degree of the middle: 1/268 of the half arc of 33.6 degrees
    assert spread == pytest.approx(2.0 * overlap / overlap.sum(), abs=2.0 / 268.0 * spread.max())


@pytest.mark.parametrize("bands", [1, 18])
def test_depths_are_those_of_the_middles_of_the_sectors_and_the_contact_lies_on_the_worn_surface(bands: int) -> None:
    depths, places = shapes(bands), directions(bands, 36)
    for k in range(3, len(places), 40):
        outer, inner = (one.ravel()[k] for one in depths)
        found = separated(depths, 1.1 * CLEARANCE * places[k], np.zeros(3))
        assert found.separation.gap == pytest.approx(outer + inner - 0.1 * CLEARANCE, abs=1e-15)
        assert list(found.arm) == pytest.approx((RADIUS - inner) * places[k], abs=1e-14)
