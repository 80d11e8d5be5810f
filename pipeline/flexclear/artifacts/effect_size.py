r"""Effect size: how far two variants of a scene differ in a quantity, and the uncertainty of the difference.

Variants with contacts are run from several starts that differ by a tiny offset. Where these members agree, their mean
is the motion. Where they separate, beyond the predictability horizon, the mean is a statistic, and the difference of
two means is known only to its standard error:

.. math:: d(t) = \sqrt{\max(0, |\bar a - \bar b|^2 - (k\,s)^2)}, \quad s^2 = (s_a^2 + s_b^2)/n

The number k of standard errors attributed to chance is Student's t for n members. s(t) is at least its root mean square
over a twentieth of the series around t: a few separated members agree at some output by accident, and among hundreds of
outputs would look like differences. Without spread d is the distance of the two motions.

Up to the horizon, where the members of both variants are one motion each, the difference is not one of statistics:
`early_changes`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.special import stdtrit

from flexclear.artifacts.points import Point, join_points, unpack_points
from flexclear.artifacts.quantities import index_of_separation
from flexclear.numerics.rotations import rotation_between
from flexclear.scene.quantity import CONTACT_REDUCTIONS, Quantity, Recorded

#: probability of a difference of means by chance below which it counts: 1 in 10 that one of 100 comparisons shows one
RARE = 1e-3
#: the same probability for two ways of integration: rejecting a good way costs evaluations only
LIKELY = 0.05
#: fraction of a series over which the spread of members is pooled
POOLED = 0.05
#: recorded reductions of quantities that are not of contacts: the series, and the largest value, which an impact may
#: cause between outputs
OTHERS = ("series", "largest")
#: units of positions and velocities
MOTIONS = ("m", "rad", "m/s", "rad/s")
#: changes of a vector's component below this fraction of the vector's largest magnitude are rounding
ROUNDING = 1e-12
#: a difference is real when it is at least so many times its uncertainty by chance or by errors of the runs
REAL = 2.0


@dataclass(frozen=True, slots=True)
class Influence:
    """Difference of two variants in the quantity's SI unit, and its uncertainty by chance.

    difference: infinite when one variant lacks the quantity, or the numbers of impacts differ.
    """

    difference: float
    uncertainty: float = 0.0

    @property
    def most(self) -> float:
        """Largest difference that is not excluded."""
        return self.difference + self.uncertainty

    @property
    def real(self) -> bool:
        """True when the difference exceeds its uncertainty by the factor REAL, whatever its size."""
        return self.difference >= REAL * self.uncertainty


@dataclass(frozen=True, slots=True)
class Agreement:
    """Error of a planned run against the full one at the decisive output, and the error allowed there [SI].

    allowed: the requested accuracy; beyond the horizon, where two runs of the full scene from indistinguishable starts
    differ by more, that difference as a root mean square. horizon: fraction of the run up to which such runs agree
    within the requested accuracy; 1 where they agree throughout, 0 where a number without time differs.
    """

    error: float
    chance: float
    allowed: float
    horizon: float = 1.0

    @property
    def fraction(self) -> float:
        """Sum of error and chance as a fraction of the allowed error."""
        most = self.error + self.chance
        return most / self.allowed if self.allowed > 0.0 else np.inf if most > 0.0 else 0.0

    @property
    def is_met(self) -> bool:
        """True when error and chance together are within the allowed error."""
        return self.error + self.chance <= self.allowed

    @property
    def is_missed(self) -> bool:
        """True when the error exceeds the allowed error by more than chance."""
        return self.error - self.chance > self.allowed

    def deciding_members(self, members: int) -> float:
        """Return how many members would decide if the difference stays as it is; infinity where no number would.

        members: number of members behind this agreement.
        """
        room = self.allowed - self.error if self.error < self.allowed else self.error - self.allowed
        return members * (self.chance / room) ** 2 if room > 0.0 else np.inf


def chance(members: int) -> float:
    """Return Student's t for a difference of two means over `members` runs each, exceeded by chance with RARE."""
    return float(stdtrit(2.0 * max(members - 1, 1), 1.0 - 0.5 * RARE))


def compared_values(owners: Mapping[str, Collection[str]], chosen: Sequence[Quantity]) -> list[Recorded]:
    """Return the recorded values by which runs are compared, without quantities that their scene does not have.

    owners: names of the scene's components, by kind.
    """
    there = [q for q in chosen if q.is_there(owners)]
    every = [
        *(one for q in there for one in _with_reductions(q)),
        *(_largest_of_vector(q) for q in there if q.component),
    ]
    every += [Recorded(q, "series") for q in there if q.kind in ("peak_force", "impulse")]
    return list({one.name: one for one in every}.values())


