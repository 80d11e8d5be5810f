"""The slider-crank of Flores, Leine & Glocker with a rigid slider, loose in a rigid guide, impact by impact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

#: crank and rod of Flores, Leine & Glocker (2010), Multibody System Dynamics 23, 165-190, table 1: lengths [m], masses
#: of crank, rod and slider [kg], moments of inertia of crank and rod [kg m^2]
CRANK, ROD, MASSES, TURNING = 0.153, 0.306, (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4)


def rigid_heights(
    times: Sequence[float], speeds: Sequence[float], gap: float, restitution: float, gravity: float
) -> np.ndarray:
    """Heights of a slider [m] that hits its guide flat, by Newton's law without friction, impact by impact.

    The slider is at the end of crank and rod, which start stretched along the guide, at these speeds [rad/s]; it turns
    with neither, as both corners of a face share every impulse.
    """
    (m1, m2, m3), (J1, J2) = MASSES, TURNING
    coupling, level = (0.5 * m2 + m3) * CRANK * ROD, ((0.5 * m1 + m2 + m3) * CRANK, (0.5 * m2 + m3) * ROD)

    def inertia(q: np.ndarray) -> np.ndarray:
        cross = coupling * np.cos(q[0] - q[1])
        moments = J1 + (0.25 * m1 + m2 + m3) * CRANK**2, J2 + (0.25 * m2 + m3) * ROD**2
        return np.array([[moments[0], cross], [cross, moments[1]]])

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        spin = coupling * np.sin(y[0] - y[1])
        force = [
            -spin * y[3] ** 2 - gravity * level[0] * np.cos(y[0]),
            spin * y[2] ** 2 - gravity * level[1] * np.cos(y[1]),
        ]
        return np.concatenate([y[2:], np.linalg.solve(inertia(y[:2]), force)])

    def height(y: np.ndarray) -> float:
        return float(CRANK * np.sin(y[0]) + ROD * np.sin(y[1]))

    def closing(_: float, y: np.ndarray) -> float:
        return gap - abs(height(y))

    closing.terminal, closing.direction = True, -1.0  # type: ignore[attr-defined]
    t, y, found = 0.0, np.array([0.0, 0.0, *speeds]), list[float]()
    for end in times:
        while t < end:
            part = solve_ivp(rates, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-13, events=closing)
            t, y = float(part.t[-1]), part.y[:, -1]
            if part.status == 1:
                way = np.array([CRANK * np.cos(y[0]), ROD * np.cos(y[1])])
                thrown = np.linalg.solve(inertia(y[:2]), way)
                y[2:] -= (1.0 + restitution) * (way @ y[2:]) / (way @ thrown) * thrown
        found.append(height(y))
    return np.array(found)
