"""Motions whose equations have kinks: integrated by SciPy from one to the next, so that no step errs over any."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

#: to 1e-13; steps short enough for no kink to be passed twice in one
CLOSE = {"method": "DOP853", "dense_output": True, "rtol": 1e-13, "atol": 1e-16, "max_step": 2e-4}


def from_kink_to_kink(
    rates: Callable, kinks: Callable[[np.ndarray], np.ndarray], y: np.ndarray, times: np.ndarray, **solver: float
) -> np.ndarray:
    """States at these times, shape (state, time), where rates(t, y) bend at the zeros of kinks(y).

    None comes twice in a row.
    """
    events = [lambda t, y, k=k: kinks(y)[k] for k in range(len(kinks(y)))]
    found, t, here = np.empty((len(y), len(times))), times[0], -1
    while t < times[-1]:
        for k, event in enumerate(events):
            event.terminal = k != here  # type: ignore[attr-defined]
        part = solve_ivp(rates, (t, times[-1]), y, events=events, **(CLOSE | solver))
        inside = (times >= t) & (times <= part.t[-1])
        found[:, inside] = part.sol(times[inside])
        t, y = part.t[-1], part.y[:, -1]
        here = next((k for k, met in enumerate(part.t_events) if len(met) and k != here), -1)
    return found
