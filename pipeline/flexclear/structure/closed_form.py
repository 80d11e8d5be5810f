r"""Exact natural frequencies of uniform rods in closed form, for comparison with those of a mesh.

Bending (Euler-Bernoulli, Rayleigh, Timoshenko) about the middle of the span, :math:`|x| \le l = L/2`:

.. math:: v = A\cos\beta x + B\cosh\alpha x + C\sin\beta x + D\alpha\sinh\alpha x,

with :math:`s^2 = -\beta^2, \alpha^2` the roots of

.. math:: s^4 + \omega^2(\rho I_\rho/EI + \rho/\kappa G)\,s^2
          + \omega^4\rho^2 I_\rho/(EI\,\kappa G) - \omega^2\rho A/EI = 0.

Transverse equilibrium gives the shear force, :math:`Q' = -\rho A\omega^2 v`, and so the slope's amplitudes
:math:`\beta - k/\beta, \alpha + k/\alpha`, :math:`k = \rho\omega^2/\kappa G`. Two conditions hold at each end. Where
both ends are alike each parity has its own 2 x 2 determinant, else it is 4 x 4; hyperbolic functions are scaled,
so that no determinant has large entries.
Source: Timoshenko, *Vibration Problems in Engineering*; Han, Benaroya & Wei (1999), J. Sound Vib. 225, 935-988.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.optimize import brentq

#: quantities that vanish at an end, as rows of `_values_at_end`: deflection 0, slope 1, moment 2, shear force 3
CONDITIONS = {"fixed": [0, 1], "pinned": [0, 2], "guided": [1, 3], "free": [2, 3]}
#: columns of `_values_at_end` by parity; factors from x = l to x = -l, up to the signs of whole rows
EVEN, ODD, MIRRORED = slice(0, 2), slice(2, 4), np.array([1.0, 1.0, -1.0, -1.0])
#: step of the root search in beta l; neighbouring roots are about pi/2 apart
STEP = math.pi / 64.0
#: end conditions of bending, torsion and extension, each two words with a hyphen
Ends = tuple[str, str, str]
#: mesh variables that exclude a closed form here
BEYOND = ("area_profile", "product_moment", "inertia_product", "lump_node")
CONSTANTS = ("area", "youngs_modulus", "shear_modulus", "density")


@dataclass(frozen=True, slots=True)
class Span:
    """A uniform rod in one plane of bending.

    rotary: rho I of the mass, zero for Euler-Bernoulli.  shear: kappa G A, infinite without shear deformation.
    """

    length: float  #: L [m]
    bending: float  #: E I [N m^2]
    line_mass: float  #: rho A [kg/m]
    rotary: float = 0.0  #: rho I [kg m]
    shear: float = math.inf  #: kappa G A [N]


def exact_frequencies(
    mesh: xr.Dataset, reference: str, families: Sequence[str], interfaces: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Return exact frequencies [Hz] by theory, each of shape (mode,); empty where no closed form applies.

    families: of the retained modes in ascending order, without gaps within a family.
    interfaces: names of the frames that the reference condition holds, in the order of the condition.
    """
    ends = _ends(mesh, reference, interfaces)
    if ends is None or not _uniform(mesh):
        return {}
    tables = {"exact_euler_bernoulli": _frequencies_of_families(mesh, ends, families, rotary=False, shear=False)}
    if mesh.attrs["theory"] == "euler-bernoulli":
        return tables  # such a mesh does not hold the rotary inertia
    tables["exact_rayleigh"] = _frequencies_of_families(mesh, ends, families, rotary=True, shear=False)
    if "shear_coefficient" in mesh:
        tables["exact_timoshenko"] = _frequencies_of_families(mesh, ends, families, rotary=True, shear=True)
    return tables


def _ends(mesh: xr.Dataset, reference: str, interfaces: Sequence[str]) -> Ends | None:
    """Return the end conditions of bending, torsion and extension; None for conditions off the rod's two ends."""
    if reference in ("free-free", "fixed-fixed"):
        return (reference,) * 3
    last = mesh.sizes["node"] - 1
    held = [int(mesh["frame_node"].sel(frame=name)) for name in interfaces]
    if reference == "cantilever" and held and held[0] in (0, last):
        return ("fixed-free",) * 3
    # the first pin also holds the axial motion and the twist
    if reference == "pinned-pinned" and sorted(held[:2]) == [0, last]:
        return "pinned-pinned", "fixed-free", "fixed-free"
    return None


def _uniform(mesh: xr.Dataset) -> bool:
    """Return True for a uniform rod without lumped masses whose planes of bending are not coupled."""
    constants = [mesh[name].values for name in (*CONSTANTS, "second_moment", "inertia_moment")]
    return not any(np.ptp(values, axis=0).any() for values in constants) and not any(name in mesh for name in BEYOND)


def _frequencies_of_families(
    mesh: xr.Dataset, ends: Ends, families: Sequence[str], *, rotary: bool, shear: bool
) -> np.ndarray:
    result = np.empty(len(families))
    for name in set(families):
        places = [k for k, family in enumerate(families) if family == name]
        result[places] = _frequencies_of_family(mesh, ends, name, len(places), rotary=rotary, shear=shear)
    return result


