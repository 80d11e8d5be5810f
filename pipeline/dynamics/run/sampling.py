"""Controllers that sample: what their internal states become at breaks of the run that are samples of theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.loads import SampledPid
from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects import LOADS
from flexclear.pipeline.dynamics.model.gauges import values
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine

#: a break is a sample when it is off by no more than this fraction of the period
NEAR = 1e-6


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
