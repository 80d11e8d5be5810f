"""A run whose time integration is as accurate as the scene asks: tolerances are tried, errors estimated.

Where the scene names no integrator, each run is made with the one that is foreseen to be cheapest (`method_selection`).

The error of a run is estimated by the same run at a hundred times tighter tolerance: an adaptive method
whose tolerance is proportional to its error (tolerance proportionality) then overestimates its distance to the
exact solution by about one per cent. Errors of the model (modes, mesh, contact law) are not part of it.
Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.4.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.quantity import Quantity, parse
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.core.system.progress import Progress

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.run.method_choice.method_selection import Suit
    from flexclear.pipeline.dynamics.run.progress_rate import Judges

#: the estimate compares with a run at this fraction of the tolerance
FINER_TOLERANCE = 1e-2
#: tolerances that are tried lie between these; below, rounding decides
TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE = 1e-14, 1e-2
#: a run is accepted when its error is between these fractions of the requested accuracy: enough, and not wasteful
ACCEPTED, WASTEFUL = 1.0, 1.0 / 3.0
#: what the next try aims at, between the two
AIM = 0.6
TOLERANCE_TRIES = 12
#: of the evaluations of a run that is accurate enough, what a looser tolerance must be foreseen to save
SAVED = 0.25
#: a run that is refused at a looser tolerance than this is tried again at a fraction of it
REFUSED_FOR_GOOD, TIGHTER_AFTER_REFUSAL = 1e-9, 0.1
#: an error that does not fall below this fraction at the FINER_TOLERANCE has another cause than the steps
STUCK = 0.3
#: the default request, as a fraction of each quantity's range; it is searched for at so many tolerances at most
BY_DEFAULT, FEW_TRIES = 1e-3, 4
#: what is below this fraction of the motion's natural size is rounding, which stiff rods magnify in forces
ROUNDING_OF_MOTION = 1e-9


@dataclass(frozen=True)
class Attempt:
    """A run at one tolerance: estimated errors by quantity, and the largest as a fraction of the requested accuracy."""

    rtol: float
    run: xr.Dataset
    errors: Mapping[str, float]
    fraction: float


@dataclass
class Search:
    """Runs made so far by tolerance, and what is requested of them.

    predictable: whether runs are compared up to the horizon of their predictability only; the request is then the
    default one, and a quantity that never changes meets it.
    """

    scene: Scene
    once: Callable[[Scene, Judges | None], xr.Dataset]
    suit: Suit | None = None
    runs: dict[float, xr.Dataset] = field(default_factory=dict)
    predictable: bool = False

    def run(self, rtol: float) -> xr.Dataset:
        """The run at a tolerance, made once."""
        if rtol not in self.runs:
            self.runs[rtol] = self._made(rtol)
        return self.runs[rtol]

    def _made(self, rtol: float) -> xr.Dataset:
        if self.suit is None:
            return self.once(edited(self.scene, {"solver.rtol": rtol}), None)
        name, why = self.suit.best(rtol), self.suit.why(rtol)
        run = self.once(edited(self.scene, {"solver.rtol": rtol, "solver.integrator": name}), self.suit.judges(rtol))
        self.suit.learn(rtol, name, run)
        return run.assign_attrs(method_reason=why)

    def attempt(self, rtol: float) -> Attempt:
        """The run at a tolerance and its estimated errors."""
        run = self.run(rtol)
        finer = max(rtol * FINER_TOLERANCE, TIGHTEST_TOLERANCE)
        # the tightest of all can only be compared with a looser one, whose error is the larger
        other = self.run(finer if finer < rtol else rtol / FINER_TOLERANCE)
        requested = self.requested(other)
        # all tighter runs are witnesses: with impacts, two neighbours may agree by luck
        witnesses = [other, *(r for tolerance, r in self.runs.items() if tolerance <= 0.1 * rtol)]
        errors = {q.name: max(self.error(run, r, q) for r in witnesses) for q in requested}
        return Attempt(rtol, run, errors, max((errors[q.name] / w for q, w in requested.items()), default=0.0))

    def error(self, run: xr.Dataset, other: xr.Dataset, quantity: Quantity) -> float:
        """Largest difference of two runs, as far as they are compared, in the unit of the quantity."""
        horizons = [float(one["horizon"]) for one in (run, other) if self.predictable and "horizon" in one]
        return quantities.error(run, other, quantity, min(horizons, default=math.inf))

    def cheapest(self, attempt: Attempt) -> Attempt:
        """The attempt, or the run that told its error, where another method made that for less.

        How much the two differ is the error of either at most, unless both err alike; runs that are tighter than both
        are asked as well.
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

    def uncompared(self, refusal: SolverError) -> Attempt:
        """The tightest run by default, whose error no other tells; raises the refusal of those where there is none."""
        if not self.runs or not self.predictable:
            raise refusal
        rtol = min(self.runs)
        return Attempt(rtol, self.runs[rtol], {}, math.inf)

    def saves(self, rtol: float, looser: float) -> bool:
        """Whether a run at a looser tolerance is foreseen to be so much cheaper that it is worth to be made.

        Where stability limits the steps it is not, and it takes two runs to know its error.
        """
        at = max(rtol * FINER_TOLERANCE, TIGHTEST_TOLERANCE)
        before, finer = self.runs[rtol], self.runs.get(at)
        if finer is None or finer is before or finer.attrs["method"] != before.attrs["method"]:
            return True
        growth = math.log(finer.attrs["evaluations"] / before.attrs["evaluations"]) / math.log(rtol / at)
        return (rtol / looser) ** max(growth, 0.0) < 1.0 - SAVED

    def requested(self, run: xr.Dataset) -> dict[Quantity, float]:
        """Requested accuracy in SI by quantity; relative ones by the size that the quantity has in `run`."""
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
                    "a relative accuracy of a quantity that never changes",
                    "give an absolute one, with a unit",
                )
            requested[quantity] = absolute
        return requested


