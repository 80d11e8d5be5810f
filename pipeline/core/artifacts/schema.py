"""The contract of the artifacts: dimensions, units and meaning of every variable.

The three towers never import each other; whoever writes a dataset calls `conform`, whoever
reads one may rely on this page.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flexclear.pipeline.core.artifacts.body_schema import BUNDLE, DEFICITS, MATRICES, MESH, MODES, RIGID, SOLID, STRESS
from flexclear.pipeline.core.artifacts.coordinates import AXES, COORDINATES, QUATERNION, turning, with_names
from flexclear.pipeline.core.artifacts.event_kinds import EVENT_KINDS
from flexclear.pipeline.core.artifacts.labelled import LabelledArray, LabelledArrays, of
from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.scene.output import VARIABLES
from flexclear.pipeline.core.variable import Schema, Variable
from flexclear.pipeline.core.version import DISTRIBUTION, version

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "AXES",
    "BUNDLE",
    "DEFICITS",
    "ENSEMBLE",
    "MATRICES",
    "MESH",
    "MODES",
    "QUATERNION",
    "RIGID",
    "RUN",
    "SOLID",
    "STRESS",
    "Schema",
    "Variable",
    "conform",
    "conformed",
    "incomplete",
    "require_complete",
]

CONVENTIONS = "CF-1.11"
AnyRun = TypeVar("AnyRun", "xr.Dataset", LabelledArrays)
_V = Variable

#: stage 4: one run
RUN: Schema = {
    "position": _V(("time", "body", "axis"), "m", "centre of mass, world axes"),
    "quaternion": _V(("time", "body", "quat"), "1", "unit quaternion, body to world"),
    "velocity": _V(("time", "body", "axis"), "m s-1", "velocity of the centre of mass, world axes"),
    "angular_velocity": _V(("time", "body", "axis"), "rad s-1", "angular velocity, world axes"),
    "acceleration": _V(("time", "body", "axis"), "m s-2", "acceleration of the centre of mass, world axes"),
    "angular_acceleration": _V(("time", "body", "axis"), "rad s-2", "angular acceleration, world axes"),
    "frame_position": _V(("time", "frame", "axis"), "m", "origin of the named frame, world axes"),
    "joint_force": _V(
        ("time", "joint", "axis"), "N", "force on the joint's second body at its frame's origin, world axes"
    ),
    "joint_moment": _V(
        ("time", "joint", "axis"), "N m", "moment on the joint's second body at its frame's origin, world axes"
    ),
    "joint_bearing_load": _V(
        ("time", "rubbing"), "N", "normal force in the bearings of a joint with friction", optional=True
    ),
    "joint_sliding_speed": _V(("time", "rubbing"), "m s-1", "sliding speed there, the largest", optional=True),
    "joint_friction_power": _V(("time", "rubbing"), "W", "power of the joint's friction, <= 0", optional=True),
    "joint_friction_loss": _V(
        ("time", "rubbing"), "J", "energy lost to the friction of the joint since the start", optional=True
    ),
    "joint_friction_force": _V(
        ("time", "rubbing", "axis"), "N", "friction's part of joint_force, world axes", optional=True
    ),
    "joint_friction_moment": _V(
        ("time", "rubbing", "axis"), "N m", "friction's part of joint_moment, world axes", optional=True
    ),
    "modal_coordinate": _V(("time", "mode"), "m", "modal coordinate, for a modal mass of 1 kg", optional=True),
    "modal_velocity": _V(("time", "mode"), "m s-1", "rate of the modal coordinate", optional=True),
    "drive_force": _V(
        ("time", "drive"), "N", "what the drive supplies along its coordinate", optional=True, turning="N m"
    ),
    "drive_position": _V(("time", "drive"), "m", "prescribed coordinate", optional=True, turning="rad"),
    "joint_position": _V(
        ("time", "coordinate"),
        "m",
        "joint coordinate of the second frame against the first",
        optional=True,
        turning="rad",
    ),
    "joint_velocity": _V(
        ("time", "coordinate"), "m s-1", "rate of the joint coordinate", optional=True, turning="rad s-1"
    ),
    "joint_acceleration": _V(
        ("time", "coordinate"), "m s-2", "second rate of the joint coordinate", optional=True, turning="rad s-2"
    ),
    "load_force": _V(
        ("time", "load", "axis"), "N", "force of the load on its frame, or its second one, world axes", optional=True
    ),
    "load_moment": _V(
        ("time", "load", "axis"),
        "N m",
        "moment of the load there, about that frame's origin, world axes",
        optional=True,
    ),
    "load_length": _V(
        ("time", "load"),
        "m",
        "length of a spring, or joint coordinate that a load acts along",
        optional=True,
        turning="rad",
    ),
    "bushing_displacement": _V(
        ("time", "bushing", "axis"), "m", "second frame's origin in the first one's axes", optional=True
    ),
    "bushing_rotation": _V(
        ("time", "bushing", "axis"), "rad", "rotation vector from the first frame to the second", optional=True
    ),
    "load_power": _V(
        ("time", "load"), "W", "power of the load on the mechanism, stored energy included", optional=True
    ),
    "controller_force": _V(
        ("time", "controller"),
        "N",
        "force of the controller along the coordinate it pushes",
        optional=True,
        turning="N m",
    ),
    "controller_integral": _V(("time", "controller"), "N", "integral part of that force", optional=True, turning="N m"),
    "gear_force": _V(
        ("time", "gear"),
        "N",
        "force of the gear along its second coordinate, on its second body",
        optional=True,
        turning="N m",
    ),
    "contact_gap": _V(
        ("time", "contact"), "m", "clearance minus eccentricity; negative in contact", optional=True, turning="rad"
    ),
    "contact_penetration": _V(("time", "contact"), "m", "max(0, -gap)", optional=True, turning="rad"),
    "contact_rate": _V(("time", "contact"), "m s-1", "rate of penetration", optional=True, turning="rad s-1"),
    "contact_force": _V(
        ("time", "contact", "axis"), "N", "contact force on the ball, world axes", optional=True, turning="N m"
    ),
    "contact_normal_force": _V(("time", "contact"), "N", "normal contact force, >= 0", optional=True, turning="N m"),
    "contact_friction_power": _V(("time", "contact"), "W", "minus the power that friction takes, <= 0", optional=True),
    "contact_sliding_speed": _V(
        ("time", "contact"), "m s-1", "sliding speed at the contact; 0 without friction or contact", optional=True
    ),
    "contact_elastic": _V(("time", "contact"), "J", "energy stored in the contact and its bristles", optional=True),
    "contact_damping_loss": _V(
        ("time", "contact"), "J", "energy lost to the normal damping of the contact since the start", optional=True
    ),
    "contact_impulse": _V(
        ("time", "contact"), "N s", "impulse of the normal force since the start", optional=True, turning="N m s"
    ),
    "contact_friction_loss": _V(
        ("time", "contact"), "J", "energy lost to the friction of the contact since the start", optional=True
    ),
    "contact_delivered_restitution": _V(
        ("contact",), "1", "rebound over approach speed that the contact's law gives a free impact", optional=True
    ),
    "wear_sliding_distance": _V(
        ("time", "worn"), "m", "distance that the surfaces in contact have slid on each other", optional=True
    ),
    "wear_load_path": _V(
        ("time", "worn"), "N m", "time integral of normal force times sliding speed since the start", optional=True
    ),
    "wear_direction_outer": _V(
        ("time", "worn", "axis"), "1", "direction from the socket's centre to the contact, socket axes", optional=True
    ),
    "wear_direction_inner": _V(
        ("time", "worn", "axis"),
        "1",
        "direction from the centre of ball or pin to the contact, its axes",
        optional=True,
    ),
    "load_loss": _V(("time",), "J", "energy lost to the loads since the start", optional=True),
    "modal_damping_loss": _V(("time",), "J", "energy lost to modal damping since the start", optional=True),
    "contact_offset": _V(
        ("time", "contact", "axis"),
        "m",
        "ball centre relative to the socket centre, socket axes",
        optional=True,
        turning="rad",
    ),
    "kinetic": _V(("time",), "J", "kinetic energy"),
    "potential": _V(("time",), "J", "potential energy of the loads"),
    "elastic": _V(("time",), "J", "energy stored in flexible bodies, springs and contacts"),
    "dissipated": _V(("time",), "J", "energy dissipated since the start"),
    "drive_work": _V(("time",), "J", "work supplied by the drives since the start"),
    "load_work": _V(("time",), "J", "work of forces and torques since the start", optional=True),
    "energy_error": _V(
        ("time",), "J", "kinetic + potential + elastic + dissipated - drive_work - load_work, minus its start value"
    ),
    "constraint_error": _V(("time",), "m", "largest violation of a loop closure, redundant rows included"),
    "mobility": _V(("time",), "1", "degrees of freedom, prescribed ones not counted", optional=True),
    "rank": _V(("time",), "1", "independent rows of the loop closures", optional=True),
    "condition": _V(
        ("time",), "1", "condition number of the independent closure rows, lengths in units of 0.1 m", optional=True
    ),
    "reaction_redundant": _V(
        ("joint",), "1", "1 where rigid bodies leave the joint's reaction undetermined", optional=True
    ),
    "pass_time": _V(("singular_pass",), "s", "time of a pass through a singular pose", optional=True),
    "pass_condition": _V(("singular_pass",), "1", "condition number where the pass was located", optional=True),
    "pass_rank_loss": _V(("singular_pass",), "1", "closure rows that depend on others in that pose", optional=True),
    "horizon": _V((), "s", "predictability horizon: time up to which pointwise values mean something", optional=True),
    "separation": _V(
        ("separation_time",),
        "1",
        "largest separation of a body from the same run started `separation_perturbation` of the clearance away, in "
        "the norm of the kinetic energy, as a fraction of its largest motion",
        optional=True,
    ),
    "event_time": _V(("event",), "s", "time of the event", optional=True),
    "event_contact": _V(("event",), "", "name of the contact", optional=True),
    "event_kind": _V(("event",), "", f"one of {', '.join(EVENT_KINDS)}", optional=True),
    "event_approach_speed": _V(
        ("event",),
        "m s-1",
        "rate of penetration at a closing, minus it at an opening, 0 at compression",
        optional=True,
        turning="rad s-1",
    ),
    "event_peak_force": _V(
        ("event",), "N", "largest normal force of the contact that this closing begins", optional=True, turning="N m"
    ),
    "event_peak_penetration": _V(("event",), "m", "largest penetration of that contact", optional=True, turning="rad"),
    "event_duration": _V(("event",), "s", "duration of that contact", optional=True),
    **{name: variable for requested in VARIABLES.values() for name, variable in requested.items()},
}


#: stage 4, for scenes with an ensemble: members on the regular output times
ENSEMBLE: Schema = {
    "position": _V(("member", "time", "body", "axis"), "m", "centre of mass, world axes"),
    "quaternion": _V(("member", "time", "body", "quat"), "1", "unit quaternion, body to world"),
    "velocity": _V(("member", "time", "body", "axis"), "m s-1", "velocity of the centre of mass, world axes"),
    "angular_velocity": _V(("member", "time", "body", "axis"), "rad s-1", "angular velocity, world axes"),
    "acceleration": _V(("member", "time", "body", "axis"), "m s-2", "acceleration of the centre of mass, world axes"),
    "contact_normal_force": _V(("member", "time", "contact"), "N", "normal contact force, >= 0", turning="N m"),
    "contact_offset": _V(
        ("member", "time", "contact", "axis"),
        "m",
        "ball centre relative to the socket centre, socket axes",
        turning="rad",
    ),
    "impact_count": _V(("member", "contact"), "1", "closings with approach above 1e-4 m/s"),
    "peak_force": _V(("member", "contact"), "N", "largest normal contact force of the run", turning="N m"),
    "peak_acceleration": _V(
        ("member", "body", "axis"), "m s-2", "largest magnitude of each component, of outputs and events"
    ),
    "contact_time_share": _V(("member", "contact"), "1", "fraction of the run spent in contact"),
}

_OF_SECTION = {
    name: _V(("section", *ENSEMBLE[name].dims[2:]), ENSEMBLE[name].units, ENSEMBLE[name].long_name)
    for name in ("position", "quaternion", "velocity", "angular_velocity", "acceleration")
}
#: sections of a periodic motion: the state once in each period, and the impacts of all recorded periods
SECTIONS: Schema = _OF_SECTION | {
    "orbit_position": _V(("waypoint", "body", "axis"), "m", "centre of mass at waypoints of the last period"),
    "orbit_quaternion": _V(("waypoint", "body", "quat"), "1", "unit quaternion at waypoints of the last period"),
    "orbit_velocity": _V(("waypoint", "body", "axis"), "m s-1", "velocity at waypoints of the last period"),
    "orbit_contact_offset": _V(
        ("waypoint", "contact", "axis"),
        "m",
        "ball centre relative to the socket centre there",
        optional=True,
        turning="rad",
    ),
    "contact_offset": _V(
        ("section", "contact", "axis"),
        "m",
        "ball centre relative to the socket centre, socket axes",
        optional=True,
        turning="rad",
    ),
    "growth": _V(("followed",), "1", "logarithm of how a neighbour's distance grew in the period"),
    "impact_section": _V(("impact",), "1", "number of the period in which the impact began", optional=True),
    "impact_contact": _V(("impact",), "", "name of the contact", optional=True),
    "impact_phase": _V(("impact",), "s", "time of the closing since the period began", optional=True),
    "impact_approach_speed": _V(
        ("impact",), "m s-1", "rate of penetration at the closing", optional=True, turning="rad s-1"
    ),
    "impact_peak_force": _V(
        ("impact",), "N", "largest normal force of the contact that it begins", optional=True, turning="N m"
    ),
    "impact_duration": _V(("impact",), "s", "duration of that contact", optional=True),
    "impact_position": _V(("impact", "body", "axis"), "m", "centre of mass at the closing, world axes", optional=True),
    "impact_quaternion": _V(("impact", "body", "quat"), "1", "unit quaternion at the closing", optional=True),
    "impact_velocity": _V(
        ("impact", "body", "axis"), "m s-1", "velocity of the centre of mass at the closing", optional=True
    ),
}

_STILL = """position quaternion frame_position joint_force joint_moment joint_position modal_coordinate
drive_force drive_position load_force load_moment load_length contact_gap contact_penetration contact_force
contact_normal_force contact_offset potential elastic"""
#: static equilibrium, or steady motion: what a run says at one instant
EQUILIBRIUM: Schema = {name: replace(RUN[name], dims=RUN[name].dims[1:]) for name in _STILL.split()}

#: natural vibrations about it; shapes per unit of a coordinate with a modal mass of 1 kg, parts real and imaginary
LINEAR: Schema = EQUILIBRIUM | {
    "frequency": _V(("vibration",), "Hz", "frequency of the vibration, damping included"),
    "undamped_frequency": _V(("vibration",), "Hz", "magnitude of the eigenvalue over 2 pi"),
    "decay_rate": _V(("vibration",), "s-1", "rate at which the vibration decays; negative when it grows"),
    "damping_ratio": _V(("vibration",), "1", "decay rate over the magnitude of the eigenvalue"),
    "dominant": _V(("vibration",), "", "body with the largest fraction of the kinetic energy"),
    "energy_share": _V(("vibration", "moving_body"), "1", "fraction of the body in the kinetic energy"),
    "frame_translation": _V(("vibration", "part", "frame", "axis"), "1", "displacement of the named frame, world axes"),
    "frame_rotation": _V(
        ("vibration", "part", "frame", "axis"), "rad m-1", "rotation vector of the named frame, world axes"
    ),
    "modal_shape": _V(("vibration", "part", "mode"), "1", "modal coordinates of the flexible bodies", optional=True),
}

#: Campbell diagram: vibrations about steady motion over the speed of a drive
CAMPBELL: Schema = {
    "frequency": _V(
        ("speed", "branch"), "Hz", "frequency of the vibration in the axes of the mechanism, which turn", gaps=True
    ),
    "whirl_frequency": _V(
        ("speed", "branch"),
        "Hz",
        "frequency in fixed axes, negative for backward whirls; NaN for what does not whirl",
        gaps=True,
    ),
    "decay_rate": _V(
        ("speed", "branch"), "s-1", "rate at which the vibration decays; negative when it grows", gaps=True
    ),
    "growth": _V(
        ("speed",),
        "s-1",
        "largest rate at which a small motion grows; 0 where stable, NaN without steady motion",
        gaps=True,
    ),
    "whirl": _V(("branch",), "", "forward or backward; empty for what does not whirl"),
    "dominant": _V(("branch",), "", "body with the largest share of the kinetic energy at most speeds"),
    "critical_speed": _V(
        ("branch",), "rad s-1", "lowest speed at which the whirl is as fast as the turning, or NaN", gaps=True
    ),
    "frame_position": _V(
        ("speed", "frame", "axis"), "m", "origin of the named frame in steady motion, world axes", gaps=True
    ),
}


#: variables that say what the entries of their dimension are, where their schema has them
_NAMING = ("event_time", "event_contact", "event_kind", "impact_time", "impact_contact")
#: what the run's end cuts short has no duration
_MAY_BE_OPEN = ("event_", "impact_")


def conform(dataset: xr.Dataset, schema: Schema, *, title: str, **attributes: str | int | float) -> xr.Dataset:
    """What `conformed` gives, of a dataset."""
    return conformed(of(dataset), schema, title=title, **attributes).to_xarray()


def conformed(data: LabelledArrays, schema: Schema, *, title: str, **attributes: str | int | float) -> LabelledArrays:
    """`data` with units, long names and coordinates of `schema`; ValueError where it differs.

    Every mandatory variable must be there with its dimensions; nothing undeclared may be. The attribute `units` is that
    of all entries; where some slide and others turn, the coordinate `<variable>_units` has the one of each instead.
    title: of the dataset, in words.
    """
    missing = [n for n, v in schema.items() if not v.optional and n not in data]
    unknown = [n for n in data if n not in schema]
    unknown += sorted(n for n in data.coords if n not in schema and n not in COORDINATES and not _is_unit(n))
    if missing or unknown:
        raise ValueError(f"artifact lacks {missing} and has undeclared {unknown}")
    data = with_names(data)
    variables, units_of = dict(data.variables), dict[str, LabelledArray]()
    for name, array in data.variables.items():
        if _is_unit(name):
            continue
        variable = schema.get(name) or COORDINATES[name]
        if array.dims != variable.dims:
            raise ValueError(f"{name} has dimensions {array.dims}, not {variable.dims}")
        may_lack = variable.gaps or name.startswith(_MAY_BE_OPEN)
        if array.values.dtype.kind == "f" and not may_lack and not np.isfinite(array.values).all():
            raise ValueError(f"{name} holds values that are not finite")
        units, mixed = _units(data, name, variable)
        described = ({"units": units} if units else {}) | {"long_name": variable.long_name}
        variables[name] = replace(array, attrs=described)
        if mixed is not None:
            units_of[f"{name}_units"] = mixed
    made = {"Conventions": CONVENTIONS, "title": title, "source": f"{DISTRIBUTION} {version()}"}
    coords = data.coords | units_of.keys() | (set(_NAMING) & variables.keys())
    return LabelledArrays(variables | units_of, frozenset(coords), made | attributes)


def _is_unit(name: str) -> bool:
    return name.endswith("_units")


def _units(data: LabelledArrays, name: str, variable: Variable) -> tuple[str, LabelledArray | None]:
    """The unit of all entries, or none and the unit of each."""
    if not variable.turning:
        return variable.units, None
    dim, turns = turning(data, variable.dims)
    if not turns.any():
        return variable.units, None
    if turns.all():
        return variable.turning, None
    each, words = np.where(turns, variable.turning, variable.units), {"long_name": f"units of {name}"}
    return "", LabelledArray((dim,), each, words)


def incomplete(run: AnyRun, why: str) -> AnyRun:
    """What there is of a run that was stopped, marked: attributes `complete` (0), `stopped_at` [s] and `stopped_by`."""
    return run.assign_attrs(complete=0, stopped_at=float(run["time"].values[-1]), stopped_by=why)


def require_complete(run: xr.Dataset | LabelledArrays, what: str = "the run") -> None:
    """InputError for what is left of a run that was stopped, which is no result."""
    if not run.attrs.get("complete", 1):
        raise InputError(
            what,
            f"it is not complete: it was stopped at t = {run.attrs.get('stopped_at', float('nan')):.6g} s "
            f"({run.attrs.get('stopped_by', 'nobody knows why')})",
            "run the scene again, which continues from there",
        )