def _frequencies_of_family(
    mesh: xr.Dataset, ends: Ends, family: str, count: int, *, rotary: bool, shear: bool
) -> np.ndarray:
    of_bending, torsion, extension = ends
    length = float(np.ptp(mesh["abscissa"].values))
    area, E, G, rho = (float(mesh[name].values[0]) for name in CONSTANTS)
    second, inertia = (mesh[name].values[0] for name in ("second_moment", "inertia_moment"))
    if family == "axial":
        return rod_frequencies(math.sqrt(E / rho), length, extension, count)
    if family == "torsion":
        return rod_frequencies(math.sqrt(G * second[0] / (rho * inertia[0])), length, torsion, count)
    # deflection in y bends about z, deflection in z about y
    axis, across = (2, 1) if family == "bending_y" else (1, 2)
    kappa = float(mesh["shear_coefficient"].values[0, across]) if shear else math.inf
    span = Span(length, E * float(second[axis]), rho * area, rho * float(inertia[axis]) * rotary, kappa * G * area)
    return bending_frequencies(span, of_bending, count)


def rod_frequencies(wave_speed: float, length: float, ends: str, count: int) -> np.ndarray:
    """Return axial or torsional frequencies [Hz], (count,): n c / 2 L for equal ends, (n - 1/2) c / 2 L for unequal.

    wave_speed: sqrt(E/rho), or sqrt(G J / rho I_p) [m/s].  ends: ``fixed`` or ``free`` for each end, with a hyphen.
    """
    first, last = ends.split("-")
    shift = 0.0 if first == last else 0.5
    return (np.arange(1, count + 1) - shift) * wave_speed / (2.0 * length)


def bending_frequencies(span: Span, ends: str, count: int) -> np.ndarray:
    """Return the `count` lowest elastic bending frequencies [Hz], shape (count,).

    ends: conditions at both ends, two words of CONDITIONS with a hyphen, as in ``fixed-free``.
    """
    first, last = (CONDITIONS[end] for end in ends.split("-"))
    if first == last:
        # each parity has about every second mode; one more on each side suffices for the sorted lowest ones
        parities = (lambda shapes: shapes[first, EVEN], lambda shapes: shapes[first, ODD])
        roots = [root for parity in parities for root in _roots(parity, span, count // 2 + 2)]
    else:
        roots = _roots(lambda shapes: np.vstack([MIRRORED * shapes[first], shapes[last]]), span, count)
    return np.sort(np.array(roots))[:count] / (2.0 * math.pi)


def _values_at_end(span: Span, omega: float) -> np.ndarray:
    """Return deflection, slope, moment / EI and shear force / rho A omega^2 at x = l of the four shapes, (4, 4).

    From x = l to x = -l, deflection and moment of the even shapes (cos, cosh) keep their sign, slope and shear force
    change it. The odd shapes (sin, sinh) behave the opposite way.
    """
    half, k = 0.5 * span.length, span.line_mass * omega**2 / span.shear
    b = omega**2 * span.rotary / span.bending + k
    c = omega**2 * span.line_mass * (omega**2 * span.rotary / span.shear - 1.0) / span.bending
    root = math.sqrt(b * b - 4.0 * c)
    beta, square = math.sqrt(0.5 * (root + b)), 0.5 * (root - b)
    cos, sin, (cosh, sinh) = math.cos(beta * half), math.sin(beta * half), _hyperbolic(square, half)
    slope, raised = beta - k / beta, square + k
    return np.array(
        [
            [cos, cosh, sin, square * sinh],
            [-slope * sin, raised * sinh, slope * cos, raised * cosh],
            [-slope * beta * cos, raised * cosh, -slope * beta * sin, raised * square * sinh],
            [-sin / beta, -sinh, cos / beta, -cosh],
        ]
    )


def _hyperbolic(square: float, half: float) -> tuple[float, float]:
    """Return cosh(alpha l) and sinh(alpha l)/alpha, both times exp(-alpha l) where alpha is real."""
    if square > 0.0:
        alpha = math.sqrt(square)
        decay = math.exp(-2.0 * alpha * half)
        return 0.5 * (1.0 + decay), 0.5 * (1.0 - decay) / alpha
    # above its cut-off the second wave propagates too
    gamma = math.sqrt(-square)
    return math.cos(gamma * half), half * float(np.sinc(gamma * half / math.pi))


def _roots(rows: Callable[[np.ndarray], np.ndarray], span: Span, count: int) -> list[float]:
    """Return the `count` lowest omega [rad/s] at which the rows of the shapes' end values are linearly dependent."""

    def at(omega: float) -> float:
        return float(np.linalg.det(rows(_values_at_end(span, omega))))

    roots: list[float] = []
    # rigid modes have roots at zero, below the first step
    # 8: step number at which the search begins: no elastic root lies below beta l = pi/4 (pinned and guided ends)
    step = 8
    low = _omega(span, step * STEP / (0.5 * span.length))
    while len(roots) < count:
        step += 1
        high = _omega(span, step * STEP / (0.5 * span.length))
        if at(low) * at(high) < 0.0:
            roots.append(brentq(at, low, high, xtol=1e-12 * high, rtol=1e-14))
        low = high
    return roots


def _omega(span: Span, beta: float) -> float:
    """Return omega [rad/s] of the first wave with wave number beta, the lower root of the characteristic equation."""
    a = span.line_mass * span.rotary / span.shear
    b = span.bending * beta**2 / span.shear * span.line_mass + span.rotary * beta**2 + span.line_mass
    c = span.bending * beta**4
    return math.sqrt(2.0 * c / (b + math.sqrt(b * b - 4.0 * a * c)))