def _largest_of_vector(quantity: Quantity) -> Recorded:
    """Return the largest magnitude of the vector of which a quantity is a component."""
    return Recorded(replace(quantity, component="", text=""), "largest")


def point_of_members(
    stored: Sequence[xr.Dataset], owners: Mapping[str, Collection[str]], chosen: Sequence[Quantity]
) -> Point:
    """Return the point of all members in artifacts of `stages.variant_runs`."""
    kept = compared_values(owners, chosen)
    return join_points([(unpack_points(one, kept)["point"], int(one.attrs["members"])) for one in stored])


def _with_reductions(quantity: Quantity) -> list[Recorded]:
    reductions = ("series",) if quantity.of_place else CONTACT_REDUCTIONS.get(quantity.kind, OTHERS)
    return [Recorded(quantity, reduction) for reduction in reductions]


def _is_rotation(what: Recorded) -> bool:
    """Return True for a quaternion, which changes by half the angle."""
    return what.quantity.kind == "orientation"


def influence(a: Point, b: Point, quantity: Quantity, members: int) -> Influence:
    """Return the difference of two variants in a quantity; zero where it is rounding.

    members: number of starts run of each; a point without deviations counts as exactly known.
    """
    if quantity.kind == "impact_times":
        return _impact_times(a, b, quantity.name)
    differences, uncertainties = [], []
    for what in _with_reductions(quantity):
        distance, error = _distance_of_means(a, b, what, members)
        uncertainty = chance(members) * error
        differences.append(float(_excess_over_chance(distance, uncertainty).max(initial=0.0)))
        uncertainties.append(float(uncertainty.max(initial=0.0)))
    result = Influence(max(differences), max(uncertainties))
    return (
        Influence(0.0)
        if result.most <= max(rounding_threshold(a, quantity), rounding_threshold(b, quantity))
        else result
    )


