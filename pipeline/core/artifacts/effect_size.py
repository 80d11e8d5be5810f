r"""What an effect does to a quantity: how far two variants of a scene differ, and how well that is known.

Variants with contacts are run from several starts that differ by a hair. Where these members agree their mean is the
motion; where they part, beyond the horizon of the motion, it is a statistic, and the difference of two means is known
to its standard error only:

.. math:: d(t) = \sqrt{\max(0, |\bar a - \bar b|^2 - (k\,s)^2)}, \quad s^2 = (s_a^2 + s_b^2)/n

with as many standard errors k taken as chance as Student's t says for so few members. No s(t) counts for less than the
root mean square over a twentieth of the series about it: a few members that have parted agree at some output by
accident, and of hundreds of outputs a few would look like differences. Without spread d is the distance of the two
motions.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.special import stdtrit

from flexclear.pipeline.core.artifacts.points import Point, unpacked
from flexclear.pipeline.core.numerics.rotations import rotation_between
from flexclear.pipeline.core.scene.quantity import CONTACT_REDUCTIONS, Quantity, Recorded

#: a difference of means that chance alone makes less often than this counts: of hundred independent looks one in ten
RARE = 1e-3
#: how often chance may make one where two ways of integration are compared: to reject a good one costs evaluations only
LIKELY = 0.05
#: fraction of a series over which the spread of members is pooled
POOLED = 0.05
#: what is recorded of a quantity to compare it by, where contacts have it not: the series, and of what impacts make
#: large its extreme, which is read where it is and not at an output
OTHERS = ("series", "largest")
#: a difference is real that is at least so many times what of it may be chance, or error of the runs
REAL = 2.0


@dataclass(frozen=True, slots=True)
class Influence:
    """How much two variants differ, in the quantity's SI unit, and what of it may be chance.

    difference: infinite when one of them lacks the quantity, or the numbers of impacts differ.
    """

    difference: float
    uncertainty: float = 0.0

    @property
    def most(self) -> float:
        """The largest difference that is not excluded."""
        return self.difference + self.uncertainty

    @property
    def real(self) -> bool:
        """Whether there is a difference, whatever its size."""
        return self.difference >= REAL * self.uncertainty


@dataclass(frozen=True, slots=True)
class Agreement:
    """How far a planned run is from the full one where it matters most, next to what is allowed there [SI].

    allowed: what is requested; beyond the horizon, where two runs of the full scene from indistinguishable starts
    differ by more, that difference as a root mean square.  horizon: fraction of the run up to which such runs agree
    within what is requested; 1 where they agree throughout, 0 where a number without time differs.
    """

    error: float
    chance: float
    allowed: float
    horizon: float = 1.0

    @property
    def fraction(self) -> float:
        """Error and chance together as a fraction of what is allowed."""
        most = self.error + self.chance
        return most / self.allowed if self.allowed > 0.0 else np.inf if most > 0.0 else 0.0

    @property
    def met(self) -> bool:
        """Whether error and chance together are within what is allowed."""
        return self.error + self.chance <= self.allowed

    @property
    def missed(self) -> bool:
        """Whether the error exceeds what is allowed by more than chance."""
        return self.error - self.chance > self.allowed

    def enough(self, members: int) -> float:
        """How many members would decide, as far as the difference stays as it is; infinite where none would.

        members: those of this one.
        """
        room = self.allowed - self.error if self.error < self.allowed else self.error - self.allowed
        return members * (self.chance / room) ** 2 if room > 0.0 else np.inf


def chance(members: int) -> float:
    """Standard errors of a difference of two means over so many members each that chance reaches (Student's t)."""
    return float(stdtrit(2.0 * max(members - 1, 1), 1.0 - 0.5 * RARE))


def recorded(owners: Mapping[str, Collection[str]], chosen: Sequence[Quantity]) -> list[Recorded]:
    """Recorded values of a run to compare it by; quantities that its scene does not have are left out.

    owners: of the scene, by what they are.
    """
    return [one for q in chosen if q.is_there(owners) for one in _compared(q)]


def watched(stored: xr.Dataset, owners: Mapping[str, Collection[str]], chosen: Sequence[Quantity]) -> Point:
    """The point in an artifact of `stages.watched_quantities`."""
    return unpacked(stored, recorded(owners, chosen))["point"]


def _compared(quantity: Quantity) -> list[Recorded]:
    reductions = ("series",) if quantity.of_place else CONTACT_REDUCTIONS.get(quantity.kind, OTHERS)
    return [Recorded(quantity, reduction) for reduction in reductions]


def _turns(what: Recorded) -> bool:
    """Whether it is a quaternion, which changes by half the angle."""
    return what.quantity.kind == "orientation"


def influence(a: Point, b: Point, quantity: Quantity, members: int) -> Influence:
    """How much two variants differ in a quantity.

    members: starts of each that were run; a point without deviations counts as one that is known.
    """
    if quantity.kind == "impact_times":
        return _impact_times(a, b, quantity.name)
    differences, doubts = [], []
    for what in _compared(quantity):
        distance, error = _along(a, b, what, members)
        doubt = chance(members) * error
        differences.append(float(_beyond(distance, doubt).max(initial=0.0)))
        doubts.append(float(doubt.max(initial=0.0)))
    return Influence(max(differences), max(doubts))


def _along(a: Point, b: Point, what: Recorded, members: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance of two means at each output and its standard error; infinite where a point lacks the quantity.

    Points of equal values and deviations are the same members: their distance is none, without error.
    """
    if what.name not in a.values or what.name not in b.values:
        return np.array([np.inf]), np.zeros(1)
    one, two = (_rows(p.values[what.name]) for p in (a, b))
    deviations = [_deviations(p, what) for p in (a, b)]
    if np.array_equal(one, two) and np.array_equal(deviations[0], deviations[1]):
        return np.zeros(len(one)), np.zeros(len(one))
    error = _pooled(np.hypot(*deviations) / np.sqrt(max(members, 1)))
    if _turns(what):
        return rotation_between(*(q / np.linalg.norm(q, axis=1, keepdims=True) for q in (one, two))), error
    return np.linalg.norm(one - two, axis=1), error


def _beyond(distance: np.ndarray, doubt: np.ndarray) -> np.ndarray:
    """The part of distances that exceeds chance."""
    squares: np.ndarray = np.maximum(0.0, distance**2 - doubt**2)
    return np.sqrt(squares)


def same_starts(a: Point, b: Point, quantity: Quantity, requested: float) -> Influence:
    """How far two ways to integrate one scene differ from the same starts, two at least, in the quantity's SI unit.

    While runs of b agree within what is requested, what the starts have in common is the error: the mean of their
    differences, less LIKELY chance by Student's paired t. The rest of that mean is uncertain. Beyond, what exceeds
    LIKELY chance of a difference of means that scatter as b does counts, as a fraction of what may be off there
    (`Agreement.allowed`): runs of a that scatter more are no excuse.
    """
    if quantity.kind == "impact_times":
        return _impact_times(a, b, quantity.name)
    n, error, most = len(b.members), 0.0, 0.0
    for what in _compared(quantity):
        distance, _ = _along(a, b, what, n)
        if np.isinf(distance).any():
            return Influence(np.inf)
        of_pairs, allowed = _of_pairs(a, b, what), _allowed(b, what, requested)
        alike = allowed <= requested
        doubt = stdtrit(n - 1.0, 1.0 - 0.5 * LIKELY) * np.where(alike, of_pairs, allowed / np.sqrt(n))
        error = max(error, float((_beyond(distance, doubt) * requested / allowed).max(initial=0.0)))
        most = max(most, error, float(distance[alike].max(initial=0.0)))
    return Influence(error, most - error)


def _of_pairs(a: Point, b: Point, what: Recorded) -> np.ndarray:
    """Standard error at each output of the mean difference of two ways to run a scene, from the same starts."""
    pairs = zip(a.members, b.members, strict=True)
    spread = np.std([_rows(one[what.name]) - _rows(two[what.name]) for one, two in pairs], axis=0, ddof=1)
    return _pooled(np.linalg.norm(spread, axis=1) * (2.0 if _turns(what) else 1.0)) / np.sqrt(len(b.members))


def _allowed(full: Point, what: Recorded, requested: float) -> np.ndarray:
    """What may be off at each output: what is requested, or the difference of two runs of the scene itself."""
    scattered: np.ndarray = np.sqrt(2.0) * _pooled(_deviations(full, what))
    return np.maximum(requested, scattered)


def _deviations(point: Point, what: Recorded) -> np.ndarray:
    """Standard deviation of one member at each output."""
    rows = _rows(point.deviation.get(what.name, np.zeros(len(_rows(point.values[what.name])))))
    return np.linalg.norm(rows, axis=1) * (2.0 if _turns(what) else 1.0)


def agreement(planned: Point, full: Point, quantity: Quantity, members: int, requested: float) -> Agreement:
    """How well a planned run agrees with the full one in a quantity, at the output where that is decided.

    members: starts of each; where both points hold them, their differences start by start say what may be chance, where
    that is less than what two independent means say.  requested: accuracy [SI].
    """
    if quantity.kind == "impact_times":
        return Agreement(_impact_times(planned, full, quantity.name).difference, 0.0, requested)
    results = []
    for what in _compared(quantity):
        distance, doubt = _along(planned, full, what, members)
        if np.isinf(distance).any():
            return Agreement(np.inf, 0.0, requested)
        doubt = chance(members) * doubt
        if min(len(planned.members), len(full.members)) > 1:
            doubt = np.minimum(doubt, stdtrit(members - 1.0, 1.0 - 0.5 * RARE) * _of_pairs(planned, full, what))
        error, allowed = _beyond(distance, doubt), _allowed(full, what, requested)
        floor = np.maximum(allowed, np.finfo(float).tiny)  # nothing is allowed of what never changes
        worst = int(np.argmax((error - doubt) / floor))
        if error[worst] - doubt[worst] <= allowed[worst]:
            worst = int(np.argmax((error + doubt) / floor))
        beyond = allowed > requested
        horizon = float(np.argmax(beyond)) / len(beyond) if beyond.any() else 1.0
        results.append(Agreement(float(error[worst]), float(doubt[worst]), float(allowed[worst]), horizon))
    missed = [one for one in results if one.missed]
    worst_of = max(missed or results, key=lambda one: one.fraction)
    same = all(one.error == one.chance == 0.0 for one in results)
    return replace(worst_of, horizon=1.0 if same else results[0].horizon)  # that of the series, where there is one


def scatter(point: Point, quantity: Quantity) -> float:
    """How far one member is off the mean of all, as a standard deviation in SI; the largest over the series.

    The quantity of one run beyond the horizon is known no better.
    """
    if quantity.kind == "impact_times":
        return 0.0
    spreads = [_pooled(_deviations(point, what)) for what in _compared(quantity) if what.name in point.deviation]
    return max((float(spread.max(initial=0.0)) for spread in spreads), default=0.0)


def _pooled(error: np.ndarray) -> np.ndarray:
    """Errors of a series, none below the root mean square of its neighbours."""
    width = max(1, round(POOLED * len(error)))
    around = np.convolve(
        np.pad(error**2, (width // 2, (width - 1) // 2), mode="edge"), np.full(width, 1.0 / width), "valid"
    )
    return np.maximum(error, np.sqrt(around))


def _impact_times(a: Point, b: Point, name: str) -> Influence:
    if f"{name}.count" not in a.values or f"{name}.count" not in b.values:
        return Influence(np.inf)
    counts = {float(p.values[f"{name}.count"]) for p in (a, b)}
    parted = any(float(p.deviation.get(f"{name}.count", 0.0)) > 0.0 for p in (a, b))
    if len(counts) > 1 or parted:
        return Influence(np.inf)
    if counts == {0.0}:
        return Influence(0.0)
    return Influence(max(abs(float(a.values[f"{name}.{r}"] - b.values[f"{name}.{r}"])) for r in ("first", "last")))


def size(point: Point, quantity: Quantity) -> float:
    """What a relative accuracy is relative to: the largest change from the start; of forces and rates the largest."""
    name = quantity.name
    if quantity.kind == "impact_times":
        return float(np.nan_to_num(point.values[f"{name}.last"]))
    if quantity.kind in ("peak_force", "impulse"):
        return float(np.abs(point.values[_compared(quantity)[0].name]))
    values = _rows(point.values[f"{name}.series"])
    if quantity.kind == "orientation":
        return float(rotation_between(values[:1], values).max())
    if quantity.of_place:
        return float(np.linalg.norm(values - values[:1], axis=1).max())
    return float(np.abs(point.values[f"{name}.largest"]))


def _rows(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    return values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)
