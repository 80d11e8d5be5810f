r"""What an effect does to a quantity: how far two variants of a scene are apart, and how well that is known.

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
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.numerics.rotations import rotation_between
from flexclear.pipeline.core.scene.quantity import Quantity, Recorded
from flexclear.pipeline.core.scene.schema import Ensemble, Scene

#: a difference of means that chance alone makes less often than this counts: of hundred independent looks one in ten
RARE = 1e-3
#: fraction of a series over which the spread of members is pooled
POOLED = 0.05
#: by how much members start apart: a fraction of the clearance, and the least [m]
FRACTION, LEAST = 1e-3, 1e-8
#: what is recorded of a quantity to compare it by: the series, and of what impacts make large its extreme, which is
#: read where it is and not at an output
OF_KIND = {
    "peak_force": ("largest",),
    "impulse": ("final",),
    "impact_times": ("count", "first", "last"),
}
OTHERS = ("series", "largest")


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


def chance(members: int) -> float:
    """Standard errors of a difference of two means over so many members each that chance reaches (Student's t)."""
    return float(stdtrit(2.0 * max(members - 1, 1), 1.0 - 0.5 * RARE))


def with_members(scene: Scene) -> Scene:
    """The scene with members that start a hair apart: a thousandth of its least clearance, at least 1e-8 m.

    No start is known better; and members that are nearer to each other than the errors of a loose tolerance would make
    these look like influences.
    """
    clearances = [joint.clearance for joint in scene.contacts().values()]
    perturbation = max(LEAST, FRACTION * min(clearances, default=0.0))
    changed = scene.model_copy(update={"ensemble": Ensemble(perturbation=perturbation)})
    changed._name, changed._path = scene.name, scene.path
    return changed


def recorded(owners: Mapping[str, Collection[str]], chosen: Sequence[Quantity]) -> list[Recorded]:
    """Recorded values of a run to compare it by; quantities that its scene does not have are left out.

    owners: of the scene, by what they are.
    """
    return [Recorded(q, r) for q in chosen if q.is_there(owners) for r in _reductions(q)]


def _reductions(quantity: Quantity) -> tuple[str, ...]:
    return ("series",) if quantity.of_place else OF_KIND.get(quantity.kind, OTHERS)


def influence(a: Point, b: Point, quantity: Quantity, members: int) -> Influence:
    """How much two variants differ in a quantity.

    members: starts of each that were run; a point without deviations counts as one that is known.
    """
    name = quantity.name
    if quantity.kind == "impact_times":
        return _impact_times(a, b, name)
    parts = [
        _apart(a, b, f"{name}.{reduction}", members, turning=quantity.kind == "orientation")
        for reduction in _reductions(quantity)
    ]
    return Influence(max(p.difference for p in parts), max(p.uncertainty for p in parts))


def _apart(a: Point, b: Point, name: str, members: int, *, turning: bool) -> Influence:
    if name not in a.values or name not in b.values:
        return Influence(np.inf)
    one, two = (_rows(p.values[name]) for p in (a, b))
    spreads = [np.linalg.norm(_rows(p.deviation.get(name, np.zeros(len(one)))), axis=1) for p in (a, b)]
    error = np.hypot(*spreads) / np.sqrt(max(members, 1))
    if turning:
        one, two = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (one, two))
        distance, error = rotation_between(one, two), 2.0 * error  # a quaternion changes by half the angle
    else:
        distance = np.linalg.norm(one - two, axis=1)
    error = chance(members) * _pooled(error)
    distances = np.sqrt(np.maximum(0.0, distance**2 - error**2))
    return Influence(float(distances.max(initial=0.0)), float(error.max(initial=0.0)))


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
        return float(np.abs(point.values[f"{name}.{OF_KIND[quantity.kind][0]}"]))
    values = _rows(point.values[f"{name}.series"])
    if quantity.kind == "orientation":
        return float(rotation_between(values[:1], values).max())
    if quantity.of_place:
        return float(np.linalg.norm(values - values[:1], axis=1).max())
    return float(np.abs(point.values[f"{name}.largest"]))


def _rows(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    return values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)
