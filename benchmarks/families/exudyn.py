"""Whole runs against Exudyn at equal error, both against the same converged reference.

The reference is our run at rtol 1e-13; Exudyn's error against it falls with its step, which confirms it independently.
Error: largest deviation of the platform's velocity (and position) at multiples of 1 ms, where both codes also record
it.  Each of Exudyn's runs is measured next to ours that is no worse in either and needs the fewest evaluations. Times
are those of the whole integration with its samples; building the model and compiling are in neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from benchmarks import accuracy, exudyn_model, exudyn_runs
from benchmarks.accuracy import Error, Reference, Rung
from benchmarks.engines import Mechanism, damped, mechanism, without_friction
from benchmarks.exudyn_model import load
from benchmarks.exudyn_runs import METHODS, Outcome, solve
from benchmarks.tables import short, table
from pipeline.core.scene.schema import Scene

TITLE = "Whole runs against Exudyn"
#: modules whose texts belong to what the page says
EXPLAINED_BY = (exudyn_model, exudyn_runs)
BODY = "platform"
#: shares of the largest speed for which the times needed are compared
LEVELS = (1e-2, 1e-3, 1e-4)
REPEATS = 3
#: Exudyn runs longer than this are not repeated [s]
LONG = 1.0
SMOOTH = (1e-3, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
STIFF = (5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)
#: the second method is no better in the long run; it takes part at the first steps of each ladder
TRIED = 4
INSTALL = "exudyn is not installed; to compare with it: .venv/bin/python -m pip install -e '.[exudyn]'"


@dataclass(frozen=True)
class Case:
    """A scene, edited or not. horizon: end of the comparison [s]; own_law: Exudyn has another friction law."""

    title: str
    scene: str
    edit: Callable[[Scene], Scene]
    steps: tuple[float, ...]
    horizon: float | None = None
    own_law: bool = False


CASES = (
    Case("ideal", "ideal", lambda scene: scene, SMOOTH),
    Case("far_cb", "far_cb", lambda scene: scene, SMOOTH),
    Case("csj without friction", "csj", without_friction, STIFF),
    Case("csj, each code with its own friction law", "csj", lambda scene: scene, STIFF, own_law=True),
    Case(
        "far_csj_cb without friction, 5 % modal damping",
        "far_csj_cb",
        lambda scene: damped(without_friction(scene), 0.05),
        STIFF,
    ),
    Case("far_csj_cb without friction, error up to 30 ms", "far_csj_cb", without_friction, STIFF, horizon=0.03),
)


def measure() -> Iterator[dict[str, Any]]:
    """One result per case; nothing when exudyn is not installed."""
    try:
        load()
    except ImportError:
        print(INSTALL)
        return
    for case in CASES:
        yield _case(case)


def _case(case: Case) -> dict[str, Any]:
    original = mechanism(case.scene)
    here = original.with_scene(case.title, case.edit(original.scene))
    horizon = case.horizon or here.scene.time.end
    reference = accuracy.converged(here, BODY, horizon)
    ours = accuracy.ladder(here, BODY, reference)
    theirs, law, difference = reference, {}, None
    if case.own_law:
        finest = solve(here, BODY, next(iter(METHODS)), case.steps[-1])
        if finest.samples is None:
            raise RuntimeError(f"Exudyn fails on its finest run of {case.title}: {finest.failure}")
        theirs, difference = accuracy.of_samples(finest.samples, horizon), reference.error(finest.samples)
        law = {"difference_of_laws": _numbers(difference)}
    steps = case.steps[:-1] if case.own_law else case.steps
    settings = [(method, step) for k, method in enumerate(METHODS) for step in (steps[:TRIED] if k else steps)]
    runs = [_run(here, method, step, theirs, ours) for method, step in settings]
    return {
        "case": case.title,
        "horizon": horizon,
        **law,
        "ours": [{"rtol": r.rtol, "evaluations": r.evaluations, **_numbers(r.error)} for r in ours],
        "exudyn": runs,
        "levels": [_level(level, runs) for level in LEVELS],
    }


def _numbers(error: Error) -> dict[str, float]:
    return {"position_um": 1e6 * error.position, "velocity_mm_s": 1e3 * error.velocity, "relative": error.relative}


def _run(here: Mechanism, method: str, step: float, reference: Reference, ours: list[Rung]) -> dict[str, Any]:
    """One of their runs, and next to it ours that match its error or one of the levels."""
    found: dict[str, Any] = {"method": method, "step": step}
    first = solve(here, BODY, method, step)
    if first.samples is None:
        return found | {"failed": first.failure}
    error = reference.error(first.samples)
    wanted = {"equal": _cheapest(ours, lambda e: e.within(error))}
    for level in LEVELS:
        wanted[str(level)] = _cheapest(ours, partial(_reaches, level))
    seconds, timed = _side_by_side(here, method, step, first, [rung for rung in wanted.values() if rung])
    matches = {
        name: {"rtol": rung.rtol, "s": timed[rung.rtol], "ratio": seconds / timed[rung.rtol]}
        for name, rung in wanted.items()
        if rung
    }
    return found | {"s": seconds, **_numbers(error), "ours": matches}


def _reaches(level: float, error: Error) -> bool:
    return error.relative <= level


def _cheapest(ours: list[Rung], good: Callable[[Error], bool]) -> Rung | None:
    return min((rung for rung in ours if good(rung.error)), key=lambda rung: rung.evaluations, default=None)


def _side_by_side(
    here: Mechanism, method: str, step: float, first: Outcome, rungs: list[Rung]
) -> tuple[float, dict[float, float]]:
    """Median times [s] of theirs, and of ours by tolerance, measured in turns."""
    theirs, ours = [first.seconds], {rung.rtol: [rung.time()] for rung in rungs}
    for _ in range(REPEATS - 1):
        if first.seconds < LONG:
            theirs.append(solve(here, BODY, method, step).seconds)
        for rung in {rung.rtol: rung for rung in rungs}.values():
            ours[rung.rtol].append(rung.time())
    return float(np.median(theirs)), {rtol: float(np.median(times)) for rtol, times in ours.items()}


def _level(level: float, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Their fastest run that reaches a level against ours; theirs may reach none, then its longest run is a bound."""
    done = [r for r in runs if "s" in r and str(level) in r["ours"]]
    reaching = [r for r in done if r["relative"] <= level]
    best = min(reaching, key=lambda r: r["s"]) if reaching else max(done, key=lambda r: r["s"], default=None)
    if best is None:
        return {"level": level}
    ours = best["ours"][str(level)]
    return {
        "level": level,
        "reached": bool(reaching),
        "method": best["method"],
        "step": best["step"],
        "exudyn_s": best["s"],
        "ours_s": ours["s"],
        "rtol": ours["rtol"],
        "ratio": ours["ratio"],
    }


