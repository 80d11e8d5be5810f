r"""What a free impact and a bounce must do, in closed form or in one dimension.

Free impact of a mass m: :math:`m\ddot\delta = -K\delta^n(1 + a\dot\delta/\dot\delta_0)`.  With
:math:`w=\dot\delta/\dot\delta_0` the depth separates from the speed, so that the rebound
:math:`w = -e` obeys :math:`\ln[(1+a)/(1-ae)] = a(1+e)` for every K, n, m and speed.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import beta


def modified_coulomb(speed: float, static: float, dynamic: float, v_static: float, v_dynamic: float) -> float:
    """Coefficient of the paper's friction, of a sliding speed >= 0 [m/s] (Wang & Wang 2019, eqs. 27-29)."""
    if speed < v_static:
        return 0.5 * static * speed / v_static * (3.0 - (speed / v_static) ** 2)
    x = min(1.0, (speed - v_static) / (v_dynamic - v_static))
    return static + (dynamic - static) * x * x * (3.0 - 2.0 * x)


def hysteresis(restitution: float) -> float:
    """Factor a of Lankarani and Nikravesh for a requested coefficient of restitution (Wang & Wang 2019, eq. 25)."""
    return 0.75 * (1.0 - restitution**2)


def delivered_restitution(a: float) -> float:
    """Rebound over approach speed that the law gives a free impact; 1 for a = 0."""
    if a == 0.0:
        return 1.0

    def defect(e: float) -> float:
        return math.log1p(a) - math.log1p(-a * e) - a * (1.0 + e)

    return float(brentq(defect, 1e-12, min(1.0, (1.0 - 1e-15) / a), xtol=1e-15))


def largest_depth(mass: float, speed: float, stiffness: float, a: float, exponent: float = 1.5) -> float:
    r"""Largest penetration [m] of a free impact.

    :math:`\delta^{n+1} = (n+1)\,(m v^2/K)\,[1/a - \ln(1+a)/a^2]`, and half of it for a = 0.
    """
    fraction = 0.5 if a == 0.0 else 1.0 / a - math.log1p(a) / a**2
    return float(((exponent + 1.0) * mass * speed**2 / stiffness * fraction) ** (1.0 / (exponent + 1.0)))


def hertz_time(mass: float, speed: float, stiffness: float, exponent: float = 1.5) -> float:
    r"""Duration [s] of a lossless impact.

    :math:`2(\delta/v)\int_0^1(1-x^{n+1})^{-1/2}dx = 2(\delta/v)\,B(\tfrac1{n+1},\tfrac12)/(n+1)`.
    """
    depth = largest_depth(mass, speed, stiffness, 0.0, exponent)
    power = exponent + 1.0
    return float(2.0 * depth / speed * beta(1.0 / power, 0.5) / power)


@dataclass(frozen=True)
class Bounce:
    """One contact of a falling ball: times [s], speeds [m/s], largest depth [m]."""

    start: float
    end: float
    approach: float
    separation: float
    depth: float


def bounces(
    mass: float, stiffness: float, restitution: float, gravity: float, height: float, until: float
) -> list[Bounce]:
    """A ball let go at `height` above a Lankarani-Nikravesh floor; gravity acts during the contacts too."""
    a, found = hysteresis(restitution), []
    t, speed = math.sqrt(2.0 * height / gravity), math.sqrt(2.0 * gravity * height)
    while t < until:
        approach = speed

        def rhs(_: float, y: np.ndarray, v0: float = approach) -> list[float]:
            depth = max(0.0, y[0])
            return [y[1], gravity - stiffness * depth**1.5 * max(0.0, 1.0 + a * y[1] / v0) / mass]

        def left(_: float, y: np.ndarray) -> float:
            return y[0]

        def turned(_: float, y: np.ndarray) -> float:
            return y[1]

        left.terminal, left.direction, turned.direction = True, -1.0, -1.0  # type: ignore[attr-defined]
        longest = 10.0 * hertz_time(mass, approach, stiffness)
        tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16, "max_step": longest / 1000.0}
        run = solve_ivp(rhs, (0.0, longest), [0.0, approach], events=(left, turned), **tight)
        speed = -float(run.y[1, -1])
        found.append(Bounce(t, t + float(run.t[-1]), approach, speed, float(run.y_events[1][0][0])))
        t += float(run.t[-1]) + 2.0 * speed / gravity
    return found
