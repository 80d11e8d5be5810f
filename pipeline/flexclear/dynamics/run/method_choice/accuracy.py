"""Run with the requested accuracy of time integration, by a ladder of tolerances that estimate each other's errors.

Where the scene names no integrator, each run uses the one that is predicted to be cheapest (`method_selection`).

The error of a run is estimated by the same run at the next tighter tolerance of the ladder: the error of an adaptive
method is proportional to its tolerance, so that the difference of the two is the error less the other's known part of
it. Each run serves as the comparison of the one before, and goes on to the end only where it is delivered. Where the
errors of two neighbouring tolerances fall, the error at the next one is extrapolated instead of compared.
Errors of the model (modes, mesh, contact law) are not part of it.
Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.4.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexclear.artifacts import quantities
from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity, parse
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import LabelledArrays
    from flexclear.dynamics.run.method_choice.method_selection import Costs
    from flexclear.dynamics.run.progress_rate import Judges

#: limits of the tolerances that are tried for a request; below, rounding dominates
TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE = 1e-14, 1e-2
#: the ladder for a relative request begins at this multiple of it: errors are rarely smaller than the tolerance
ABOVE_REQUEST = 10.0
#: ratio of neighbouring tolerances, and that of runs without contacts and request: they cost so little that half as
#: many, each of which may be tighter than necessary, cost less
FINER_RUNG, SMOOTH_RUNG = 0.1, 1e-2
#: an error that does not fall below this fraction at the next tolerance has another cause than the steps
STUCK = 0.3
#: an extrapolated error is this multiple of what follows from the fall before: falls differ from rung to rung
DOUBT = 2.0
#: default requested accuracy, as a fraction of each quantity's range; loosest and tightest tolerance of its ladder
BY_DEFAULT, LOOSEST_RUNG, TIGHTEST_RUNG = 1e-3, 1e-4, 1e-10
#: loosest tolerance of that ladder with contacts: clearances are some thousandths of a mechanism's size, to which
#: tolerances refer
LOOSEST_WITH_CONTACTS = 1e-5
#: motions below this fraction of their natural size are rounding, which stiff rods magnify in forces
ROUNDING_OF_MOTION = 1e-9


class Parts(Protocol):
    """A run that can be had in parts: up to a time, then from there to its end."""

    def until(self, time: float, /) -> LabelledArrays:
        """Return the run up to a time [s] or later, without predictability horizon."""

    def whole(self) -> LabelledArrays:
        """Return the run to its end, with its horizon."""


#: begins the run of a scene, under judges of its integrators
Make = Callable[[Scene, "Judges | None"], Parts]


@dataclass(frozen=True)
class Attempt:
    """A run at one tolerance: estimated errors by quantity, and the largest one relative to the requested accuracy."""

    rtol: float
    errors: Mapping[str, float]
    fraction: float

    @property
    def met(self) -> bool:
        """True when all errors are within the request."""
        return self.fraction <= 1.0


@dataclass
class Search:
    """Runs begun so far, by tolerance, and the request.

    predictable: True for the default request, for which runs are compared only up to the predictability horizon, and
    quantities that never change meet the request. shown: what is known of each run.  wholes: those with their horizons.
    """

    scene: Scene
    make: Make
    costs: Costs | None = None
    predictable: bool = False
    begun: dict[float, Parts] = field(default_factory=dict)
    shown: dict[float, LabelledArrays] = field(default_factory=dict)
    wholes: dict[float, LabelledArrays] = field(default_factory=dict)

    def whole(self, rtol: float) -> LabelledArrays:
        """Return the whole run at a tolerance, made once."""
        if rtol not in self.wholes:
            self.wholes[rtol] = self.shown[rtol] = self._made(rtol, lambda parts: parts.whole())
        return self.wholes[rtol]

    def until(self, rtol: float, time: float) -> LabelledArrays:
        """Return the run at a tolerance up to a time [s] or later; its parts are made once."""
        if rtol not in self.shown or _end(self.shown[rtol]) < min(time, self.scene.time.end):
            self.shown[rtol] = self._made(rtol, lambda parts: parts.until(time))
        return self.shown[rtol]

    def _made(self, rtol: float, part: Callable[[Parts], LabelledArrays]) -> LabelledArrays:
        change: dict[str, object] = {"solver.rtol": rtol}
        if self.costs is None:
            if rtol not in self.begun:
                self.begun[rtol] = self.make(edited(self.scene, change), None)
            return part(self.begun[rtol])
        name, why, known = self.costs.best(rtol), self.costs.why(rtol), rtol in self.begun
        if not known:
            change["solver.integrator"] = name
            self.begun[rtol] = self.make(edited(self.scene, change), self.costs.judges(rtol))
        run = part(self.begun[rtol])
        if known:
            return run.assign_attrs(method_reason=self.shown[rtol].attrs["method_reason"])
        share = (_end(run) - self.scene.time.start) / self.costs.span
        self.costs.learn(rtol, name, run, min(share, 1.0))
        return run.assign_attrs(method_reason=why)

    @property
    def ratio(self) -> float:
        """Ratio of neighbouring tolerances of the ladder."""
        return SMOOTH_RUNG if self.predictable and self._smooth else FINER_RUNG

    @property
    def _smooth(self) -> bool:
        """True for a scene without contacts and stops."""
        return not self.scene.contacts() and not self.scene.stops()

    @property
    def loosest(self) -> float:
        """First tolerance of the ladder."""
        assert self.scene.accuracy is not None
        if self.predictable:
            return LOOSEST_RUNG if self._smooth else LOOSEST_WITH_CONTACTS
        fractions = [want.relative for want in self.scene.accuracy.quantities.values() if want.relative is not None]
        guess = min((ABOVE_REQUEST * fraction for fraction in fractions), default=LOOSEST_TOLERANCE)
        return float(f"{np.clip(guess, 100.0 * TIGHTEST_TOLERANCE, LOOSEST_TOLERANCE):.1e}")

    def next_rung(self, rtol: float) -> float:
        """Return the next tighter tolerance of the ladder."""
        return float(f"{max(self.ratio * rtol, TIGHTEST_TOLERANCE):.1e}")

    def rung(self, rtol: float, until: float) -> Attempt:
        """Return the run at a tolerance, compared up to a time [s] with the one at the next tighter tolerance."""
        run, other = self.until(rtol, until), self.until(self.next_rung(rtol), until)
        requested = self.requested(self.sizes)
        errors = {q.name: quantities.largest_distance(run, other, q, until) / (1.0 - self.ratio) for q in requested}
        return Attempt(rtol, errors, max((errors[q.name] / w for q, w in requested.items()), default=0.0))

    def extrapolated(self, rtol: float, attempts: Sequence[Attempt]) -> Attempt | None:
        """Return the run at a tolerance that meets the request if its errors fall as those of the last two attempts.

        attempts: by tolerance, the loosest first. Return None where these are no neighbours, or errors fall too little.
        """
        if len(attempts) < 2:
            return None
        before, last = attempts[-2:]
        if (self.next_rung(before.rtol), self.next_rung(last.rtol)) != (last.rtol, rtol):
            return None
        fall = last.fraction / before.fraction
        factor = DOUBT * max(fall, self.ratio)
        expected = Attempt(rtol, {name: factor * e for name, e in last.errors.items()}, factor * last.fraction)
        return expected if fall < STUCK and expected.met else None

    def again(self, attempts: Sequence[Attempt], until: float) -> list[Attempt]:
        """Return attempts compared up to a later time [s], without those whose runs are refused before it."""
        later = list[Attempt]()
        for one in attempts:
            with suppress(SolverError):
                later.append(self.rung(one.rtol, until))
        return later

    @property
    def sizes(self) -> LabelledArrays:
        """The run by whose sizes relative requests are judged: the tightest one that reached the end."""
        end = max(map(_end, self.shown.values()))
        return self.shown[min(rtol for rtol, run in self.shown.items() if _end(run) >= end)]

    def cheapest(self, attempt: Attempt) -> Attempt:
        """Return the attempt, or the run that served its error estimate if another method made that run at less cost:
        it errs by less."""
        finer = self.next_rung(attempt.rtol)
        if not attempt.met or finer not in self.shown:
            return attempt
        run, other = self.shown[attempt.rtol], self.shown[finer]
        rates = [one.attrs["evaluations"] / float(np.ptp(one["time"].values)) for one in (run, other)]
        if other.attrs["method"] == run.attrs["method"] or rates[1] >= rates[0]:
            return attempt
        return Attempt(finer, attempt.errors, attempt.fraction)

    def requested(self, run: LabelledArrays) -> dict[Quantity, float]:
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


def deliver(scene: Scene, make: Make, progress: Progress, costs: Costs | None = None) -> LabelledArrays:
    """Return the cheapest run whose estimated errors meet the request, or the most accurate one with an explanation.

    costs: costs for method selection; None where the scene names an integrator.  The dataset's attributes state
    requested and estimated errors, the verdict, and the reason of the method.
    """
    return _delivered(Search(scene, make, costs), progress)


def at_tolerance(scene: Scene, make: Make, costs: Costs) -> LabelledArrays:
    """Return the run of a scene at its own tolerance, by the method that is predicted to be cheapest."""
    return Search(scene, make, costs).whole(scene.solver.rtol)


def by_default(
    scene: Scene,
    make: Make,
    progress: Progress,
    costs: Callable[[Scene], Costs],
) -> LabelledArrays:
    """Return the run of a scene that requests no accuracy and leaves its integration open.

    As `deliver`, for BY_DEFAULT of each usual quantity over time (`Scene.requested_quantities`), up to the
    predictability horizon.
    """
    progress(None, f"running to an accuracy of {BY_DEFAULT:g} of the range of each quantity instead")
    names = [q.name for q in scene.requested_quantities() if q.over_time]
    request = {"quantities": {name: {"relative": BY_DEFAULT} for name in names}, "allow_missed": True, "by_need": True}
    wanting = edited(scene, {"accuracy": request})
    return _delivered(Search(wanting, make, costs(wanting), predictable=True), progress)


def _climb(search: Search, progress: Progress) -> Attempt:
    """Return the loosest tolerance of the ladder that meets the request, else the one with the least error.

    Up to their horizons, runs are compared up to that of the run at the loosest tolerance. Another horizon replaces it,
    and the last runs are compared once more, where the delivered run has a later one, and where errors do not fall:
    then the loosest run seemed predictable for too long. A run that is refused, as where its energy ledger does not
    close, is left out.
    """
    tightest = TIGHTEST_RUNG if search.predictable else TIGHTEST_TOLERANCE
    rtol, until, nearest, refusal = search.loosest, -math.inf, list[Attempt](), SolverError("")
    while rtol > tightest:
        try:
            until = _horizon(search, rtol) if until < 0.0 else until
            now = search.extrapolated(rtol, nearest) or search.rung(rtol, until)
            stuck = bool(nearest) and not now.fraction < STUCK * nearest[-1].fraction
            if now.met or stuck:
                own = _horizon(search, rtol)
                if own > until if now.met else own < until:
                    until, nearest = own, search.again(nearest[-2:], own)
                    continue
        except SolverError as error:
            refusal, rtol = error, search.next_rung(rtol)
            continue
        progress(None, f"tolerance {rtol:.1e}: error {now.fraction:.2g} of the requested accuracy")
        nearest.append(now)
        if now.met:
            break
        rtol = search.next_rung(rtol)
    if nearest:
        return min(nearest, key=lambda one: (one.fraction, one.rtol))
    whole = [rtol for rtol, run in search.shown.items() if _end(run) >= search.scene.time.end]
    if not whole:
        raise refusal
    return Attempt(min(whole), {}, math.inf)


def _horizon(search: Search, rtol: float) -> float:
    """Return the time up to which a run counts [s]: its predictability horizon, its end where none is asked for."""
    run = search.whole(rtol) if search.predictable else None
    return float(run["horizon"].values) if run is not None and "horizon" in run else search.scene.time.end


def _end(run: LabelledArrays) -> float:
    """Return the last time of a run [s]."""
    return float(run["time"].values[-1])


def _delivered(search: Search, progress: Progress) -> LabelledArrays:
    best = search.cheapest(_climb(search, progress))
    run = search.whole(best.rtol)
    requested = {
        q.name: w for q, w in search.requested(search.sizes).items() if q.name in best.errors or not best.errors
    }
    verdict = "met" if best.met else _missed(search, best, requested)
    progress(None, f"accuracy {verdict} (relative tolerance {best.rtol:.1e})")
    if "method_reason" in run.attrs:
        progress(None, str(run.attrs["method_reason"]))
    meaning = (
        f"largest error of the time integration, estimated by runs with a tolerance ratio of {1.0 / search.ratio:g}"
    )
    if search.predictable:
        meaning += f"; requested by default: {BY_DEFAULT:g} of the range, up to the predictability horizon"
    return run.assign_attrs(
        accuracy_requested=json.dumps({name: f"{w:.3g}" for name, w in requested.items()}, sort_keys=True),
        accuracy_estimated=json.dumps({name: f"{e:.3g}" for name, e in best.errors.items()}, sort_keys=True),
        accuracy_verdict=verdict,
        accuracy_rtol=best.rtol,
        accuracy_runs=len(search.begun),
        accuracy_meaning=meaning,
    )


def _missed(search: Search, best: Attempt, requested: Mapping[str, float]) -> str:
    """Return a sentence with the missed accuracy and the reason why no tolerance helps."""
    if not best.errors:
        return "not verified: the error is unknown, since runs at tighter tolerances are refused"
    name = max(requested, key=lambda n: best.errors[n] / requested[n])
    error, times = best.errors[name], best.errors[name] / requested[name]
    text = f"missed: {name} has an error of {error:.2g}, {times:.2g} times the requested accuracy"
    looser = min((r for r in search.shown if r > best.rtol), default=None)
    if looser is None:
        return text
    quantity, run = parse(name, search.scene.owners()), search.shown[best.rtol]
    until = float(run["horizon"].values) if search.predictable and "horizon" in run else math.inf
    if not best.errors[name] < STUCK * quantities.largest_distance(search.shown[looser], run, quantity, until):
        until_then = _trusted_until(search, best, quantity, requested[name])
        return f"{text}; tighter tolerances do not help{until_then}: the motion is chaotic or rounding decides"
    return f"{text}; this is the tightest tolerance"


def _trusted_until(search: Search, best: Attempt, quantity: Quantity, requested: float) -> str:
    if not quantity.over_time:
        return ""
    run, other = (search.shown[rtol] for rtol in (best.rtol, search.next_rung(best.rtol)))
    time, distance = quantities.deviation(run, other, quantity)
    beyond = np.flatnonzero(distance > requested)
    return f" (it holds until t = {time[beyond[0]]:.4g} s)" if beyond.size else ""
