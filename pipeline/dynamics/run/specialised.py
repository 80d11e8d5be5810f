"""When the steps evaluate with code for the mechanism's wiring alone, instead of the code for all mechanisms.

It takes some seconds to make, once for all scenes of this wiring, and half the time to run. It is made for ensembles,
sections and sweeps at once, and for a run that has taken `MANY` evaluations: what the scene says and what its run has
met decide, no clock and no cache, so that equal scenes give equal bytes. Values differ from those of the other code by
rounding. Friction in ideal joints is solved for by iteration, from what the last evaluation found: that stays with the
kernels.
"""

from __future__ import annotations

from threading import Lock

import numpy as np

from flexclear.pipeline.core.progress import Progress, silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.run.engine import Engine
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError
from flexclear.pipeline.dynamics.specialise.wiring import wiring

#: evaluations of one run after which it goes on so: those that it has taken cost what the code takes to make
MANY = 1_000_000
#: selections of closure rows for which it is made, of one integration
SELECTIONS = 4
_making = Lock()


def settle(engine: Engine, progress: Progress) -> None:
    """Let the steps from here on evaluate with what this integration calls for.

    That is told by the engine and its count of evaluations, so an integration that was interrupted goes on as it would.
    """
    engine.straight.used = engine.straight.wanted or bool(engine.n[m.EVALUATIONS] >= MANY)
    if engine.straight.used:
        _make(engine, progress)
    engine.connect()


def specialise(engine: Engine, progress: Progress = silent) -> None:
    """Let all of the engine's integrations use straight code, from now on."""
    engine.straight.wanted = True
    settle(engine, progress)


def _make(engine: Engine, progress: Progress) -> None:
    """Code for the engine's wiring and the closure rows that are solved for now, unless that would be no faster.

    An integration that goes on in another process needs that of the rows which it has met before, too.
    """
    known, rows = engine.straight.addresses, engine.straight.rows
    if INTERPRETED or engine.model.parts.joint_frictions or engine.method.traits.reads_all:
        return
    if engine.kept.tobytes() not in rows and len(rows) < SELECTIONS:
        rows.append(engine.kept.tobytes())
    for kept in [kept for kept in rows if kept not in known]:
        h = engine.h.copy()
        selection.write(engine.model, h, np.frombuffer(kept, dtype=bool))
        try:
            with _making:  # members of ensembles run side by side
                wired = wiring(engine.model.arrays, h)
                known[kept] = functions.specialised(engine.model.parts, wired, lambda text: progress(None, text))
        except UnsuitedError:
            known[kept] = 0
