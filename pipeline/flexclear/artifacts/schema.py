"""The contract of the artifacts: dimensions, units and meaning of every variable.

The three towers never import each other: code that writes a dataset calls `conform`, and code that reads one can rely
on these tables.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flexclear.artifacts.coordinates import AXES as AXES
from flexclear.artifacts.coordinates import COORDINATES, turning, with_names
from flexclear.artifacts.coordinates import QUATERNION as QUATERNION
from flexclear.artifacts.labelled import LabelledArray, LabelledArrays, label_dataset
from flexclear.scene.output import Schema as Schema
from flexclear.scene.output import Variable as Variable
from flexclear.scene.output import table
from flexclear.scene.run_schema import RUN as RUN
from flexclear.system.errors import InputError
from flexclear.system.version import DISTRIBUTION, version

if TYPE_CHECKING:
    import xarray as xr

CONVENTIONS = "CF-1.11"
AnyRun = TypeVar("AnyRun", "xr.Dataset", LabelledArrays)

#: stage 1 of a solid: cells of one type, materials by region, frames tied to nodes
SOLID: Schema = table("""
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each cell, in the order of VTK
cell_region | cell | 1 | index of the cell's region among `region`
youngs_modulus | region | Pa | Young's modulus
poisson | region | 1 | Poisson's ratio
density | region | kg m-3 | mass density
frame_tie | frame | | rigid: nodes follow the frame; mean: the frame follows the nodes
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
tie_node | tie | 1 | tied node
tie_weight | tie | 1 | its weight in a mean
tie_frame | tie | 1 | index of the frame that it is tied to among `frame`
patch_node | patch | 1 | node of the boundary in a named region
patch_region | patch | 1 | index of that region among `surface_region`
""")

#: next to stage 3: a rigid body with the mass properties of a mesh
RIGID: Schema = table("""
mass | | kg | mass
com | axis | m | centre of mass in the mesh frame
inertia | axis axis2 | kg m2 | inertia about the centre of mass, axes of the mesh frame
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
""")

#: stage 1 of a body assembled by another code: matrices by their entries, and the meaning of the unknowns
MATRICES: Schema = table("""
unknown_node | unknown | 1 | number of the node
unknown_component | unknown | | ux uy uz rx ry rz, or internal where rigid motion has no part
unknown_position | unknown axis | m | position of the unknown in the mesh frame
stiffness_row | stiffness_entry | 1 | row
stiffness_column | stiffness_entry | 1 | column
stiffness_value | stiffness_entry | J | stiffness, per unit of row and of column: m for ux uy uz, rad for rx ry rz
mass_row | mass_entry | 1 | row
mass_column | mass_entry | 1 | column
mass_value | mass_entry | kg m2 | mass, per unit of row and of column: m for ux uy uz, rad for rx ry rz
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
tie_node | tie | 1 | number of the node whose motion, or mean motion, is the frame's
tie_frame | tie | 1 | index of the frame
given_shape? | unknown shape | 1 | shape that came with the body, for the reference condition "given"
listed_frequency? | listed | Hz | frequencies of the free body in the program's listing
listed_mass? | | kg | mass there
body_mass? | | kg | mass
first_moment? | axis | kg m | integral of rho X
second_moment? | axis axis2 | kg m2 | integral of rho X X^T
unknown_first_moment? | axis unknown | kg | integral of rho S per unknown
unknown_position_moment? | axis axis2 unknown | kg m | integral of rho X_k S_l per unknown
pair_axes? | pair_entry | 1 | 3 k + l of an integral of rho S_k S_l, k <= l
pair_row? | pair_entry | 1 | unknown of S_k
pair_column? | pair_entry | 1 | unknown of S_l
pair_value? | pair_entry | kg | integral of rho S_k S_l
""")

#: stage 3 on request: data for section forces and stresses, of rods and of solids
STRESS: Schema = table("""
section_place? | section | m | position of the section along the rod; one at either end of each cell
section_position? | section axis | m | undeformed centre of the section, body frame
section_rotation? | section axis axis2 | 1 | rotation matrix, section to body frame, undeformed
section_translation_shape? | section axis mode | 1 | displacement of the section per modal coordinate, body axes
section_rotation_shape? | section axis mode | rad m-1 | rotation vector of the section per modal coordinate
slice_mass? | slice | kg | mass of a slice of the rod
slice_position? | slice axis | m | undeformed centre of mass of the slice, body frame
slice_spread? | slice axis axis2 | kg m2 | integral of rho r r^T about it, body axes
slice_translation_shape? | slice axis mode | 1 | displacement of the slice's centre per modal coordinate
slice_rotation_shape? | slice axis mode | rad m-1 | rotation vector of the slice per modal coordinate
slice_beyond? | section slice | 1 | one where the slice lies beyond the section
frame_beyond? | section frame | 1 | one where the named frame lies beyond the section
fibre_stress? | section fibre stress section_load | m-2, m-3 | axial stress and shear stress along y and z of a fibre
    per N, Qy, Qz, T, My, Mz
