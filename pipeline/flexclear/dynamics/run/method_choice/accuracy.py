"""Run with the requested accuracy of time integration, by trying tolerances and estimating errors.

Where the scene names no integrator, each run uses the one that is predicted to be cheapest (`method_selection`).

The error of a run is estimated by the same run at a hundred times tighter tolerance: an adaptive method whose tolerance
is proportional to its error (tolerance proportionality) then overestimates its distance to the exact solution by about
one per cent. Errors of the model (modes, mesh, contact law) are not part of it.
Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.4.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity, parse
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

if TYPE_CHECKING:
    from flexclear.dynamics.run.method_choice.method_selection import Costs
    from flexclear.dynamics.run.progress_rate import Judges

#: tolerance of the run that serves the error estimate, as a fraction of the run's
FINER_TOLERANCE = 1e-2
#: limits of the tolerances that are tried; below, rounding dominates
TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE = 1e-14, 1e-2
#: limits of an accepted run's error, as fractions of the requested accuracy: sufficient, and not wasteful
ACCEPTED, WASTEFUL = 1.0, 1.0 / 3.0
#: error at which the next try aims, between the two
AIM = 0.6
TOLERANCE_TRIES = 12
#: least predicted saving of a looser tolerance, as a fraction of the evaluations of a sufficient run
SAVED = 0.25
#: a run refused at a tolerance looser than this is tried again at a fraction of the tolerance
REFUSED_FOR_GOOD, TIGHTER_AFTER_REFUSAL = 1e-9, 0.1
#: an error that does not fall below this fraction at FINER_TOLERANCE has another cause than the steps
STUCK = 0.3
#: default requested accuracy, as a fraction of each quantity's range; the loosest and the tightest tolerance of the
#: ladder that is climbed for it; and the ratio of neighbouring ones in scenes with contacts: twice the runs, but those
#: that serve comparisons end at the horizon, and the delivered run need not be tighter than necessary
BY_DEFAULT, LOOSEST_RUNG, TIGHTEST_RUNG, FINER_RUNG = 1e-3, 1e-4, 1e-10, 0.1
#: motions below this fraction of their natural size are rounding, which stiff rods magnify in forces
ROUNDING_OF_MOTION = 1e-9


class Make(Protocol):
    """Makes the run of a scene, under judges of its integrators."""

    def __call__(self, scene: Scene, judges: Judges | None, /, *, alone: bool = False) -> xr.Dataset:
        """Return the run. alone: without the perturbed run that gives the predictability horizon."""


@dataclass(frozen=True)
class Attempt:
    """A run at one tolerance: estimated errors by quantity, and the largest one relative to the requested accuracy."""

    rtol: float
    run: xr.Dataset
    errors: Mapping[str, float]
    fraction: float


@dataclass
class Search:
    """Runs made so far, by tolerance, and the request.

    predictable: True for the default request, for which runs are compared only up to the predictability horizon, and
    quantities that never change meet the request. shorter: runs that end at a horizon, by tolerance.
    """

    scene: Scene
    make: Make
    costs: Costs | None = None
    runs: dict[float, xr.Dataset] = field(default_factory=dict)
    shorter: dict[float, xr.Dataset] = field(default_factory=dict)
    predictable: bool = False

    def run(self, rtol: float) -> xr.Dataset:
        """Return the run at a tolerance, made once."""
        if rtol not in self.runs:
            self.runs[rtol] = self._made(self.scene, rtol)
        return self.runs[rtol]

    def until(self, rtol: float, horizon: float) -> xr.Dataset:
        """Return the run at a tolerance, which may end at the horizon [s] or later, made once."""
        if rtol in self.runs or horizon >= self.scene.time.end:
            return self.run(rtol)
        if rtol not in self.shorter or float(self.shorter[rtol]["time"][-1]) < horizon:
            end = max(horizon, self.scene.time.start + self.scene.output.interval)
            self.shorter[rtol] = self._made(edited(self.scene, {"time.end": end}), rtol, alone=True)
        return self.shorter[rtol]

    def _made(self, scene: Scene, rtol: float, **how: bool) -> xr.Dataset:
        if self.costs is None:
            return self.make(edited(scene, {"solver.rtol": rtol}), None, **how)
        name, why = self.costs.best(rtol), self.costs.why(rtol)
        run = self.make(edited(scene, {"solver.rtol": rtol, "solver.integrator": name}), self.costs.judges(rtol), **how)
        self.costs.learn(rtol, name, run, (scene.time.end - scene.time.start) / self.costs.span)
        return run.assign_attrs(method_reason=why)

    def attempt(self, rtol: float) -> Attempt:
        """Return the run at a tolerance and its estimated errors."""
        run = self.run(rtol)
        finer = max(rtol * FINER_TOLERANCE, TIGHTEST_TOLERANCE)
        # the tightest run can only be compared with a looser one, whose error is larger
        other = self.run(finer if finer < rtol else rtol / FINER_TOLERANCE)
        requested = self.requested(other)
        # all tighter runs are compared: with impacts, two close tolerances may agree by chance
        witnesses = [other, *(r for tolerance, r in self.runs.items() if tolerance <= 0.1 * rtol)]
        errors = {q.name: max(self.error(run, r, q) for r in witnesses) for q in requested}
        return Attempt(rtol, run, errors, max((errors[q.name] / w for q, w in requested.items()), default=0.0))

    def error(self, run: xr.Dataset, other: xr.Dataset, quantity: Quantity) -> float:
        """Return the largest difference of two runs within the compared time, in the unit of the quantity."""
        horizons = [float(one["horizon"]) for one in (run, other) if self.predictable and "horizon" in one]
        return quantities.error(run, other, quantity, min(horizons, default=math.inf))

    def cheapest(self, attempt: Attempt) -> Attempt:
        """Return the attempt, or the run that served its error estimate if another method made that run at less cost.

        The difference of the two is at least the error of either, unless both err alike, so runs tighter than both are
        compared as well.
        """
        finer = attempt.rtol * FINER_TOLERANCE
        other = self.runs.get(finer)
        if (
            attempt.fraction > ACCEPTED
            or other is None
            or other.attrs["evaluations"] >= attempt.run.attrs["evaluations"]
        ):
            return attempt
        tighter = [run for rtol, run in self.runs.items() if rtol < finer]
        if not tighter:
            return replace(attempt, rtol=finer, run=other)
        requested = self.requested(other)
        errors = {q.name: max(attempt.errors[q.name], *(self.error(other, r, q) for r in tighter)) for q in requested}
        fraction = max((errors[q.name] / w for q, w in requested.items()), default=0.0)
        return Attempt(finer, other, errors, fraction) if fraction <= ACCEPTED else attempt

    @property
    def ratio(self) -> float:
        """Ratio of neighbouring tolerances of the ladder."""
        return FINER_RUNG if self.scene.contacts() or self.scene.stop else FINER_TOLERANCE

    def next_rung(self, rtol: float) -> float:
        """Return the next tighter tolerance of the ladder."""
        return float(f"{self.ratio * rtol:.1e}")

    def rung(self, rtol: float, until: float) -> Attempt:
        """Return the run at a tolerance, compared up to a time [s] with the one at the next tighter tolerance.

        The difference of the two is the error less that of the other, which is `ratio` of it.
        """
        run, other = self.until(rtol, until), self.until(self.next_rung(rtol), until)
        requested = self.requested(self.runs[min(self.runs)])
        errors = {q.name: quantities.error(run, other, q, until) / (1.0 - self.ratio) for q in requested}
        return Attempt(rtol, run, errors, max((errors[q.name] / w for q, w in requested.items()), default=0.0))

    def uncompared(self, refusal: SolverError) -> Attempt:
        """Return the tightest run, without an estimate; raise the refusal where none exists."""
        if not self.runs:
            raise refusal
        rtol = min(self.runs)
        return Attempt(rtol, self.runs[rtol], {}, math.inf)

    def saves(self, rtol: float, looser: float) -> bool:
        """Return True when a run at a looser tolerance is predicted to be cheap enough to be worth making.

        Where stability limits the steps it is not, and two runs are needed to know its error.
        """
        at = max(rtol * FINER_TOLERANCE, TIGHTEST_TOLERANCE)
        before, finer = self.runs[rtol], self.runs.get(at)
        if finer is None or finer is before or finer.attrs["method"] != before.attrs["method"]:
            return True
        growth = math.log(finer.attrs["evaluations"] / before.attrs["evaluations"]) / math.log(rtol / at)
        return (rtol / looser) ** max(growth, 0.0) < 1.0 - SAVED

    def requested(self, run: xr.Dataset) -> dict[Quantity, float]:
        """Return the requested accuracy in SI by quantity; relative ones refer to the quantity's size in `run`."""
        accuracy = self.scene.accuracy
        assert accuracy is not None
        requested = {}
        for name, want in accuracy.quantities.items():
            quantity = parse(name, self.scene.owners())
            absolute = want.absolute
            if absolute is None:
                size = quantities.scale(run, quantity)
                rounding = self.predictable and size <= ROUNDING_OF_MOTION * quantities.natural_size(run, quantity.unit)
                absolute = 0.0 if rounding else (want.relative or 0.0) * size
            if not absolute > 0.0 and self.predictable:
                continue
            if not absolute > 0.0:
                raise InputError(
                    f"{self.scene.path or self.scene.name} [accuracy] {name}",
                    "is a relative accuracy, but the quantity is constant",
                    "give an absolute one, with a unit",
                )
            requested[quantity] = absolute
        return requested


