r"""Flexible rod 1 and ideal joints: a second derivation, the leg of `flexible_simulation` held to its socket.

Unknown at every instant: the accelerations of the leg and of its modes, of the socket's distance
from B1, the axial forces of legs 2, 3, 4, the horizontal forces at C and the force at A1; known: the
leg's equations, the platform's six balances, and that ball and socket accelerate alike.
"""

import json
from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853

from tests.reference import sps4
from tests.reference.clearance import GRID, Setting, demand, platform_motion, setting
from tests.reference.flexible_simulation import STEM, Leg, ball_turn, carried, equations, leg, read, start, state_rate
from tests.reference.ideal_motion import Motion, cross, motion_at, skew

Array = np.ndarray


@dataclass(frozen=True)
class Result:
    """At the output times: states, the platform's motion, and the force on the ball A1 by the socket, (time, 3) [N]."""

    time: Array
    state: Array
    platform: list[Motion]
    force: Array


def solve(s: Setting, one: Leg, t: float, y: Array) -> tuple[Array, Motion, Array]:
    """State rate, platform motion, and force on the ball A1 by the socket, world axes; rising half of the stroke."""
    n = one.shapes.shape[1]
    x, m = read(n, t, 1, y), platform_motion(s, t, 1, y[0], y[1])
    lengths, rates, accelerations = sps4.leg_lengths(m.layout, t)
    lengths[0], rates[0], accelerations[0] = y[0], y[1], 1.0
    faster = motion_at(m.layout, m.height, m.rotation, lengths, rates, accelerations)
    base, axes, arms = demand(s, m)
    M, right = equations(one, x)
    point = carried(one, x, ball_turn(one, x), STEM)
    ball = np.hstack([-skew(point.place), point.shape])
    k = 3 + n
    A, b = np.zeros((k + 9, k + 9)), np.zeros(k + 9)
    force = slice(k + 6, k + 9)
    A[:k, :k], A[:k, force], b[:k] = M, -ball.T @ x.R.T, right
    A[k : k + 6, k] = demand(s, faster)[0] - base
    A[k : k + 3, k + 1 : k + 4], A[k + 3 : k + 6, k + 1 : k + 4] = axes.T, cross(arms, axes).T
    A[k, k + 4] = A[k + 1, k + 5] = 1.0
    A[k : k + 3, force], A[k + 3 : k + 6, force] = np.eye(3), skew(m.rotation @ sps4.FIRST.A[0])
    b[k : k + 6] = -base
    A[force, :k], A[force, k] = x.R @ ball, m.legs[2][0] - faster.legs[2][0]
    b[force] = m.legs[2][0] - x.R @ point.bias
    found = np.linalg.solve(A, b)
    return state_rate(y, x, float(found[k]), found[:k]), m, found[force]


def simulate(until: float, rtol: float = 1e-9) -> Result:
    """Run from rest to `until` [s] <= 0.09."""
    s, one = setting(), leg()
    y = start(one.shapes.shape[1])
    times = np.arange(0.0, until + GRID / 2.0, GRID)
    solver = DOP853(lambda t, y: solve(s, one, t, y)[0], 0.0, y, times[-1], rtol=rtol, atol=1e-14, max_step=GRID)
    states = [y]
    while solver.status == "running":
        solver.step()
        dense = solver.dense_output()
        while len(states) < len(times) and times[len(states)] <= solver.t:
            states.append(dense(times[len(states)]))
    solved = [solve(s, one, t, y) for t, y in zip(times, states, strict=True)]
    return Result(times, np.array(states), [m for _, m, _ in solved], np.array([f for _, _, f in solved]))


def table(result: Result, every: int = 2) -> dict[str, list[float]]:
    """The numbers stored for comparison, on each `every`-th output."""
    columns: dict[str, list[float]] = {"time": result.time[::every].tolist(), "force": result.force[::every].tolist()}
    for name in ("height", "speed", "tilt"):
        columns[name] = [float(getattr(m, name)) for m in result.platform[::every]]
    return columns


if __name__ == "__main__":
    # python -m tests.reference.flexible_ideal > tests/reference/far_cb.json (some minutes)
    print(json.dumps(table(simulate(0.02, rtol=1e-11)), indent=1))
