"""Whole runs against Exudyn at equal error, both against the same converged reference.

Each of Exudyn's runs is measured next to ours that is no worse in position and velocity and needs the fewest
evaluations. Times are those of the whole integration with its samples; building the model and compiling are in neither.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from benchmarks import errors
from benchmarks.errors import Error, Reference, Rung
from benchmarks.exudyn_model import METHODS, Outcome, solve
from benchmarks.family import Case, Family, Measured, Record
from benchmarks.mechanisms import Mechanism, damped, mechanism, without_friction
from benchmarks.page import short
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.post.plotting.table import pipe_table

BODY = "platform"
#: shares of the largest speed for which the times needed are compared
LEVELS = (1e-2, 1e-3, 1e-4)
REPEATS = 5
#: Exudyn runs longer than this are not repeated [s]
LONG = 1.0
SMOOTH = (1e-3, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
RARELY = (9e-3, 4.5e-3, 2.25e-3, 1e-3, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
STIFF = (5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)
#: the other methods are no better in the long run; they take part at the first steps of each ladder
TRIED = 4


@dataclass(frozen=True)
class Comparison:
    """A scene, edited or not.

    horizon: end of the comparison [s].  sampling: both codes record every so many seconds.
    own_law: Exudyn has another friction law.
    study: the cost study in whose figure its runs are points.  note: how they differ from that scene.
    """

    scene: str
    steps: tuple[float, ...]
    edit: Callable[[Scene], Scene] = field(default=lambda scene: scene, repr=False)
    horizon: float | None = None
    sampling: float = errors.SAMPLING
    own_law: bool = False
    study: str = ""
    note: str = ""


OWN_LAW = "its friction is linear up to one speed and constant above; errors against its own finest run"
COMPARISONS = {
    "ideal": Comparison("ideal", SMOOTH, study="sps4/ideal"),
    "ideal, recorded every 9 ms": Comparison("ideal", RARELY, sampling=9e-3),
    "far_cb": Comparison("far_cb", SMOOTH, study="sps4/far_cb"),
    "far_cb, recorded every 9 ms": Comparison("far_cb", RARELY, sampling=9e-3),
    "csj without friction": Comparison("csj", STIFF, without_friction),
    "csj, each code with its own friction law": Comparison(
        "csj", STIFF, own_law=True, study="sps4/csj", note=f"; {OWN_LAW}"
    ),
    "far_csj_cb without friction, 5 % modal damping": Comparison(
        "far_csj_cb",
        STIFF,
        lambda scene: damped(without_friction(scene), 0.05),
        study="sps4/variants/far_csj_cb_damped",
        note="; without friction",
    ),
    "far_csj_cb without friction, error up to 30 ms": Comparison(
        "far_csj_cb",
        STIFF,
        without_friction,
        horizon=0.03,
        study="sps4/far_csj_cb",
        note="; without friction; errors up to 30 ms",
    ),
}


def edited(case: Case) -> Mechanism:
    """The mechanism that both codes run."""
    original = mechanism(case.of.scene)
    return original.with_scene(case.name, case.of.edit(original.scene))


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Of each case a record on what is compared, then one for each of our runs and one for each of Exudyn's."""
    for case in cases:
        yield case, list(_records(case, edited(case)))


def _records(case: Case, here: Mechanism) -> Iterator[Record]:
    asked: Comparison = case.of
    horizon = asked.horizon or here.scene.time.end
    reference = errors.converged(here, BODY, horizon, asked.sampling)
    ours = errors.ladder(here, BODY, reference)
    theirs, law, steps = reference, {}, asked.steps
    if asked.own_law:
        finest = solve(here, BODY, next(iter(METHODS)), steps[-1], asked.sampling)
        if finest.samples is None:
            raise RuntimeError(f"Exudyn fails on its finest run of {case.name}: {finest.failure}")
        theirs, steps = Reference(finest.samples, horizon, asked.sampling), steps[:-1]
        law = {"difference_of_laws": _numbers(reference.error(finest.samples))}
    yield {"horizon": horizon, "version": version("exudyn"), **law}
    for r in ours:
        what = {"integrator": r.integrator, "rtol": r.rtol, "evaluations": r.evaluations, "s": r.seconds}
        yield {"by": "flexclear", **what, **_numbers(r.error)}
    for k, method in enumerate(METHODS):
        for step in steps[:TRIED] if k else steps:
            yield {"by": "exudyn", "method": method, "step": step, **_run(here, method, step, theirs, ours)}


