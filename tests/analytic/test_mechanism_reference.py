"""The independent solutions agree with what they can be checked against without any engine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexclear.pipeline.core.numerics.rotations import skew
from tests.reference import sps4
from tests.reference.ideal_motion import UP, Motion, ideal
from tests.reference.inverse_dynamics import leg_inertia, reactions

GRAVITIES = [np.zeros(3), np.array([0.0, 0.0, -9.81]), np.array([1.0, 2.0, -9.81])]
#: central differences of order 4 over 1e-5 s of functions that vary over 0.02 s: truncation below 1e-12 of
#: the derivative's scale, rounding 1e-16 / 1e-5 of the function's
STEP, SLACK = 1e-5, 1e-9


def derivative(values: list[np.ndarray | float]) -> np.ndarray:
    """At the middle of five equidistant values."""
    a, b, _, d, e = (np.asarray(v) for v in values)
    return (a - 8.0 * b + 8.0 * d - e) / (12.0 * STEP)


def around(t: float) -> list[Motion]:
    """Motion at five neighbouring times."""
    return ideal(sps4.LAYOUT, t + STEP * np.arange(-2, 3))


def energy(m: Motion, gravity: np.ndarray) -> float:
    """Kinetic and potential energy of the mechanism [J]."""
    plate = sps4.platform(m.layout)
    centre, inertia = m.rotation @ plate.centre, m.rotation @ plate.inertia @ m.rotation.T
    v = m.speed * UP
    total = 0.5 * (plate.mass + sps4.CENTRAL_MASS) * m.speed**2 + plate.mass * v @ np.cross(m.omega, centre)
    total += 0.5 * m.omega @ inertia @ m.omega
    total -= plate.mass * gravity @ (m.height * UP + centre) + sps4.CENTRAL_MASS * gravity[2] * m.height
    for d, rate in zip(m.legs[0], m.legs[1], strict=True):
        length = math.sqrt(d @ d)
        u = d / length
        stretch = u @ rate
        turn = (rate - stretch * u) / length
        about_B, _, arm = leg_inertia(length)
        total += 0.5 * about_B * turn @ turn + 0.5 * sps4.UPPER[0] * stretch**2 - arm * gravity @ u
    return float(total)


@pytest.mark.parametrize("t", [0.0, 0.01, 0.05, 0.09, 0.13, 0.18])
def test_leg_vectors_have_the_driven_lengths(t: float) -> None:
    (m,) = ideal(sps4.LAYOUT, np.array([t]), -1 if t == 0.18 else 1)
    # Newton ends at rounding: of some ten operations on lengths of 0.4 m, each good to 3e-17 m; with a margin of ten
    assert np.linalg.norm(m.legs[0], axis=1) == pytest.approx(sps4.leg_lengths(m.layout, t)[0], abs=3e-15)


@pytest.mark.parametrize("t", [0.01, 0.05, 0.13])
def test_speeds_and_accelerations_are_derivatives(t: float) -> None:
    motions = around(t)
    m = motions[2]
    assert derivative([x.height for x in motions]) == pytest.approx(m.speed, abs=SLACK)
    assert derivative([x.speed for x in motions]) == pytest.approx(m.acceleration, abs=SLACK)
    turning = derivative([x.rotation for x in motions]) @ m.rotation.T
    assert turning == pytest.approx(skew(m.omega), abs=SLACK)
    assert derivative([x.omega for x in motions]) == pytest.approx(m.alpha, abs=1e-8)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=["weightless", "down", "oblique"])
@pytest.mark.parametrize("t", [0.02, 0.05, 0.10, 0.15])
def test_drive_power_is_the_rate_of_energy(t: float, gravity: np.ndarray) -> None:
    motions = around(t)
    supplied = reactions(motions[2], gravity).drive @ sps4.leg_lengths(sps4.LAYOUT, t)[1]
    # powers are tens of watts
    assert derivative([energy(m, gravity) for m in motions]) == pytest.approx(supplied, abs=1e-8)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=["weightless", "down", "oblique"])
def test_reactions_add_up_to_the_whole_mechanisms_momentum_balance(gravity: np.ndarray) -> None:
    for t in (0.02, 0.10):
        m = ideal(sps4.LAYOUT, np.array([t]))[0]
        r, plate = reactions(m, gravity), sps4.platform(m.layout)
        masses, accelerations = [plate.mass, sps4.CENTRAL_MASS], [m.acceleration * UP, m.acceleration * UP]
        centre = m.rotation @ plate.centre
        accelerations[0] = accelerations[0] + np.cross(m.alpha, centre) + np.cross(m.omega, np.cross(m.omega, centre))
        for k in range(4):
            length, rate, second = (x[k] for x in sps4.leg_lengths(m.layout, t))
            d, v, a = (x[k] for x in m.legs)
            u, u_rate = d / length, (v - rate * d / length) / length
            u_second = (a - second * u - 2.0 * rate * u_rate) / length
            for mass, first, whole in ((*sps4.LOWER[:2], 0.0), (sps4.UPPER[0], -sps4.UPPER[1], 1.0)):
                masses.append(mass)
                accelerations.append(whole * a + first / mass * u_second)
        demanded = sum(mass * (a - gravity) for mass, a in zip(masses, accelerations, strict=True))
        assert r.at_B.sum(axis=0) + r.at_Z == pytest.approx(demanded, abs=1e-10)


@pytest.mark.parametrize(
    "layout, lift, tilt, speed, force",
    [(sps4.LAYOUT, 41.9e-3, 21.35, 0.699, 117.3), (sps4.FIRST, 31.3e-3, 21.4, 0.522, 33.0)],
    ids=["identified", "first"],
)
def test_the_strokes_extremes_are_the_known_ones(
    layout: sps4.Layout, lift: float, tilt: float, speed: float, force: float
) -> None:
    """Magnitudes of the paper's mechanism with both assumed layouts: a guard against a changed geometry."""
    times = np.linspace(0.0, 0.18, 361)
    motions = ideal(layout, times, np.where(times < 0.18, 1, -1))
    assert max(m.height for m in motions) - layout.height == pytest.approx(lift, abs=0.05e-3)
    assert max(abs(m.tilt) for m in motions) == pytest.approx(np.radians(tilt), abs=np.radians(0.05))
    assert max(abs(m.speed) for m in motions) == pytest.approx(speed, abs=5e-4)
    assert max(np.linalg.norm(reactions(m).at_A[0]) for m in motions) == pytest.approx(force, rel=3e-3)
