"""When the steps evaluate with code for the mechanism's wiring alone, instead of the code for all mechanisms.

It takes some seconds to make, once for all scenes of this wiring, and half the time to run. It is made for ensembles,
sections and sweeps at once, and for a run that has taken `MANY` evaluations: what the scene says and what its run has
met decide, no clock and no cache, so that equal scenes give equal bytes. Values differ from those of the other code by
rounding. Friction in ideal joints is solved for by iteration, from what the last evaluation found: that stays with the
kernels.

Members of an ensemble are evaluated several at once (`run.crew`). How many depends on the machine, so the code gives
the same bits for any number.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import numpy as np

from flexclear.pipeline.core.progress import Progress, silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions, stacks
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.run.crew import Crews, crews
from flexclear.pipeline.dynamics.run.engine import Engine
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError
from flexclear.pipeline.dynamics.specialise.wiring import wiring

#: evaluations of one run after which it goes on so: those that it has taken cost what the code takes to make
MANY = 1_000_000
#: selections of closure rows for which it is made, of one integration
SELECTIONS = 4
#: states that are evaluated at once: few, or many. Of fewer than `FEW` each is evaluated alone
FEW, LANES = 2, (4, 8)
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


@contextmanager
def abreast(engine: Engine, members: int, threads: int, progress: Progress) -> Iterator[Crews | None]:
    """Crews for so many engines like this one, in so many threads; None where each is to take its own steps.

    Either way they, as `another` makes them of it, use straight code with the same bits.
    """
    engine.straight.wanted = engine.straight.exact = True
    lanes = next((one for one in LANES if one * threads >= members), LANES[-1])
    code = 0
    if members >= FEW * threads and stacks.supported() and suited(engine):
        code = _code(engine, engine.kept.tobytes(), progress, lanes)
    if code:
        with crews(engine.kept.tobytes(), code, lanes, threads) as made:
            yield made
    else:
        settle(engine, progress)
        yield None


def suited(engine: Engine) -> bool:
    """Whether there can be straight code."""
    return not (INTERPRETED or engine.model.parts.joint_frictions)


def _make(engine: Engine, progress: Progress) -> None:
    """Code for the engine's wiring and the closure rows that are solved for now, unless that would be no faster.

    An integration that goes on in another process needs that of the rows which it has met before, too.
    """
    known, rows, crew = engine.straight.addresses, engine.straight.rows, engine.straight.crew
    if not suited(engine):
        return
    if engine.kept.tobytes() not in rows and len(rows) < SELECTIONS:
        rows.append(engine.kept.tobytes())
    for kept in rows:
        if kept not in known and not (crew and crew.kept == kept):
            known[kept] = _code(engine, kept, progress, lanes=int(engine.straight.exact))


def _code(engine: Engine, kept: bytes, progress: Progress, lanes: int) -> int:
    """Address of the code for closure rows; 0 where there is none."""
    h = engine.h.copy()
    selection.write(engine.model, h, np.frombuffer(kept, dtype=bool))
    try:
        with _making:  # members of ensembles run side by side
            wired = wiring(engine.model.arrays, h)
            return functions.specialised(engine.model.parts, wired, lambda text: progress(None, text), lanes)
    except UnsuitedError:
        return 0