def show(results: list[dict[str, Any]]) -> str:
    """Times needed for an accuracy, then every run of Exudyn with ours beside it."""
    head = ("velocity error below", "Exudyn [s]", "step [s]", "ours [s]", "rtol", "Exudyn / ours")
    texts = [table(head, [_level_row(r["case"], level) for r in results for level in r["levels"]])]
    columns = ("method, step", "position [um]", "velocity [mm/s]", "Exudyn [s]", "rtol", "ours, no worse [s]", "ratio")
    for r in results:
        note = f"error over {1e3 * r['horizon']:g} ms"
        if "difference_of_laws" in r:
            d = r["difference_of_laws"]
            note += (
                "; each against the converged solution of its own law, which differ by "
                f"{short(d['position_um'])} um and {short(d['velocity_mm_s'])} mm/s"
            )
        texts.append(f"{r['case']} ({note}):\n\n{table(columns, [_run_row(run) for run in r['exudyn']])}")
    return "\n\n".join(texts)


def _level_row(case: str, level: dict[str, Any]) -> list[str]:
    name = f"{case}: {100 * level['level']:g} %"
    if "ratio" not in level:
        return [name, "", "", "", "", ""]
    mark = "" if level["reached"] else "> "  # their finest run does not get there
    seconds, step = f"{mark}{level['exudyn_s']:.3g}", f"{level['step']:g}"
    return [name, seconds, step, f"{level['ours_s']:.3g}", f"{level['rtol']:g}", f"{mark}{level['ratio']:.3g}"]


def _run_row(run: dict[str, Any]) -> list[str]:
    name = f"{run['method']}, {run['step']:g} s"
    if "failed" in run:
        return [name, "failed", "", "", "", "", ""]
    errors = [short(run["position_um"]), short(run["velocity_mm_s"]), f"{run['s']:.3g}"]
    equal = run["ours"].get("equal")
    matched = [f"{equal['rtol']:g}", f"{equal['s']:.3g}", f"{equal['ratio']:.3g}"] if equal else ["", "", ""]
    return [name, *errors, *matched]
