"""Series of one run (and its ensemble) for figures and tables, impacts and wear included.

Wear: depths by Archard's law, and their distribution over pin and socket. Totals are the run's own integrals. They are
spread over the surfaces along the path of the contact between recorded rows, which are the outputs and all events; a
contact that turns by more than a sector between two outputs is spread along the shorter arc.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.artifacts.labelled import LabelledArrays, label_arrays, label_dataset
from flexclear.artifacts.quantities import IMPACT, PERTURBATION, SEPARATED, index_of_separation
from flexclear.artifacts.schema import RUN, Schema, conform_arrays, require_complete
from flexclear.numerics.rotations import angle_about_y, index_of_largest, rotation_between
from flexclear.scene.output import table

if TYPE_CHECKING:
    import xarray as xr

#: variables of the artifact by name; their dimensions are those of the schema POST
Arrays = dict[str, np.ndarray]


def derive(run: xr.Dataset, ensemble: xr.Dataset | None = None) -> xr.Dataset:
    """Return `derive_arrays` for datasets."""
    return derive_arrays(label_dataset(run), None if ensemble is None else label_dataset(ensemble)).to_xarray()


def derive_arrays(run: LabelledArrays, ensemble: LabelledArrays | None = None) -> LabelledArrays:
    """Return the post artifact of one run (schema POST): rotations, displacements, reactions, impacts, horizon.

    run: artifact of schema RUN.  ensemble: artifact of schema ENSEMBLE; without one the artifact has no ensemble
    variables.  `horizon` is the run's own (its end where it has none), `ensemble_horizon` the ensemble's. Nothing is
    interpolated: series are on the run's own times, ensemble statistics on `ensemble_time`. Raises InputError for the
    results of a run that was stopped.
    """
    require_complete(run)
    arrays: Arrays = {**motion(run), **contacts(run), **impacts(run), **wear(run, parameters(run).get("joint", {}))}
    arrays["reaction"] = reactions(run)
    arrays |= extremes(run, arrays["reaction"])
    used = {dim for name in arrays for dim in POST[name].dims}
    coords: dict[str, object] = {
        name: array for name, array in run.variables.items() if name in run.coords and {*array.dims} <= used
    }
    if ensemble is not None:
        arrays |= ensemble_statistics(ensemble)
        arrays["ensemble_horizon"] = np.array(
            separation_time(
                ensemble["time"].values, ensemble["velocity"].values, float(ensemble["peak_speed"].values.max())
            )
        )
        coords |= {"ensemble_time": ensemble["time"].values, "ensemble_body": ensemble["body"].values}
        coords["quantile"] = np.array(QUANTILES)
    arrays["horizon"] = np.array(float(run["horizon"].values if "horizon" in run else run["time"].values[-1]))
    attributes = {
        "impact_threshold": f"{IMPACT:g} m/s",
        "horizon_criterion": f"members or run and perturbed run differ by {SEPARATED:g} of the motion most of the time",
    }
    attributes["references"] = str(run.attrs.get("references", ""))
    title = f"Derived results: {run.attrs['title']}"
    data = {name: (POST[name].dims, values) for name, values in arrays.items()}
    return conform_arrays(label_arrays(data, coords), POST, title=title, **attributes)


def motion(run: xr.Dataset | LabelledArrays) -> Arrays:
    """Return angle about y, total rotation and displacement of every body."""
    q, position = run["quaternion"].values, run["position"].values
    return {
        "rotation_y": angle_about_y(q),
        "rotation": rotation_between(q[:1], q),
        "displacement": position - position[:1],
    }


def reactions(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Return the magnitude of the force that each joint transmits [N], shape (time, joint).

    For a joint with clearance that is the contact force.
    """
    force: np.ndarray = np.linalg.norm(run["joint_force"].values, axis=-1)
    joints = list(run["joint"].values)
    if "contact_force" in run:
        for k, name in enumerate(run["contact"].values):
            if name in joints:  # the others are ends of stops
                force[:, joints.index(name)] = np.linalg.norm(run["contact_force"].values[:, k], axis=-1)
    return force


