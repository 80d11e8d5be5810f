"""Members of an ensemble, several of which are evaluated at once (`run.evaluation.batched_evaluation`).

How many depends on the machine, so the code gives the same bits for any number. No single run reaches this module.
"""

from __future__ import annotations

from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.dynamics.run.evaluation.batched_evaluation import Places
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.specialised import settle, side_by_side
from flexclear.pipeline.dynamics.run.evaluation.straight_code import made

#: states that are evaluated at once: few, or many. Of fewer than `FEW` each is evaluated alone
FEW, LANES = 2, (4, 8)


def abreast(engine: Engine, members: int, threads: int, progress: Progress) -> Places | None:
    """Places for so many engines like this one, in so many threads; None where each is to take its own steps.

    Either way they, as `another` makes them of it, evaluate with the same bits.
    """
    engine.straight.exact, rows = True, engine.selected.tobytes()
    lanes = next((one for one in LANES if one * threads >= members), LANES[-1])
    together = members >= FEW * threads and side_by_side(engine)
    if together and made(engine.model, engine.h, rows, progress, lanes=lanes, exact=True):
        return Places(lanes, threads)
    settle(engine, progress)
    return None
