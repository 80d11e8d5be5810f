"""Sampling controllers: their internal states after samples of the run; and a check of all against divergence."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import pieces_of, size
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.loads.sampled_pid import sample as sample_error
from flexclear.dynamics.model.gauges import values
from flexclear.dynamics.model.model import Model
from flexclear.scene.loads import Pid, SampledPid
from flexclear.system.errors import SolverError

if TYPE_CHECKING:
    from flexclear.dynamics.run.evaluation.engine import Engine
    from flexclear.dynamics.run.trajectory import Trajectory

#: remedy for an unbounded motion
REMEDY = "reduce the gain or the period of a controller, or increase the time constant of a load"
#: a break is a sample when it deviates by no more than this fraction of the period
AT_A_SAMPLE = 1e-6
#: a coordinate diverges at this multiple of the largest of its reference, its start, a turn or the mechanism
LOST = 100.0


def sampler(engine: Engine) -> Callable[[np.ndarray, float], np.ndarray]:
    """Build sample(y, t): the state after the samples that are due at time t, from the state before; shape (NY,)."""
    model, gauges, numbers = engine.model, *(engine.model.arrays.table(one) for one in (m.GAUGES, m.LOAD_NUMBERS))
    periods = {name: load.period for name, load in model.scene.load.items() if isinstance(load, SampledPid)}
    sampled = model.rows_of(SampledPid)
    continues = model.scene.start is not None and bool(model.scene.start.recorded)

    def sample(y: np.ndarray, t: float) -> np.ndarray:
        due = [row for name, row in sampled.items() if _is_due(periods[name], t - engine.start)]
        if not due:
            return y
        y = y.copy()
        engine.select_pieces_after(t)
        engine.attempt(y, t)
        sites, laws = engine.table(m.SITE_FRAMES), engine.table(m.LAW)["value"]
        internal = y[len(y) - model.arrays.size(m.N_INTERNAL) :]
        for row in due:
            error = float(laws[row["law0"]]) - values(gauges[[row["measured"]]], sites, internal)[0]
            gains, states = numbers["value"][row["number0"] :][:7], internal[int(row["internal0"]) :][:3]
            states[:] = sample_error(gains, states, error, first=t == engine.start and not continues)
        return y

    return sample


def _is_due(period: float, elapsed: float) -> bool:
    """Return True when a controller samples at this time [s] after the start."""
    return abs(elapsed - period * round(elapsed / period)) <= AT_A_SAMPLE * period


def require_controlled(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """Raise SolverError for a controlled coordinate far beyond the size of its reference and the mechanism."""
    topology, gauges = model.arrays.table(m.LOADS), model.arrays.table(m.GAUGES)
    for k, (name, _) in enumerate(model.loads):
        load = model.scene.load.get(name)
        if not isinstance(load, (Pid, SampledPid)):
            continue
        looked_at = topology[k]["measured"] if topology[k]["measured"] >= 0 else topology[k]["gauge"]
        turning = bool(gauges[int(looked_at)]["turning"])
        law = pieces_of(load.reference, "angle" if turning else "length")
        asked = size(law, float(trajectory.time[0]), float(trajectory.time[-1]), 0)
        value = np.abs(seen.loads["value"][:, k])
        bound = LOST * max(asked, float(value[0]), 2.0 * np.pi if turning else model.length)
        beyond = np.flatnonzero(~(value <= bound))
        if len(beyond):
            text = f"the motion diverges: the coordinate of controller {name} reached {value[beyond[0]]:.3g} "
            text += f"{'rad' if turning else 'm'}, beyond {LOST:g} times its reference and the mechanism's size"
            raise SolverError(f"at t = {trajectory.time[beyond[0]]:.6g} s: {text}; {REMEDY}")