def extremes(run: xr.Dataset | LabelledArrays, reaction: np.ndarray) -> Arrays:
    """Return largest magnitudes and their times, of all rows: regular outputs, events, deepest points of contacts.

    reaction: of every joint [N], shape (time, joint).
    """
    series = {"reaction": reaction, "acceleration": np.abs(run["acceleration"].values)}
    if "drive_force" in run:
        series["drive_force"] = np.abs(run["drive_force"].values)
    if "contact_penetration" in run:
        series["penetration"] = run["contact_penetration"].values
        series["force"] = run["contact_normal_force"].values
    arrays: Arrays = {}
    for name, values in series.items():
        arrays[f"peak_{name}"] = values.max(axis=0, initial=0.0)
        arrays[f"peak_{name}_time"] = run["time"].values[index_of_largest(values, axis=0)]
    if "von_mises_stress" in run:
        at = index_of_largest(run["von_mises_stress"].values, axis=0)
        gauges = np.arange(len(at))
        arrays["peak_stress"] = run["von_mises_stress"].values[at, gauges]
        arrays["peak_stress_time"] = run["time"].values[at]
        arrays["peak_stress_position"] = run["stress_position"].values[at, gauges]
    if "event_peak_force" in run:
        arrays["peak_force"] = _peak_force(run)
    return arrays


def contacts(run: xr.Dataset | LabelledArrays) -> Arrays:
    """Return eccentricity, clearance and fraction of time in contact, per contact."""
    if "contact_offset" not in run:
        return {}
    distance = np.linalg.norm(run["contact_offset"].values, axis=-1)
    gap = run["contact_gap"].values
    return {
        "eccentricity": distance,
        # gap = clearance - eccentricity at every time; the median is free of rounding at single times
        "clearance": np.median(gap + distance, axis=0),
        "contact_time_share": _time_share(run),
    }


def _time_share(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Return the fraction of the run that each contact is closed, from its located begins and ends."""
    time, fraction, names = run["time"].values, np.zeros(run.sizes["contact"]), list(run["contact"].values)
    closings = of_kind(run, "closing")
    begun, lasted = run["event_time"].values[closings], run["event_duration"].values[closings]
    lasted = np.where(np.isfinite(lasted), lasted, time[-1] - begun)
    for name, seconds in zip(run["event_contact"].values[closings], lasted, strict=True):
        fraction[names.index(name)] += seconds
    return fraction / (time[-1] - time[0])


def _peak_force(run: xr.Dataset | LabelledArrays) -> np.ndarray:
    """Return the largest normal force: of the outputs and of the peaks that the solver tracked between them."""
    peak: np.ndarray = run["contact_normal_force"].values.max(axis=0)
    for k, name in enumerate(run["contact"].values):
        tracked = run["event_peak_force"].values[run["event_contact"].values == name]
        peak[k] = max(peak[k], np.max(tracked[np.isfinite(tracked)], initial=0.0))
    return peak


def parameters(run: xr.Dataset | LabelledArrays) -> dict:
    """Return the scene's parameters from the run's attributes; empty where the run lacks them."""
    return json.loads(run.attrs.get("parameters", "{}"))


def impacts(run: xr.Dataset | LabelledArrays) -> Arrays:
    """Return variables ``impact_*`` of the post artifact; empty for a run without contacts.

    Impacts are the closings with an approach speed above IMPACT; the separation speed is that of the next opening of
    the same contact.  Separation speed, duration, impulse and losses are NaN for an impact that the run's end cuts
    short.
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
        "impact_time": begun,
        "impact_contact": contact[strong],
        "impact_approach_speed": speed[strong],
        "impact_separation_speed": np.where(ended, speed[opens], np.nan),
        "impact_peak_force": run["event_peak_force"].values[strong],
        "impact_duration": np.where(ended, run["event_time"].values[opens] - begun, np.nan),
        "impact_count": np.array([np.count_nonzero(contact[strong] == name) for name in names], dtype=np.int64),
        **_impulses_and_losses(run, contact[strong], begun, np.where(ended, run["event_time"].values[opens], np.nan)),
    }


#: contact integrals of the run's energy ledger, by the variable of an impact's part of them
BOOKS = {
    "impact_impulse": "contact_impulse",
    "impact_damping_loss": "contact_damping_loss",
    "impact_friction_loss": "contact_friction_loss",
}


