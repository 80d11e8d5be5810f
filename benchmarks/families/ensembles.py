"""Cost of an ensemble's members relative to one run: one by one and several at once, on one and two workers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any
from unittest.mock import patch

from benchmarks.family import Case, Family, Measured, Record
from benchmarks.mechanisms import Mechanism, mechanism
from benchmarks.page import Columns, short, table
from benchmarks.timing import Times, in_turn, slope
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.dynamics.record import ensemble
from flexclear.scene.load import edited
from flexclear.scene.schema import Ensemble
from flexclear.system.progress import silent
from flexclear.workflow import cores

#: scenes, and the number of members in the paper's ensembles
SCENES, MEMBERS = ("csj", "far_csj_cb"), 16
#: numbers of members in a short run of the fullest scene on a single thread, and its end [s]
GROWING, UNTIL = (1, 2, 4, 8, 16, 32), 0.02
ROUNDS = 3


def cases() -> list[Case]:
    """Return the scenes, then the numbers of members, as cases."""
    return [Case(name) for name in SCENES] + [Case(f"{n} members", n) for n in GROWING]


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each case; the numbers of members take turns."""
    for case in cases:
        if case.of is None:
            yield case, [_beside_a_run(mechanism(case.name))]
    growing = [case for case in cases if case.of is not None]
    if growing:
        yield from _growing(growing)


def _beside_a_run(here: Mechanism) -> Record:
    """Return the times of a run without its perturbed run, and of all members."""
    full = _with_members(here, MEMBERS)
    tasks = {
        "run": partial(_timed, partial(dynamics.simulate, here.scene, here.bundles, silent)),
        "alone": partial(_timed, full, workers=1, together=False),
        "together": partial(_timed, full, workers=1),
        "alone, 2 workers": partial(_timed, full, workers=2, together=False),
        "together, 2 workers": partial(_timed, full, workers=2),
    }
    found = _in_turn(tasks)
    return {"members": MEMBERS} | {
        name: {"wall": w.record("s"), "cpu": c.record("s")} for name, (w, c) in found.items()
    }


def _growing(cases: Sequence[Case]) -> Measured:
    here = mechanism(SCENES[-1])
    short_one = here.with_scene("short", edited(here.scene, {"time.end": UNTIL}))
    tasks = {case.name: partial(_timed, _with_members(short_one, case.of), workers=1) for case in cases}
    for case, (_, cpu) in zip(cases, _in_turn(tasks).values(), strict=True):
        yield case, [{"members": case.of, **cpu.record("s")}]


def _with_members(here: Mechanism, members: int) -> Callable[[], Any]:
    settings = (here.scene.ensemble or Ensemble()).model_copy(update={"members": members})
    scene = here.scene.model_copy(update={"ensemble": settings})
    return lambda: analyses.ensemble(scene, here.bundles, silent)


def _timed(work: Callable[[], Any], workers: int = 0, *, together: bool = True) -> tuple[float, float]:
    """Return wall and processor time of some work [s]."""
    number = (lambda: workers) if workers else cores.count_cores
    few = ensemble.FEW if together else MEMBERS + 1
    with patch.object(cores, "cores", number), patch.object(ensemble, "FEW", few):
        begun, spent = time.perf_counter(), time.process_time()
        work()
        return time.perf_counter() - begun, time.process_time() - spent


def _in_turn(tasks: Mapping[str, Callable[[], tuple[float, float]]]) -> dict[str, tuple[Times, Times]]:
    """Return wall and processor times of each task."""
    pairs_of = {name: list(zip(*pairs, strict=True)) for name, pairs in in_turn(tasks, ROUNDS).items()}
    return {name: (Times(wall), Times(cpu)) for name, (wall, cpu) in pairs_of.items()}


def show(records: list[Record]) -> str:
    """Return both tables, with the exponent of the growth."""

    def wall(name: str) -> Callable[[Record], str]:
        return lambda r: short(r[name]["wall"]["s"])

    def cpu(name: str) -> Callable[[Record], str]:
        return lambda r: short(r[name]["cpu"]["s"])

    scenes: Columns = {
        "scene": lambda r: r["case"],
        "one run, wall [s]": wall("run"),
        f"{MEMBERS} members one by one, wall on 2 workers [s]": wall("alone, 2 workers"),
        "several at once, wall on 2 workers [s]": wall("together, 2 workers"),
        "cost in runs": lambda r: short(r["together, 2 workers"]["wall"]["s"] / r["run"]["wall"]["s"]),
        "one by one, processor [s]": cpu("alone"),
        "at once, processor [s]": cpu("together"),
        "factor": lambda r: f"{r['alone']['cpu']['s'] / r['together']['cpu']['s']:.2f}",
    }
    growing: Columns = {
        "members": lambda r: str(r["members"]),
        "processor [s]": lambda r: short(r["s"]),
        "per member [s]": lambda r: short(r["s"] / r["members"]),
    }
    grown = [r for r in records if "s" in r]
    parts = [table([r for r in records if "run" in r], scenes), table(grown, growing)]
    if len(grown) > 1:
        exponent = slope([r["members"] for r in grown], [r["s"] for r in grown])
        parts.append(f"Time grows as the number of members to the power {exponent:.2f}.")
    return "\n\n".join(parts)


FAMILY = Family(
    what="members of ensembles next to one run, several at once, and growth with their number",
    takes="2 min",
    page="benchmarks.md",
    cases=cases,
    measure=measure,
    show=show,
)
