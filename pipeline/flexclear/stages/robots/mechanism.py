"""Bodies, joints and loops of a compiled model as parts of a scene.

A body of MuJoCo with several joints becomes as many bodies in a row, all but the last without mass. One without joints
belongs to the body that carries it, unless it has a mass of its own; what cannot move belongs to the ground.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain, count
from typing import Any, NamedTuple

import mujoco
import numpy as np

from flexclear.dynamics.model.merge import GROUND, Placement
from flexclear.numerics.rotations import (
    axis_to_matrix,
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from flexclear.scene.fields import LONGEST_NAME
from flexclear.stages.robots.text import Draft

OBJECT, JOINT, EQUALITY = mujoco.mjtObj, mujoco.mjtJoint, mujoco.mjtEq
#: types of joints by the model's numbers for them
TYPES = {int(JOINT.mjJNT_FREE): "free", int(JOINT.mjJNT_BALL): "spherical"}
TYPES |= {int(JOINT.mjJNT_SLIDE): "prismatic", int(JOINT.mjJNT_HINGE): "revolute"}
#: entries below this fraction of the largest are rounding
ROUNDING = 1e-14


class Coordinate(NamedTuple):
    """A joint of the model in the scene. turns: True for an angle; address: of its position; speed: of its rate."""

    joint: str
    type: str
    address: int
    speed: int

    @property
    def turns(self) -> bool:
        """True for an angle."""
        return self.type == "revolute"

    @property
    def single(self) -> bool:
        """True for a joint with one coordinate."""
        return self.type in ("revolute", "prismatic")


@dataclass
class Assembly:
    """A model on its way into a scene.

    places: of each body of the model the scene's body and its frame in that.  joints: by their number in the model.
    q, v: positions and speeds at the start.
    """

    model: Any
    draft: Draft
    q: np.ndarray
    v: np.ndarray
    places: list[tuple[str, Placement]] = field(default_factory=lambda: [(GROUND, Placement())])
    joints: dict[int, Coordinate] = field(default_factory=dict)
    taken: set[str] = field(default_factory=lambda: {GROUND, "source"})

    def name(self, kind: Any, number: int, what: str) -> str:
        """Return a new name in the scene for an object of the model, as close to its own as names may be."""
        return self.take(mujoco.mj_id2name(self.model, kind, number) or f"{what}_{number}", what)

    def take(self, wanted: str, what: str) -> str:
        """Return a name that no other part has; a second one of the same name says what it is."""
        plain = re.sub(r"[^\w-]+", "_", wanted)[: LONGEST_NAME // 2].strip("_") or what
        plain = plain if plain.isascii() else re.sub(r"[^\x00-\x7f]", "_", plain)
        names = chain((plain, f"{plain}_{what}"), (f"{plain}_{what}_{k}" for k in count(2)))
        name = next(name for name in names if name not in self.taken)
        self.taken.add(name)
        return name

    def frame(self, body: str, name: str, place: Placement, axis: np.ndarray | None = None) -> str:
        """Add a frame to a body of the scene and return how joints name it; axis: written instead of a quaternion."""
        frames = self.draft.parts["body"][body].setdefault("frames", {})
        if name in frames:
            name = self.take(name, "frame")
        frames[name] = pose(place, axis)
        return f"{body}.{name}"

    def frame_of(self, body: int, name: str, place: Placement) -> str:
        """Add a frame that is given in a body of the model."""
        owner, here = self.places[body]
        return self.frame(owner, name, here.of(place))


def placement(position: np.ndarray, quaternion: np.ndarray) -> Placement:
    """Return a placement as MuJoCo gives it."""
    return Placement(np.array(position, dtype=float), quaternion_to_matrix(np.array(quaternion, dtype=float)))


def pose(place: Placement, axis: np.ndarray | None = None) -> dict[str, Any]:
    """Return a placement as a pose of the scene, without what is zero."""
    found: dict[str, Any] = {}
    if np.any(place.p):
        found["position"] = clean(place.p)
    if axis is not None:
        return found if axis[2] == 1.0 else {**found, "axis": clean(axis)}
    if not np.array_equal(place.R, np.eye(3)):
        found["quaternion"] = clean(matrix_to_quaternion(place.R))
    return found


def clean(numbers: np.ndarray) -> list[Any]:
    """Return numbers as lists, with zeros in place of rounding."""
    values = np.array(numbers, dtype=float)
    values[np.abs(values) < ROUNDING * np.abs(values).max(initial=0.0)] = 0.0
    return list(values.tolist())


def take_bodies(at: Assembly) -> None:
    """Add all bodies with their joints and named sites, parents first."""
    model, draft = at.model, at.draft
    draft.add("body", GROUND, {"type": "ground"})
    draft.comments["body"] = (
        "bodies: mass, centre of mass and inertia about it in the body's frame, frames, what is shown"
    )
    draft.comments["joint"] = "joints: about, or along, z of the first frame; coordinates are those of the robot's file"
    for b in range(1, model.nbody):
        owner, carrier = at.places[model.body_parentid[b]]
        here = carrier.of(placement(model.body_pos[b], model.body_quat[b]))
        joints = range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b])
        if not joints and (model.body_weldid[b] == 0 or model.body_mass[b] == 0.0):
            at.places.append((owner, here))
            continue
        name = at.name(OBJECT.mjOBJ_BODY, b, "body")
        if not joints:
            draft.add("body", name, _inertia(model, b))
            weld = at.take(f"{name}_weld", "joint")
            between = [at.frame(owner, weld, here), at.frame(name, weld, Placement())]
            draft.add("joint", weld, {"type": "fixed", "between": between})
        else:
            _join(at, b, name, joints, owner, here)
        at.places.append((name, Placement()))
    fixed = 0
    for s in range(model.nsite):
        place, site = placement(model.site_pos[s], model.site_quat[s]), mujoco.mj_id2name(model, OBJECT.mjOBJ_SITE, s)
        if at.places[model.site_bodyid[s]][0] == GROUND:
            fixed += 1
        elif site:
            at.frame_of(model.site_bodyid[s], at.take(site, "site"), place)
    if fixed:
        draft.lost.append(f"sites on what does not move: {fixed}")


def _join(at: Assembly, b: int, name: str, joints: range, owner: str, here: Placement) -> None:
    """Add a body of the model with its joints, and the bodies without mass between several joints."""
    model, draft = at.model, at.draft
    for j in joints:
        kind, joint = TYPES[int(model.jnt_type[j])], at.name(OBJECT.mjOBJ_JOINT, j, "joint")
        at.joints[j] = Coordinate(joint, kind, model.jnt_qposadr[j], model.jnt_dofadr[j])
        last = j == joints[-1]
        carried = name if last else at.take(f"{name}_after_{joint}", "body")
        empty = {"type": "rigid", "mass": 0, "inertia": [0, 0, 0], "geometry": []}
        draft.add("body", carried, _inertia(model, b) if last else empty)
        p, axis = np.array(model.jnt_pos[j]), None
        inner, outer = Placement(p), here.of(Placement(p))
        if kind == "free":
            inner = outer = Placement()
        elif kind != "spherical":
            zero, n, A = (
                model.qpos0[model.jnt_qposadr[j]],
                np.array(model.jnt_axis[j]),
                axis_to_matrix(model.jnt_axis[j]),
            )
            inner = Placement(p, A)
            back = Placement(R=rotation_vector_to_matrix(np.array([0.0, 0.0, -zero])))
            back = back if kind == "revolute" else Placement(np.array([0.0, 0.0, -zero]))
            outer, axis = here.of(inner).of(back), n
        straight = axis is not None and np.array_equal(here.R, np.eye(3)) and (zero == 0.0 or kind == "prismatic")
        between = [at.frame(owner, joint, outer, axis if straight else None), at.frame(carried, joint, inner, axis)]
        draft.add("joint", joint, {"type": kind, "between": between})
        owner, here = carried, Placement()


def _inertia(model: Any, b: int) -> dict[str, Any]:
    """Return the keys of a rigid body with its inertia in its own axes."""
    R = quaternion_to_matrix(np.array(model.body_iquat[b]))
    J = R @ np.diag(model.body_inertia[b]) @ R.T
    J[np.abs(J) < ROUNDING * np.abs(J).max()] = 0.0
    diagonal = np.array_equal(J, np.diag(np.diag(J)))
    rows = [[J[min(i, k), max(i, k)] for k in range(3)] for i in range(3)]
    com = {"com": clean(model.body_ipos[b])} if np.any(model.body_ipos[b]) else {}
    return {"type": "rigid", "mass": model.body_mass[b], **com, "inertia": clean(np.diag(J)) if diagonal else rows}


def take_loops(at: Assembly) -> None:
    """Add equality constraints: connections and welds as joints, coupled coordinates as gears, held ones as drives."""
    model, soft, coupled = at.model, 0, list[tuple[Coordinate, Coordinate, float, float]]()
    for e in range(model.neq):
        kind, data = EQUALITY(int(model.eq_type[e])), model.eq_data[e]
        name = mujoco.mj_id2name(model, OBJECT.mjOBJ_EQUALITY, e) or f"loop_{e}"
        if not model.eq_active0[e] or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY:
            at.draft.lost.append(f"equality constraint {name}: not active at the start")
        elif kind in (EQUALITY.mjEQ_CONNECT, EQUALITY.mjEQ_WELD):
            soft += _close(at, e, at.take(name, "loop"), kind == EQUALITY.mjEQ_WELD)
        elif kind != EQUALITY.mjEQ_JOINT or np.any(data[2:5]):
            what = "a polynomial of joints" if kind == EQUALITY.mjEQ_JOINT else kind.name.removeprefix("mjEQ_").lower()
            at.draft.lost.append(f"equality constraint {name}: {what}")
        else:
            soft += 1
            coupled += _couple(at, e, at.take(name, "gear"))
    given = np.array(at.q)
    for second, first, offset, ratio in coupled * len(coupled):  # in rows of couplings one start follows from another
        at.q[second.address] = offset + ratio * at.q[first.address]
        at.v[second.speed] = ratio * at.v[first.speed]
    if moved := [second.joint for second, *_ in coupled if at.q[second.address] != given[second.address]]:
        at.draft.changed.append(f"positions at the start follow from coupled joints: {', '.join(moved)}")
    if soft:
        at.draft.changed.append(f"{soft} equality constraints are exact; MuJoCo's are soft (solref, solimp)")


def _close(at: Assembly, e: int, name: str, weld: bool) -> bool:
    """Add a joint between two bodies, or two sites; return whether there is one to add."""
    model, data = at.model, at.model.eq_data[e]
    ends = (model.eq_obj1id[e], model.eq_obj2id[e])
    if model.eq_objtype[e] == OBJECT.mjOBJ_SITE:
        places = [placement(model.site_pos[s], model.site_quat[s]) for s in ends]
        ends = tuple(model.site_bodyid[s] for s in ends)
    elif weld:
        places = [placement(data[3:6], data[6:10]), Placement(np.array(data[:3]))]
    else:
        places = [Placement(np.array(data[:3])), Placement(np.array(data[3:6]))]
    if at.places[ends[0]][0] == at.places[ends[1]][0]:
        at.draft.lost.append(f"equality constraint {name}: both sides belong to one body")
        return False
    between = [at.frame_of(body, name, place) for body, place in zip(ends, places, strict=True)]
    source = f"closes a loop: <{'weld' if weld else 'connect'}>"
    at.draft.add("joint", name, {"type": "fixed" if weld else "spherical", "between": between, "source": source})
    return True


def _couple(at: Assembly, e: int, name: str) -> Iterator[tuple[Coordinate, Coordinate, float, float]]:
    """Add a gear and yield its second and first coordinate with offset and ratio, or add a drive that holds one."""
    model, (offset, ratio) = at.model, at.model.eq_data[e][:2]
    second, first = (at.joints.get(k) for k in (model.eq_obj1id[e], model.eq_obj2id[e]))
    assert second is not None
    offset += model.qpos0[second.address]
    if first is None or ratio == 0.0:
        at.draft.add("drive", name, {"joint": second.joint, "law": offset}, "a held coordinate")
        at.q[second.address], at.v[second.speed] = offset, 0.0
        return
    units = {(True, False): "rad/m", (False, True): "m/rad"}.get((second.turns, first.turns))
    part = {"first": first.joint, "second": second.joint, "ratio": f"{ratio:.15g} {units}" if units else ratio}
    at.draft.add("gear", name, part, "coupled coordinates")
    yield second, first, offset - ratio * model.qpos0[first.address], ratio


def take_start(at: Assembly) -> dict[str, dict[str, Any]]:
    """Return the starts of joints by name; the bodies of free and ball joints get poses, all of them velocities."""
    data, starts = mujoco.MjData(at.model), dict[str, dict[str, Any]]()
    data.qpos[:], data.qvel[:] = at.q, at.v
    mujoco.mj_normalizeQuat(at.model, data.qpos)
    for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
        step(at.model, data)
    for j, one in at.joints.items():
        if one.single:
            given = {"position": at.q[one.address], "velocity": at.v[one.speed]}
            if found := {key: number for key, number in given.items() if number != 0.0}:
                starts[one.joint] = found
            continue
        b = at.model.jnt_bodyid[j]
        part = at.draft.parts["body"][at.places[b][0]]
        if one.type == "free" or not np.array_equal(data.qpos[one.address : one.address + 4], [1.0, 0.0, 0.0, 0.0]):
            part["pose"] = pose(Placement(np.array(data.xpos[b]), quaternion_to_matrix(np.array(data.xquat[b]))))
        if np.any(at.v):
            twist = np.zeros(6)
            mujoco.mj_objectVelocity(at.model, data, OBJECT.mjOBJ_BODY, b, twist, 0)
            part |= {"velocity": clean(twist[3:]), "angular_velocity": clean(twist[:3])}
    return starts


def names_of(model: Any, kind: Any, numbers: Iterator[int] | list[int]) -> str:
    """Return the names of objects of the model, or their numbers where they have none."""
    return ", ".join(mujoco.mj_id2name(model, kind, n) or f"no. {n}" for n in numbers)