def deliver(
    scene: Scene, once: Callable[[Scene, Judges | None], xr.Dataset], progress: Progress, suit: Suit | None = None
) -> xr.Dataset:
    """The cheapest run found whose estimated errors are what the scene wants; or the best, and a word on it.

    once: makes the run of a scene, under judges of its integrators.  suit: by what its integrator is chosen; None where
    the scene names one.  The dataset's attributes say what was requested, estimated and met, and why by which
    integrator.
    """
    return _delivered(Search(scene, once, suit), progress)


def by_default(
    scene: Scene,
    once: Callable[[Scene, Judges | None], xr.Dataset],
    progress: Progress,
    suit: Callable[[Scene], Suit],
) -> xr.Dataset:
    """The run of a scene that requests no accuracy and leaves its integration open.

    As `deliver`, for BY_DEFAULT of each usual quantity over time (`Scene.requested`), up to the predictability horizon.
    """
    progress(None, f"a run good to {BY_DEFAULT:g} of the range of each quantity is made instead")
    names = [q.name for q in scene.requested() if q.over_time]
    request = {"quantities": {name: {"relative": BY_DEFAULT} for name in names}, "allow_missed": True, "by_need": True}
    wanting = edited(scene, {"accuracy": request})
    return _delivered(Search(wanting, once, suit(wanting), predictable=True), progress)


def _delivered(search: Search, progress: Progress) -> xr.Dataset:
    best = search.cheapest(_search(search, progress))
    requested = {q.name: w for q, w in search.requested(best.run).items()}
    met = best.fraction <= ACCEPTED
    verdict = "met" if met else _missed(search, best, requested)
    progress(None, f"accuracy {verdict} (relative tolerance {best.rtol:.1e})")
    if "method_reason" in best.run.attrs:
        progress(None, str(best.run.attrs["method_reason"]))
    meaning = "largest error of the time integration, estimated by two runs with a tolerance ratio of 100"
    if search.predictable:
        meaning += f"; requested by default: {BY_DEFAULT:g} of the range, up to the predictability horizon"
    return best.run.assign_attrs(
        accuracy_requested=json.dumps({name: f"{w:.3g}" for name, w in requested.items()}, sort_keys=True),
        accuracy_estimated=json.dumps({name: f"{e:.3g}" for name, e in best.errors.items()}, sort_keys=True),
        accuracy_verdict=verdict,
        accuracy_rtol=best.rtol,
        accuracy_runs=len(search.runs),
        accuracy_meaning=meaning,
    )


def _search(search: Search, progress: Progress) -> Attempt:
    """Tolerance by tolerance: the error's logarithm is close to linear in the tolerance's."""
    rtol = _first(search.scene)
    enough: Attempt | None = None
    nearest: Attempt | None = None
    too_loose, refusal = math.inf, SolverError("")
    for _ in range(FEW_TRIES if search.predictable else TOLERANCE_TRIES):
        try:
            now = search.attempt(rtol)
        except SolverError as error:
            refusal = error
            if rtol <= REFUSED_FOR_GOOD:
                if not search.predictable:
                    raise
                break
            # a tolerance so loose that the run is refused, as its ledger does not close
            too_loose = min(too_loose, rtol)
            rtol = _next(rtol, 1.0 / TIGHTER_AFTER_REFUSAL, enough, too_loose)
            continue
        progress(None, f"tolerance {rtol:.1e}: error {now.fraction:.2g} of the requested accuracy")
        if nearest is None or now.fraction < nearest.fraction:
            nearest = now
        if now.fraction <= ACCEPTED:
            enough = now if enough is None or now.rtol > enough.rtol else enough
            if now.fraction >= WASTEFUL or rtol >= LOOSEST_TOLERANCE or search.predictable:
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
    return enough or nearest or search.uncompared(refusal)


def _first(scene: Scene) -> float:
    """A guess that the search corrects; a tenth of the tightest relative wish, or the scene's own tolerance."""
    assert scene.accuracy is not None
    fractions = [want.relative for want in scene.accuracy.quantities.values() if want.relative is not None]
    guess = 0.1 * min(fractions) if fractions else scene.solver.rtol
    return float(np.clip(guess, 100.0 * TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE))


def _next(rtol: float, fraction: float, enough: Attempt | None, too_loose: float) -> float:
    """The next tolerance, which two digits describe."""
    if enough is not None and too_loose < math.inf:
        return float(f"{math.sqrt(enough.rtol * too_loose):.1e}")
    change = float(np.clip(AIM / max(fraction, 1e-300), 1e-3, 1e3))
    return float(f"{np.clip(rtol * change, TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE):.1e}")


def _missed(search: Search, best: Attempt, requested: Mapping[str, float]) -> str:
    """By how much, and why no tolerance helps."""
    if not best.errors:
        return "not verified: runs at tighter tolerances are refused, so that the error is unknown"
    name = max(requested, key=lambda n: best.errors[n] / requested[n])
    error, times = best.errors[name], best.errors[name] / requested[name]
    text = f"missed: {name} is good to {error:.2g}, {times:.2g} times what is requested"
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
