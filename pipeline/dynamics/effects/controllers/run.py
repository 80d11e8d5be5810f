"""Controllers that sample: their internal states after breaks of the run that are samples; and that none diverges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.loads import Pid, SampledPid
from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.drives.pieces import pieces_of, size
from flexclear.pipeline.dynamics.effects import LOADS
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.gauges import values
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.ledger import REMEDY
from flexclear.pipeline.dynamics.run.trajectory import Trajectory

#: a break is a sample when it is off by no more than this fraction of the period
NEAR = 1e-6
#: a coordinate is out of control at so many times the largest of its reference, its start, a turn or the mechanism
LOST = 100.0


@dataclass(frozen=True)
class _Sampled:
    """A controller: its row of LOADS, its numbers, its part, the indices of its internal states."""

    row: Any
    numbers: np.ndarray
    part: Any
    states: slice
    period: float

    def due(self, elapsed: float) -> bool:
        """Whether it samples so long [s] after the start."""
        return abs(elapsed - self.period * round(elapsed / self.period)) <= NEAR * self.period


def sampler(engine: Engine) -> Callable[[np.ndarray, float], np.ndarray]:
    """The function sample(y, t): state after the samples that are due at time t, from that before; shape (NY,)."""
    controllers = list(_controllers(engine))

    def sample(y: np.ndarray, t: float) -> np.ndarray:
        due = [one for one in controllers if one.due(t - engine.start)]
        if not due:
            return y
        y = y.copy()
        engine.select_pieces_after(t)
        engine.attempt(y, t)
        sites, laws, gauges = (
            engine.table(m.SITE_FRAMES),
            engine.table(m.LAW)["value"],
            engine.model.arrays.table(m.GAUGES),
        )
        internal = y[len(y) - engine.model.arrays.size(m.N_INTERNAL) :]
        for one in due:
            value = values(gauges[[one.row["measured"]]], sites, internal)[0]
            error = float(laws[one.row["law0"]]) - value
            internal[one.states] = one.part.sample(one.numbers, internal[one.states], error, first=t == engine.start)
        return y

    return sample


def _controllers(engine: Engine) -> list[_Sampled]:
    model, controllers = engine.model, []
    for k, (name, _) in enumerate(model.loads):
        load = model.scene.load[name]
        if isinstance(load, SampledPid):
            row = model.arrays.table(m.LOADS)[k]
            numbers = model.arrays.table(m.LOAD_NUMBERS)["value"][row["number0"] : row["number0"] + 7]
            states = slice(int(row["internal0"]), int(row["internal0"]) + 3)
            part = lookup(LOADS, load.type, where=f"[load.{name}]")
            controllers.append(_Sampled(row, numbers, part, states, load.period))
    return controllers


def require_controlled(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """SolverError for a controlled coordinate beyond all that its reference and the mechanism have of size."""
    wiring, gauges = model.arrays.table(m.LOADS), model.arrays.table(m.GAUGES)
    for k, (name, _) in enumerate(model.loads):
        load = model.scene.load.get(name)
        if not isinstance(load, (Pid, SampledPid)):
            continue
        looked_at = wiring[k]["measured"] if wiring[k]["measured"] >= 0 else wiring[k]["gauge"]
        turning = bool(gauges[int(looked_at)]["turning"])
        law = pieces_of(load.reference, "angle" if turning else "length")
        asked = size(law, float(trajectory.time[0]), float(trajectory.time[-1]), 0)
        value = np.abs(seen.loads["value"][:, k])
        bound = LOST * max(asked, float(value[0]), 2.0 * np.pi if turning else model.length)
        beyond = np.flatnonzero(~(value <= bound))
        if len(beyond):
            text = f"the motion diverges: controller {name} has its coordinate at {value[beyond[0]]:.3g} "
            text += f"{'rad' if turning else 'm'}, beyond {LOST:g} times its reference and the mechanism's size"
            raise SolverError(f"at t = {trajectory.time[beyond[0]]:.6g} s: {text}; {REMEDY}")
