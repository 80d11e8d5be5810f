"""When the steps evaluate with code for the mechanism's wiring alone, instead of the code for all mechanisms.

It takes some seconds to make, once for all scenes of this wiring, and half the time to run. It is made for ensembles,
sections and sweeps at once, and for a run that has taken `MANY` evaluations: what the scene says and what its run has
met decide, no clock and no cache, so that equal scenes give equal bytes. Values differ from those of the other code by
rounding. Friction in ideal joints is solved for by iteration, from what the last evaluation found: that stays with the
kernels.

Members of an ensemble are evaluated several at once (`run.evaluation.batched_evaluation`). How many depends on the
machine, so the code gives the same bits for any number.
"""

from __future__ import annotations

from threading import Lock

import numpy as np

from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions
from flexclear.pipeline.dynamics.effects import Parts
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.run.evaluation.batched_evaluation import LaneGroup, Place, Places
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError
from flexclear.pipeline.dynamics.specialise.wiring import Wiring, wiring

#: evaluations of one run after which it continues so: those that it has taken cost what the code takes to make
MANY = 1_000_000
#: selections of closure rows for which it is made, of one integration
SELECTIONS = 4
#: states that are evaluated at once: few, or many. Of fewer than `FEW` each is evaluated alone
FEW, LANES = 2, (4, 8)
_making = Lock()
#: addresses by parts, wiring and lanes: many engines of a process use them
_known: dict[tuple[Parts, Wiring, int, bool], int] = {}


def settle(engine: Engine, progress: Progress) -> None:
    """Let the steps from here on evaluate with what this integration calls for.

    That is reported by the engine and its count of evaluations, so an integration that was interrupted continues as it
    would.
    """
    engine.straight.used = engine.straight.requested or bool(engine.n[m.EVALUATIONS] >= MANY)
    if engine.straight.used:
        _make(engine, progress)
    engine.connect()


def specialise(engine: Engine, progress: Progress = silent) -> None:
    """Let all of the engine's integrations use straight code, from now on."""
    engine.straight.requested = True
    settle(engine, progress)


def abreast(engine: Engine, members: int, threads: int, progress: Progress) -> Places | None:
    """Places for so many engines like this one, in so many threads; None where each is to take its own steps.

    Either way they, as `another` makes them of it, use straight code with the same bits.
    """
    engine.straight.requested = engine.straight.exact = True
    lanes = next((one for one in LANES if one * threads >= members), LANES[-1])
    if members >= FEW * threads and side_by_side(engine) and _code(engine, engine.selected.tobytes(), progress, lanes):
        return Places(lanes, threads)
    settle(engine, progress)
    return None


def side_by_side(engine: Engine) -> bool:
    """Whether its attempts can be made together with those of others."""
    return engine.method.staged and suited(engine)


def suited(engine: Engine) -> bool:
    """Whether there can be straight code."""
    return not (INTERPRETED or any(effect.iterates for effect in engine.model.parts.present))


def _make(engine: Engine, progress: Progress) -> None:
    """Code for the engine's wiring and the closure rows that its selection keeps, unless that would be no faster.

    An integration that continues in another process needs that of the rows which it has met before, too.
    """
    straight, rows_of_engine = engine.straight, engine.selected.tobytes()
    if not suited(engine):
        return
    if straight.place is not None and straight.group is None and engine.method.staged:
        straight.group = _group(engine, rows_of_engine, straight.place, progress)
    if rows_of_engine not in straight.rows and (len(straight.rows) < SELECTIONS or engine.h[m.N_CHANGES]):
        straight.rows.append(rows_of_engine)
    for rows in straight.rows:
        if rows not in straight.addresses:
            straight.addresses[rows] = _code(engine, rows, progress, lanes=int(straight.exact))


def _group(engine: Engine, rows: bytes, place: Place, progress: Progress) -> LaneGroup | None:
    """What takes the steps at a place, with the closure rows that the first integration there begins with."""
    address = _code(engine, rows, progress, place.width)
    return place.group(rows, address, len(engine.model.arrays.f)) if address else None


def _code(engine: Engine, rows: bytes, progress: Progress, lanes: int) -> int:
    """Address of the code for closure rows; 0 where there is none."""
    h, parts, changes = engine.h.copy(), engine.model.parts, bool(engine.h[m.N_CHANGES])
    selection.write(engine.model, h, np.frombuffer(rows, dtype=bool))
    with _making:  # engines may run side by side
        wired = wiring(engine.model.arrays, h)
        known = _known.get((parts, wired, lanes, changes))
        if known is None:
            try:
                known = functions.specialised(parts, wired, lambda text: progress(None, text), lanes, changes=changes)
            except UnsuitedError:
                if changes:
                    raise
                known = 0
            _known[parts, wired, lanes, changes] = known
        return known
