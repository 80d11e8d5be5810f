"""Coordinates of the artifacts: what the entries of each dimension are called, and what belongs to them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexclear.pipeline.core.artifacts.labelled import LabelledArray, LabelledArrays
from flexclear.pipeline.core.scene.variable import Schema, Variable

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")
#: what an entry of `<dimension>_motion` says; it decides the unit of variables whose entries slide or turn
TRANSLATION, ROTATION = "translation", "rotation"


def _words(dim: str, long_name: str) -> Variable:
    return Variable((dim,), "", long_name, optional=True)


def _number(dim: str, long_name: str, units: str = "1") -> Variable:
    return Variable((dim,), units, long_name, optional=True)


_MOTION = "translation or rotation: what it is along or about"
COORDINATES: Schema = {
    "time": _number("time", "time", "s"),
    "separation_time": _number("separation_time", "time at which run and perturbed run were compared", "s"),
    "ensemble_time": _number("ensemble_time", "time of the ensemble's output", "s"),
    "waypoint": _number("waypoint", "time since the period began", "s"),
    "axis": _words("axis", "component along x, y, z"),
    "axis2": _words("axis2", "component along x, y, z"),
    "quat": _words("quat", "component of a quaternion"),
    "body": _words("body", "name of the body"),
    "ensemble_body": _words("ensemble_body", "name of the body whose motion the ensemble keeps"),
    "frame": _words("frame", "name of the frame; of a mechanism body.frame"),
    "frame_body": _words("frame", "body that the frame is fixed to"),
    "frame_held": _words("frame_held", "frame that is held meanwhile"),
    "joint": _words("joint", "name of the joint"),
    "joint_type": _words("joint", "type of the joint"),
    "joint_first_frame": _words("joint", "its first frame, whose axes are those of its motion"),
    "joint_second_frame": _words("joint", "its second frame, on which its force acts"),
    "joint_first_body": _words("joint", "body of the first frame"),
    "joint_second_body": _words("joint", "body of the second frame"),
    "coordinate": _words("coordinate", "joint, or joint.coordinate where it has several"),
    "coordinate_joint": _words("coordinate", "name of its joint"),
    "coordinate_motion": _words("coordinate", _MOTION),
    "drive": _words("drive", "name of the drive, of its coordinate, or of an actuator"),
    "drive_motion": _words("drive", _MOTION),
    "load": _words("load", "name of the load"),
    "load_type": _words("load", "type of the load"),
    "load_motion": _words("load", "translation or rotation: what its length measures"),
    "bushing": _words("bushing", "name of the bushing"),
    "controller": _words("controller", "name of the controller"),
    "controller_motion": _words("controller", _MOTION),
    "gear": _words("gear", "name of the gear"),
    "gear_motion": _words("gear", "translation or rotation: what its second coordinate is"),
    "contact": _words("contact", "name of the joint with clearance, or of the stop's end"),
    "contact_type": _words("contact", "type of that joint, or stop"),
    "event_motion": _words("event", "rotation where it acts along an angle, else translation"),
    "contact_motion": _words("contact", "rotation where it ends an angle, else translation"),
    "rubbing": _words("rubbing", "name of the ideal joint with friction"),
    "worn": _words("worn", "name of the contact that wears"),
    "band": _number("band", "number of the band of equal height on a sphere, from its lower pole on"),
    "sector": _number("sector", "number of the sector about z of the surface's frame, from x on"),
    "pass_joint": _words("singular_pass", "joint on whose coordinate the branches differ most"),
    "mode": _words("mode", "body.number, or in the files of one body its number"),
    "mode2": _number("mode2", "number of the mode"),
    "mode_body": _words("mode", "body that the mode belongs to"),
    "mode_number": _number("mode", "number of the mode in the body's bundle"),
    "rigid_mode": _number("rigid_mode", "number of the rigid-body mode"),
    "dof": _words("dof", "displacement along, rotation about x, y, z"),
    "direction": _words("direction", "displacement along, rotation about x, y, z"),
    "direction_motion": _words("direction", _MOTION),
    "bound_frequency": _number("bound_frequency", "frequency of the load", "Hz"),
    "node": _number("node", "number of the node, from 0; `cell_node` refers to it"),
    "cell": _number("cell", "number of the cell, from 0"),
    "corner": _number("corner", "number of the corner of a cell, from 0"),
    "around": _number("around", "number of the point around a drawn section, from 0"),
    "point": _number("point", "number of the Gauss point, from 0"),
    "region": _words("region", "name of the region of cells of one material"),
    "lump": _number("lump", "number of the lumped mass, from 0"),
    "section": _number("section", "number of the section, from 0"),
    "section_body": _words("section", "body that the section belongs to"),
    "section_place": _number("section", "position of the section along the rod", "m"),
    "section_load": _words("section_load", "section force N, Qy, Qz, or moment T, My, Mz"),
    "section_load_motion": _words("section_load", "translation for forces, rotation for moments"),
    "stress": _words("stress", "axial stress, and shear stress along y and z"),
    "tensor": _words("tensor", "component of a symmetric tensor"),
    "field": _words("field", "what a field's factor is: mode, frame with direction, or acceleration"),
    "stress_field": _words("stress_field", "body, and what its stress field's factor is"),
    "stress_field_body": _words("stress_field", "body whose stress field it is"),
    "gauge": _words("gauge", "body, for all of it, or body.gauge; in the files of one body its gauges"),
    "gauge_body": _words("gauge", "body that the gauge is on"),
    "surface_region": _words("surface_region", "name of a region with nodes on the boundary"),
    "slice": _number("slice", "number of the slice, from 0"),
    "fibre": _number("fibre", "number of the fibre, from 0"),
    "member": _number("member", "number of the member, from 0"),
    "quantile": _number("quantile", "fraction of the members below"),
    "followed": _number("followed", "number of the period in which a neighbour was followed, from 0"),
    "speed": _number("speed", "speed of the drive of a Campbell diagram; m s-1 where it slides", "rad s-1"),
    "branch": _number("branch", "number of the branch of vibrations, from 1"),
    "vibration": _number("vibration", "number of the vibration, from 1"),
    "part": _words("part", "real or imaginary part"),
    "moving_body": _words("moving_body", "name of the body"),
    "frequency": _number("frequency", "cycles per period"),
    "lag": _number("lag", "number of periods later"),
    "component": _number("component", "direction of the motion, by variance, from 0"),
}
#: dimensions whose entries have no other name than their number, and the number of the first
NUMBERED = {
    **dict.fromkeys(("node", "cell", "corner", "around", "point", "lump", "section", "slice", "fibre"), 0),
    **dict.fromkeys(("followed", "lag", "component", "band", "sector"), 0),
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
    """How `<dimension>_motion` calls an entry."""
    return ROTATION if turning else TRANSLATION


def with_names(data: LabelledArrays) -> LabelledArrays:
    """The same with the coordinates that follow from its dimensions alone."""
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
    """The dimension among `dims` whose entries slide or turn, and which of them turn; of none, an empty name.

    Events and impacts are of the kind of their contacts.
    """
    for dim in dims:
        if f"{dim}_motion" in data.coords:
            return dim, np.asarray(data[f"{dim}_motion"].values == ROTATION)
        if f"{dim}_contact" in data.coords and "contact_motion" in data.coords:
            turns = set(data["contact"].values[data["contact_motion"].values == ROTATION].tolist())
            return dim, np.array([name in turns for name in data[f"{dim}_contact"].values.tolist()], dtype=bool)
    return "", np.zeros(0, dtype=bool)
