"""Joint types. To add one: a module here and a line below; the family tests pick it up.

Each module holds one class with
- ``POSITIONS``, ``SPEEDS``: coordinates of a tree joint of this type, one letter each (r, t);
- ``TRANSLATIONS``: axes of the first frame along which a closure forbids displacement;
- ``ROTATIONS``: pairs (axis of the first frame, axis of the second) that a closure keeps perpendicular;
- ``motion``: kernel for the motion of the second frame relative to the first (see `spherical`);
- ``COORDINATES``: its freedoms by name, in the order of the speeds, where drives and loads may act on them;
  turning and sliding them one after the other, from the first frame on, is its motion (see `coordinate`);
- ``coordinates(R, p)``: joint positions of a relative pose, for the start.
"""

KIND = "joint type"
NAMES = {
    "fixed": "fixed:Fixed",
    "prismatic": "prismatic:Prismatic",
    "revolute": "revolute:Revolute",
    "cylindrical": "cylindrical:Cylindrical",
    "planar": "planar:Planar",
    "universal": "universal:Universal",
    "spherical": "spherical:Spherical",
    "rotation-vector": "rotation_vector:RotationVector",
    "free": "free:Free",
}
CONTACTS = {
    "clearance-spherical": "clearance_spherical:ClearanceSpherical",
    "clearance-revolute": "clearance_revolute:ClearanceRevolute",
}
#: the ideal joint that a clearance joint keeps beside its contact
HELD = {"clearance-revolute": "planar"}
