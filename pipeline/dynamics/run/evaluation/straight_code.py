"""Straight code for the wiring of a mechanism alone: which there is, and where.

It is made once for all scenes of a wiring, and takes less time to make and to run than kernels do. Kernels are for what
is too long for it. The wiring decides, no clock and no cache, so that equal scenes give equal bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions, sources
from flexclear.pipeline.dynamics.compile.sources import DESCRIBED, SPECIALISED, WHOLE
from flexclear.pipeline.dynamics.effects import Parts
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.model.mobility import Mobility
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError
from flexclear.pipeline.dynamics.specialise.wiring import Wiring, wiring

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.run.evaluation.batched_evaluation import LaneGroup, Place

_making = Lock()
#: addresses by parts, wiring, name, lanes, whether exact and whether with changes: many engines of a process use them
_known: dict[tuple[Parts, Wiring, str, int, bool, bool], int] = {}


@dataclass
class Straight:
    """Code for one wiring (`Engine.settle`), shared by the engines of one work space.

    exact: whether it is to give the same bits for one state as for several at once.
    place: where it may step together with others; by default each engine takes its own steps.
    group: who takes the steps there, for the closure rows that it is for.
    addresses: where it is, by the closure rows that it solves for and its name (`compile.sources`).
    rows: those for which the present integration has code for steps alone.  They are its own, since what other
    integrations of this engine have met must not change a bit of this one.
    """

    exact: bool = False
    place: Place | None = None
    group: LaneGroup | None = None
    addresses: dict[tuple[bytes, str], int] = field(default_factory=dict)
    rows: list[bytes] = field(default_factory=list)


def equations(model: Model, mobility: Mobility) -> dict[str, str]:
    """Sources of what evaluates a model and describes it, by name, with all closure rows: no selection has longer code.

    Steps that solve for all of them have code of their own as well; where some are redundant, which is chosen later.
    """
    if INTERPRETED:
        return sources.kernels(model.parts)
    wired = wiring(model.arrays, model.arrays.h)
    names = (WHOLE, DESCRIBED) if mobility.redundant else (WHOLE, DESCRIBED, SPECIALISED)
    return {name: sources.straight(model.parts, wired, name) for name in names}


def address(
    model: Model, h: np.ndarray, straight: Straight, rows: bytes, name: str = SPECIALISED, progress: Progress = silent
) -> int:
    """Address of straight code for closure rows, by its name (`compile.sources`)."""
    known = straight.addresses
    if (rows, name) not in known:
        known[rows, name] = made(model, h, rows, progress, name, exact=straight.exact)
    return known[rows, name]


def made(
    model: Model,
    h: np.ndarray,
    rows: bytes,
    progress: Progress,
    name: str = SPECIALISED,
    lanes: int = 1,
    *,
    exact: bool = False,
) -> int:
    """Address of code for closure rows, of several lanes where so many are requested; 0 where there is none."""
    h, parts, of_steps = h.copy(), model.parts, name == SPECIALISED
    changes, exact = bool(h[m.N_CHANGES]) and of_steps, exact and of_steps
    selection.write(model, h, np.frombuffer(rows, dtype=bool))
    with _making:  # engines may run side by side
        wired = wiring(model.arrays, h)
        key = (parts, wired, name, lanes, exact, changes)
        if key not in _known:
            if lanes > 1:
                source = sources.batched(parts, wired, lanes)
            else:
                source = sources.tangent(parts, wired) if changes else sources.straight(parts, wired, name, exact=exact)
            try:
                _known[key] = functions.straight(name, source, partial(progress, None))
            except UnsuitedError:
                if changes:
                    raise
                _known[key] = 0
        return _known[key]
