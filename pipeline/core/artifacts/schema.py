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
from flexclear.pipeline.core.artifacts.labelled import LabelledArray, LabelledArrays, of
from flexclear.pipeline.core.scene.run_schema import RUN
from flexclear.pipeline.core.scene.variable import Schema, Variable, table
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.version import DISTRIBUTION, version

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

#: stage 4, for scenes with an ensemble: members on the regular output times
ENSEMBLE: Schema = table("""
position | member time body axis | m | centre of mass, world axes
quaternion | member time body quat | 1 | unit quaternion, body to world
velocity | member time body axis | m s-1 | velocity of the centre of mass, world axes
angular_velocity | member time body axis | rad s-1 | angular velocity, world axes
acceleration | member time body axis | m s-2 | acceleration of the centre of mass, world axes
contact_normal_force | member time contact | N, N m | normal contact force, >= 0
contact_offset | member time contact axis | m, rad | ball centre relative to the socket centre, socket axes
impact_count | member contact | 1 | closings with approach above 1e-4 m/s
peak_force | member contact | N, N m | largest normal contact force of the run
peak_acceleration | member body axis | m s-2 | largest magnitude of each component, of outputs and events
contact_time_share | member contact | 1 | fraction of the run spent in contact
""")

_OF_SECTION = {
    name: replace(ENSEMBLE[name], dims=("section", *ENSEMBLE[name].dims[2:]))
    for name in ("position", "quaternion", "velocity", "angular_velocity", "acceleration")
}
#: sections of a periodic motion: the state once in each period, and the impacts of all recorded periods
SECTIONS: Schema = _OF_SECTION | table("""
orbit_position | waypoint body axis | m | centre of mass at waypoints of the last period
orbit_quaternion | waypoint body quat | 1 | unit quaternion at waypoints of the last period
orbit_velocity | waypoint body axis | m s-1 | velocity at waypoints of the last period
orbit_contact_offset? | waypoint contact axis | m, rad | ball centre relative to the socket centre there
contact_offset? | section contact axis | m, rad | ball centre relative to the socket centre, socket axes
growth | followed | 1 | logarithm of how a neighbour's distance grew in the period
impact_section? | impact | 1 | number of the period in which the impact began
impact_contact? | impact | | name of the contact
impact_phase? | impact | s | time of the closing since the period began
impact_approach_speed? | impact | m s-1, rad s-1 | rate of penetration at the closing
impact_peak_force? | impact | N, N m | largest normal force of the contact that it begins
impact_duration? | impact | s | duration of that contact
impact_position? | impact body axis | m | centre of mass at the closing, world axes
impact_quaternion? | impact body quat | 1 | unit quaternion at the closing
impact_velocity? | impact body axis | m s-1 | velocity of the centre of mass at the closing
""")

_STILL = """position quaternion frame_position joint_force joint_moment joint_position modal_coordinate
drive_force drive_position load_force load_moment load_length contact_gap contact_penetration contact_force
contact_normal_force contact_offset potential elastic"""
#: static equilibrium, or steady motion: what a run says at one instant
EQUILIBRIUM: Schema = {name: replace(RUN[name], dims=RUN[name].dims[1:]) for name in _STILL.split()}

#: natural vibrations about it; shapes per unit of a coordinate with a modal mass of 1 kg, parts real and imaginary
LINEAR: Schema = EQUILIBRIUM | table("""
frequency | vibration | Hz | frequency of the vibration, damping included
undamped_frequency | vibration | Hz | magnitude of the eigenvalue over 2 pi
decay_rate | vibration | s-1 | rate at which the vibration decays; negative when it grows
damping_ratio | vibration | 1 | decay rate over the magnitude of the eigenvalue
dominant | vibration | | body with the largest fraction of the kinetic energy
energy_share | vibration moving_body | 1 | fraction of the body in the kinetic energy
frame_translation | vibration part frame axis | 1 | displacement of the named frame, world axes
frame_rotation | vibration part frame axis | rad m-1 | rotation vector of the named frame, world axes
modal_shape? | vibration part mode | 1 | modal coordinates of the flexible bodies
""")

#: Campbell diagram: vibrations about steady motion over the speed of a drive
CAMPBELL: Schema = table("""
frequency~ | speed branch | Hz | frequency of the vibration in the axes of the mechanism, which turn
whirl_frequency~ | speed branch | Hz | frequency in fixed axes, negative for backward whirls; NaN for what does not
    whirl
decay_rate~ | speed branch | s-1 | rate at which the vibration decays; negative when it grows
growth~ | speed | s-1 | largest rate at which a small motion grows; 0 where stable, NaN without steady motion
whirl | branch | | forward or backward; empty for what does not whirl
dominant | branch | | body with the largest share of the kinetic energy at most speeds
critical_speed~ | branch | rad s-1 | lowest speed at which the whirl is as fast as the turning, or NaN
frame_position~ | speed frame axis | m | origin of the named frame in steady motion, world axes
""")


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
