"""Progress rate of a run, and the decision that another method continues it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.refusals import refusal
from flexclear.scene.integrators import DEFAULT, STIFF
from flexclear.scene.load import with_numbers
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError

#: an explicit method ends when it is stiff after so many evaluations and would need so many in all
TRIAL, HOPELESS = 400_000, 10_000_000
#: a scene without method runs by the default one if that takes at most so many evaluations, with those of its perturbed
#: run some seconds; the prediction starts after so many
AFFORDABLE, EARLIEST = 1_000_000, 100_000
#: tolerance of expensive runs that are compared with no other: members' starts differ by a hundredth of a micrometre
UNVERIFIED = 1e-7


class DearError(SolverError):
    """The default method does not suit: it would take more than AFFORDABLE evaluations, or steps at the limit of its
    stability and so leaves vibrations."""


class Look(NamedTuple):
    """Progress of a run: time [s], and counts of evaluations, steps and stiff steps."""

    time: float
    evaluations: int
    steps: int
    stiff: int


@dataclass(frozen=True)
class Judge:
    """A periodic decision whether another method continues a run.

    every: evaluations between two decisions; None: whenever the run pauses.  verdict: returns the reason why another
    method should continue, or nothing, from the samples so far: the first at the method's start, the last the present.
    """

    every: int | None
    verdict: Callable[[Engine, Sequence[Look]], str]


#: by integrator its judge, and the integrator that continues
Panel = Mapping[str, tuple[Judge, str]]


class Judges(NamedTuple):
    """Judges of a run and of its perturbed run; two panels, since judges may have memory.

    trial: evaluations of the run before which the perturbed run does not begin, since the run may be given up.
    """

    run: Panel
    perturbed: Panel
    trial: int = 0


def observe_progress(engine: Engine) -> Look:
    """Return the present progress of the run."""
    n = engine.n
    counts = (int(n[k]) for k in (m.EVALUATIONS, m.STEPS, m.STIFF_STEPS))
    return Look(float(engine.control[m.TIME]), *counts)


def half(looks: Sequence[Look]) -> Look:
    """Return the last sample with at most half of the method's evaluations so far."""
    middle = 0.5 * (looks[0].evaluations + looks[-1].evaluations)
    return looks[bisect_right(looks, middle, key=lambda one: one.evaluations) - 1]


def pace(looks: Sequence[Look], patience: float) -> float:
    """Return the evaluations per second of motion in the last half of a method's evaluations.

    patience: number of evaluations up to which a lower average counts: a fast start or a single impact says little.
    """
    first, middle, now = looks[0], half(looks), looks[-1]
    average, late = (
        (now.evaluations - since.evaluations) / max(now.time - since.time, 1e-300) for since in (first, middle)
    )
    return late if now.evaluations - first.evaluations > patience else min(average, late)


def limited_by_stability(looks: Sequence[Look]) -> bool:
    """Return True when recently stability, not accuracy, limited the method's steps."""
    before, now = half(looks), looks[-1]
    return now.stiff - before.stiff > refusal.STIFF_SHARE * (now.steps - before.steps)


def crawls(engine: Engine, looks: Sequence[Look]) -> str:
    """Return the reason why a run whose steps stability limits would take far too long; else nothing."""
    n, control, now = engine.n, engine.control, looks[-1]
    if (
        not engine.method.traits.hands_over_to
        or control[m.FIXED]
        or now.evaluations < TRIAL
        or not limited_by_stability(looks)
    ):
        return ""
    whole = now.evaluations + pace(looks, TRIAL) * (engine.end - now.time)
    return refusal.stiffness(n, control) if whole > min(HOPELESS, n[m.CAP]) else ""


def affordable(scene: Scene) -> Judges | None:
    """Return judges that raise DearError when a run by the default method is predicted to be expensive.

    Return None for a scene that gives its method or accuracy.
    """
    if scene.accuracy is not None or not scene.solver.by_need:
        return None
    return Judges({DEFAULT: (Judge(None, _dear), STIFF)}, {}, TRIAL)


def scene_without_comparison(scene: Scene) -> Scene:
    """Return the scene of an expensive run without comparison, of a member or point, by method and tolerance of these.

    A tolerance that the scene gives stays.
    """
    rtol = scene.solver.rtol if scene.solver.by_need == "integrator" else UNVERIFIED
    return with_numbers(scene, {"solver.integrator": STIFF, "solver.rtol": rtol})


def _dear(engine: Engine, looks: Sequence[Look]) -> str:
    now = looks[-1]
    whole = now.evaluations + pace(looks, TRIAL) * (engine.end - now.time)
    if now.evaluations >= EARLIEST and whole > AFFORDABLE:
        rtol = engine.model.scene.solver.rtol
        raise DearError(f"{DEFAULT} would take some {whole:.1g} evaluations at a relative tolerance of {rtol:g}")
    return crawls(engine, looks)
