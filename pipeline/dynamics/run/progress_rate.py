"""Whether a run gets on, and who decides that another method continues with it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from flexclear.pipeline.core.scene.integrators import DEFAULT, STIFF
from flexclear.pipeline.core.scene.load import with_numbers
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.refusals import refusal

#: an explicit method is given up when it is stiff after so many evaluations and would need so many in all
TRIAL, HOPELESS = 400_000, 10_000_000
#: a scene that leaves its integration open is run at the default tolerance where that takes no more evaluations than
#: this, which are some seconds; they are predicted from so many on
AFFORDABLE, EARLIEST = 1_500_000, 100_000
#: tolerance of dear runs that none is compared with: members start a hundredth of a micrometre apart
UNVERIFIED = 1e-7


class DearError(SolverError):
    """A run at the default tolerance is predicted to take more than AFFORDABLE evaluations."""


class Look(NamedTuple):
    """Where a run was when it was examined: time [s], and counts of evaluations, steps and steps that were stiff."""

    time: float
    evaluations: int
    steps: int
    stiff: int


@dataclass(frozen=True)
class Judge:
    """Who looks at a run now and then, whether another method should continue with it.

    every: evaluations between two looks; None: as often as the run pauses.  verdict: why another one should, or
    nothing; given the looks so far, of which the first is where the method began and the last the present one.
    """

    every: int | None
    verdict: Callable[[Engine, Sequence[Look]], str]


#: by integrator, who judges its run, and which one continues if not
Panel = Mapping[str, tuple[Judge, str]]


class Judges(NamedTuple):
    """Judges of a run and of its perturbed run; two panels, since judges may store what they have seen."""

    run: Panel
    perturbed: Panel


def look(engine: Engine) -> Look:
    """Where the run is now."""
    n = engine.n
    counts = (int(n[k]) for k in (m.EVALUATIONS, m.STEPS, m.STIFF_STEPS))
    return Look(float(engine.control[m.TIME]), *counts)


def half(looks: Sequence[Look]) -> Look:
    """The last look at which at most half of what the method has used by now was used."""
    middle = 0.5 * (looks[0].evaluations + looks[-1].evaluations)
    return looks[bisect_right(looks, middle, key=lambda one: one.evaluations) - 1]


def pace(looks: Sequence[Look], patience: float) -> float:
    """Evaluations per second of motion by which to judge a method: as of late, since half of its evaluations.

    patience: evaluations up to which the average counts where it is less; a fast start or a single impact says little.
    """
    first, middle, now = looks[0], half(looks), looks[-1]
    average, late = (
        (now.evaluations - since.evaluations) / max(now.time - since.time, 1e-300) for since in (first, middle)
    )
    return late if now.evaluations - first.evaluations > patience else min(average, late)


def limited(looks: Sequence[Look]) -> bool:
    """Whether of late stability, not accuracy, limits the steps that the method chooses."""
    before, now = half(looks), looks[-1]
    return now.stiff - before.stiff > refusal.STIFF_SHARE * (now.steps - before.steps)


def crawls(engine: Engine, looks: Sequence[Look]) -> str:
    """Why the run would take far too long, where stability limits the steps; else nothing."""
    n, control, now = engine.n, engine.control, looks[-1]
    if not engine.method.traits.hands_over_to or control[m.FIXED] or now.evaluations < TRIAL or not limited(looks):
        return ""
    whole = now.evaluations + pace(looks, TRIAL) * (engine.end - now.time)
    return refusal.stiffness(n, control) if whole > min(HOPELESS, n[m.CAP]) else ""


def affordable(scene: Scene) -> Judges | None:
    """Judges that end a run at the default tolerance by DearError when it is predicted to be dear.

    None where the scene says how it is integrated, or how accurately.
    """
    if scene.accuracy is not None or not scene.solver.by_need:
        return None
    return Judges({DEFAULT: (Judge(None, _dear), STIFF)}, {})


def unverified(scene: Scene) -> Scene:
    """The scene, whose run is dear, at the method and tolerance of runs that none is compared with: members, points."""
    return with_numbers(scene, {"solver.integrator": STIFF, "solver.rtol": UNVERIFIED})


def _dear(engine: Engine, looks: Sequence[Look]) -> str:
    now = looks[-1]
    whole = now.evaluations + pace(looks, TRIAL) * (engine.end - now.time)
    if now.evaluations >= EARLIEST and whole > AFFORDABLE:
        rtol = engine.model.scene.solver.rtol
        raise DearError(f"{DEFAULT} would take some {whole:.1g} evaluations at a relative tolerance of {rtol:g}")
    return crawls(engine, looks)