def deliver(scene: Scene, make: Make, progress: Progress, costs: Costs | None = None) -> xr.Dataset:
    """Return the cheapest run whose estimated errors meet the request, or the most accurate one with an explanation.

    costs: costs for method selection; None where the scene names an integrator.  The dataset's attributes state
    requested and estimated errors, the verdict, and the reason of the method.
    """
    search = Search(scene, make, costs)
    return _delivered(search, search.cheapest(_search(search, progress)), progress)


def at_tolerance(scene: Scene, make: Make, costs: Costs) -> xr.Dataset:
    """Return the run of a scene at its own tolerance, by the method that is predicted to be cheapest."""
    return Search(scene, make, costs).run(scene.solver.rtol)


def by_default(
    scene: Scene,
    make: Make,
    progress: Progress,
    costs: Callable[[Scene], Costs],
) -> xr.Dataset:
    """Return the run of a scene that requests no accuracy and leaves its integration open.

    As `deliver`, for BY_DEFAULT of each usual quantity over time (`Scene.requested`), up to the predictability horizon.
    """
    progress(None, f"running to an accuracy of {BY_DEFAULT:g} of the range of each quantity instead")
    names = [q.name for q in scene.requested() if q.over_time]
    request = {"quantities": {name: {"relative": BY_DEFAULT} for name in names}, "allow_missed": True, "by_need": True}
    wanting = edited(scene, {"accuracy": request})
    search = Search(wanting, make, costs(wanting), predictable=True)
    return _delivered(search, search.cheapest(_climb(search, progress)), progress)


