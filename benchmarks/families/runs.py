"""Whole warm runs of the paper's scenes at their own tolerance: the integration alone, and the simulate stage."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.family import Case, Family, Measured
from benchmarks.mechanisms import SCENES, Mechanism, mechanism
from benchmarks.page import Columns, spread, table
from benchmarks.timing import interleaved, once
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.trajectory import integrate

ROUNDS = 5


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each scene; the scenes take turns, so that a slow minute of the machine slows all of them."""
    mechanisms = {case: mechanism(case.name) for case in cases}
    tasks: dict[str, Callable[[], float]] = {}
    evaluations: dict[str, int] = {}
    for here in mechanisms.values():
        tasks[f"{here.name} integration"], evaluations[here.name] = _integration(here)
        tasks[f"{here.name} stage"] = _stage(here)
    times = interleaved(tasks, ROUNDS)
    for case, here in mechanisms.items():
        integration = times[f"{here.name} integration"]
        record = {
            "rtol": here.scene.solver.rtol,
            "evaluations": evaluations[here.name],
            "integration": integration.record("s"),
            "stage": times[f"{here.name} stage"].record("s"),
            "us_per_evaluation": 1e6 * integration.median / evaluations[here.name],
        }
        yield case, [record]


def _integration(here: Mechanism) -> tuple[Callable[[], float], int]:
    engine = here.engine()
    start = consistent_start(engine)
    evaluations = integrate(engine, start, silent).counters["evaluations"]
    return lambda: once(lambda: integrate(engine, start, silent)), evaluations


def _stage(here: Mechanism) -> Callable[[], float]:
    return lambda: once(lambda: dynamics.simulated(here.scene, here.bundles, silent))


#: the rest of the stage is the evaluation of every recorded row, and the dataset
COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "integration [s]": lambda r: spread(r["integration"], "s", 4),
    "simulate stage [s]": lambda r: spread(r["stage"], "s", 3),
    "evaluations": lambda r: str(r["evaluations"]),
    "us per evaluation, all in": lambda r: f"{r['us_per_evaluation']:.2f}",
}


FAMILY = Family(
    what="seconds of whole warm runs of the paper's scenes",
    takes="2 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in SCENES],
    measure=measure,
    show=lambda records: table(records, COLUMNS),
    quick="ideal",
)
