"""Differences between two runs, and effects of the paper's models as numbers.

Runs are compared only at their common times, without interpolation. Only for the times in between is a smooth motion
interpolated, with its accelerations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from papers.wang_wang_2019.models import BALL_FRAME, IDEAL, JOINT, PLATFORM, SAME_TIME, Model, common_times

#: variables of two runs that are compared
COMPARED = ("quaternion", "position", "velocity")


@dataclass(frozen=True, slots=True)
class Deviation:
    """Largest absolute differences of one body between two runs, and the span in which they occur."""

    angle: float  #: angle about y [rad]
    rotation: float  #: total rotation [rad]
    displacement: float  #: z [m]
    velocity: float  #: along z [m/s]
    until: float  #: last time that was compared [s]

    def over(self, other: Deviation) -> tuple[float, float, float]:
        """Return angle, displacement and velocity as fractions of those of another deviation."""
        return self.angle / other.angle, self.displacement / other.displacement, self.velocity / other.velocity


def max_deviation(run: xr.Dataset, reference: xr.Dataset, body: str, until: float = np.inf) -> Deviation:
    """Return the largest differences of `body` between two runs at their common times up to `until` [s].

    Raises ValueError when the runs have no common time in that span.
    """
    i, j = common_times(run.time.values, reference.time.values)
    inside = run.time.values[i] <= until + SAME_TIME * abs(until)
    i, j = i[inside], j[inside]
    if i.size == 0:
        raise ValueError("the two runs have no output time in common")
    return _compare(run, i, reference, j, body)


def velocity_at_events(run: xr.Dataset, smooth: xr.Dataset, body: str, until: float = np.inf) -> tuple[float, float]:
    """Return the largest difference of the velocity along z [m/s], and its time [s], up to `until` [s].

    The times are the run's own, events included.  smooth: motion without impacts, interpolated with its accelerations.
    """
    from scipy.interpolate import CubicHermiteSpline

    time = run.time.values
    inside = time <= min(until, smooth.time.values[-1]) + SAME_TIME * time[-1]
    mine, other = (one.sel(body=body, axis="z") for one in (run, smooth))
    known = CubicHermiteSpline(other.time.values, other.velocity.values, other.acceleration.values)
    differences = np.abs(mine.velocity.values - known(time))[inside]
    return float(differences.max()), float(time[inside][differences.argmax()])


def ensemble_deviations(ensemble: xr.Dataset, reference: xr.Dataset, body: str) -> list[Deviation]:
    """Return `max_deviation` of every member over the whole run, in the order of the members."""
    i, j = common_times(ensemble.time.values, reference.time.values)
    members = (ensemble[list(COMPARED)].isel(member=k) for k in range(ensemble.sizes["member"]))
    return [_compare(member, i, reference, j, body) for member in members]


def _compare(run: xr.Dataset, i: np.ndarray, reference: xr.Dataset, j: np.ndarray, body: str) -> Deviation:
    a, b = (one[list(COMPARED)].sel(body=body).isel(time=k) for one, k in ((run, i), (reference, j)))
    # SciPy has the scalar part last
    turn_a, turn_b = (Rotation.from_quat(np.roll(one.quaternion.values, -1, axis=1)) for one in (a, b))
    return Deviation(
        angle=_largest(np.subtract(*(np.arcsin(turn.as_matrix()[:, 0, 2]) for turn in (turn_a, turn_b)))),
        rotation=_largest((turn_a.inv() * turn_b).magnitude()),
        displacement=_largest(a.position.values[:, 2] - b.position.values[:, 2]),
        velocity=_largest(a.velocity.values[:, 2] - b.velocity.values[:, 2]),
        until=float(a.time.max()),
    )


def _largest(values: np.typing.ArrayLike) -> float:
    return float(np.max(np.abs(values)))


#: artifacts by reference, such as ``sps4/csj:run``
Data = dict[str, xr.Dataset]
#: answers differ when they are more than this fraction apart; those of two ensembles also by this many standard
#: deviations of the members
SLIGHT, SEPARATION = 0.1, 2.0


def moved(data: Data, model: Model, ideal_model: Model = IDEAL) -> Deviation:
    """Return the largest deviations from the ideal model; for a model with an ensemble the means over the members."""
    ideal = data[f"{ideal_model.scene}:run"]
    if f"{model.scene}:ensemble" not in data:
        return max_deviation(data[f"{model.scene}:run"], ideal, PLATFORM)
    members = ensemble_deviations(data[f"{model.scene}:ensemble"], ideal, PLATFORM)
    return Deviation(*np.mean([astuple(member) for member in members], axis=0).tolist())


def sizes(data: Data, ideal_model: Model = IDEAL) -> Deviation:
    """Return the largest values of the ideal model's own motion."""
    run, post = data[f"{ideal_model.scene}:run"], data[f"{ideal_model.scene}:post"]
    z = np.abs(post.displacement.sel(body=PLATFORM, axis="z").values).max()
    v = np.abs(run.velocity.sel(body=PLATFORM, axis="z").values).max()
    angle = np.abs(post.rotation_y.sel(body=PLATFORM).values).max()
    return Deviation(float(angle), float(angle), float(z), float(v), float(run.time.values[-1]))


