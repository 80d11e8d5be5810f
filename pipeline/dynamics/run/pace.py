"""Whether a run gets on, and who decides that another method goes on with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run import refusal
from flexclear.pipeline.dynamics.run.engine import Engine

#: an explicit method is given up when it is stiff after so many evaluations and would need so many in all
TRIAL, HOPELESS = 400_000, 10_000_000


@dataclass(frozen=True)
class Judge:
    """Who looks at a run now and then, whether another method should go on with it.

    every: evaluations between two looks.  verdict: why another one should, or nothing.
    """

    every: int
    verdict: Callable[[Engine], str]


def foreseen(engine: Engine) -> float:
    """Evaluations of the whole run, at the pace so far."""
    return float(engine.n[m.EVALUATIONS] / max((engine.control[m.TIME] - engine.start) / engine.control[m.SPAN], 1e-12))


def limited(engine: Engine) -> bool:
    """Whether stability, not accuracy, limits the steps that the method chooses."""
    return bool(engine.n[m.STIFF_STEPS] > refusal.STIFF_SHARE * engine.n[m.STEPS])


def crawls(engine: Engine) -> str:
    """Why the run would take far too long, where stability limits the steps; else nothing."""
    n, control = engine.n, engine.control
    if not engine.method.traits.hands_over_to or control[m.FIXED] or n[m.EVALUATIONS] < TRIAL:
        return ""
    return refusal.stiffness(n, control) if limited(engine) and foreseen(engine) > min(HOPELESS, n[m.CAP]) else ""
