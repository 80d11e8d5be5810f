"""Whole runs against Exudyn at equal error, both against the same converged reference.

Each of Exudyn's runs is measured next to our fastest run that is no worse in position and velocity. Times are those of
the whole integration with its samples; they exclude building the model and compiling.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from benchmarks import errors
from benchmarks.errors import Error, Reference, Rung, Samples
from benchmarks.exudyn_model import METHODS, Outcome, solve
from benchmarks.family import Case, Family, Measured, Record
from benchmarks.mechanisms import Mechanism, damped, mechanism, without_friction
from benchmarks.page import short
from benchmarks.processes import LostError, Worker
from benchmarks.timing import interleaved
from flexclear.post.plotting.table import Table, as_csv, pipe_table
from flexclear.scene.schema import Scene

BODY = "platform"
#: velocity errors, as fractions of the largest speed, for which times are compared
LEVELS = (1e-2, 1e-3, 1e-4)
REPEATS = 5
#: longer runs of Exudyn are not repeated [s]
LONG = 1.0
SMOOTH = (1e-3, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
RARELY = (9e-3, 4.5e-3, 2.25e-3, 1e-3, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
STIFF = (5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)
#: steps where impacts magnify errors, or where the finest run is a reference [s]
FINER = (*STIFF, 5e-7, 2e-7)
#: sampling time of a run that is a reference [s]
RECORDED = 1e-6
#: number of first steps of each ladder at which the other methods take part: they are no better in the long run
TRIED = 4
#: a run is left out when another one, no worse in either error, takes less than this fraction of its time
CLEARLY = 0.9


#: processor time after which a run counts as hanging [s]; the most expensive one takes a fifth of this limit
LIMIT = 120


@dataclass(frozen=True)
class Comparison:
    """A scene, edited or not, that both codes run.

    horizon: end of both runs [s].  sampling: interval at which both codes record [s].
    own_law: True when Exudyn has another friction law.
    study: cost study whose figure shows Exudyn's runs.  note: how these runs differ from the scene of the study.
    """

    scene: str
    steps: tuple[float, ...]
    edit: Callable[[Scene], Scene] = field(default=lambda scene: scene, repr=False)
    horizon: float | None = None
    sampling: float = errors.SAMPLING
    own_law: bool = False
    study: str = ""
    note: str = ""


@dataclass(frozen=True)
class Run:
    """A setting of Exudyn, its outcome and the error of that outcome."""

    method: str
    step: float
    outcome: Outcome
    error: Error | None


OWN_LAW = "its friction is linear up to one speed and constant above; errors against its own finest run"
COMPARISONS = {
    "ideal": Comparison("ideal", SMOOTH, study="sps4/ideal"),
    "ideal, recorded every 9 ms": Comparison("ideal", RARELY, sampling=9e-3),
    "far_cb": Comparison("far_cb", SMOOTH, study="sps4/far_cb"),
    "far_cb, recorded every 9 ms": Comparison("far_cb", RARELY, sampling=9e-3),
    "csj without friction": Comparison("csj", STIFF, without_friction),
    "csj, each code with its own friction law": Comparison(
        "csj", FINER, own_law=True, study="sps4/csj", note=f"; {OWN_LAW}"
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
        FINER,
        without_friction,
        horizon=0.03,
        study="sps4/far_csj_cb",
        note="; without friction; errors up to 30 ms",
    ),
}


class Peer:
    """Exudyn's runs of one mechanism in a separate process, which times the integration alone.

    One process serves all runs, so that no time includes its start, and all but its first run are warm. After a failed
    run the next one gets a new process.
    """

    def __init__(self, here: Mechanism, body: str) -> None:
        self.here, self.body = here, body
        self.worker: Worker | None = None

    def run(self, method: str, step: float, sampling: float) -> Outcome:
        """Make a run at a fixed step [s], sampled at an interval [s]; arguments as of `exudyn_model.solve`."""
        used = self.worker is not None
        try:
            self.worker = self.worker or Worker(work, LIMIT)
            found: Outcome = self.worker.ask((self.here, self.body, method, step, sampling))
        except LostError as lost:
            self.close()
            if used and not lost.seconds:  # leftovers of earlier runs may have killed the process
                return self.run(method, step, sampling)
            return Outcome(0.0, None, str(lost))
        if found.samples is None:
            self.close()
        return found

    def close(self) -> None:
        """End the process."""
        if self.worker is not None:
            self.worker.dismiss()
        self.worker = None


def work(parameters: tuple[Any, ...], begin: Callable[[], None]) -> Outcome:
    """Solve one run in the process of a `Peer`."""
    begin()
    return solve(*parameters)


def edited(case: Case) -> Mechanism:
    """Return the mechanism that both codes run."""
    original, comparison = mechanism(case.of.scene), case.of
    scene = comparison.edit(original.scene)
    if comparison.horizon is not None:
        scene = scene.model_copy(update={"time": scene.time.model_copy(update={"end": comparison.horizon})})
    return original.with_scene(case.name, scene)


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield for each case a record on the comparison, then one for each of our runs and one for each of Exudyn's."""
    for case in cases:
        here = edited(case)
        with closing(Peer(here, BODY)) as peer:
            yield case, list(_records(case, here, peer))


