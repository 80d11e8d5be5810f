"""Differences between two runs, without interpolation: only at times that both have.

But for what happens between these: a smooth motion can be interpolated with its accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.quantities import SAME_TIME, common_times
from flexclear.pipeline.core.numerics.rotations import angle_about_y, rotation_between


@dataclass(frozen=True, slots=True)
class Deviation:
    """Largest absolute differences of one body between two runs, and the span they are taken over."""

    angle: float  #: angle about y [rad]
    rotation: float  #: total rotation [rad]
    displacement: float  #: z [m]
    velocity: float  #: along z [m/s]
    until: float  #: last time that was compared [s]


def max_deviation(run: xr.Dataset, reference: xr.Dataset, body: str, until: float = np.inf) -> Deviation:
    """Largest differences of `body` between two runs at their common times up to `until` [s].

    Raises ValueError when the runs have no common time in that span.
    """
    i, j = common_times(run.time.values, reference.time.values)
    inside = run.time.values[i] <= until + SAME_TIME * abs(until)
    i, j = i[inside], j[inside]
    if i.size == 0:
        raise ValueError("the two runs have no output time in common")
    return _compare(_motion(run, body), i, _motion(reference, body), j, run.time.values)


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
    other = _motion(reference, body)
    members = (ensemble.isel(member=k) for k in range(ensemble.sizes["member"]))
    return [_compare(_motion(member, body), i, other, j, ensemble.time.values) for member in members]


@dataclass(frozen=True, slots=True)
class _Motion:
    quaternion: np.ndarray
    z: np.ndarray
    vz: np.ndarray


def _motion(run: xr.Dataset, body: str) -> _Motion:
    one = run.sel(body=body)
    return _Motion(one.quaternion.values, one.position.values[:, 2], one.velocity.values[:, 2])


def _compare(a: _Motion, i: np.ndarray, b: _Motion, j: np.ndarray, time: np.ndarray) -> Deviation:
    qa, qb = a.quaternion[i], b.quaternion[j]
    return Deviation(
        angle=_largest(angle_about_y(qa) - angle_about_y(qb)),
        rotation=_largest(rotation_between(qa, qb)),
        displacement=_largest(a.z[i] - b.z[j]),
        velocity=_largest(a.vz[i] - b.vz[j]),
        until=float(time[i].max()),
    )


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))