def _numbers(error: Error) -> dict[str, float]:
    return {"position_um": 1e6 * error.position, "velocity_mm_s": 1e3 * error.velocity, "relative": error.relative}


def _run(here: Mechanism, method: str, step: float, reference: Reference, ours: list[Rung]) -> Record:
    """One of their runs, and next to it ours that match its error or one of the levels."""
    first = solve(here, BODY, method, step, reference.sampling)
    if first.samples is None:
        return {"failed": first.failure}
    try:
        error = reference.error(first.samples)
    except ValueError:  # where it cuts its steps, as it may at contacts, its samples come late
        return {"failed": "its samples are not at the times of the others"}
    wanted = {"equal": errors.cheapest(ours, lambda e: e.within(error))}
    for level in LEVELS:
        wanted[str(level)] = errors.cheapest(ours, partial(_reaches, level))
    rungs = [rung for rung in wanted.values() if rung]
    seconds, timed = _side_by_side(partial(solve, here, BODY, method, step, reference.sampling), first, rungs)
    matches = {name: _match(rung, seconds, timed[_name(rung)]) for name, rung in wanted.items() if rung}
    return {"s": seconds, **_numbers(error), "ours": matches}


def _name(rung: Rung) -> str:
    return f"{rung.integrator} {rung.rtol:g}"


def _match(rung: Rung, theirs: float, ours: Sequence[float]) -> dict[str, Any]:
    whole, bare, alike, *straight = ours
    found = {"run": _name(rung), "position_um": 1e6 * rung.error.position, "s": whole, "bare_s": bare}
    found |= {"alike_s": alike, "alike_relative": rung.alike_error.relative}
    return found | ({"straight_s": straight[0]} if straight else {}) | {"ratio": theirs / whole}


def _reaches(level: float, error: Error) -> bool:
    return error.relative <= level


def _side_by_side(
    again: Callable[[], Outcome], first: Outcome, rungs: list[Rung]
) -> tuple[float, dict[str, list[float]]]:
    """Median times [s] of theirs, by name of ours: whole, integration alone, two sensors, straight code; in turns."""
    theirs, mine = [first.seconds], {_name(rung): rung for rung in rungs}
    timers = {name: [r.time, r.bare, r.alike, *([r.straight] if r.straight else [])] for name, r in mine.items()}
    ours: dict[str, list[list[float]]] = {name: [] for name in mine}
    for number in range(REPEATS):
        if number and first.seconds < LONG:
            theirs.append(again().seconds)
        for name, mine_of in timers.items():
            ours[name].append([timer() for timer in mine_of])
    return float(np.median(theirs)), {name: np.median(times, axis=0).tolist() for name, times in ours.items()}


def show(records: list[Record]) -> str:
    """Times needed for an accuracy, then every run of Exudyn with ours beside it."""
    heads, runs = {r["case"]: r for r in records if "horizon" in r}, _runs(records)
    levels = [_level_row(case, level, runs[case]) for case in heads for level in LEVELS]
    head = (
        "velocity error below",
        "Exudyn [s]",
        "its run",
        "its position [um]",
        "ours [s]",
        "our run",
        "our position [um]",
        "Exudyn / ours",
        "the same recorded",
        "its error",
        "integration alone",
        "straight code",
    )
    columns = ("method, step", "position [um]", "velocity [mm/s]", "Exudyn [s]", "ours", "ours, no worse [s]", "ratio")
    texts = [pipe_table(head, levels)]
    for case, r in heads.items():
        note = f"error over {1e3 * r['horizon']:g} ms"
        if "difference_of_laws" in r:
            d = r["difference_of_laws"]
            note += (
                "; each against the converged solution of its own law, which differ by "
                f"{short(d['position_um'])} um and {short(d['velocity_mm_s'])} mm/s"
            )
        texts.append(f"{case} ({note}):\n\n{pipe_table(columns, [_run_row(run) for run in runs[case]])}")
    return "\n\n".join(texts)


