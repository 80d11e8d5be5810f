"""Differences between two runs, without interpolation, and what the models differ in as numbers.

Differences are taken only at times that both runs have.

But for what happens between these: a smooth motion can be interpolated with its accelerations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import BALL_FRAME, IDEAL, JOINT, PLATFORM, Model
from flexclear.pipeline.core.artifacts.quantities import SAME_TIME, common_times
from flexclear.pipeline.core.numerics.rotations import angle_about_y, rotation_between

#: what is compared of two runs
COMPARED = ("quaternion", "position", "velocity")


@dataclass(frozen=True, slots=True)
class Deviation:
    """Largest absolute differences of one body between two runs, and the span they are taken over."""

    angle: float  #: angle about y [rad]
    rotation: float  #: total rotation [rad]
    displacement: float  #: z [m]
    velocity: float  #: along z [m/s]
    until: float  #: last time that was compared [s]

    def over(self, other: Deviation) -> tuple[float, float, float]:
        """Angle, displacement and velocity as fractions of another one's."""
        return self.angle / other.angle, self.displacement / other.displacement, self.velocity / other.velocity


def max_deviation(run: xr.Dataset, reference: xr.Dataset, body: str, until: float = np.inf) -> Deviation:
    """Largest differences of `body` between two runs at their common times up to `until` [s].

    Raises ValueError when the runs have no common time in that span.
    """
    i, j = common_times(run.time.values, reference.time.values)
    inside = run.time.values[i] <= until + SAME_TIME * abs(until)
    i, j = i[inside], j[inside]
    if i.size == 0:
        raise ValueError("the two runs have no output time in common")
    return _compare(run, i, reference, j, body)


def velocity_at_events(run: xr.Dataset, smooth: xr.Dataset, body: str, until: float = np.inf) -> tuple[float, float]:
    """Largest difference of the velocity along z [m/s] at a run's own times up to `until` [s], events among them.

    smooth: a motion without impacts, cubic in between by its accelerations.  Returns the time [s] as well.
    """
    from scipy.interpolate import CubicHermiteSpline

    time = run.time.values
    inside = time <= min(until, smooth.time.values[-1]) + SAME_TIME * time[-1]
    mine, other = (one.sel(body=body, axis="z") for one in (run, smooth))
    known = CubicHermiteSpline(other.time.values, other.velocity.values, other.acceleration.values)
    differences = np.abs(mine.velocity.values - known(time))[inside]
    return float(differences.max()), float(time[inside][differences.argmax()])


def ensemble_deviations(ensemble: xr.Dataset, reference: xr.Dataset, body: str) -> list[Deviation]:
    """`max_deviation` of every member over the whole run; members in order."""
    i, j = common_times(ensemble.time.values, reference.time.values)
    members = (ensemble[list(COMPARED)].isel(member=k) for k in range(ensemble.sizes["member"]))
    return [_compare(member, i, reference, j, body) for member in members]


def _compare(run: xr.Dataset, i: np.ndarray, reference: xr.Dataset, j: np.ndarray, body: str) -> Deviation:
    a, b = (one[list(COMPARED)].sel(body=body).isel(time=k) for one, k in ((run, i), (reference, j)))
    qa, qb = a.quaternion.values, b.quaternion.values
    return Deviation(
        angle=_largest(angle_about_y(qa) - angle_about_y(qb)),
        rotation=_largest(rotation_between(qa, qb)),
        displacement=_largest(a.position.values[:, 2] - b.position.values[:, 2]),
        velocity=_largest(a.velocity.values[:, 2] - b.velocity.values[:, 2]),
        until=float(a.time.max()),
    )


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))


#: artifacts by reference, such as ``sps4/csj:run``
Data = dict[str, xr.Dataset]
#: two answers differ by more than this fraction, and those of two ensembles also by this many standard deviations of
#: the members
SLIGHT, SEPARATION = 0.1, 2.0


def moved(data: Data, model: Model, ideal_model: Model = IDEAL) -> Deviation:
    """Largest deviations from the ideal model; of a model with an ensemble the means over the members."""
    ideal = data[f"{ideal_model.scene}:run"]
    if f"{model.scene}:ensemble" not in data:
        return max_deviation(data[f"{model.scene}:run"], ideal, PLATFORM)
    members = ensemble_deviations(data[f"{model.scene}:ensemble"], ideal, PLATFORM)
    return Deviation(*np.mean([astuple(member) for member in members], axis=0).tolist())


def sizes(data: Data, ideal_model: Model = IDEAL) -> Deviation:
    """Largest values of the ideal model's own motion."""
    run, post = data[f"{ideal_model.scene}:run"], data[f"{ideal_model.scene}:post"]
    z = np.abs(post.displacement.sel(body=PLATFORM, axis="z").values).max()
    v = np.abs(run.velocity.sel(body=PLATFORM, axis="z").values).max()
    angle = np.abs(post.rotation_y.sel(body=PLATFORM).values).max()
    return Deviation(float(angle), float(angle), float(z), float(v), float(run.time.values[-1]))


def effects(data: Data, model: Model) -> dict[str, float]:
    """Largest differences from the ideal model, that of the force at A1 [N] among them."""
    most = moved(data, model)
    newtons = float(np.linalg.norm(difference(data, model, force), axis=1).max())
    return {"angle": most.angle, "displacement": most.displacement, "velocity": most.velocity, "force": newtons}


def reaction(data: Data, model: Model) -> float:
    """Largest force at A1 [N], with clearance the normal one; of ensembles the mean of the members' largest."""
    if f"{model.scene}:ensemble" in data:
        return float(data[f"{model.scene}:ensemble"].peak_force.sel(contact=JOINT).mean())
    post = data[f"{model.scene}:post"]
    return float(post.peak_force.sel(contact=JOINT) if "contact" in post.sizes else post.peak_reaction.sel(joint=JOINT))


def peaks(data: Data, model: Model) -> tuple[float, float]:
    """Largest force at A1 [N] as of `reaction`, and largest vertical acceleration of the platform [m/s^2]."""
    return reaction(data, model), acceleration(data, model)


def acceleration(data: Data, model: Model) -> float:
    """Largest vertical acceleration of the platform [m/s^2]; of ensembles the mean of the members' largest."""
    kind = "ensemble" if f"{model.scene}:ensemble" in data else "post"
    return float(data[f"{model.scene}:{kind}"].peak_acceleration.sel(body=PLATFORM, axis="z").mean())


def difference(data: Data, model: Model, of: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
    """Sizes of the differences from the ideal model at the outputs that both have."""
    run, ideal = data[f"{model.scene}:run"], data[f"{IDEAL.scene}:run"]
    i, j = common_times(run.time.values, ideal.time.values)
    return np.abs(of(run)[i] - of(ideal)[j])


def vertical(run: xr.Dataset) -> np.ndarray:
    """The platform's acceleration along z [m/s^2], shape (time,)."""
    return run.acceleration.sel(body=PLATFORM, axis="z").values


def ball_centre(run: xr.Dataset) -> np.ndarray:
    """The ball_centre of ball A1, world axes [m], shape (time, 3)."""
    return run.frame_position.sel(frame=BALL_FRAME).values


def force(run: xr.Dataset) -> np.ndarray:
    """What joint A1 transmits [N], shape (time, 3)."""
    return run.joint_force.sel(joint=JOINT).values


def differ(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the means of two ensembles' members do, by `SLIGHT` and by `SEPARATION`."""
    gap, spread = abs(a.mean() - b.mean()), max(a.std(ddof=1), b.std(ddof=1))
    return bool(gap > SLIGHT * abs(b.mean()) and gap > SEPARATION * spread)
