"""A slider-crank with a clearance pin, derived in the plane in minimal coordinates, with SciPy only.

Coordinates: crank angle phi, rod angle theta (from its big end to the piston pin), piston place s.
The rod's small end is the piston pin (s, 0); journal centre O = (s - L cos theta, -L sin theta), pin
centre I = r (cos phi, sin phi). Contact forces act at Q = I + R n on the crank and on the rod.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

CRANK, ROD, CENTRE = 0.05, 0.15, 0.1
CRANK_INERTIA, ROD_MASS, ROD_INERTIA, PISTON_MASS = 0.02, 0.4, 1.2e-3, 0.3
CLEARANCE, PIN = 1e-4, 0.01
RESTITUTION, YOUNG, POISSON = 0.8, 206.8e9, 0.29
STATIC, DYNAMIC, V_STATIC, V_DYNAMIC = 0.1, 0.08, 1e-3, 2e-2
#: eq. (26) of Wang & Wang (2019) for equal materials
STIFFNESS = 4.0 / (3.0 * 2.0 * (1.0 - POISSON**2) / YOUNG) * math.sqrt((PIN + CLEARANCE) * PIN / CLEARANCE)
HYSTERESIS = 8.0 * (1.0 - RESTITUTION) / (5.0 * RESTITUTION)


@dataclass(frozen=True)
class Impact:
    """Time [s], approach and separation speed [m/s], largest penetration [m] and force [N] of one contact."""

    start: float
    end: float
    approach: float
    separation: float
    depth: float
    force: float


def start(phi: float, omega: float) -> np.ndarray:
    """State (phi, theta, s and rates) of the ideal mechanism."""
    theta = math.asin(-CRANK * math.sin(phi) / ROD)
    turn = -CRANK * omega * math.cos(phi) / (ROD * math.cos(theta))
    s = CRANK * math.cos(phi) + ROD * math.cos(theta)
    slide = -CRANK * omega * math.sin(phi) - ROD * math.sin(theta) * turn
    return np.array([phi, theta, s, omega, turn, slide])


def relative(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pin centre from the journal's, and its velocity as seen from the rod's directions at rest."""
    phi, theta, s, omega, turn, slide = y
    pin, pin_rate = (
        CRANK * np.array([math.cos(phi), math.sin(phi)]),
        CRANK * omega * np.array([-math.sin(phi), math.cos(phi)]),
    )
    journal = np.array([s - ROD * math.cos(theta), -ROD * math.sin(theta)])
    journal_rate = np.array([slide + ROD * math.sin(theta) * turn, -ROD * math.cos(theta) * turn])
    return pin - journal, pin_rate - journal_rate


def gap(y: np.ndarray) -> float:
    """Clearance less eccentricity [m]."""
    return CLEARANCE - float(np.linalg.norm(relative(y)[0]))


def penetration_rate(y: np.ndarray) -> float:
    """Rate of the eccentricity [m/s]."""
    p, v = relative(y)
    return float(p @ v) / max(float(np.linalg.norm(p)), 1e-300)


def friction(speed: float) -> float:
    """The paper's coefficient."""
    if speed >= V_DYNAMIC:
        return DYNAMIC
    if speed >= V_STATIC:
        x = (speed - V_STATIC) / (V_DYNAMIC - V_STATIC)
        return STATIC + (DYNAMIC - STATIC) * x * x * (3.0 - 2.0 * x)
    x = speed / V_STATIC
    return 0.5 * STATIC * x * (3.0 - x * x)


def normal_force(y: np.ndarray, impact_rate: float) -> float:
    """Flores' force [N]."""
    depth = max(0.0, -gap(y))
    return max(0.0, STIFFNESS * depth**1.5 * (1.0 + HYSTERESIS * penetration_rate(y) / impact_rate))


def rates(y: np.ndarray, impact_rate: float | None) -> np.ndarray:
    """First-order equations; impact_rate: None while the contact is open."""
    phi, theta, s, omega, turn, slide = y
    sine, cosine = math.sin(theta), math.cos(theta)
    load = np.zeros(3)  # generalised forces of phi, theta, s
    if impact_rate is not None:
        p, _ = relative(y)
        n = p / np.linalg.norm(p)
        Q = CRANK * np.array([math.cos(phi), math.sin(phi)]) + PIN * n
        of_crank = np.array([-Q[1], Q[0]])  # velocity of the crank's point at Q per unit of phi's rate
        arm = Q - np.array([s, 0.0])
        of_rod = np.array([-arm[1], arm[0]])
        slip = omega * of_crank - turn * of_rod - np.array([slide, 0.0])
        slip = slip - n * (n @ slip)
        speed, pressed = float(np.linalg.norm(slip)), normal_force(y, impact_rate)
        force = -pressed * n
        if speed > 0.0:
            force = force - pressed * friction(speed) * slip / speed
        load = np.array([force @ of_crank, -force @ of_rod, -force[0]])
    M = np.array([[ROD_MASS * CENTRE**2 + ROD_INERTIA, ROD_MASS * CENTRE * sine], [0.0, ROD_MASS + PISTON_MASS]])
    M[1, 0] = M[0, 1]
    known = np.array([load[1], load[2] - ROD_MASS * CENTRE * cosine * turn**2])
    theta2, s2 = np.linalg.solve(M, known)
    return np.array([omega, turn, slide, load[0] / CRANK_INERTIA, theta2, s2])


def simulate(end: float, count: int) -> list[Impact]:
    """The first `count` contacts, each located by the integrator's own root finding."""
    y, t, found = start(0.3, 5000.0 * math.pi / 30.0), 0.0, []

    def opened(_: float, y: np.ndarray) -> float:
        return gap(y)

    opened.terminal, opened.direction = True, 0.0  # type: ignore[attr-defined]
    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14}
    while t < end and len(found) < count:
        opened.direction = -1.0  # type: ignore[attr-defined]
        free = solve_ivp(lambda _, y: rates(y, None), (t, end), y, events=opened, max_step=2e-5, **tight)
        if free.status != 1:
            break
        t, y = float(free.t[-1]), free.y[:, -1]
        began, rate = t, penetration_rate(y)
        opened.direction = 1.0  # type: ignore[attr-defined]
        closed = solve_ivp(
            lambda _, y, rate=rate: rates(y, rate),
            (t, end),
            y,
            events=opened,
            max_step=2e-6,
            dense_output=True,
            **tight,
        )
        t, y = float(closed.t[-1]), closed.y[:, -1]
        states = closed.sol(np.linspace(began, t, 4001)).T
        depth = max(-gap(x) for x in states)
        force = max(normal_force(x, rate) for x in states)
        found.append(Impact(began, t, rate, -penetration_rate(y), depth, force))
    return found