def _runs(records: list[Record]) -> dict[str, list[Record]]:
    """Exudyn's runs by case."""
    found: dict[str, list[Record]] = {}
    for r in records:
        if r.get("by") == "exudyn":
            found.setdefault(r["case"], []).append(r)
    return found


def _level_row(case: str, level: float, runs: list[Record]) -> list[str]:
    """Their fastest run that reaches a level against ours; theirs may reach none, then its longest run is a bound."""
    name = f"{case}: {100 * level:g} %"
    done = [r for r in runs if "s" in r and str(level) in r["ours"]]
    reaching = [r for r in done if r["relative"] <= level]
    if not done:
        return [name, *[""] * 11]
    best = min(reaching, key=lambda r: r["s"]) if reaching else max(done, key=lambda r: r["s"])
    mark, ours = "" if reaching else "> ", best["ours"][str(level)]  # their finest run may not get there
    seconds, ratio = f"{mark}{best['s']:.3g}", f"{mark}{ours['ratio']:.3g}"
    theirs = [seconds, f"{best['method']}, {best['step']:g} s", short(best["position_um"])]
    # records from before these were measured say nothing about them
    alike, bare, straight = (
        f"{mark}{best['s'] / ours[part]:.3g}" if part in ours else "" for part in ("alike_s", "bare_s", "straight_s")
    )
    error = f"{100 * ours['alike_relative']:.2g} %" if "alike_relative" in ours else ""
    mine = [f"{ours['s']:.3g}", ours["run"], short(ours["position_um"])]
    return [name, *theirs, *mine, ratio, alike, error, bare, straight]


def _run_row(run: Record) -> list[str]:
    name = f"{run['method']}, {run['step']:g} s"
    if "failed" in run:
        return [name, "failed", "", "", "", "", ""]
    cells = [short(run["position_um"]), short(run["velocity_mm_s"]), f"{run['s']:.3g}"]
    equal = run["ours"].get("equal")
    matched = [equal["run"], f"{equal['s']:.3g}", f"{equal['ratio']:.3g}"] if equal else ["", "", ""]
    return [name, *cells, *matched]


def points(records: list[Record]) -> dict[str, list[dict[str, Any]]]:
    """By scene of a cost study its runs as `flexclear cost --peer` draws them: seconds [s] and errors [SI] by step."""
    versions = {r["case"]: r["version"] for r in records if "version" in r}
    return {
        asked.study: list(_tracks(runs, f"Exudyn {versions[case]}", asked.note))
        for case, runs in _runs(records).items()
        # a log may have cases that are no longer compared
        if (asked := COMPARISONS.get(case)) and asked.study
    }


def _tracks(runs: list[Record], program: str, note: str) -> Iterator[dict[str, Any]]:
    done = [run for run in runs if "s" in run]
    for method in dict.fromkeys(run["method"] for run in done):
        mine = [run for run in done if run["method"] == method]
        yield {
            "name": f"Exudyn, {method}",
            "note": f"{program}: times of its integration alone, ours hold all that a run records{note}",
            "seconds": [run["s"] for run in mine],
            "error": {
                f"{BODY}.position": [1e-6 * run["position_um"] for run in mine],
                f"{BODY}.velocity": [1e-3 * run["velocity_mm_s"] for run in mine],
            },
        }


def files(records: list[Record]) -> Mapping[str, bytes]:
    """The file of those points."""
    return {"accuracy/exudyn.json": f"{json.dumps(points(records), indent=1)}\n".encode()}


FAMILY = Family(
    what="whole runs against Exudyn at equal error",
    takes="15 min",
    page="benchmarks.md",
    cases=lambda: [Case(name, asked) for name, asked in COMPARISONS.items()],
    measure=measure,
    show=show,
    files=files,
    needs=("exudyn", "exudyn"),
)
