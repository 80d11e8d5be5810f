"""From one run (and its ensemble) to the series that figures, tables and people look at."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from flexclear.pipeline.core.algebra import rotation_between
from flexclear.pipeline.core.artifacts.schema import conform
from flexclear.pipeline.core.quantities import IMPACT, PARTED
from flexclear.pipeline.post.horizon import QUANTILES, Variables, ensemble_statistics, horizon
from flexclear.pipeline.post.impacts import impacts, of_kind
from flexclear.pipeline.post.rotations import angle_about_y
from flexclear.pipeline.post.schema import POST
from flexclear.pipeline.post.wear import wear


def derive(run: xr.Dataset, ensemble: xr.Dataset | None = None) -> xr.Dataset:
    """The post artifact of one run (schema POST): rotations, displacements, reactions, impacts, horizon.

    run: artifact of schema RUN.  ensemble: artifact of schema ENSEMBLE; without one there are no ensemble
    variables.  The horizon is the run's own (its end where it has none), the ensemble's is called so.
    Nothing is interpolated: series are on the run's own times, ensemble statistics on `ensemble_time`.
    """
    worn, surfaces = wear(run, parameters(run).get("joint", {}))
    data: Variables = {**motion(run), **contacts(run), **impacts(run), **worn}
    names, force = reactions(run)
    data["reaction"] = (("time", "joint"), force)
    data["peak_reaction"] = (("joint",), force.max(axis=0, initial=0.0))
    data["peak_acceleration"] = (("body", "axis"), np.abs(run.acceleration.values).max(axis=0, initial=0.0))
    end = float(run["horizon"] if "horizon" in run else run.time.values[-1])
    coords = {name: run[name].values for name in ("time", "body", "contact") if name in run.coords}
    coords |= surfaces
    coords["joint"] = np.array(names, dtype=str)
    if ensemble is not None:
        data |= ensemble_statistics(ensemble)
        data["ensemble_horizon"] = ((), np.array(horizon(ensemble.time.values, ensemble.velocity.values)))
        coords |= {"ensemble_time": ensemble.time.values, "kept": ensemble.body.values}
        coords["quantile"] = np.array(QUANTILES)
    data["horizon"] = ((), np.array(end))
    attributes = {
        "impact_threshold": f"{IMPACT:g} m/s",
        "horizon_criterion": f"velocities of the ensemble, or of run and twin, differ by {PARTED:g} of the largest",
    }
    result = conform(xr.Dataset(data, coords=coords), POST, **attributes)
    if ensemble is not None:
        result["ensemble_time"].attrs = {"units": "s", "long_name": "time of the ensemble's output"}
        result["quantile"].attrs = {"units": "1", "long_name": "share of the members below"}
    return result


def motion(run: xr.Dataset) -> Variables:
    """Angle about y, total rotation and displacement of every body."""
    q, position = run.quaternion.values, run.position.values
    return {
        "rotation_y": (("time", "body"), angle_about_y(q)),
        "rotation": (("time", "body"), rotation_between(q[:1], q)),
        "displacement": (("time", "body", "axis"), position - position[:1]),
    }


def reactions(run: xr.Dataset) -> tuple[list[str], np.ndarray]:
    """Joint names, and the magnitude of what each transmits [N], shape (time, joint).

    For a joint with clearance that is the contact force.
    """
    force = dict(_magnitudes(run, "joint", "joint_force"))
    if "contact_force" in run:
        force |= dict(_magnitudes(run, "contact", "contact_force"))
    columns = list(force.values()) or [np.empty((run.sizes["time"], 0))]
    return list(force), np.column_stack(columns)


def _magnitudes(run: xr.Dataset, dim: str, name: str) -> list[tuple[str, np.ndarray]]:
    values = np.linalg.norm(run[name].values, axis=-1)
    return [(str(part), values[:, i]) for i, part in enumerate(run[dim].values)]


def contacts(run: xr.Dataset) -> Variables:
    """Eccentricity, clearance, peak force and share of time in contact, per clearance joint."""
    if "contact_offset" not in run:
        return {}
    distance = np.linalg.norm(run.contact_offset.values, axis=-1)
    gap = run.contact_gap.values
    return {
        "eccentricity": (("time", "contact"), distance),
        # gap = clearance - eccentricity at every time; the median is free of rounding at single times
        "clearance": (("contact",), np.median(gap + distance, axis=0)),
        "peak_force": (("contact",), _peak_force(run)),
        "contact_time_share": (("contact",), _time_share(run)),
    }


def _time_share(run: xr.Dataset) -> np.ndarray:
    """Share of the run that each contact is closed, from its located begins and ends."""
    time, share = run.time.values, np.zeros(run.sizes["contact"])
    closings = of_kind(run, "closing")
    begun, lasted = run.event_time.values[closings], run.event_duration.values[closings]
    lasted = np.where(np.isfinite(lasted), lasted, time[-1] - begun)
    np.add.at(share, run.event_contact.values.astype(int)[closings], lasted)
    return share / (time[-1] - time[0])


def _peak_force(run: xr.Dataset) -> np.ndarray:
    """Largest normal force: of the outputs and of the peaks that the solver tracked between them."""
    peak = run.contact_normal_force.values.max(axis=0)
    if "event_peak_force" in run:
        for i, value in zip(run.event_contact.values.astype(int), run.event_peak_force.values, strict=True):
            if np.isfinite(value):
                peak[i] = max(peak[i], value)
    return peak


def parameters(run: xr.Dataset) -> dict:
    """The scene's parameters as the run's attributes tell them; empty when they do not."""
    return json.loads(run.attrs.get("parameters", "{}"))


def assumptions(run: xr.Dataset) -> dict[str, str]:
    """Place -> ``assumed: why``, as the run's attributes tell them."""
    return json.loads(run.attrs.get("assumptions", "{}"))