def effects(data: Data, model: Model) -> dict[str, float]:
    """Return the largest differences from the ideal model, with that of the force at A1 [N]."""
    most = moved(data, model)
    newtons = float(np.linalg.norm(difference(data, model, force), axis=1).max())
    return {"angle": most.angle, "displacement": most.displacement, "velocity": most.velocity, "force": newtons}


def reaction(data: Data, model: Model) -> float:
    """Return the largest force at A1 [N], with clearance the normal one; for ensembles the mean of the maxima."""
    if f"{model.scene}:ensemble" in data:
        return float(data[f"{model.scene}:ensemble"].peak_force.sel(contact=JOINT).mean())
    post = data[f"{model.scene}:post"]
    return float(post.peak_force.sel(contact=JOINT) if "contact" in post.sizes else post.peak_reaction.sel(joint=JOINT))


def peaks(data: Data, model: Model) -> tuple[float, float]:
    """Return the largest force at A1 [N] as of `reaction`, and the platform's largest vertical acceleration [m/s^2]."""
    return reaction(data, model), acceleration(data, model)


def acceleration(data: Data, model: Model) -> float:
    """Return the platform's largest vertical acceleration [m/s^2]; for ensembles the mean of the members' largest."""
    kind = "ensemble" if f"{model.scene}:ensemble" in data else "post"
    return float(data[f"{model.scene}:{kind}"].peak_acceleration.sel(body=PLATFORM, axis="z").mean())


def difference(data: Data, model: Model, of: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
    """Return the magnitudes of the differences from the ideal model at the outputs that both have."""
    run, ideal = data[f"{model.scene}:run"], data[f"{IDEAL.scene}:run"]
    i, j = common_times(run.time.values, ideal.time.values)
    return np.abs(of(run)[i] - of(ideal)[j])


def vertical(run: xr.Dataset) -> np.ndarray:
    """Return the platform's acceleration along z [m/s^2], shape (time,)."""
    return run.acceleration.sel(body=PLATFORM, axis="z").values


def ball_centre(run: xr.Dataset) -> np.ndarray:
    """Return the centre of ball A1, world axes [m], shape (time, 3)."""
    return run.frame_position.sel(frame=BALL_FRAME).values


def force(run: xr.Dataset) -> np.ndarray:
    """Return the force that joint A1 transmits [N], shape (time, 3)."""
    return run.joint_force.sel(joint=JOINT).values


def differ(a: np.ndarray, b: np.ndarray) -> bool:
    """Return True when the means of two ensembles' members differ, by `SLIGHT` and by `SEPARATION`."""
    gap, spread = abs(a.mean() - b.mean()), max(a.std(ddof=1), b.std(ddof=1))
    return bool(gap > SLIGHT * abs(b.mean()) and gap > SEPARATION * spread)