def _impulses_and_losses(
    run: xr.Dataset | LabelledArrays, contact: np.ndarray, begun: np.ndarray, ended: np.ndarray
) -> Arrays:
    """Return impulse and losses of each impact, NaN where it has not ended; the run has rows at all events."""
    time, booked = run["time"].values, Arrays()
    for name, book in BOOKS.items():
        if book in run:
            values, fractions = run[book].values, np.full(len(contact), np.nan)
            names = list(run["contact"].values)
            for i, c in enumerate(names.index(name) for name in contact):
                fractions[i] = np.interp(ended[i], time, values[:, c]) - np.interp(begun[i], time, values[:, c])
            booked[name] = fractions
    return booked


def of_kind(run: xr.Dataset | LabelledArrays, name: str) -> np.ndarray:
    """Return True for the events of a kind, e.g. those that close a gap, shape (event,)."""
    return np.asarray(run["event_kind"].values == name, dtype=bool)


def _next_opening(i: int, contact: np.ndarray, openings: np.ndarray) -> int:
    """Return the index of the first opening of the same contact after event i, or -1."""
    later = np.flatnonzero((contact[i + 1 :] == contact[i]) & openings[i + 1 :])
    return int(i + 1 + later[0]) if later.size else -1


#: steps of the path between two rows, each of which goes to one sector; bands of a sphere, of equal area
PIECES, BANDS = 16, 18
SURFACES = ("outer", "inner")


def wear(run: xr.Dataset | LabelledArrays, joints: dict[str, Any]) -> Arrays:
    """Return variables ``wear_*`` of the post artifact; empty without wear.

    joints: parameters of the scene's joints.  Depths are those that a surface alone would have; both share the volume.
    """
    if "wear_load_path" not in run:
        return {}
    names = [str(name) for name in run["worn"].values]
    laws = [joints[name]["wear"] for name in names]
    sectors = max(int(law["sectors"]) for law in laws)
    bands = BANDS if any("ball_radius" in joints[name] for name in names) else 1
    shape = (len(names), bands, sectors)
    maps = {f"wear_{what}_{side}": np.zeros(shape) for what in ("depth", "impulse") for side in SURFACES}
    path, sliding = run["wear_load_path"].values, run["wear_sliding_distance"].values
    contacts = run["contact"].values.tolist()
    impulse = run["contact_impulse"].values[:, [contacts.index(name) for name in names]]
    volume = np.zeros(len(names))
    for k, (name, law) in enumerate(zip(names, laws, strict=True)):
        per_path, own = law["coefficient"] / law["hardness"], int(law["sectors"])
        rows = BANDS if "ball_radius" in joints[name] else 1
        volume[k] = per_path * (path[-1, k] - path[0, k])
        for side in SURFACES:
            direction = run[f"wear_direction_{side}"].values[:, k]
            area = surface_area(joints[name], side) / (own * rows)
            fractions = spread_over_surface(direction, np.stack([path[:, k], impulse[:, k]], axis=1), own, rows)
            maps[f"wear_depth_{side}"][k, :rows, :own] = per_path * fractions[..., 0] / area
            maps[f"wear_impulse_{side}"][k, :rows, :own] = fractions[..., 1]
    totals: Arrays = {
        "wear_volume": volume,
        "wear_distance": sliding[-1] - sliding[0],
        "wear_sectors": np.array([int(law["sectors"]) for law in laws], dtype=np.int32),
    }
    for side in SURFACES:
        totals[f"wear_deepest_{side}"] = maps[f"wear_depth_{side}"].reshape(len(names), -1).max(axis=1)
    return totals | maps


def surface_area(joint: dict[str, Any], side: str) -> float:
    """Return the area of a surface [m^2]; half a sphere is not distinguished from a whole one."""
    widened = float(joint["clearance"]) if side == "outer" else 0.0
    if "ball_radius" in joint:
        return float(4.0 * np.pi * (joint["ball_radius"] + widened) ** 2)
    return float(2.0 * np.pi * (joint["pin_radius"] + widened) * joint["length"])


