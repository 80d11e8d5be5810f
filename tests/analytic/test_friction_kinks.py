"""A ball that slides down a slope through the speeds at which its friction law bends, against its one equation."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.analytic.mechanism_runs import run
from tests.reference.contact_solutions import modified_coulomb

PLANE = "checks/ball_on_plane"
G, SLOPE, RADIUS, MASS, INERTIA = 9.81, np.radians(30.0), 0.1, 1.0, 0.004
DOWN = np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
UP = np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])
#: where its weight presses it into the slope, 1e6 N/m, so that its normal force is constant [m]
RESTING = (RADIUS - MASS * G * np.cos(SLOPE) / 1e6) * UP
#: it slides at first so fast [m/s], and slower and slower, since friction is larger than its weight's pull
SPEED = 0.06
LAW = {"static": 0.5, "dynamic": 0.4, "v_static": 5e-3, "v_dynamic": 2e-2}
TOLERANCES = tuple(float(10.0**-k) for k in np.arange(7.0, 10.1, 0.5))


@cache
def slid(rtol: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], and sliding speeds of the ball's surface [m/s]."""
    changes = (
        ("time.end", 20e-3),
        ("output.interval", 1e-3),
        ("solver.rtol", rtol),
        ("body.sliding.pose", (("position", tuple(RESTING.tolist())),)),
        ("body.sliding.velocity", tuple((SPEED * DOWN).tolist())),
        ("joint.slip.friction", (("law", "modified-coulomb"), *LAW.items())),
    )
    dataset = run(PLANE, changes)
    moving = dataset.sel(body="sliding")
    return dataset.time.values, moving.velocity.values @ DOWN - RADIUS * moving.angular_velocity.values[:, 1]


def known(times: np.ndarray) -> np.ndarray:
    """Sliding speeds at these times: s' = g sin - mu(s) g cos (1 + m r^2 / J), from kink to kink."""
    grip = G * np.cos(SLOPE) * (1.0 + MASS * RADIUS**2 / INERTIA)

    def rate(_: float, s: np.ndarray) -> list[float]:
        return [G * np.sin(SLOPE) - grip * modified_coulomb(float(s[0]), **LAW)]

    found, t, s = np.empty(len(times)), 0.0, SPEED
    for kink in (LAW["v_dynamic"], LAW["v_static"], 0.0):

        def reached(_: float, s: np.ndarray, kink: float = kink) -> float:
            return float(s[0]) - kink

        reached.terminal = True  # type: ignore[attr-defined]
        part = solve_ivp(
            rate,
            (t, times[-1]),
            [s],
            "DOP853",
            events=reached,
            dense_output=True,
            rtol=1e-13,
            atol=1e-16,
            max_step=2e-4,
        )
        here = (times >= t) & (times <= part.t[-1])
        found[here] = part.sol(times[here])[0]
        t, s = part.t[-1], kink
    return found


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_errors_of_a_run_over_kinks_of_friction_follow_its_tolerance(rtol: float) -> None:
    """They are 0.02 to 0.18 times rtol here; steps over the kinks made that up to 26 times, at single tolerances."""
    times, speeds = slid(rtol)
    assert speeds.min() < LAW["v_static"]
    assert np.abs(speeds - known(times)).max() < 2.0 * rtol * SPEED
