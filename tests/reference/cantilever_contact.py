r"""The paper's rod, clamped at one end, its free end a pin in a fixed journal: modes of own beam elements, SciPy.

A clamped body frame does not move, so that :math:`\ddot q_i + \omega_i^2 q_i = Q_i` holds without further terms:
bending in the plane and stretch, shapes scaled to unit modal mass; the pin adds its mass to them. The
journal's centre is where the tip's is at rest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from tests.reference.contact_solutions import modified_coulomb
from tests.reference.rod_basis import AREA, DENSITY, ELEMENTS, SECOND, STEP, YOUNGS_MODULUS, gauss, hermite

Array = np.ndarray


@dataclass(frozen=True)
class Pin:
    """Mass [kg], inertia [kg m^2], radius, clearance [m], stiffness [N/m^1.5], Flores' restitution, friction."""

    mass: float
    inertia: float
    radius: float
    clearance: float
    stiffness: float
    restitution: float
    static: float
    dynamic: float
    v_static: float
    v_dynamic: float


@dataclass(frozen=True)
class Rod:
    """Per coordinate: circular frequency, tip displacement (x, y) and turn about z, work of a unit weight along y."""

    omega: Array
    tip: Array
    turn: Array
    weight: Array


def rod(bending: int, axial: int) -> Rod:
    """The lowest bending shapes in the plane and the lowest axial ones."""
    n, (x, weight) = ELEMENTS + 1, gauss()
    w, d, dd = hermite(x)
    K, M, load = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    stretch, lumps = np.zeros((n, n)), np.zeros((n, n))
    for e in range(ELEMENTS):
        b, a = slice(2 * e, 2 * e + 4), slice(e, e + 2)
        K[b, b] += YOUNGS_MODULUS * SECOND * STEP * np.einsum("g,gi,gj->ij", weight, dd, dd)
        M[b, b] += DENSITY * STEP * AREA * np.einsum("g,gi,gj->ij", weight, w, w)
        M[b, b] += DENSITY * STEP * SECOND * np.einsum("g,gi,gj->ij", weight, d, d)
        load[b] += DENSITY * AREA * STEP * np.einsum("g,gi->i", weight, w)
        stretch[a, a] += YOUNGS_MODULUS * AREA / STEP * np.array([[1.0, -1.0], [-1.0, 1.0]])
        lumps[a, a] += DENSITY * AREA * STEP / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    squares, shapes = eigh(K[2:, 2:], M[2:, 2:], subset_by_index=[0, bending - 1])
    axial_squares, axial_shapes = eigh(stretch[1:, 1:], lumps[1:, 1:], subset_by_index=[0, axial - 1])
    none, never = np.zeros(bending), np.zeros(axial)
    tip = np.array([np.append(none, axial_shapes[-1]), np.append(shapes[-2], never)])
    omega = np.sqrt(np.append(squares, axial_squares))
    return Rod(omega, tip, np.append(shapes[-1], never), np.append(load[2:] @ shapes, never))


def simulate(beam: Rod, pin: Pin, gravity: float, end: float, count: int) -> list[tuple[float, float, float, float]]:
    """(begin, approach, end, separation) of the first contacts of the rod let go straight, at rest."""
    loaded = np.eye(len(beam.omega)) + pin.mass * beam.tip.T @ beam.tip + pin.inertia * np.outer(beam.turn, beam.turn)
    weight = -gravity * (beam.weight + pin.mass * beam.tip[1])
    k, hysteresis = len(beam.omega), 8.0 * (1.0 - pin.restitution) / (5.0 * pin.restitution)

    def place(y: Array) -> tuple[float, float, Array]:
        p, v = beam.tip @ y[:k], beam.tip @ y[k:]
        distance = math.hypot(*p)
        normal = p / distance if distance > 0.0 else np.array([1.0, 0.0])
        return pin.clearance - distance, float(normal @ v), normal

    def rates(y: Array, impact_rate: float | None) -> Array:
        pushed = weight - beam.omega**2 * y[:k]
        if impact_rate is not None:
            gap, rate, normal = place(y)
            along = np.array([-normal[1], normal[0]])
            slip = float(along @ (beam.tip @ y[k:])) + pin.radius * float(beam.turn @ y[k:])
            pressed = pin.stiffness * max(0.0, -gap) ** 1.5 * (1.0 + hysteresis * rate / impact_rate)
            mu = modified_coulomb(abs(slip), pin.static, pin.dynamic, pin.v_static, pin.v_dynamic)
            rubbing = -max(0.0, pressed) * math.copysign(mu, slip)
            force = -max(0.0, pressed) * normal + rubbing * along
            pushed = pushed + beam.tip.T @ force + beam.turn * pin.radius * rubbing
        return np.concatenate([y[k:], np.linalg.solve(loaded, pushed)])

    def gap(direction: float) -> Callable[[float, Array], float]:
        def event(_: float, y: Array) -> float:
            return place(y)[0]

        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
        return event

    y, t, found = np.zeros(2 * k), 0.0, []
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16}
    while len(found) < count:
        free = solve_ivp(lambda _, y: rates(y, None), (t, end), y, events=gap(-1.0), max_step=1e-5, **tight)
        t, y = float(free.t[-1]), free.y[:, -1]
        if free.status != 1:
            break
        begin, approach = t, place(y)[1]
        touching = {"events": gap(1.0), "max_step": 1e-6, **tight}
        closed = solve_ivp(lambda _, y, rate=approach: rates(y, rate), (t, end), y, **touching)
        t, y = float(closed.t[-1]), closed.y[:, -1]
        if closed.status != 1:
            break
        found.append((begin, approach, t, -place(y)[1]))
    return found
