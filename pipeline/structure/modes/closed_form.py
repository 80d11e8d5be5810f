r"""Exact natural frequencies of uniform rods with both ends alike, from theory rather than from elements.

Bending (Euler-Bernoulli, Rayleigh, Timoshenko) about the middle of the span, :math:`|x| \le l = L/2`:

.. math:: v = A\cos\beta x + B\cosh\alpha x \quad\text{or}\quad v = A\sin\beta x + B\sinh\alpha x,

with :math:`s^2 = -\beta^2, \alpha^2` the roots of

.. math:: s^4 + \omega^2(\rho I_\rho/EI + \rho/\kappa G)\,s^2
          + \omega^4\rho^2 I_\rho/(EI\,\kappa G) - \omega^2\rho A/EI = 0.

Transverse equilibrium gives the slope's amplitudes :math:`\beta - k/\beta, \alpha + k/\alpha`,
:math:`k = \rho\omega^2/\kappa G`, and the shear force :math:`Q' = -\rho A\omega^2 v`. Each parity then leaves one
equation in omega without large numbers.
Source: Timoshenko, *Vibration Problems in Engineering*; Han, Benaroya & Wei (1999), J. Sound Vib. 225, 935-988.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq

Ends = Literal["free-free", "fixed-fixed"]
#: step of the search in beta l; neighbouring roots of one parity are about pi apart
STEP = math.pi / 64.0


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


def bending(span: Span, ends: Ends, count: int) -> np.ndarray:
    """The `count` lowest bending frequencies [Hz], rigid ones left out, shape (count,)."""
    half = 0.5 * span.length
    roots: list[float] = []
    # of either parity about every second mode; one more on each side is enough for the sorted lowest
    for residual in _RESIDUALS[ends]:
        roots += _roots(lambda omega, f=residual: f(_terms(span, omega, half)), span, half, count // 2 + 2)  # type: ignore[misc]
    return np.sort(np.array(roots))[:count] / (2.0 * math.pi)


def rod(wave_speed: float, length: float, count: int) -> np.ndarray:
    """Axial or torsional frequencies [Hz], n c / 2 L for free as for fixed ends, shape (count,).

    wave_speed: sqrt(E/rho), or sqrt(G J / rho I_p) [m/s].
    """
    return np.arange(1, count + 1) * wave_speed / (2.0 * length)


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


def _clamped_even(t: _Terms) -> float:
    return t.raised * t.c * t.S + t.slope * t.s * t.C


def _clamped_odd(t: _Terms) -> float:
    return t.raised * t.s * t.C - t.slope * t.c * t.square * t.S


def _free_even(t: _Terms) -> float:
    return t.slope * t.beta**2 * t.c * t.S + t.raised * t.s * t.C


def _free_odd(t: _Terms) -> float:
    return t.slope * t.beta**2 * t.s * t.C - t.raised * t.square * t.c * t.S


_RESIDUALS: dict[str, tuple[Callable[[_Terms], float], ...]] = {
    "fixed-fixed": (_clamped_even, _clamped_odd),
    "free-free": (_free_even, _free_odd),
}


def _roots(residual: Callable[[float], float], span: Span, half: float, count: int) -> list[float]:
    """The `count` lowest roots omega [rad/s] of one parity, by sign changes along the wave number."""
    roots: list[float] = []
    # below the first elastic root (beta l > 1) only the rigid root at zero could be met
    step = 16
    low = _omega(span, step * STEP / half)
    while len(roots) < count:
        step += 1
        high = _omega(span, step * STEP / half)
        if residual(low) * residual(high) < 0.0:
            roots.append(brentq(residual, low, high, xtol=1e-12 * high, rtol=1e-14))
        low = high
    return roots


def _omega(span: Span, beta: float) -> float:
    """Frequency of the first wave with the wave number beta: the lower root of the characteristic equation."""
    a = span.line_mass * span.rotary / span.shear
    b = span.bending * beta**2 / span.shear * span.line_mass + span.rotary * beta**2 + span.line_mass
    c = span.bending * beta**4
    return math.sqrt(2.0 * c / (b + math.sqrt(b * b - 4.0 * a * c)))
