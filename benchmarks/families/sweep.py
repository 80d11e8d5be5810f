"""Cost of a sweep's point beyond its kernels, speed-up by two workers, and memory of a worker."""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import psutil

from benchmarks.family import Case, Family, Record, each
from benchmarks.page import percent, table
from flexclear.artifacts.paths import PROJECT
from flexclear.dynamics.record.point import Runner
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.scene.load import load_scene, with_numbers
from flexclear.scene.quantity import parse_recorded
from flexclear.stages.scenes import bundles
from flexclear.stages.simulation import params
from flexclear.stages.sweeps.sweep_engine import Job, engine
from flexclear.stages.sweeps.sweep_points import Work as Points

#: timed points of each kind; two earlier points are not timed
POINTS = 24


class Kind(NamedTuple):
    """A scene, its recorded quantities, the varied key path and its range; words: description on the page."""

    scene: str
    words: str
    keep: tuple[str, ...]
    place: str
    ends: tuple[float, float]
    set: dict[str, Any]


ROWS = {"output.interval": 1e-3}
FINAL, LARGEST = ("platform.position.final",), ("platform.velocity.largest",)
FORCES = ("platform.velocity.largest", "A1.force.largest")
CLEARANCE = ("joint.A1.clearance", (3e-4, 5e-4))
KINDS = {
    "stroke, final": Kind("sps4/ideal", "length of the run, final position", FINAL, "time.end", (0.17, 0.18), {}),
    "stroke, largest": Kind(
        "sps4/ideal", "length of the run, largest velocity at 1 ms", LARGEST, "time.end", (0.17, 0.18), ROWS
    ),
    "mass": Kind("sps4/ideal", "a mass, largest velocity at 1 ms", LARGEST, "body.platform.mass", (0.3, 0.4), ROWS),
    "clearance": Kind("sps4/csj", "clearance, largest velocity and force at 1 ms", FORCES, *CLEARANCE, ROWS),
    "clearance, peak": Kind("sps4/csj", "clearance, peak force", ("A1.peak_force",), *CLEARANCE, {}),
    "pendulum": Kind(
        "checks/pendulum", "length, final position", ("bob.position.final",), "body.bob.com.0", (-2.0, -1.0), {}
    ),
}
#: points of the sweep that one and two workers compute, and number of repeats
SHARED, TURNS = 80, 3
#: numbers of points after which the memory of a worker is read
LOOKS = (500, 5000)


def _measured(case: Case) -> list[Record]:
    makers: dict[str, Callable[[], Record]] = {"workers": _workers, "memory": _memory}
    return [makers[case.name]() if case.name in makers else _point(KINDS[case.name])]


def _point(kind: Kind) -> Record:
    """Return the processor times of a point and of its kernels."""
    run, values = _runner(kind), np.linspace(*kind.ends, POINTS + 2)
    every, kernels = [], []
    with _timed_kernels() as spent:
        for value in values:
            spent[0], begun = 0.0, time.process_time()
            run(float(value))
            every.append(time.process_time() - begun)
            kernels.append(spent[0])
    whole, own = 1e3 * np.array(every[2:]), 1e3 * np.array(kernels[2:])
    low, high = np.percentile(whole - own, (25, 75))
    return {
        "scene": kind.scene,
        "words": kind.words,
        "all_ms": float(np.median(whole)),
        "kernels_ms": float(np.median(own)),
        "rest_ms": float(np.median(whole - own)),
        "spread": float(0.5 * (high - low) / np.median(whole - own)),
    }


def _runner(kind: Kind) -> Callable[[float], None]:
    """Return a function that runs a point as a worker does."""
    scene = with_numbers(load_scene(PROJECT / "scenes" / f"{kind.scene}.toml"), kind.set)
    runner = Runner({}, [parse_recorded(name, scene.owners()) for name in kind.keep])

    def run(value: float) -> None:
        point = runner.run(with_numbers(scene, {kind.place: value}))
        if point.refused:
            raise RuntimeError(f"{kind.scene}, {kind.place} = {value}: {point.refused}")

    return run


@contextmanager
def _timed_kernels() -> Iterator[list[float]]:
    """Sum the processor time [s] of the compiled functions that are called inside this context."""
    spent = [0.0]

    def timed(function: Callable[..., None]) -> Callable[..., None]:
        def call(*given: Any) -> None:
            begun = time.process_time()
            function(*given)
            spent[0] += time.process_time() - begun

        return call

    kernels: dict[str, Any] = {name: timed(getattr(Engine, name)) for name in ("evaluate", "advance", "observe")}
    with patch.multiple(Engine, **kernels):
        yield spent


def _workers() -> Record:
    """Return the rate of two workers over that of one, measured in turns; both are started and compiled beforehand."""
    kind = KINDS["clearance, peak"]
    scene = load_scene(PROJECT / "scenes" / f"{kind.scene}.toml")
    family = Points("family", params(scene), bundles(scene), kind.keep, 0, False)
    packed, ratios = {"family": pickle.dumps(family)}, []
    jobs = [Job(str(k), "family", {kind.place: float(x)}) for k, x in enumerate(np.linspace(*kind.ends, SHARED))]
    with engine(2, None) as two, engine(1, None) as one:
        for turn in range(TURNS + 1):
            seconds = []
            for workers in (one, two):
                begun = time.monotonic()
                workers.run(jobs, packed, lambda *_: None)
                seconds.append(time.monotonic() - begun)
            if turn:
                ratios.append(seconds[0] / seconds[1])
    return {"points": SHARED, "ratio": float(np.median(ratios)), "load": os.getloadavg()[0]}


def _memory() -> Record:
    """Return the resident memory of a worker [MB] after some and after many points."""
    run, found = _runner(KINDS["stroke, final"]), []
    ends = np.linspace(*KINDS["stroke, final"].ends, LOOKS[-1])
    for k, end in enumerate(ends, start=1):
        run(float(end))
        if k in LOOKS:
            found.append(psutil.Process().memory_info().rss / 1e6)
    return {"looks": list(LOOKS), "megabytes": found}


def show(records: list[Record]) -> dict[str, str]:
    """Return the table of points, and sentences about workers and memory."""
    points = [record for record in records if "all_ms" in record]
    columns: dict[str, Callable[[Record], str]] = {
        "points": lambda r: f"`{r['scene']}`, {r['words']}",
        "all": lambda r: f"{r['all_ms']:.1f}",
        "kernels": lambda r: f"{r['kernels_ms']:.1f}",
        "the rest": lambda r: f"{r['rest_ms']:.1f} ± {percent(r['spread'])}",
    }
    sentences = []
    for record in records:
        if "ratio" in record:
            sentences.append(
                f"Two workers compute {record['points']} points with clearance {record['ratio']:.2f} times as fast as "
                f"one, at a load average of {record['load']:.1f} for the whole machine."
            )
        if "megabytes" in record:
            few, many = (
                f"{value:.0f} MB after {n}" for value, n in zip(record["megabytes"], record["looks"], strict=True)
            )
            sentences.append(f"A worker takes {few} points of the ideal mechanism, and {many}.")
    return {"points": table(points, columns), "workers": "\n".join(sentences)}


FAMILY = Family(
    what="a point of a sweep: its kernels and the rest; workers; memory",
    takes="2 minutes",
    page="sweeps.md",
    cases=lambda: [Case(name) for name in (*KINDS, "workers", "memory")],
    measure=each(_measured),
    show=show,
    quick="pendulum",
)