def _records(case: Case, here: Mechanism, peer: Peer) -> Iterator[Record]:
    comparison: Comparison = case.of
    reference = errors.converged(here, BODY, here.scene.time.end, comparison.sampling)
    theirs, law = _own(case, peer, reference) if comparison.own_law else (reference, {})
    yield {"horizon": reference.horizon, "version": version("exudyn"), **law}
    tried = [_tried(peer, method, step, theirs) for method, step in _settings(comparison)]
    done = [run for run in tried if run.error is not None]
    ours = errors.ladder(here, BODY, reference, partial(_beyond, [run.error for run in done if run.error]))
    for r in ours:
        what = {"integrator": r.integrator, "rtol": r.rtol, "evaluations": r.evaluations, "s": r.seconds}
        yield {"by": "flexclear", **what, **_numbers(r.error)}
    best = [done[k] for k in front([(r.outcome.seconds, r.error.position, r.error.velocity) for r in done if r.error])]
    requested = {level: _candidates(done, level) for level in LEVELS}
    for run in tried:
        levels = [level for level, runs in requested.items() if run in runs]
        record = {"by": "exudyn", "method": run.method, "step": run.step}
        if run.error is None:
            yield record | {"failed": run.outcome.failure}
        elif run in best or levels:
            yield record | _compared(run, levels, peer, comparison.sampling, ours)
        else:
            yield record | {"s": run.outcome.seconds, **_numbers(run.error)}


def _settings(comparison: Comparison) -> list[tuple[str, float]]:
    """Return the methods and steps [s] to try; with a friction law of its own, Exudyn's finest run is the reference."""
    steps = comparison.steps[:-1] if comparison.own_law else comparison.steps
    return [(method, step) for k, method in enumerate(METHODS) for step in (steps[:TRIED] if k else steps)]


def _own(case: Case, peer: Peer, ours: Reference) -> tuple[Reference, Record]:
    """Return Exudyn's own finest run as a reference at any time, and its difference from ours."""
    finest = peer.run(next(iter(METHODS)), case.of.steps[-1], RECORDED).samples
    if finest is None:
        raise RuntimeError(f"Exudyn fails on its finest run of {case.name}")
    t, velocity = finest.time, finest.velocity
    position = CubicHermiteSpline(t, finest.position, velocity)

    def at(times: np.ndarray) -> Samples:
        # within a microsecond of contact a velocity is linear to some micrometres per second
        return Samples(times, position(times), np.stack([np.interp(times, t, v) for v in velocity.T], axis=1))

    samples = at(ours.samples.time)
    return replace(ours, samples=samples, at=at), {"difference_of_laws": _numbers(ours.error(samples))}


def _tried(peer: Peer, method: str, step: float, reference: Reference) -> Run:
    outcome = peer.run(method, step, reference.sampling)
    if outcome.samples is None:
        return Run(method, step, outcome, None)
    error = reference.error(outcome.samples)
    if outcome.seconds < LONG:  # the first run in a process is slower
        again = peer.run(method, step, reference.sampling)
        outcome = min(outcome, again, key=lambda o: o.seconds) if again.samples else outcome
    return Run(method, step, outcome, error)


