"""Mechanisms of rigid bodies with loose joints, by Newton's and Coulomb's laws, impact by impact."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

#: crank and rod of Flores, Leine & Glocker (2010), Multibody System Dynamics 23, 165-190, table 1: lengths [m], masses
#: of crank, rod and slider [kg], moments of inertia of crank and rod [kg m^2]
CRANK, ROD, MASSES, TURNING = 0.153, 0.306, (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4)
#: of a state
Function = Callable[[np.ndarray], np.ndarray]


def heights_by_impacts(
    times: Sequence[float],
    start: np.ndarray,
    accelerations: Function,
    gaps: Function,
    impulses: Callable[[np.ndarray, int], tuple[np.ndarray, np.ndarray]],
    restitution: float,
    height: Callable[[np.ndarray], float],
) -> np.ndarray:
    """Heights [m] at times at which no contact lasts.

    start: coordinates and speeds.  gaps: [m], of which one closes at a time.  impulses: the slopes of a gap over the
    coordinates, and the changes of speed by a unit impulse that opens it, with friction.
    """
    n = len(start) // 2

    def closing(k: int) -> Callable[[float, np.ndarray], float]:
        def gap(_: float, y: np.ndarray) -> float:
            return float(gaps(y)[k])

        gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
        return gap

    events = [closing(k) for k in range(len(gaps(start)))]
    t, y, found = 0.0, start, list[float]()
    for end in times:
        while t < end:
            part = solve_ivp(
                lambda _, y: np.concatenate([y[n:], accelerations(y)]),
                *((t, end), y),
                method="DOP853",
                rtol=1e-12,
                atol=1e-13,
                events=events,
                max_step=1e-4,
            )
            t, y = float(part.t[-1]), part.y[:, -1]
            if part.status == 1:
                slope, thrown = impulses(y, next(k for k, times in enumerate(part.t_events or ()) if len(times)))
                y[n:] -= (1.0 + restitution) * (slope @ y[n:]) / (slope @ thrown) * thrown
        found.append(height(y))
    return np.array(found)


def rigid_heights(
    times: Sequence[float],
    speeds: Sequence[float],
    gap: float,
    restitution: float,
    gravity: float,
    friction: float = 0.0,
) -> np.ndarray:
    """Heights of a slider [m] that hits its guide flat.

    The slider is at the end of crank and rod, which start stretched along the guide, at these speeds [rad/s]; it turns
    with neither, as the corners of a face share impulses so that it does not tilt, and slides through impacts.
    """
    (m1, m2, m3), (J1, J2) = MASSES, TURNING
    coupling, level = (0.5 * m2 + m3) * CRANK * ROD, ((0.5 * m1 + m2 + m3) * CRANK, (0.5 * m2 + m3) * ROD)

    def inertia(q: np.ndarray) -> np.ndarray:
        cross = coupling * np.cos(q[0] - q[1])
        moments = J1 + (0.25 * m1 + m2 + m3) * CRANK**2, J2 + (0.25 * m2 + m3) * ROD**2
        return np.array([[moments[0], cross], [cross, moments[1]]])

    def accelerations(y: np.ndarray) -> np.ndarray:
        spin = coupling * np.sin(y[0] - y[1])
        force = [
            -spin * y[3] ** 2 - gravity * level[0] * np.cos(y[0]),
            spin * y[2] ** 2 - gravity * level[1] * np.cos(y[1]),
        ]
        return np.linalg.solve(inertia(y[:2]), force)

    def height(y: np.ndarray) -> float:
        return float(CRANK * np.sin(y[0]) + ROD * np.sin(y[1]))

    def impulses(y: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        up, along = np.array([CRANK, ROD]) * np.cos(y[:2]), -np.array([CRANK, ROD]) * np.sin(y[:2])
        slope = (2.0 * k - 1.0) * up
        return slope, np.linalg.solve(inertia(y[:2]), slope - friction * np.sign(along @ y[2:]) * along)

    start = np.array([0.0, 0.0, *speeds])
    return heights_by_impacts(
        times, start, accelerations, lambda y: gap + np.array([-1.0, 1.0]) * height(y), impulses, restitution, height
    )


#: of scenes/checks/clearance_four_bar.toml: the coupler's angle [rad], the clearance [m], and the diagonal of the mass
#: matrix in the crank's angle and in place and angle of coupler and rocker
LEAN, RADIAL = 0.7227342478134157, 2e-4
INERTIAS = np.array([1e-3 + 0.5 * 0.05**2, 1.0, 1.0, 8e-3, 0.8, 0.8, 4e-3])


def rigid_four_bar(times: Sequence[float], restitution: float) -> np.ndarray:
    """Heights [m] of the middle of the rocker of a four-bar that falls with smooth loose pins B, C and D."""

    def ends(y: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Differences of the places of pins and journals, and their slopes (2, 7)."""

        def point(at: int, along: float) -> tuple[np.ndarray, np.ndarray]:
            a, J = y[at + 2] if at else y[0], np.zeros((2, 7))
            J[:, at + 2 if at else 0] = along * np.array([-np.sin(a), np.cos(a)])
            if at:
                J[:, at : at + 2] = np.eye(2)
            return along * np.array([np.cos(a), np.sin(a)]) + (y[at : at + 2] if at else 0.0), J

        fixed = np.array([0.3, 0.0]), np.zeros((2, 7))
        pairs = [(point(0, 0.1), point(1, -0.15)), (point(1, 0.15), point(4, 0.1)), (fixed, point(4, -0.1))]
        return [b[0] - a[0] for a, b in pairs], [b[1] - a[1] for a, b in pairs]

    def gaps(y: np.ndarray) -> np.ndarray:
        return RADIAL - np.linalg.norm(ends(y)[0], axis=1)

    def accelerations(y: np.ndarray) -> np.ndarray:
        weights = np.array([0.5 * 0.05 * np.cos(y[0]), 0.0, 1.0, 0.0, 0.0, 0.8, 0.0])
        return -9.81 * weights / INERTIAS

    def impulses(y: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        away, slopes = (part[k] for part in ends(y))
        slope = -away @ slopes / np.linalg.norm(away)
        return slope, slope / INERTIAS

    middle = [0.2125, 0.09921567416492215]
    start = np.array([0.0, *middle, LEAN, middle[0] + 0.1, middle[1], 2.0 * LEAN, *[0.0] * 7])
    return heights_by_impacts(times, start, accelerations, gaps, impulses, restitution, lambda y: float(y[5]))