section_round? | section | 1 | one where the section is the same about every axis
stress_field? | node tensor field | Pa | stress at the node, body axes, per unit of the field's factor in SI
node_doubtful? | node | 1 | one where a cell of the node touches a rigidly tied frame
gauge_node? | gauge_entry | 1 | node of a gauge
gauge_index? | gauge_entry | 1 | index of that gauge among `gauge`
""")

#: stages 2 and 3: deficits of the reduced body against the full model
DEFICITS: Schema = table("""
compliance_full? | frame frame_held direction | m N-1, rad N-1 m-1 | static compliance of a frame with another held
    (the frame itself: nothing held), full model, axes of the frame
compliance_share? | frame frame_held direction | 1 | fraction of the full model's compliance that the modes have
error_bound? | frame direction bound_frequency | m N-1, rad N-1 m-1 | largest error of a frame's motion along a unit
    harmonic load on it, axes of the frame
effective_mass? | direction mode | kg, kg m2 | squared momentum of the mode per unit rigid motion about the centre of
    mass, over its modal mass
free_frequency? | free_mode | Hz | first frequencies of the free body, where another program assembled it
listed_frequency? | listed | Hz | elastic frequencies in that program's listing
""")

#: stage 1: nodes and two-node beam cells in the mesh frame
MESH: Schema = table("""
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each cell, from start to end
area | cell | m2 | cross-section area
second_moment | cell axis | m4 | torsion constant and bending second moments (stiffness)
inertia_moment | cell axis | m4 | polar and bending second moments of area (mass)
youngs_modulus | cell | Pa | Young's modulus
shear_modulus | cell | Pa | shear modulus
density | cell | kg m-3 | mass density
frame_node | frame | 1 | node to which the named frame is tied
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
abscissa? | node | m | position of the node along the rod
rod_rotation? | axis axis2 | 1 | rotation matrix, rod axes (x along the rod) to mesh frame
shear_coefficient? | cell axis | 1 | fraction of the area that carries force along x, y and z of the rod
product_moment? | cell | m4 | integral of y z over the section (stiffness)
inertia_product? | cell | m4 | integral of y z over the section (mass)
area_profile? | cell point | 1 | area at the Gauss points over that of the cell
second_moment_profile? | cell point axis | 1 | second moments at the Gauss points over those of the cell
inertia_moment_profile? | cell point axis | 1 | second moments of the mass at the points of the cell
shear_coefficient_profile? | cell point axis | 1 | shear coefficients at the points of the cell
lump_node? | lump | 1 | node that carries the lumped mass
lump_mass? | lump | kg | lumped mass
lump_offset? | lump axis | m | centre of the lumped mass seen from its node, mesh axes
lump_inertia? | lump axis axis2 | kg m2 | inertia of the lumped mass about its centre, mesh axes
""")

#: stage 2: frequencies and shapes under one reference condition, all FE degrees of freedom
MODES: Schema = DEFICITS | table("""
frequency | mode | Hz | natural frequency of the retained coordinate in the reduced basis
shape | node dof mode | 1 | mass-normalised shape: ux uy uz rx ry rz per unit modal coordinate
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each drawn cell
vector | unknown mode | 1 | mass-normalised shape, every unknown of the model
rigid_frequency? | rigid_mode | Hz | frequencies of the removed rigid-body modes
kind | mode | | bending, torsion or axial by fraction of kinetic energy
exact_euler_bernoulli? | mode | Hz | exact frequency of the uniform rod, Euler-Bernoulli bending
exact_rayleigh? | mode | Hz | exact frequency of the uniform rod, bending with rotary inertia
exact_timoshenko? | mode | Hz | exact frequency of the uniform rod, bending with rotary inertia and shear
""")

#: stage 3: all that the dynamics needs of a flexible body, in its body frame
BUNDLE: Schema = (
    DEFICITS
    | STRESS
    | table("""