def _numbers(error: Error) -> dict[str, float]:
    return {"position_um": 1e6 * error.position, "velocity_mm_s": 1e3 * error.velocity, "relative": error.relative}


def front(runs: Sequence[tuple[float, ...]]) -> list[int]:
    """Return the indices of the runs, given by time and errors, that no clearly faster run equals in every error."""
    return [
        k
        for k, (mine, *wrong) in enumerate(runs)
        if not any(s < CLEARLY * mine and all(e <= w for e, w in zip(es, wrong, strict=True)) for s, *es in runs)
    ]


def _candidates(done: list[Run], level: float) -> list[Run]:
    """Return the two fastest runs that reach a level, since single times scatter; else the longest run, as a bound."""
    reaching = sorted(
        (run for run in done if run.error and _reaches(level, run.error)), key=lambda run: run.outcome.seconds
    )
    return reaching[:2] or sorted(done, key=lambda run: -run.outcome.seconds)[:1]


def _compared(run: Run, levels: list[float], peer: Peer, sampling: float, ours: list[Rung]) -> Record:
    """Return one of their runs and, measured in turns with it, ours that is no worse and ours that reach some levels.

    Our times are those of the whole run and, for runs that reach levels, of its parts.
    """
    wrong = run.error
    assert wrong is not None
    requested = {"equal": errors.cheapest(ours, lambda error: error.within(wrong))}
    requested |= {str(level): errors.cheapest(ours, partial(_reaches, level)) for level in levels}
    tasks: dict[tuple[str, str], Callable[[], float]] = {}
    for name, rung in requested.items():
        if rung is not None:
            tasks[_name(rung), "s"] = rung.time
            if name != "equal":
                tasks |= {(_name(rung), "bare_s"): rung.bare, (_name(rung), "alike_s"): rung.alike}
    if run.outcome.seconds < LONG:
        tasks["theirs", "s"] = lambda: peer.run(run.method, run.step, sampling).seconds
    times = {task: found.median for task, found in interleaved(tasks, REPEATS).items()}
    theirs = times.pop(("theirs", "s"), run.outcome.seconds)
    matches = {
        name: {
            "run": _name(rung),
            "position_um": 1e6 * rung.error.position,
            **{part: seconds for (which, part), seconds in times.items() if which == _name(rung)},
            "alike_relative": rung.alike_error.relative,
            "ratio": theirs / times[_name(rung), "s"],
        }
        for name, rung in requested.items()
        if rung
    }
    return {"s": theirs, **_numbers(wrong), "ours": matches}


def _beyond(theirs: list[Error], error: Error) -> bool:
    """Return True when an error of ours is no larger than any of theirs, and within all levels."""
    return error.relative <= min(LEVELS) and all(error.within(their) for their in theirs)


def _reaches(level: float, error: Error) -> bool:
    return error.relative <= level


def _name(rung: Rung) -> str:
    return f"{rung.integrator} {rung.rtol:g}"


def show(records: list[Record]) -> str:
    """Return the times needed for an accuracy; `files` has every run of Exudyn that counts."""
    runs, known = (
        _runs(records),
        [case for case in COMPARISONS for r in records if r["case"] == case and "horizon" in r],
    )
    levels = [_level_row(case, level, runs[case]) for case in known for level in LEVELS]
    head = (
        "velocity error below",
        "Exudyn [s]",
        "its run",
        "its position [um]",
        "ours [s]",
        "our run",
        "our position [um]",
        "Exudyn / ours",
        "equal samples",
        "error of these",
        "integration alone",
    )
    failed = [f"{case}: {text}" for case in known if (text := _unlisted(runs[case]))]
    return "\n\n".join([pipe_table(head, levels), *failed])


def _listed(runs: Mapping[str, list[Record]]) -> Table:
    """Return every run of Exudyn that counts, with ours that is no worse."""
    heads = ("case", "method, step", "position [um]", "velocity [mm/s]", "Exudyn [s]")
    rows = []
    for case, mine in runs.items():
        done = [run for run in mine if "s" in run]
        best = [done[k] for k in front([(run["s"], run["position_um"], run["velocity_mm_s"]) for run in done])]
        rows += [(case, *_run_row(run)) for run in best if "ours" in run]
    return Table("Runs", (*heads, "ours", "ours, no worse [s]", "ratio"), tuple(rows))


