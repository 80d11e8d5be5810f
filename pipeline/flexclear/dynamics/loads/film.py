r"""Film of a viscous liquid between pin and journal, or ball and socket, by Reynolds' equation.

In axes that turn at the mean angular velocity of both surfaces, the pressure follows from the eccentricity e and its
rate v alone. The film carries on the half of the journal, or socket, that the centre approaches; pressure is zero at
the edge of this half. Where no load turns with the journal that is the half-Sommerfeld condition. With
:math:`(a, b)` = e/c along and across v, :math:`h = 1 - a\cos\psi - b\sin\psi` and integrals over :math:`|\psi| < \pi/2`

.. math:: F_v = -\frac{\mu R L^3 v}{c^3} \int \frac{\cos^2\psi}{h^3} d\psi,\quad
          F_\perp = -\frac{\mu R L^3 v}{c^3} \int \frac{\cos\psi\sin\psi}{h^3} d\psi

for the short bearing; they are derivatives of :math:`\int d\psi/h = D/\sqrt{1-a^2-b^2}`. The long one has
:math:`12 R^2/L^2` times the integrals of :math:`(\sin\psi - K)\sin\psi/h^3` and :math:`-(\sin\psi - K)\cos\psi/h^3`,
with K such that no pressure is left at the end. The finite one has their harmonic mean times the ratio that
`finite_film` fits to solutions in two dimensions. A ball is only squeezed: along e by the film on a hemisphere, across
by half of that on a sphere, without the force that its turning causes at right angles.

The torques on pin and journal are :math:`\mp 2\pi\mu R^3L\omega/(c\sqrt{1-\epsilon^2}) - e \times F/2` with the
difference :math:`\omega` of their speeds, so that momentum is conserved and what they lose, :math:`-F\cdot v` and that
of :math:`\omega`, is positive. Below the roughness s the film's least thickness h goes over to s/2 with a steady
curvature, as s (1/2 + x^3 - x^4/2), x = h/s: the dry contact, which begins at x = 1, takes over.

Source: Pinkus & Sternlicht (1961), *Theory of Hydrodynamic Lubrication*; Booker (1965), *J. Basic Engineering* 87,
537-546 (axes at the mean speed); Flores & Lankarani (2010), *Nonlinear Dynamics* 60, 99-114 (sphere).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

from flexclear.dynamics.joints.conditions import twist_between
from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.half_circle import half_circle
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.specialise.symbols import branch, log, sqrt
from flexclear.dynamics.vectors import ZERO, Vector, Wrench, cross, dot
from flexclear.scene.films import Squeeze

#: orders of the polynomials of the fit, in eccentricity and in direction
ORDERS = 10, 10
#: eccentricities below which functions of a ball come from their series, whose next terms are below 1e-13
SERIES_BELOW = 0.05


def apply(given: Given, model: str) -> Load:
    """Return the wrench of a film on the pin or ball, and the power that it loses."""
    clearance, rough, resistance, *numbers = given.numbers
    F, G = given.F, given.G
    R, e = F.R_WB, G.p_WB - F.p_WB
    v = R.T @ (G.v - F.v - cross(0.5 * (F.omega + G.omega), e))
    own = R.T @ e * (1.0 / clearance)
    if model != "ball":
        own, v = (Vector([x, y, 0.0]) for x, y, _ in (own, v))
    eccentricity = own * _within(dot(own, own), rough)
    acting = _of_ball(eccentricity, v) if model == "ball" else _of_pin(model, eccentricity, v, numbers)
    force = R @ acting * -resistance
    torque, passing = 0.5 * cross(force, e), twist_between(F, G)
    if model != "ball":
        axis = R.column(2)
        torque = torque - axis * (numbers[0] / sqrt(1.0 - dot(eccentricity, eccentricity)) * dot(passing.angular, axis))
    wrench = Wrench(torque, force)
    return Load(wrench, lost=-wrench.on(passing))


def _within(squared: Any, rough: Any) -> Any:
    """Return the factor that keeps an eccentricity, given by its square, half a roughness away from the wall."""

    def close() -> Any:
        size = sqrt(squared)
        return (1.0 - rough * thickness((1.0 - size) / rough)) / size

    return branch(squared > (1.0 - rough) * (1.0 - rough), close, lambda: 1.0)


def thickness(x: Any) -> Any:
    """Return the least thickness of a film over the roughness, for a distance x <= 1 of the surfaces over it."""
    return branch(x > 0.0, lambda: 0.5 + x * x * x * (1.0 - 0.5 * x), lambda: 0.5)


def _of_pin(model: str, e: Vector, v: Vector, numbers: Sequence[Any]) -> Vector:
    """Return the resistance to the velocity of a pin, in units of that of the short bearing."""
    speed = dot(v, v)
    u = branch(speed > 0.0, lambda: (1.0 / sqrt(speed)) * v, lambda: ZERO)
    a, b = dot(e, u), u[0] * e[1] - u[1] * e[0]
    short, long = half_circle(a, b)
    if model == "short":
        along, across = short
    else:
        along, across = (numbers[1] * one for one in long)
    if model == "finite":
        fit = ratios(a, dot(e, e), numbers[2:])
        along, across = (k * s * one / (s + one) for k, s, one in zip(fit, short, (along, across), strict=True))
    return along * v + b * across * Vector([-v[1], v[0], 0.0])


def ratios(a: Any, squared: Any, fit: Sequence[Any]) -> tuple[Any, Any]:
    """Return the ratios of the finite bearing to the harmonic mean of short and long, along and across v.

    squared: of the eccentricity.  fit: 1/log of the least thickness, ratios in the middle, coefficients.
    """
    scale, *middle = fit[:3]
    rows, columns = ORDERS

    def off() -> tuple[Any, Any]:
        size, q = sqrt(squared), sqrt(1.0 - squared)
        x = _chebyshev(2.0 * scale * log(1.0 - size) - 1.0, rows)
        y = _chebyshev(_arsinh(a / (size * q)) / _arsinh(1.0 / q), columns)
        by_row = [dot_of(fit[3 + k : 3 + k + columns], y) for k in range(0, 2 * rows * columns, columns)]
        along, across = (dot_of(part, x) for part in (by_row[:rows], by_row[rows:]))
        return middle[0] + size * along, middle[1] + size * across

    return branch(squared > 0.0, off, lambda: (middle[0], middle[1]))


def dot_of(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Return the sum of the products of two rows of numbers."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def _arsinh(x: Any) -> Any:
    size = abs(x)
    value = log(size + sqrt(size * size + 1.0))
    return branch(x < 0.0, lambda: -value, lambda: value)


def _chebyshev(x: Any, count: int) -> list[Any]:
    found = [1.0, x]
    while len(found) < count:
        found.append(2.0 * x * found[-1] - found[-2])
    return found


def _of_ball(e: Vector, v: Vector) -> Vector:
    """Return the resistance to the velocity of a ball."""
    squared, speed = dot(e, e), dot(v, v)
    across = _across(squared)

    def off() -> Vector:
        towards = dot(e, v) / sqrt(speed)
        return ((_squeeze(towards) - across) * dot(e, v) / squared) * e

    return across * v + branch(squared * speed > 0.0, off, lambda: ZERO)


def _squeeze(s: Any) -> Any:
    """Return the resistance on the axis of a hemisphere, from the eccentricity towards it."""
    series = 0.0
    for n in range(12, 2, -1):
        series = series * s + (1.0 - 1.0 / n)

    def closed() -> Any:
        return (log(1.0 - s) + s / (1.0 - s) - 0.5 * s * s) / (s * s * s)

    return 6.0 * pi * branch(abs(s) < SERIES_BELOW, lambda: series, closed)


def _across(squared: Any) -> Any:
    """Return the resistance of half a sphere across its eccentricity, which is given by its square."""

    def series() -> Any:
        total = 0.0
        for n in range(5, -1, -1):
            total = total * squared + 1.0 / (2 * n + 1) + 1.0 / (2 * n + 3)
        return total

    def closed() -> Any:
        size = sqrt(squared)
        artanh = 0.5 * log((1.0 + size) / (1.0 - size))
        return (artanh + (artanh - size) / squared) / size

    return 12.0 * pi / (4.0 + squared) * branch(squared < SERIES_BELOW * SERIES_BELOW, series, closed)


def row(load: Squeeze, path: str) -> Row:
    """Return the load's row: clearance [m], roughness over it, resistance to squeezing [N s/m], and of pins the torque
    per speed [N m s], the scale of the long bearing, and the fit of a finite one."""
    joint, film = load.gap, load.film
    clearance, radius, viscosity = joint.clearance, joint.radius, film.viscosity
    rough = film.height(clearance) / clearance
    if film.kind == "ball":
        return Row(frames=load.between, numbers=(clearance, rough, viscosity * radius * (radius / clearance) ** 3))
    length = joint.length
    numbers = [
        *(clearance, rough, viscosity * radius * (length / clearance) ** 3),
        2.0 * pi * viscosity * radius**3 * length / clearance,
        12.0 * (radius / length) ** 2,
    ]
    if film.kind == "finite":
        from flexclear.dynamics.loads.finite_film import fit_ratios

        numbers += fit_ratios(radius / length, 0.5 * rough, ORDERS)
    return Row(frames=load.between, numbers=tuple(numbers))
