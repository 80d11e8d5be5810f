"""Joint types. To add one: a module here, a line in the table, and that type in scene/parts; the family tests include
it automatically.

Each is a module, or an object of `turn_and_slide`, with the functions of numbers that may be symbols
- ``motion(x, u)``: `relative.Relative` motion of the second frame in the first at positions and speeds;
- ``position_rate(x, u)``: rates of the positions;

and with
- ``POSITIONS``, ``SPEEDS``: coordinates of a tree joint of this type, one letter each (r, t);
- ``TRANSLATIONS``: axes of the first frame along which a closure forbids displacement;
- ``ROTATIONS``: pairs (axis of the first frame, axis of the second) that a closure keeps perpendicular;
- ``COORDINATES``: its freedoms by name, in the order of the speeds, where drives and loads may act on them;
  its motion applies these turns and slides one after the other, from the first frame on (see `coordinate`);
- where its positions are no coordinates, ``coordinates(R, p)``: joint positions of a relative pose, for the start pose.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.joints import free, rotation_vector, spherical, turn_and_slide, universal

#: by type; no scene can name rotation vectors, of prescribed paths, and what holds a loose slider in a plane
JOINTS: dict[str, Any] = {
    "spherical": spherical,
    "revolute": turn_and_slide.REVOLUTE,
    "universal": universal,
    "prismatic": turn_and_slide.PRISMATIC,
    "cylindrical": turn_and_slide.CYLINDRICAL,
    "slot": turn_and_slide.SLOT,
    "planar": turn_and_slide.PLANAR,
    "guided": turn_and_slide.GUIDED,
    "fixed": turn_and_slide.FIXED,
    "free": free,
    "rotation-vector": rotation_vector,
}
