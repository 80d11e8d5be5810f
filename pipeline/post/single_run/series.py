"""From one run (and its ensemble) to the series that figures, tables and people look at."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.artifacts.labelled import LabelledArrays, labelled, of
from flexclear.pipeline.core.artifacts.quantities import IMPACT, SEPARATED
from flexclear.pipeline.core.artifacts.schema import conformed, require_complete
from flexclear.pipeline.core.numerics.rotations import angle_about_y, first_largest, rotation_between
from flexclear.pipeline.post.single_run.horizon import QUANTILES, Variables, ensemble_statistics, horizon
from flexclear.pipeline.post.single_run.impacts import impacts, of_kind
from flexclear.pipeline.post.single_run.schema import POST
from flexclear.pipeline.post.single_run.wear import wear

if TYPE_CHECKING:
    import xarray as xr


def derive(run: xr.Dataset, ensemble: xr.Dataset | None = None) -> xr.Dataset:
    """What `derived` gives, of datasets."""
    return derived(of(run), None if ensemble is None else of(ensemble)).to_xarray()


def derived(run: LabelledArrays, ensemble: LabelledArrays | None = None) -> LabelledArrays:
    """The post artifact of one run (schema POST): rotations, displacements, reactions, impacts, horizon.

    run: artifact of schema RUN.  ensemble: artifact of schema ENSEMBLE; without one there are no ensemble
    variables.  The horizon is the run's own (its end where it has none), the ensemble's is called so.
    Nothing is interpolated: series are on the run's own times, ensemble statistics on `ensemble_time`.
    Raises InputError for what is left of a run that was stopped.
    """
    require_complete(run)
    data: Variables = {**motion(run), **contacts(run), **impacts(run), **wear(run, parameters(run).get("joint", {}))}
    data["reaction"] = (("time", "joint"), reactions(run))
    data |= extremes(run, data["reaction"][1])
    end = float(run["horizon"].values if "horizon" in run else run["time"].values[-1])
    used = {dim for dims, _ in data.values() for dim in dims}
    coords: dict[str, object] = {
        name: array for name, array in run.variables.items() if name in run.coords and {*array.dims} <= used
    }
    if ensemble is not None:
        data |= ensemble_statistics(ensemble)
        data["ensemble_horizon"] = ((), np.array(horizon(ensemble["time"].values, ensemble["velocity"].values)))
        coords |= {"ensemble_time": ensemble["time"].values, "ensemble_body": ensemble["body"].values}
        coords["quantile"] = np.array(QUANTILES)
    data["horizon"] = ((), np.array(end))
    attributes = {
        "impact_threshold": f"{IMPACT:g} m/s",
        "horizon_criterion": f"ensemble, or run and perturbed run, stay separated by {SEPARATED:g} of the motion",
    }
    attributes["references"] = str(run.attrs.get("references", ""))
    title = f"What follows from: {run.attrs['title']}"
    return conformed(labelled(data, coords), POST, title=title, **attributes)


def motion(run: xr.Dataset | LabelledArrays) -> Variables:
    """Angle about y, total rotation and displacement of every body."""
    q, position = run["quaternion"].values, run["position"].values
    return {
        "rotation_y": (("time", "body"), angle_about_y(q)),
        "rotation": (("time", "body"), rotation_between(q[:1], q)),
        "displacement": (("time", "body", "axis"), position - position[:1]),
    }


def reactions(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Magnitude of what each joint transmits [N], shape (time, joint).

    For a joint with clearance that is the contact force.
    """
    force: np.ndarray = np.linalg.norm(run["joint_force"].values, axis=-1)
    joints = list(run["joint"].values)
    if "contact_force" in run:
        for k, name in enumerate(run["contact"].values):
            if name in joints:  # the others are ends of stops
                force[:, joints.index(name)] = np.linalg.norm(run["contact_force"].values[:, k], axis=-1)
    return force


def extremes(run: xr.Dataset | LabelledArrays, reaction: np.ndarray) -> Variables:
    """Largest magnitudes and their times, of all rows: regular outputs, events, deepest points of contacts.

    reaction: of every joint [N], shape (time, joint).
    """
    series = {
        "reaction": (("joint",), reaction),
        "acceleration": (("body", "axis"), np.abs(run["acceleration"].values)),
    }
    if "drive_force" in run:
        series["drive_force"] = (("drive",), np.abs(run["drive_force"].values))
    if "contact_penetration" in run:
        series["penetration"] = (("contact",), run["contact_penetration"].values)
        series["force"] = (("contact",), run["contact_normal_force"].values)
    variables: Variables = {}
    for name, (dims, values) in series.items():
        variables[f"peak_{name}"] = (dims, values.max(axis=0, initial=0.0))
        variables[f"peak_{name}_time"] = (dims, run["time"].values[first_largest(values, axis=0)])
    if "von_mises_stress" in run:
        at = first_largest(run["von_mises_stress"].values, axis=0)
        gauges = np.arange(len(at))
        variables["peak_stress"] = (("gauge",), run["von_mises_stress"].values[at, gauges])
        variables["peak_stress_time"] = (("gauge",), run["time"].values[at])
        variables["peak_stress_position"] = (("gauge", "axis"), run["stress_position"].values[at, gauges])
    if "event_peak_force" in run:
        variables["peak_force"] = (("contact",), _peak_force(run))
    return variables


def contacts(run: xr.Dataset | LabelledArrays) -> Variables:
    """Eccentricity, clearance and fraction of time in contact, per contact."""
    if "contact_offset" not in run:
        return {}
    distance = np.linalg.norm(run["contact_offset"].values, axis=-1)
    gap = run["contact_gap"].values
    return {
        "eccentricity": (("time", "contact"), distance),
        # gap = clearance - eccentricity at every time; the median is free of rounding at single times
        "clearance": (("contact",), np.median(gap + distance, axis=0)),
        "contact_time_share": (("contact",), _time_share(run)),
    }


def _time_share(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Fraction of the run that each contact is closed, from its located begins and ends."""
    time, fraction, names = run["time"].values, np.zeros(run.sizes["contact"]), list(run["contact"].values)
    closings = of_kind(run, "closing")
    begun, lasted = run["event_time"].values[closings], run["event_duration"].values[closings]
    lasted = np.where(np.isfinite(lasted), lasted, time[-1] - begun)
    for name, seconds in zip(run["event_contact"].values[closings], lasted, strict=True):
        fraction[names.index(name)] += seconds
    return fraction / (time[-1] - time[0])


def _peak_force(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Largest normal force: of the outputs and of the peaks that the solver tracked between them."""
    peak: np.ndarray = run["contact_normal_force"].values.max(axis=0)
    for k, name in enumerate(run["contact"].values):
        tracked = run["event_peak_force"].values[run["event_contact"].values == name]
        peak[k] = max(peak[k], np.max(tracked[np.isfinite(tracked)], initial=0.0))
    return peak


def parameters(run: xr.Dataset | LabelledArrays) -> dict:
    """The scene's parameters from the run's attributes; empty when they do not."""
    return json.loads(run.attrs.get("parameters", "{}"))