def _climb(search: Search, progress: Progress) -> Attempt:
    """Return the run at the loosest tolerance of the ladder that meets the request, or the one with the least error.

    Runs that serve comparisons end at the horizon of the run at the loosest tolerance, unless the delivered run has a
    later one.
    """
    rtol, until, nearest, refusal = LOOSEST_RUNG, -math.inf, list[Attempt](), SolverError("")
    while rtol > TIGHTEST_RUNG:
        try:
            if until < 0.0 or rtol in search.runs:
                until = max(until, _horizon(search, search.run(rtol)))
            now = search.rung(rtol, until)
            if now.fraction <= ACCEPTED and _horizon(search, search.run(rtol)) > until:
                continue  # compare up to its own horizon
        except SolverError as error:
            refusal, rtol = error, search.next_rung(rtol)
            continue
        progress(None, f"tolerance {rtol:.1e}: error {now.fraction:.2g} of the requested accuracy")
        nearest.append(now)
        if now.fraction <= ACCEPTED:
            break
        rtol = search.next_rung(rtol)
    if not nearest:
        return search.uncompared(refusal)
    best = min(nearest, key=lambda one: (one.fraction, one.rtol))
    return replace(best, run=search.run(best.rtol))


def _horizon(search: Search, run: xr.Dataset) -> float:
    """Return the predictability horizon of a run [s], its end where it has none."""
    return float(run["horizon"]) if "horizon" in run else search.scene.time.end


def _delivered(search: Search, best: Attempt, progress: Progress) -> xr.Dataset:
    sizes = search.runs[min(search.runs)] if search.predictable else best.run
    requested = {q.name: w for q, w in search.requested(sizes).items() if q.name in best.errors or not best.errors}
    met = best.fraction <= ACCEPTED
    verdict = "met" if met else _missed(search, best, requested)
    progress(None, f"accuracy {verdict} (relative tolerance {best.rtol:.1e})")
    if "method_reason" in best.run.attrs:
        progress(None, str(best.run.attrs["method_reason"]))
    ratio = 1.0 / (search.ratio if search.predictable else FINER_TOLERANCE)
    meaning = f"largest error of the time integration, estimated by two runs with a tolerance ratio of {ratio:g}"
    if search.predictable:
        meaning += f"; requested by default: {BY_DEFAULT:g} of the range, up to the predictability horizon"
    return best.run.assign_attrs(
        accuracy_requested=json.dumps({name: f"{w:.3g}" for name, w in requested.items()}, sort_keys=True),
        accuracy_estimated=json.dumps({name: f"{e:.3g}" for name, e in best.errors.items()}, sort_keys=True),
        accuracy_verdict=verdict,
        accuracy_rtol=best.rtol,
        accuracy_runs=len(search.runs) + len(search.shorter),
        accuracy_meaning=meaning,
    )


