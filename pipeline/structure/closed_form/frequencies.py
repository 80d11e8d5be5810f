r"""Exact natural frequencies of uniform rods with any ends, from theory rather than from elements.

Bending (Euler-Bernoulli, Rayleigh, Timoshenko) about the middle of the span, :math:`|x| \le l = L/2`:

.. math:: v = A\cos\beta x + B\cosh\alpha x + C\sin\beta x + D\alpha\sinh\alpha x,

with :math:`s^2 = -\beta^2, \alpha^2` the roots of

.. math:: s^4 + \omega^2(\rho I_\rho/EI + \rho/\kappa G)\,s^2
          + \omega^4\rho^2 I_\rho/(EI\,\kappa G) - \omega^2\rho A/EI = 0.

Transverse equilibrium gives the shear force, :math:`Q' = -\rho A\omega^2 v`, and so the slope's amplitudes
:math:`\beta - k/\beta, \alpha + k/\alpha`, :math:`k = \rho\omega^2/\kappa G`. Two conditions hold at each end. Where
both ends are alike each parity leaves a determinant of its own, else one of four rows; hyperbolic functions are scaled,
so that none has large numbers.
Source: Timoshenko, *Vibration Problems in Engineering*; Han, Benaroya & Wei (1999), J. Sound Vib. 225, 935-988.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

#: what vanishes at an end, as rows of `_even` and `_odd`: deflection 0, slope 1, moment 2, shear force 3
CONDITIONS = {"fixed": (0, 1), "pinned": (0, 2), "guided": (1, 3), "free": (2, 3)}
#: step of the search in beta l; neighbouring roots are about pi/2 apart
STEP = math.pi / 64.0
#: where the search begins: no elastic root lies below beta l = pi/4 (pinned and guided ends)
FIRST_STEP = 8


@dataclass(frozen=True, slots=True)
class Span:
    """A uniform rod in one plane of bending.

    rotary: rho I of the mass; zero for Euler-Bernoulli.  shear: kappa G A; infinite without shear deformation.
    """

    length: float  #: L [m]
    bending: float  #: E I [N m^2]
    line_mass: float  #: rho A [kg/m]
    rotary: float = 0.0  #: rho I [kg m]
    shear: float = math.inf  #: kappa G A [N]


def bending(span: Span, ends: str, count: int) -> np.ndarray:
    """The `count` lowest bending frequencies [Hz], rigid ones left out, shape (count,).

    ends: conditions at both ends, two words of CONDITIONS with a hyphen, as in ``fixed-free``.
    """
    half = 0.5 * span.length
    first, last = (CONDITIONS[end] for end in ends.split("-"))
    if first == last:
        # of either parity about every second mode; one more on each side is enough for the sorted lowest
        parities = (lambda t: _two(_even(t), first), lambda t: _two(_odd(t), first))
        roots = [root for parity in parities for root in _roots(parity, span, half, count // 2 + 2)]
    else:
        roots = _roots(lambda t: _four(t, first, last), span, half, count)
    return np.sort(np.array(roots))[:count] / (2.0 * math.pi)


def rod(wave_speed: float, length: float, ends: str, count: int) -> np.ndarray:
    """Axial or torsional frequencies [Hz], shape (count,): n c / 2 L for ends alike, (n - 1/2) c / 2 L else.

    wave_speed: sqrt(E/rho), or sqrt(G J / rho I_p) [m/s].  ends: of ``fixed`` and ``free``, with a hyphen.
    """
    first, last = ends.split("-")
    shift = 0.0 if first == last else 0.5
    return (np.arange(1, count + 1) - shift) * wave_speed / (2.0 * length)


@dataclass(frozen=True, slots=True)
class _Terms:
    """Values at the end x = l: cos, sin, C = cosh, S = sinh/alpha (both scaled), and the wave numbers."""

    c: float
    s: float
    C: float
    S: float
    beta: float
    slope: float  #: beta - k/beta
    square: float  #: alpha^2
    raised: float  #: alpha^2 + k


def _terms(span: Span, omega: float, half: float) -> _Terms:
    shear = span.line_mass * omega**2 / span.shear
    b = omega**2 * span.rotary / span.bending + shear
    c = omega**2 * span.line_mass * (omega**2 * span.rotary / span.shear - 1.0) / span.bending
    root = math.sqrt(b * b - 4.0 * c)
    beta, square = math.sqrt(0.5 * (root + b)), 0.5 * (root - b)
    C, S = _hyperbolic(square, half)
    return _Terms(math.cos(beta * half), math.sin(beta * half), C, S, beta, beta - shear / beta, square, square + shear)


def _hyperbolic(square: float, half: float) -> tuple[float, float]:
    """cosh(alpha l) and sinh(alpha l)/alpha, both times exp(-alpha l) where alpha is real."""
    if square > 0.0:
        alpha = math.sqrt(square)
        decay = math.exp(-2.0 * alpha * half)
        return 0.5 * (1.0 + decay), 0.5 * (1.0 - decay) / alpha
    # above the cut-off of the second wave it travels too
    gamma = math.sqrt(-square)
    return math.cos(gamma * half), half * float(np.sinc(gamma * half / math.pi))


def _even(t: _Terms) -> np.ndarray:
    """Deflection, slope, moment / EI and shear force / rho A omega^2 at x = l of cos and cosh, shape (4, 2).

    At x = -l deflection and moment are the same, slope and shear force the opposite.
    """
    return np.array(
        [[t.c, t.C], [-t.slope * t.s, t.raised * t.S], [-t.slope * t.beta * t.c, t.raised * t.C], [-t.s / t.beta, -t.S]]
    )


def _odd(t: _Terms) -> np.ndarray:
    """The same of sin and alpha sinh; at x = -l it is the other way round."""
    turned = t.raised * t.square * t.S
    return np.array(
        [
            [t.s, t.square * t.S],
            [t.slope * t.c, t.raised * t.C],
            [-t.slope * t.beta * t.s, turned],
            [t.c / t.beta, -t.C],
        ]
    )


def _two(parity: np.ndarray, rows: tuple[int, int]) -> float:
    (a, b), (c, d) = parity[list(rows)]
    return float(a * d - b * c)


def _four(t: _Terms, first: tuple[int, int], last: tuple[int, int]) -> float:
    even, odd = _even(t), _odd(t)
    # a row may change its sign: at x = -l either the even or the odd half does
    rows = [np.hstack([even[list(first)], -odd[list(first)]]), np.hstack([even[list(last)], odd[list(last)]])]
    return float(np.linalg.det(np.vstack(rows)))


def _roots(residual: Callable[[_Terms], float], span: Span, half: float, count: int) -> list[float]:
    """The `count` lowest roots omega [rad/s], by sign changes along the wave number."""

    def at(omega: float) -> float:
        return residual(_terms(span, omega, half))

    roots: list[float] = []
    # rigid roots lie at zero
    step = FIRST_STEP
    low = _omega(span, step * STEP / half)
    while len(roots) < count:
        step += 1
        high = _omega(span, step * STEP / half)
        if at(low) * at(high) < 0.0:
            roots.append(brentq(at, low, high, xtol=1e-12 * high, rtol=1e-14))
        low = high
    return roots


def _omega(span: Span, beta: float) -> float:
    """Frequency of the first wave with the wave number beta: the lower root of the characteristic equation."""
    a = span.line_mass * span.rotary / span.shear
    b = span.bending * beta**2 / span.shear * span.line_mass + span.rotary * beta**2 + span.line_mass
    c = span.bending * beta**4
    return math.sqrt(2.0 * c / (b + math.sqrt(b * b - 4.0 * a * c)))