def spread_over_surface(direction: np.ndarray, totals: np.ndarray, sectors: int, bands: int) -> np.ndarray:
    """Distribute increments of totals (time, what) over sectors passed by a direction (time, 3), (band, sector, what).

    Sector s holds angles about z from x on, s to s + 1 times 2 pi/sectors; band b z-components from -1 on.
    """
    distributed = np.zeros((bands, sectors, totals.shape[1]))
    growth, fraction = np.diff(totals, axis=0), (np.arange(PIECES) + 0.5) / PIECES
    grown = np.flatnonzero(np.any(growth != 0.0, axis=1))
    start, end = direction[grown], direction[grown + 1]
    # before a contact begins, or after it has ended, the centres may have been anywhere
    start = np.where(np.any(start != 0.0, axis=1, keepdims=True), start, end)
    between = start[:, None] + fraction[None, :, None] * (end - start)[:, None]
    angle = np.arctan2(between[..., 1], between[..., 0]) % (2.0 * np.pi)
    sector = np.minimum((angle / (2.0 * np.pi) * sectors).astype(int), sectors - 1)
    size = np.linalg.norm(between, axis=-1)
    height = np.divide(between[..., 2], size, out=np.zeros_like(size), where=size > 0.0)
    band = np.minimum(((height + 1.0) / 2.0 * bands).astype(int), bands - 1)
    for what in range(totals.shape[1]):
        values = np.repeat(growth[grown, what] / PIECES, PIECES)
        np.add.at(distributed[..., what], (band.ravel(), sector.ravel()), values)
    return distributed


#: fractions of the members below the recorded quantiles: few, the middle and the bulk
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def member_spread(velocity: np.ndarray) -> np.ndarray:
    """Return the largest distance of a member's velocity from the mean [m/s], over members and bodies, shape (time,).

    velocity: shape (member, time, body, axis) [m/s].
    """
    return np.linalg.norm(velocity - velocity.mean(axis=0), axis=-1).max(axis=(0, 2))


def separation_time(time: np.ndarray, velocity: np.ndarray, speed: float = 0.0) -> float:
    """Return the time from which members are separated, by `member_spread` over the top speed; else the last time [s].

    speed: the largest one between the given times [m/s].  Beyond the horizon two runs that differ by a perturbation far
    below any tolerance differ visibly, so a pointwise value is one draw out of many.
    """
    peak = max(float(np.linalg.norm(velocity, axis=-1).max()), speed)
    first = index_of_separation(time, member_spread(velocity) / (peak or 1.0), float(time[-1] - time[0]))
    return float(time[-1] if first is None else time[first])


def horizon_sentence(horizon: float, end: float, members: float | None = None) -> str:
    """Return a statement on a run's predictability horizon [s]; end: of the run [s].

    members: horizon of its ensemble [s], which may start further from the run than the perturbed run does.
    """
    neighbour = f"A run whose contacts start {100.0 * PERTURBATION:g} % of their clearance elsewhere"
    difference = f"{100.0 * SEPARATED:g} % of each body's largest motion"
    if horizon >= end:
        text = f"{neighbour} stays close to this one: they differ by more than {difference} for moments at most."
    else:
        whole = f"the run lasts {1e3 * end:.4g} ms"
        text = f"{neighbour} differs by more than {difference} from {1e3 * horizon:.4g} ms on ({whole})."
    if members is None or members >= end:
        return text
    return f"{text} The members of its ensemble differ by {100.0 * SEPARATED:g} % from {1e3 * members:.4g} ms on."


def ensemble_statistics(ensemble: xr.Dataset | LabelledArrays) -> Arrays:
    """Return mean, standard deviation (``ddof = 1``) and QUANTILES over the members, on the ensemble's own times.

    Quantiles are interpolated between members (numpy's default); of an angle, a vector's components, a contact.
    """
    position, same = ensemble["position"].values, ("velocity", "acceleration", "peak_force", "contact_time_share")
    members = {
        "rotation_y": angle_about_y(ensemble["quaternion"].values),
        "displacement": position - position[:, :1],
        "normal_force": ensemble["contact_normal_force"].values,
        "impact_count": ensemble["impact_count"].values.astype(float),
        **{name: ensemble[name].values for name in (*same, "peak_acceleration")},
    }
    result: Arrays = {"spread": member_spread(ensemble["velocity"].values)}
    for name, values in members.items():
        result[f"{name}_mean"] = values.mean(axis=0)
        result[f"{name}_std"] = values.std(axis=0, ddof=1)
        result[f"{name}_quantile"] = np.quantile(values, QUANTILES, axis=0)
    return result