mass | | kg | mass
first_moment | axis | kg m | integral of rho X
second_moment | axis axis2 | kg m2 | integral of rho X X^T
modal_first_moment | axis mode | kg | integral of rho S
position_mode_moment | axis axis2 mode | kg m | integral of rho X_k S_lj
mode_mode_moment | axis axis2 mode mode2 | kg | integral of rho S_ki S_lj
modal_mass | mode mode2 | kg | modal mass matrix
modal_stiffness | mode mode2 | N m-1 | modal stiffness matrix
frequency | mode | Hz | natural frequency of the coordinate
frame_position | frame axis | m | undeformed origin of the named frame in the body frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, named frame to body frame, undeformed
frame_translation_shape | frame axis mode | 1 | displacement of the frame per modal coordinate, body axes
frame_rotation_shape | frame axis mode | rad m-1 | rotation vector of the frame per modal coordinate, body axes
second_order_moment | axis axis2 mode mode2 | kg | integral of rho X_k times the second derivative of the displacement
    along l by modal coordinates
second_order_first_moment? | axis mode mode2 | kg m-1 | integral of rho times the second derivative of the displacement
    by modal coordinates
frame_second_translation? | frame axis mode mode2 | m-1 | second derivative of the frame's displacement by modal
    coordinates, body axes
frame_second_rotation? | frame axis mode mode2 | rad m-2 | second derivative of the frame's rotation vector by modal
    coordinates, body axes
station_rotation? | station axis mode | rad m-1 | twist and tilt at stations of a rod per modal coordinate, rod's axes
station_curvature? | station axis mode | rad m-2 | rates of twist and bending along the rod per modal coordinate
station_stiffness? | station axis axis2 | N m3 | stiffness of the section to them, times the length that it represents
untilted_inertia | axis axis2 | kg m2 | moment of inertia of sections that twist but do not tilt (Euler-Bernoulli)
node_position | node axis | m | undeformed node position in the body frame
cell_node | cell corner | 1 | node indices of each cell
shape_translation | node axis mode | 1 | node displacement per modal coordinate, body axes
shape_rotation | node axis mode | rad m-1 | node rotation vector per modal coordinate, body axes
radius | cell | m | radius of the drawn section
outline? | cell around axis | m | from a rod's centre line to points around its section, body axes, the first again
    last; not of round ones