def _unlisted(runs: list[Record]) -> str:
    """Return the settings that failed, by reason."""
    found: dict[str, list[str]] = {}
    for run in runs:
        if "failed" in run:
            found.setdefault(run["failed"], []).append(_called(run))
    return "\n".join(f"Failed: {'; '.join(names)} ({why})." for why, names in found.items())


def _runs(records: list[Record]) -> dict[str, list[Record]]:
    """Return Exudyn's runs by case."""
    found: dict[str, list[Record]] = {}
    for r in records:
        if r.get("by") == "exudyn":
            found.setdefault(r["case"], []).append(r)
    return found


def _level_row(case: str, level: float, runs: list[Record]) -> list[str]:
    """Return their fastest run that reaches a level against ours; where none does, their longest run is a bound."""
    name = f"{case}: {100 * level:g} %"
    done = [r for r in runs if str(level) in r.get("ours", ())]
    reaching = [r for r in done if r["relative"] <= level]
    if not done:
        return [name, *[""] * 10]
    best = min(reaching, key=lambda r: r["s"]) if reaching else max(done, key=lambda r: r["s"])
    mark, ours = "" if reaching else "> ", best["ours"][str(level)]  # their finest run may miss the level
    seconds, ratio = f"{mark}{best['s']:.3g}", f"{mark}{ours['ratio']:.3g}"
    theirs = [seconds, _called(best), short(best["position_um"])]
    alike, bare = (f"{mark}{best['s'] / ours[part]:.3g}" for part in ("alike_s", "bare_s"))
    error = f"{100 * ours['alike_relative']:.2g} %"
    mine = [f"{ours['s']:.3g}", ours["run"], short(ours["position_um"])]
    return [name, *theirs, *mine, ratio, alike, error, bare]


def _called(run: Record) -> str:
    return f"{run['method']}, {run['step']:g} s"


def _run_row(run: Record) -> list[str]:
    cells = [_called(run), short(run["position_um"]), short(run["velocity_mm_s"]), f"{run['s']:.3g}"]
    equal = run["ours"].get("equal")
    return cells + ([equal["run"], f"{equal['s']:.3g}", f"{equal['ratio']:.3g}"] if equal else ["", "", ""])


def points(records: list[Record]) -> dict[str, list[dict[str, Any]]]:
    """Return Exudyn's runs by scene of a cost study: seconds [s] and errors [SI] by step."""
    versions = {r["case"]: r["version"] for r in records if "version" in r}
    return {
        comparison.study: list(_tracks(runs, f"Exudyn {versions[case]}", comparison.note))
        for case, runs in _runs(records).items()
        if (comparison := COMPARISONS[case]).study
    }


def _tracks(runs: list[Record], program: str, note: str) -> Iterator[dict[str, Any]]:
    done = [run for run in runs if "s" in run]
    for method in dict.fromkeys(run["method"] for run in done):
        mine = [run for run in done if run["method"] == method]
        yield {
            "name": f"Exudyn, {method}",
            "note": f"{program}: times of its integration with two sensors{note}",
            "seconds": [run["s"] for run in mine],
            "error": {
                f"{BODY}.position": [1e-6 * run["position_um"] for run in mine],
                f"{BODY}.velocity": [1e-3 * run["velocity_mm_s"] for run in mine],
            },
        }


def files(records: list[Record]) -> Mapping[str, bytes]:
    """Return all runs as a table, by path below docs/."""
    return {"benchmarks/exudyn.csv": as_csv(_listed(_runs(records))).encode()}


FAMILY = Family(
    what="whole runs against Exudyn at equal error",
    takes="12 min",
    page="benchmarks.md",
    cases=lambda: [Case(name, comparison) for name, comparison in COMPARISONS.items()],
    measure=measure,
    show=show,
    rows="(ideal|far_cb|csj without friction|modal damping): 0.1 %",
    files=files,
    needs=("exudyn", "exudyn"),
    children=True,
)