#: variables of an ensemble with mean, standard deviation and quantiles over its members
_OF_MEMBERS = table("""
rotation_y? | ensemble_time ensemble_body | rad | rotation y
displacement? | ensemble_time ensemble_body axis | m | displacement
velocity? | ensemble_time ensemble_body axis | m s-1 | velocity
acceleration? | ensemble_time ensemble_body axis | m s-2 | acceleration
normal_force? | ensemble_time contact | N, N m | normal force
impact_count? | contact | 1 | impact count
peak_force? | contact | N, N m | peak force
contact_time_share? | contact | 1 | contact time share
peak_acceleration? | ensemble_body axis | m s-2 | peak acceleration
""")

#: stage 5: series and tables of one run, and of its ensemble where the scene has one
POST: Schema = table(f"""
rotation_y | time body | rad | angle about the world's y axis, asin(R_WB[0, 2])
rotation | time body | rad | total rotation from the first pose
displacement | time body axis | m | centre of mass, minus its first position, world axes
reaction | time joint | N | magnitude of the joint force; of the contact force where the joint has clearance
peak_reaction | joint | N | largest reaction, of outputs and events
peak_reaction_time | joint | s | time of the largest reaction
peak_acceleration | body axis | m s-2 | largest magnitude of each component of the acceleration, of outputs and events
peak_acceleration_time | body axis | s | time of that magnitude
peak_drive_force? | drive | N, N m | largest magnitude of the drive's force or torque
peak_drive_force_time? | drive | s | time of that magnitude
peak_stress? | gauge | Pa | largest von Mises stress of the gauge
peak_stress_time? | gauge | s | time of that stress
peak_stress_position? | gauge axis | m | undeformed position of that stress, body frame; of a rod its section's
eccentricity? | time contact | m, rad | distance of ball and socket centres
clearance? | contact | m, rad | radial clearance; of a plane without meaning
impact_time? | impact | s | time of a closing above the impact threshold
impact_contact? | impact | | name of the contact
impact_approach_speed? | impact | m s-1, rad s-1 | rate of penetration at the closing
impact_separation_speed? | impact | m s-1, rad s-1 | rate of separation at the opening that follows
impact_peak_force? | impact | N, N m | largest normal force of the contact
impact_duration? | impact | s | duration of the contact
impact_count? | contact | 1 | closings above the impact threshold, ended or not
impact_impulse? | impact | N s, N m s | impulse of the normal force in the contact
impact_damping_loss? | impact | J | energy lost to the contact's damping in it
impact_friction_loss? | impact | J | energy lost to the contact's friction in it
peak_force? | contact | N, N m | largest normal contact force of the run
peak_force_time? | contact | s | time of that force
peak_penetration? | contact | m, rad | largest penetration of the run
peak_penetration_time? | contact | s | time of that penetration
wear_volume? | worn | m3 | volume that the contact has worn, of both surfaces together
wear_distance? | worn | m | sliding distance of the contact
wear_sectors? | worn | 1 | sectors in use, around z of the frames
wear_depth_outer? | worn band sector | m | depth if all wear were on the socket or journal, by sector
wear_impulse_outer? | worn band sector | N s | impulse on the socket or journal, by sector
wear_depth_inner? | worn band sector | m | depth if all wear were on the ball or pin, by sector
wear_impulse_inner? | worn band sector | N s | impulse on the ball or pin, by sector
wear_deepest_outer? | worn | m | largest of these depths on the socket or journal
wear_deepest_inner? | worn | m | largest of these depths on the ball or pin
contact_time_share? | contact | 1 | fraction of the run spent in contact
horizon | | s | {RUN["horizon"].long_name}
ensemble_horizon? | | s | where the members of the ensemble part
spread? | ensemble_time | m s-1 | largest distance of a member's velocity from the mean
""")
for _name, _one in _OF_MEMBERS.items():
    POST |= {
        f"{_name}_mean": replace(_one, long_name=f"ensemble mean of the {_one.long_name}"),
        f"{_name}_std": replace(_one, long_name=f"ensemble standard deviation of the {_one.long_name}"),
        f"{_name}_quantile": replace(
            _one, dims=("quantile", *_one.dims), long_name=f"quantiles of the {_one.long_name} over the members"
        ),
    }
