r"""The mechanism with ideal joints and a rod 1 that can only stretch: an estimate of the flexible one.

To first order bending turns a leg without changing its length, so that the platform feels the
stretch :math:`\varepsilon` alone.  With the static shape x/L, the principle of virtual work along leg 1,

.. math:: T = \frac{EA}{L}\varepsilon + m_b\,a_b + \int_0^L \rho A\,\frac{x}{L}\,a(x)\,dx,
          \qquad a = \ddot r - r\,|\dot u|^2,

closes the platform's six balances, in which T is the axial force at A1.  Good to the ratio of the
rod's mass to what it carries; the rest of the rod's inertia is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853

from tests.reference import sps4
from tests.reference.ideal_motion import UP, Motion, cross, ideal, motion, motion_at
from tests.reference.inverse_dynamics import WEIGHTLESS, leg_loads, platform_demand

Array = np.ndarray
#: rod 1: Wang & Wang (2019), Table 2
LENGTH, AREA, YOUNGS_MODULUS, DENSITY = 0.24, np.pi * 1e-4, 7.17e10, 2740.0
STIFFNESS = YOUNGS_MODULUS * AREA / LENGTH
MASS = DENSITY * AREA * LENGTH
#: lower end of the rod, where its axial motion is driven: this far below A [m]
BELOW = 0.28


@dataclass(frozen=True)
class Result:
    """Stretch [m] and its rate, and the platform's motion, at the output times."""

    time: Array
    stretch: Array
    platform: list[Motion]


def balances(m: Motion, plate: sps4.Plate) -> tuple[Array, Array, Array]:
    """Six balances of the mechanism but for the axial forces; axes of and arms to the four legs."""
    legs = leg_loads(*m.legs, WEIGHTLESS)
    arms = m.layout.A @ m.rotation.T
    force, moment = platform_demand(m, plate, WEIGHTLESS)
    force = force + legs.across_at_A.sum(axis=0) + sps4.CENTRAL_MASS * m.acceleration * UP
    moment = moment + cross(arms, legs.across_at_A).sum(axis=0)
    return np.concatenate([force, moment]), legs.axis, arms


def stretch_acceleration(t: float, side: int, y: Array, guess: Motion, plate: sps4.Plate) -> float:
    """Second derivative of the stretch [m/s^2] in the state y = (stretch, rate)."""
    lengths, rates, accelerations = sps4.leg_lengths(guess.layout, t, side)
    driven = accelerations[0]
    lengths[0], rates[0] = lengths[0] + y[0], rates[0] + y[1]
    m = motion(lengths, rates, accelerations, guess)
    base, axes, arms = balances(m, plate)
    faster = motion_at(m.layout, m.height, m.rotation, lengths, rates, accelerations + np.array([1.0, 0.0, 0.0, 0.0]))
    matrix = np.zeros((7, 7))
    matrix[:6, 0] = balances(faster, plate)[0] - base
    matrix[:3, 1:5], matrix[3:6, 1:5] = axes.T, cross(arms, axes).T
    matrix[0, 5] = matrix[1, 6] = 1.0
    # the leg: T - (m_b + m / 3) stretch'' = forces without it
    turn = (m.legs[1][0] - rates[0] * axes[0]) / lengths[0]
    spin2 = float(turn @ turn)
    matrix[6, 0], matrix[6, 1] = -(sps4.BALL.mass + MASS / 3.0), 1.0
    low = lengths[0] - BELOW
    rod = MASS * (0.5 * driven - (0.5 * low + LENGTH / 3.0) * spin2)
    ball = sps4.BALL.mass * (driven - (lengths[0] - sps4.BALL_CENTRE) * spin2)
    right = np.concatenate([-base, [STIFFNESS * y[0] + rod + ball]])
    return float(np.linalg.solve(matrix, right)[0])


def simulate(until: float, interval: float = 1e-4, rtol: float = 1e-9) -> Result:
    """Run from rest to `until` [s] <= 0.09, in the rising half of the stroke."""
    times = np.arange(0.0, until + interval / 2.0, interval)
    guesses, plate = ideal(sps4.FIRST, times), sps4.platform(sps4.FIRST)

    def rhs(t: float, y: Array) -> Array:
        guess = guesses[min(round(t / interval), len(guesses) - 1)]
        return np.array([y[1], stretch_acceleration(t, 1, y, guess, plate)])

    solver = DOP853(rhs, 0.0, np.zeros(2), times[-1], rtol=rtol, atol=1e-16)
    states = [np.zeros(2)]
    while solver.status == "running":
        solver.step()
        dense = solver.dense_output()
        while len(states) < len(times) and times[len(states)] <= solver.t:
            states.append(dense(times[len(states)]))
    stretch = np.array(states)
    platform = []
    for t, y, guess in zip(times, stretch, guesses, strict=True):
        lengths, rates, accelerations = sps4.leg_lengths(sps4.FIRST, t)
        lengths[0], rates[0] = lengths[0] + y[0], rates[0] + y[1]
        accelerations[0] += stretch_acceleration(t, 1, y, guess, plate)
        platform.append(motion(lengths, rates, accelerations, guess))
    return Result(times, stretch, platform)