def _distance_of_means(a: Point, b: Point, what: Recorded, members: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance of two means at each output and its standard error; infinite where a quantity is missing.

    Points with equal values and deviations are the same members: their distance is zero, without error.
    """
    if what.name not in a.values or what.name not in b.values:
        return np.array([np.inf]), np.zeros(1)
    one, two = (_as_rows(p.values[what.name]) for p in (a, b))
    deviations = [_deviations(p, what) for p in (a, b)]
    if np.array_equal(one, two) and np.array_equal(deviations[0], deviations[1]):
        return np.zeros(len(one)), np.zeros(len(one))
    error = _pool_errors(np.hypot(*deviations) / np.sqrt(max(members, 1)))
    if _is_rotation(what):
        return rotation_between(*(q / np.linalg.norm(q, axis=1, keepdims=True) for q in (one, two))), error
    return np.linalg.norm(one - two, axis=1), error


def _excess_over_chance(distance: np.ndarray, uncertainty: np.ndarray) -> np.ndarray:
    """Return the part of distances that exceeds chance."""
    squares: np.ndarray = np.maximum(0.0, distance**2 - uncertainty**2)
    return np.sqrt(squares)


def predictable_outputs(points: Sequence[Point], chosen: Sequence[Quantity], full: Point) -> int | None:
    """Return the number of outputs up to which the members of each point are one motion: 0 where they never are, None
    where they always are.

    They separate where they visibly differ (`quantities.index_of_separation`), relative to the quantity's size in
    `full`, in positions and velocities where such quantities are chosen: forces of impacts differ for moments before.
    """
    outputs, series = list[int](), [q for q in chosen if q.over_time]
    for quantity in [q for q in series if q.unit in MOTIONS] or series:
        what, scale = Recorded(quantity, "series"), reference_size(full, quantity)
        for point in points:
            if what.name in point.deviation and scale > rounding_threshold(full, quantity):
                separation = _deviations(point, what) / scale
                first = index_of_separation(np.linspace(0.0, 1.0, len(separation)), separation, 1.0)
                outputs += [] if first is None else [first if first > 1 else 0]
    return min(outputs, default=None)


def influence_of_removal(without: Point, full: Point, quantity: Quantity, members: int) -> Influence:
    """Return the `influence` of what a variant lacks on the full scene; nan where one of them was refused."""
    refused = without.refused or full.refused
    return Influence(np.nan, np.nan) if refused else influence(without, full, quantity, members)


def over_run(whole: Influence, early: Influence, quantity: Quantity) -> Influence:
    """Return the change over the whole run, which is at least the one up to the horizon that chance does not hide."""
    larger = quantity.over_time and early.difference > whole.difference
    return replace(whole, difference=early.difference) if larger else whole


def early_changes(
    without: Point,
    full: Point,
    chosen: Sequence[Quantity],
    members: int,
    times: Sequence[float],
    error: Callable[[Quantity, float], float],
) -> tuple[float, list[Influence]]:
    """Return the time [s] up to which all members of both points are one motion each, and the changes up to it.

    The time is nan, and the changes are those of the whole run, where they always are; changes are nan where they never
    are, and where a point was refused. times: of the outputs [s].  error: of the time integration of a run in a
    quantity, up to a time [s].
    """
    outputs = 0 if without.refused or full.refused else predictable_outputs((without, full), chosen, full)
    horizon = float(times[outputs - 1]) if outputs and len(times) else np.nan
    until = np.inf if outputs is None else horizon
    return horizon, [
        predictable_difference(without, full, q, members, outputs, 2.0 * error(q, until) if outputs != 0 else 0.0)
        for q in chosen
    ]


def predictable_difference(
    a: Point, b: Point, quantity: Quantity, members: int, outputs: int | None, error: float
) -> Influence:
    """Return the largest certain difference of two variants over the first outputs (None: all), and its uncertainty.

    error: of both runs' time integration together, in the quantity's unit.  A difference that is nowhere REAL times its
    uncertainty is zero, with the largest one that is not excluded as uncertainty.
    """
    what = Recorded(quantity, "series")
    if outputs == 0:
        return Influence(np.nan, np.nan)
    if quantity.kind == "impact_times" or what.name not in a.values or what.name not in b.values:
        return _impact_times(a, b, quantity.name) if quantity.kind == "impact_times" else Influence(np.inf)
    distance, spread = _distance_of_means(
        _first_outputs(a, what.name, outputs), _first_outputs(b, what.name, outputs), what, members
    )
    uncertainty = chance(members) * spread + error
    sure = distance >= REAL * uncertainty
    if not (sure & (distance > max(rounding_threshold(a, quantity), rounding_threshold(b, quantity)))).any():
        most = float((distance + uncertainty).max())
        return Influence(
            0.0, 0.0 if most <= max(rounding_threshold(a, quantity), rounding_threshold(b, quantity)) else most
        )
    at = int(np.argmax(np.where(sure, distance - uncertainty, -1.0)))
    return Influence(float(distance[at]), float(uncertainty[at]))


def _first_outputs(point: Point, name: str, outputs: int | None) -> Point:
    """Return the first outputs of one series of a point."""
    values, deviation = (
        {name: rows[name][:outputs]} if name in rows else {} for rows in (point.values, point.deviation)
    )
    return Point(values, {}, deviation, 0)


def same_starts(a: Point, b: Point, quantity: Quantity, requested: float) -> Influence:
    """Return the difference of two ways to integrate one scene from the same two or more starts, in the SI unit.

    While runs of b agree within the requested accuracy, the error is the mean of the differences over the starts, less
    LIKELY chance by Student's paired t. The rest of that mean is uncertain. Beyond, only the excess over LIKELY chance
    of a difference of means that scatter as b does counts, as a fraction of the error allowed there
    (`Agreement.allowed`): a larger scatter of a is no excuse.
    """
    if quantity.kind == "impact_times":
        return _impact_times(a, b, quantity.name)
    n, error, most = len(b.members), 0.0, 0.0
    for what in _with_reductions(quantity):
        distance, _ = _distance_of_means(a, b, what, n)
        if np.isinf(distance).any():
            return Influence(np.inf)
        of_pairs, allowed = _error_of_pairs(a, b, what), _allowed_error(b, what, requested)
        alike = allowed <= requested
        uncertainty = stdtrit(n - 1.0, 1.0 - 0.5 * LIKELY) * np.where(alike, of_pairs, allowed / np.sqrt(n))
        error = max(error, float((_excess_over_chance(distance, uncertainty) * requested / allowed).max(initial=0.0)))
        most = max(most, error, float(distance[alike].max(initial=0.0)))
    return Influence(error, most - error)


def _error_of_pairs(a: Point, b: Point, what: Recorded) -> np.ndarray:
    """Return the standard error of the mean difference of two ways to run a scene, by pairs of equal starts."""
    pairs = zip(a.members, b.members, strict=True)
    spread = np.std([_as_rows(one[what.name]) - _as_rows(two[what.name]) for one, two in pairs], axis=0, ddof=1)
    return _pool_errors(np.linalg.norm(spread, axis=1) * (2.0 if _is_rotation(what) else 1.0)) / np.sqrt(len(b.members))


def _allowed_error(full: Point, what: Recorded, requested: float) -> np.ndarray:
    """Return the allowed error at each output: the requested accuracy, or the difference of two runs of the scene."""
    scattered: np.ndarray = np.sqrt(2.0) * _pool_errors(_deviations(full, what))
    return np.maximum(requested, scattered)


def _deviations(point: Point, what: Recorded) -> np.ndarray:
    """Return the standard deviation of one member at each output."""
    rows = _as_rows(point.deviation.get(what.name, np.zeros(len(_as_rows(point.values[what.name])))))
    return np.linalg.norm(rows, axis=1) * (2.0 if _is_rotation(what) else 1.0)


def agreement(planned: Point, full: Point, quantity: Quantity, members: int, requested: float) -> Agreement:
    """Return how well a planned run agrees with the full one in a quantity, at the decisive output.

    members: number of starts of each. Where both points hold their members, the differences per start bound chance if
    that bound is below the one of two independent means. requested: accuracy [SI].
    """
    if quantity.kind == "impact_times":
        return Agreement(_impact_times(planned, full, quantity.name).difference, 0.0, requested)
    results = []
    for what in _with_reductions(quantity):
        distance, uncertainty = _distance_of_means(planned, full, what, members)
        if np.isinf(distance).any():
            return Agreement(np.inf, 0.0, requested)
        uncertainty = chance(members) * uncertainty
        if min(len(planned.members), len(full.members)) > 1:
            of_pairs = stdtrit(members - 1.0, 1.0 - 0.5 * RARE) * _error_of_pairs(planned, full, what)
            uncertainty = np.minimum(uncertainty, of_pairs)
        error, allowed = _excess_over_chance(distance, uncertainty), _allowed_error(full, what, requested)
        floor = np.maximum(allowed, np.finfo(float).tiny)  # the allowed error of a constant quantity is zero
        worst = int(np.argmax((error - uncertainty) / floor))
        if error[worst] - uncertainty[worst] <= allowed[worst]:
            worst = int(np.argmax((error + uncertainty) / floor))
        beyond = allowed > requested
        horizon = float(np.argmax(beyond)) / len(beyond) if beyond.any() else 1.0
        results.append(Agreement(float(error[worst]), float(uncertainty[worst]), float(allowed[worst]), horizon))
    missed = [one for one in results if one.is_missed]
    worst_of = max(missed or results, key=lambda one: one.fraction)
    same = all(one.error == one.chance == 0.0 for one in results)
    return replace(worst_of, horizon=1.0 if same else results[0].horizon)  # the first result is the series, if any


def scatter(point: Point, quantity: Quantity) -> float:
    """Return one member's standard deviation from the mean of all members [SI]; the largest over the series.

    The quantity of a single run beyond the horizon is known no better.
    """
    if quantity.kind == "impact_times":
        return 0.0
    spreads = [
        _pool_errors(_deviations(point, what)) for what in _with_reductions(quantity) if what.name in point.deviation
    ]
    return max((float(spread.max(initial=0.0)) for spread in spreads), default=0.0)


def _pool_errors(error: np.ndarray) -> np.ndarray:
    """Return the errors of a series, none below the root mean square of its neighbours."""
    width = max(1, round(POOLED * len(error)))
    around = np.convolve(
        np.pad(error**2, (width // 2, (width - 1) // 2), mode="edge"), np.full(width, 1.0 / width), "valid"
    )
    return np.maximum(error, np.sqrt(around))


def _impact_times(a: Point, b: Point, name: str) -> Influence:
    if f"{name}.count" not in a.values or f"{name}.count" not in b.values:
        return Influence(np.inf)
    counts = {float(p.values[f"{name}.count"]) for p in (a, b)}
    scattered = any(float(p.deviation.get(f"{name}.count", 0.0)) > 0.0 for p in (a, b))
    if len(counts) > 1 or scattered:
        return Influence(np.inf)
    if counts == {0.0}:
        return Influence(0.0)
    return Influence(max(abs(float(a.values[f"{name}.{r}"] - b.values[f"{name}.{r}"])) for r in ("first", "last")))


def reference_size(point: Point, quantity: Quantity) -> float:
    """Return the reference of relative accuracies: largest change from the start, or value of forces and rates."""
    name = quantity.name
    if quantity.kind == "impact_times":
        return float(np.nan_to_num(point.values[f"{name}.last"]))
    if quantity.kind in ("peak_force", "impulse"):
        return float(np.abs(point.values[_with_reductions(quantity)[0].name]))
    values = _as_rows(point.values[f"{name}.series"])
    if quantity.kind == "orientation":
        return float(rotation_between(values[:1], values).max())
    if quantity.of_place:
        return float(np.linalg.norm(values - values[:1], axis=1).max())
    return float(np.abs(point.values[f"{name}.largest"]))


def rounding_threshold(point: Point, quantity: Quantity) -> float:
    """Return the value below which a vector's component is rounding, such as motion across a plane; 0 for others."""
    return ROUNDING * float(point.values.get(_largest_of_vector(quantity).name, 0.0)) if quantity.component else 0.0


def _as_rows(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    return values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)