""")
)

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
peak_speed | member body | m s-1 | largest speed of the centre of mass, also between outputs
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
orbit_contact_offset? | waypoint contact axis | m, rad | ball centre relative to the socket centre at waypoints
contact_offset? | section contact axis | m, rad | ball centre relative to the socket centre, socket axes
growth | followed | 1 | logarithm of the growth factor of a neighbour's distance in the period
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

#: wear over many cycles: at the begin of each step, the surfaces, and the run with them
WEAR: Schema = table("""
cycles | step | 1 | cycles done
step_error | step | 1 | estimated error of the depths of the step that ends here, over the clearance
worn_clearance | step worn | m | radial clearance with the mean depths of both surfaces
worn_gap | step worn | m | radial clearance with the largest depths of both surfaces
peak_force | step worn | N | largest normal contact force of the run
run_volume | step worn | m3 | volume that the run wears, of both surfaces together
wear_sectors | worn | 1 | sectors in use, around z of the frames
wear_bands | worn | 1 | bands in use: one of a pin
radius_outer | worn | m | radius of the socket or journal without wear
radius_inner | worn | m | radius of the ball or pin without wear
depth_outer | step worn band sector | m | depth worn off the socket or journal
depth_inner | step worn band sector | m | depth worn off the ball or pin
rate_outer | step worn band sector | m | depth that a cycle takes from the socket or journal
rate_inner | step worn band sector | m | depth that a cycle takes from the ball or pin
""")

_STILL = """position quaternion frame_position joint_force joint_moment joint_position modal_coordinate
drive_force drive_position load_force load_moment load_length contact_gap contact_penetration contact_force
contact_normal_force contact_offset potential elastic"""
#: static equilibrium, or steady motion: variables of a run at one instant
EQUILIBRIUM: Schema = {name: replace(RUN[name], dims=RUN[name].dims[1:]) for name in _STILL.split()}

#: natural vibrations about the equilibrium; shapes (real, imaginary) per unit of a coordinate with modal mass 1 kg
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
frequency~ | speed branch | Hz | frequency of the vibration in the axes of the mechanism, which turn; in fixed axes
    where the equations vary with the angle of the drive
whirl_frequency~ | speed branch | Hz | frequency in fixed axes, negative for backward whirls; NaN for what does not
    whirl
decay_rate~ | speed branch | s-1 | rate at which the vibration decays; negative when it grows
growth~ | speed | s-1 | largest rate at which a small motion grows; 0 where stable, NaN without steady motion
whirl | branch | | forward or backward; empty for vibrations without whirl
dominant | branch | | body with the largest fraction of the kinetic energy at most speeds
critical_speed~ | branch | rad s-1 | lowest speed at which the whirl frequency equals the speed, or NaN
frame_position~ | speed frame axis | m | origin of the named frame in steady motion, world axes
""")

#: state space about an equilibrium, in changes from there; units of the entries follow from those of rows and columns
STATE_SPACE: Schema = table("""
A | state state2 | 1 | rates of the states per state
B | state input | 1 | rates of the states per input
C | output state | 1 | outputs per state
D | output input | 1 | outputs per input
input_value | input | 1 | value of the input at the equilibrium, in its unit
output_value | output | 1 | value of the output at the equilibrium, in its unit
state_unit | state | | SI unit of the state
input_unit | input | | SI unit of the input
output_unit | output | | SI unit of the output
""")


#: variables that become coordinates of their dimension, where their schema has them
_NAMING = ("event_time", "event_contact", "event_kind", "impact_time", "impact_contact")
#: prefixes of variables that may be NaN: a contact that the end of the run cuts short has no duration
_MAY_BE_OPEN = ("event_", "impact_")


def conform(dataset: xr.Dataset, schema: Schema, *, title: str, **attributes: str | int | float) -> xr.Dataset:
    """Return a dataset with units, long names and coordinates of `schema`, see `conform_arrays`."""
    return conform_arrays(label_dataset(dataset), schema, title=title, **attributes).to_xarray()


def conform_arrays(
    data: LabelledArrays, schema: Schema, *, title: str, **attributes: str | int | float
) -> LabelledArrays:
    """Return `data` with units, long names and coordinates of `schema`; raise ValueError where it differs.

    Every mandatory variable must be present with its dimensions; undeclared variables are errors. The attribute `units`
    is that of all entries; where some slide and others turn, the coordinate `<variable>_units` has one per entry
    instead. title: of the dataset, in words.
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
    """Return the unit of all entries, or an empty text and the unit of each."""
    if not variable.turning:
        return variable.units, None
    dim, turns = turning(data, variable.dims)
    if not turns.any():
        return variable.units, None
    if turns.all():
        return variable.turning, None
    each, words = np.where(turns, variable.turning, variable.units), {"long_name": f"units of {name}"}
    return "", LabelledArray((dim,), each, words)


def mark_incomplete(run: AnyRun, why: str) -> AnyRun:
    """Mark a run that was stopped: attributes `complete` (0), `stopped_at` [s] and `stopped_by`."""
    return run.assign_attrs(complete=0, stopped_at=float(run["time"].values[-1]), stopped_by=why)


def require_complete(run: xr.Dataset | LabelledArrays, what: str = "the run") -> None:
    """Raise InputError for a run that was stopped before its end, which is no result."""
    if not run.attrs.get("complete", 1):
        raise InputError(
            what,
            f"the run is not complete: it was stopped at t = {run.attrs.get('stopped_at', float('nan')):.6g} s "
            f"({run.attrs.get('stopped_by', 'reason unknown')})",
            "run the scene again",
        )
