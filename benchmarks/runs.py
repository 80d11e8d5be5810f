"""Whole warm runs of the paper's scenes at their own tolerance: the integration alone, and the simulate stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from benchmarks.engines import SCENES, Mechanism, mechanism
from benchmarks.measure import interleaved, once
from benchmarks.tables import percent, table
from pipeline import dynamics
from pipeline.core.progress import silent
from pipeline.dynamics.run.engine import consistent_start
from pipeline.dynamics.run.trajectory import integrate

TITLE = "Seconds per warm run"
ROUNDS = 5


def measure() -> Iterator[dict[str, Any]]:
    """One result per scene; the scenes take turns, so that a slow minute of the machine slows all of them."""
    mechanisms = [mechanism(name) for name in SCENES]
    tasks: dict[str, Callable[[], float]] = {}
    counters: dict[str, dict[str, int]] = {}
    for here in mechanisms:
        tasks[f"{here.name} integration"], counters[here.name] = _integration(here)
        tasks[f"{here.name} stage"] = _stage(here)
    times = interleaved(tasks, ROUNDS)
    for here in mechanisms:
        integration, stage = times[f"{here.name} integration"], times[f"{here.name} stage"]
        evaluations = counters[here.name]["evaluations"]
        yield {
            "scene": here.name,
            "rtol": here.scene.solver.rtol,
            "evaluations": evaluations,
            "integration": {"s": integration.median, "spread": integration.spread},
            "stage": {"s": stage.median, "spread": stage.spread},
            "us_per_evaluation": 1e6 * integration.median / evaluations,
        }


def _integration(here: Mechanism) -> tuple[Callable[[], float], dict[str, int]]:
    engine = here.engine()
    start, _ = consistent_start(engine)
    counters = integrate(engine, start, silent).counters
    return lambda: once(lambda: integrate(engine, start, silent)), counters


def _stage(here: Mechanism) -> Callable[[], float]:
    return lambda: once(lambda: dynamics.simulate(here.scene, here.bundles, silent))


def show(results: list[dict[str, Any]]) -> str:
    """The table; the rest of the stage is the evaluation of every recorded row, and the dataset."""
    rows = [
        [
            r["scene"],
            f"{r['integration']['s']:.4f} ± {percent(r['integration']['spread'])}",
            f"{r['stage']['s']:.3f} ± {percent(r['stage']['spread'])}",
            str(r["evaluations"]),
            f"{r['us_per_evaluation']:.2f}",
        ]
        for r in results
    ]
    head = ("scene", "integration [s]", "simulate stage [s]", "evaluations", "us per evaluation, all in")
    return table(head, rows)
