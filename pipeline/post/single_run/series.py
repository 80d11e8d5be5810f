"""From one run (and its ensemble) to the series that figures, tables and people look at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.artifacts.quantities import IMPACT

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays

import json
from typing import TYPE_CHECKING

from flexclear.pipeline.core.artifacts.labelled import LabelledArrays, labelled, of
from flexclear.pipeline.core.artifacts.quantities import SEPARATED
from flexclear.pipeline.core.artifacts.schema import conformed, require_complete
from flexclear.pipeline.core.numerics.rotations import angle_about_y, first_largest, rotation_between
from flexclear.pipeline.post.single_run.horizon import QUANTILES, Variables, ensemble_statistics, horizon
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


def impacts(run: xr.Dataset | LabelledArrays) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Variables ``impact_*`` of the post artifact; empty for a run without contacts.

    Listed and counted are the closings with an approach speed above IMPACT; the separation speed is
    that of the next opening of the same contact.  Of one that the run's end cuts short, separation
    speed, duration, impulse and losses are NaN.
    """
    if "event_time" not in run or "contact" not in run.sizes:
        return {}
    contact, names = run["event_contact"].values, [str(name) for name in run["contact"].values]
    speed = run["event_approach_speed"].values
    closings, openings = of_kind(run, "closing"), of_kind(run, "opening")
    strong = np.flatnonzero(closings & (speed > IMPACT))
    opens = np.array([_next_opening(int(i), contact, openings) for i in strong], dtype=int)
    ended, begun = opens >= 0, run["event_time"].values[strong]
    return {
        "impact_time": (("impact",), begun),
        "impact_contact": (("impact",), contact[strong]),
        "impact_approach_speed": (("impact",), speed[strong]),
        "impact_separation_speed": (("impact",), np.where(ended, speed[opens], np.nan)),
        "impact_peak_force": (("impact",), run["event_peak_force"].values[strong]),
        "impact_duration": (("impact",), np.where(ended, run["event_time"].values[opens] - begun, np.nan)),
        "impact_count": (
            ("contact",),
            np.array([np.count_nonzero(contact[strong] == name) for name in names], dtype=np.int64),
        ),
        **_books(run, contact[strong], begun, np.where(ended, run["event_time"].values[opens], np.nan)),
    }


#: what the run's ledger books of contacts, by the name that an impact's fraction of it has
BOOKS = {
    "impact_impulse": "contact_impulse",
    "impact_damping_loss": "contact_damping_loss",
    "impact_friction_loss": "contact_friction_loss",
}


def _books(
    run: xr.Dataset | LabelledArrays, contact: np.ndarray, begun: np.ndarray, ended: np.ndarray
) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Impulse and losses of each impact, NaN where it has not ended; there are rows at all events."""
    time, booked = run["time"].values, dict[str, tuple[tuple[str, ...], np.ndarray]]()
    for name, book in BOOKS.items():
        if book in run:
            values, fractions = run[book].values, np.full(len(contact), np.nan)
            names = list(run["contact"].values)
            for i, c in enumerate(names.index(name) for name in contact):
                fractions[i] = np.interp(ended[i], time, values[:, c]) - np.interp(begun[i], time, values[:, c])
            booked[name] = (("impact",), fractions)
    return booked


def of_kind(run: xr.Dataset | LabelledArrays, name: str) -> np.ndarray:
    """True for the events of a kind, e.g. those that close a gap, shape (event,)."""
    return np.asarray(run["event_kind"].values == name, dtype=bool)


def _next_opening(i: int, contact: np.ndarray, openings: np.ndarray) -> int:
    """Index of the first opening of the same contact after event i, or -1."""
    later = np.flatnonzero((contact[i + 1 :] == contact[i]) & openings[i + 1 :])
    return int(i + 1 + later[0]) if later.size else -1
