"""Joint types. To add one: a module here named like the type, and that type in scene/parts; the family tests
include it automatically.

Each is a module, or an object of `turn_and_slide`, with the kernels
- ``motion(w, x, u, S) -> R_FG, p_FG, bias``: pose of the second frame in the first, motion subspace and bias
  (see `spherical.motion`);
- ``position_rate(w, x, u, rate)``: rates of the positions at the speeds;

and with
- ``POSITIONS``, ``SPEEDS``: coordinates of a tree joint of this type, one letter each (r, t);
- ``TRANSLATIONS``: axes of the first frame along which a closure forbids displacement;
- ``ROTATIONS``: pairs (axis of the first frame, axis of the second) that a closure keeps perpendicular;
- ``COORDINATES``: its freedoms by name, in the order of the speeds, where drives and loads may act on them;
  its motion applies these turns and slides one after the other, from the first frame on (see `coordinate`);
- ``coordinates(R, p)``: joint positions of a relative pose, for the start pose.
"""

from flexclear.scene.parts import IDEAL
from flexclear.scene.registry import module_name

KIND = "joint type"
#: prescribed paths alone create a joint type that no scene can name, the rotation vector
NAMES = {name: module_name(name) for name in (*IDEAL, "rotation-vector")}
NAMES |= {n: f"turn_and_slide:{n.upper()}" for n in ("fixed", "revolute", "prismatic", "cylindrical", "planar")}
#: joints that are always one link; others may become chains of joints in CHAIN (see `model.chain`)
WHOLE = ("fixed", "prismatic", "revolute", "spherical", "rotation-vector", "free")
CHAIN = ("fixed", "prismatic", "revolute", "rotation-vector", "spherical")
#: the ideal joint that a clearance joint keeps in addition to its contact
HELD = {"clearance-revolute": "planar", "clearance-slot": "planar"}
