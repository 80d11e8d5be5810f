"""Coordinates of the artifacts: names of the entries of each dimension, data attached to them, tables of both."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexclear.artifacts.labelled import LabelledArray, LabelledArrays
from flexclear.scene.output import Schema, table

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")
#: entries of `<dimension>_motion`; they decide the units of variables whose entries slide or turn
TRANSLATION, ROTATION = "translation", "rotation"


_MOTION = "translation or rotation: kind of the coordinate"
COORDINATES: Schema = table(f"""
time? | time | s | time
separation_time? | separation_time | s | time at which run and perturbed run were compared
ensemble_time? | ensemble_time | s | time of the ensemble's output
waypoint? | waypoint | s | time since the period began
axis? | axis | | component along x, y, z
axis2? | axis2 | | component along x, y, z
quat? | quat | | component of a quaternion
body? | body | | name of the body
ensemble_body? | ensemble_body | | name of the body whose motion the ensemble records
frame? | frame | | name of the frame; of a mechanism body.frame
frame_body? | frame | | body that the frame is fixed to
loaded_frame? | loaded_frame | | frame of a flexible body, body.frame
loaded_body? | loaded_body | | flexible body whose loads are recorded
frame_held? | frame_held | | frame that is held
joint? | joint | | name of the joint
joint_type? | joint | | type of the joint
joint_first_frame? | joint | | first frame of the joint, whose axes are those of the joint's motion
joint_second_frame? | joint | | second frame of the joint, on which the joint's force acts
joint_first_body? | joint | | body of the first frame
joint_second_body? | joint | | body of the second frame
coordinate? | coordinate | | joint, or joint.coordinate where the joint has several
coordinate_joint? | coordinate | | name of the coordinate's joint
coordinate_motion? | coordinate | | {_MOTION}
internal? | internal | | part and number of the internal state
drive? | drive | | name of the drive, of its coordinate, or of an actuator
drive_motion? | drive | | {_MOTION}
load? | load | | name of the load
load_type? | load | | type of the load
load_motion? | load | | translation or rotation: kind of the load's length
bushing? | bushing | | name of the bushing
film? | film | | name of the joint with a film
controller? | controller | | name of the controller
controller_motion? | controller | | {_MOTION}
gear? | gear | | name of the gear
gear_motion? | gear | | translation or rotation: kind of the gear's second coordinate
contact? | contact | | name of the joint with clearance, or of the stop's end
contact_type? | contact | | type of the joint with clearance, or stop, or flank of a gear
event_motion? | event | | rotation for an event along an angle, else translation
contact_motion? | contact | | rotation for a contact that limits an angle, else translation
rubbing? | rubbing | | name of the ideal joint with friction
worn? | worn | | name of the contact that wears
step? | step | 1 | number of the step of wear, from 0
band? | band | 1 | number of the band of equal height on a sphere, from its lower pole on
sector? | sector | 1 | number of the sector about z of the surface's frame, from x on
pass_joint? | singular_pass | | joint on whose coordinate the branches differ most
state? | state | | coordinate, its rate, or an internal state of a part
state2? | state2 | | coordinate, its rate, or an internal state of a part
input? | input | | key of a load whose value is the input
output? | output | | watched quantity, or its component
mode? | mode | | body.number; in the files of one body, the number of the mode
mode2? | mode2 | 1 | number of the mode
mode_body? | mode | | body that the mode belongs to
mode_number? | mode | 1 | number of the mode in the body's bundle
rigid_mode? | rigid_mode | 1 | number of the rigid-body mode
dof? | dof | | displacement along, rotation about x, y, z
direction? | direction | | displacement along, rotation about x, y, z
direction_motion? | direction | | {_MOTION}
bound_frequency? | bound_frequency | Hz | frequency of the load
node? | node | 1 | number of the node, from 0; `cell_node` refers to it
cell? | cell | 1 | number of the cell, from 0
corner? | corner | 1 | number of the corner of a cell, from 0
around? | around | 1 | number of the point around a drawn section, from 0
point? | point | 1 | number of the Gauss point, from 0
region? | region | | name of the region of cells of one material
lump? | lump | 1 | number of the lumped mass, from 0
section? | section | 1 | number of the section, from 0
section_body? | section | | body that the section belongs to
section_place? | section | m | position of the section along the rod
section_load? | section_load | | section force N, Qy, Qz, or moment T, My, Mz
section_load_motion? | section_load | | translation for forces, rotation for moments
stress? | stress | | axial stress, and shear stress along y and z
tensor? | tensor | | component of a symmetric tensor
field? | field | | what a field's factor is: mode, frame with direction, or acceleration
stress_field? | stress_field | | body, and what its stress field's factor is
stress_field_body? | stress_field | | body whose stress field it is
gauge? | gauge | | body, for all of it, or body.gauge; in the files of one body its gauges
gauge_body? | gauge | | body that the gauge is on
surface_region? | surface_region | | name of a region with nodes on the boundary
slice? | slice | 1 | number of the slice, from 0
station? | station | 1 | number of the station along a rod, from 0
fibre? | fibre | 1 | number of the fibre, from 0
member? | member | 1 | number of the member, from 0
quantile? | quantile | 1 | fraction of the members below
followed? | followed | 1 | number of the period in which a neighbour was followed, from 0
speed? | speed | rad s-1 | speed of the drive of a Campbell diagram; m s-1 where it slides
branch? | branch | 1 | number of the branch of vibrations, from 1
vibration? | vibration | 1 | number of the vibration, from 1
part? | part | | real or imaginary part
moving_body? | moving_body | | name of the body
frequency? | frequency | 1 | cycles per period
lag? | lag | 1 | number of periods later
component? | component | 1 | direction of the motion, by variance, from 0
""")
#: dimensions whose entries are named by numbers only, and the number of the first entry
NUMBERED = {
    **dict.fromkeys(("node", "cell", "corner", "around", "point", "lump", "section", "slice", "station", "fibre"), 0),
    **dict.fromkeys(("followed", "lag", "component", "step", "band", "sector"), 0),
    **dict.fromkeys(("mode", "mode2", "rigid_mode"), 1),
}
#: dimensions whose entries are always the same
NAMED: Mapping[str, tuple[str, ...]] = {
    "axis": AXES,
    "axis2": AXES,
    "quat": QUATERNION,
    "section_load": ("N", "Qy", "Qz", "T", "My", "Mz"),
    "stress": ("axial", "shear_y", "shear_z"),
    "tensor": ("xx", "yy", "zz", "yz", "xz", "xy"),
}
#: motions of entries that are always the same
MOTIONS: Mapping[str, tuple[str, ...]] = {
    dim: (TRANSLATION,) * 3 + (ROTATION,) * 3 for dim in ("direction", "section_load")
}


def motion(turning: bool) -> str:
    """Return the entry of `<dimension>_motion`."""
    return ROTATION if turning else TRANSLATION


def with_names(data: LabelledArrays) -> LabelledArrays:
    """Return the data with the coordinates that follow from its dimensions alone."""
    variables: dict[str, LabelledArray] = {}
    for name, length in data.sizes.items():
        if name in NAMED:
            variables[name] = LabelledArray((name,), np.array(NAMED[name]))
        elif name in NUMBERED and name not in data.coords:
            variables[name] = LabelledArray((name,), np.arange(length, dtype=np.int32) + NUMBERED[name])
        if name in MOTIONS:
            variables[f"{name}_motion"] = LabelledArray((name,), np.array(MOTIONS[name]))
    return data.assign_coords(variables)


def turning(data: LabelledArrays, dims: tuple[str, ...]) -> tuple[str, np.ndarray]:
    """Return the dimension among `dims` whose entries slide or turn, and which of them turn; "" without such entries.

    Events and impacts move as their contacts do.
    """
    for dim in dims:
        if f"{dim}_motion" in data.coords:
            return dim, np.asarray(data[f"{dim}_motion"].values == ROTATION)
        if f"{dim}_contact" in data.coords and "contact_motion" in data.coords:
            turns = set(data["contact"].values[data["contact_motion"].values == ROTATION].tolist())
            return dim, np.array([name in turns for name in data[f"{dim}_contact"].values.tolist()], dtype=bool)
    return "", np.zeros(0, dtype=bool)