def _search(search: Search, progress: Progress) -> Attempt:
    """Return the attempt found by varying the tolerance: the errors' logarithm is nearly linear in the tolerance's."""
    rtol = _first(search.scene)
    enough: Attempt | None = None
    nearest: Attempt | None = None
    too_loose = math.inf
    for _ in range(TOLERANCE_TRIES):
        try:
            now = search.attempt(rtol)
        except SolverError:
            if rtol <= REFUSED_FOR_GOOD:
                raise
            # the tolerance is so loose that the run is refused, as when its energy ledger does not close
            too_loose = min(too_loose, rtol)
            rtol = _next(rtol, 1.0 / TIGHTER_AFTER_REFUSAL, enough, too_loose)
            continue
        progress(None, f"tolerance {rtol:.1e}: error {now.fraction:.2g} of the requested accuracy")
        if nearest is None or now.fraction < nearest.fraction:
            nearest = now
        if now.fraction <= ACCEPTED:
            enough = now if enough is None or now.rtol > enough.rtol else enough
            if now.fraction >= WASTEFUL or rtol >= LOOSEST_TOLERANCE:
                return now
        else:
            too_loose = min(too_loose, rtol)
            if rtol <= TIGHTEST_TOLERANCE:
                break
        rtol = _next(rtol, now.fraction, enough, too_loose)
        if enough is not None and not search.saves(enough.rtol, rtol):
            return enough
        if enough is not None and too_loose < 1.05 * enough.rtol:
            break  # the error jumps between two neighbouring tolerances
    assert nearest is not None
    return enough or nearest


def _first(scene: Scene) -> float:
    """Return a first tolerance: a tenth of the tightest relative request, or the scene's own tolerance."""
    assert scene.accuracy is not None
    fractions = [want.relative for want in scene.accuracy.quantities.values() if want.relative is not None]
    guess = 0.1 * min(fractions) if fractions else scene.solver.rtol
    return float(np.clip(guess, 100.0 * TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE))


def _next(rtol: float, fraction: float, enough: Attempt | None, too_loose: float) -> float:
    """Return the next tolerance, rounded to two digits."""
    if enough is not None and too_loose < math.inf:
        return float(f"{math.sqrt(enough.rtol * too_loose):.1e}")
    change = float(np.clip(AIM / max(fraction, 1e-300), 1e-3, 1e3))
    return float(f"{np.clip(rtol * change, TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE):.1e}")


def _missed(search: Search, best: Attempt, requested: Mapping[str, float]) -> str:
    """Return a sentence with the missed accuracy and the reason why no tolerance helps."""
    if not best.errors:
        return "not verified: the error is unknown, since runs at tighter tolerances are refused"
    name = max(requested, key=lambda n: best.errors[n] / requested[n])
    error, times = best.errors[name], best.errors[name] / requested[name]
    text = f"missed: {name} has an error of {error:.2g}, {times:.2g} times the requested accuracy"
    looser = min((r for r in search.runs if r > best.rtol), default=None)
    if looser is None:
        return text
    quantity = parse(name, search.scene.owners())
    before = search.error(search.runs[looser], best.run, quantity)
    if not best.errors[name] < STUCK * before:
        until = _trusted_until(search, best, quantity, requested[name])
        return f"{text}; tighter tolerances do not help{until}: the motion is chaotic or rounding decides"
    return f"{text}; this is the tightest tolerance"


def _trusted_until(search: Search, best: Attempt, quantity: Quantity, requested: float) -> str:
    if not quantity.over_time:
        return ""
    other = search.runs[min(search.runs, key=lambda r: (r == best.rtol, abs(math.log(r / best.rtol))))]
    time, distance = quantities.deviation(best.run, other, quantity)
    beyond = np.flatnonzero(distance > requested)
    return f" (it holds until t = {time[beyond[0]]:.4g} s)" if beyond.size else ""
