"""Merging of rigidly joined bodies into links, in which every body and frame has a fixed placement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexclear.dynamics.joints.conditions import Pose
from flexclear.dynamics.vectors import Matrix, Vector
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.parts import FlexibleBody, Ground, MeshedRigidBody, RigidBody
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled

GROUND = "ground"


@dataclass(frozen=True)
class Placement:
    """Pose of a frame: origin p and axes R (columns) in a parent frame."""

    p: np.ndarray = field(default_factory=lambda: np.zeros(3))
    R: np.ndarray = field(default_factory=lambda: np.eye(3))

    def of(self, inner: Placement) -> Placement:
        """Return `inner`, given in this frame, in this frame's parent."""
        return Placement(self.p + self.R @ inner.p, self.R @ inner.R)

    def point(self, p: np.ndarray) -> np.ndarray:
        """Return a point, given in this frame, in this frame's parent."""
        return np.asarray(self.p + self.R @ p)

    @property
    def pose(self) -> Pose:
        """The pose as vectors of plain numbers, which joints' functions take."""
        return Pose(Matrix(self.R.ravel().tolist()), Vector(self.p.tolist()))

    def inverse(self) -> Placement:
        """Return the pose of the parent in this frame."""
        return Placement(-self.R.T @ self.p, self.R.T)


@dataclass(frozen=True)
class Frame:
    """A named frame: its body and its undeformed placement there."""

    body: str
    placement: Placement


@dataclass(frozen=True)
class Group:
    """Bodies that move as one; placements: each body's frame in that of the first one, the host."""

    host: str
    placements: dict[str, Placement]
    flexible: bool


class RigidInertia(NamedTuple):
    """Mass [kg], centre of mass [m], shape (3,), and inertia about it [kg m^2], shape (3, 3), in one frame."""

    mass: float
    com: np.ndarray
    moments: np.ndarray


def frames_of(scene: Scene, bundles: Mapping[str, Labelled]) -> dict[str, Frame]:
    """Return all named frames of the scene by ``body.FRAME``."""
    frames: dict[str, Frame] = {}
    for name, body in scene.body.items():
        if isinstance(body, FlexibleBody):
            bundle = bundles[name]
            for k, frame in enumerate(bundle["frame"].values):
                placement = Placement(bundle["frame_position"].values[k], bundle["frame_rotation"].values[k])
                frames[f"{name}.{frame}"] = Frame(name, placement)
        elif isinstance(body, MeshedRigidBody):
            raise InputError(f"[body.{name}.mesh]", "its mass and frames have not been read from the recipe")
        else:
            for frame, pose in body.frames.items():
                R = quaternion_to_matrix(pose.as_quaternion())
                frames[f"{name}.{frame}"] = Frame(name, Placement(np.array(pose.position), R))
    return frames


def find_frame(frames: Mapping[str, Frame], name: str, path: str) -> Frame:
    """Return the frame called `name`; raise InputError that suggests the nearest name when none has it."""
    if name not in frames:
        raise InputError(path, f"there is no frame '{name}'", suggestion(name, list(frames)))
    return frames[name]


def merge(scene: Scene, frames: Mapping[str, Frame]) -> tuple[list[Group], dict[str, int]]:
    """Return groups of rigidly joined bodies (the ground's first), and the group of each body."""
    neighbours: dict[str, list[tuple[str, Placement]]] = {name: [] for name in scene.body}
    grounds = [n for n, b in scene.body.items() if isinstance(b, Ground)]
    for name, joint in scene.joint.items():
        if joint.type != "fixed":
            continue
        a, b = (find_frame(frames, f, f"[joint.{name}.between]") for f in joint.between)
        if _is_flexible(scene, a.body) or _is_flexible(scene, b.body):
            continue
        b_in_a = a.placement.of(b.placement.inverse())
        neighbours[a.body].append((b.body, b_in_a))
        neighbours[b.body].append((a.body, b_in_a.inverse()))
    groups: list[Group] = []
    group_of: dict[str, int] = {}
    for root in [*grounds, *(n for n in scene.body if n not in grounds)]:
        if root in group_of:
            continue
        is_ground = root in grounds
        if is_ground and groups:
            places = groups[0].placements  # several bodies of type ground are one world
        else:
            places = {}
            groups.append(Group(root, places, _is_flexible(scene, root)))
        _flood(root, neighbours, places)
        group_of.update(dict.fromkeys(places, 0 if is_ground else len(groups) - 1))
    if not grounds:
        groups.insert(0, Group(GROUND, {}, False))
        group_of = {n: i + 1 for n, i in group_of.items()}
    _refuse_bent(scene, frames, groups, group_of)
    return groups, group_of


def _refuse_bent(scene: Scene, frames: Mapping[str, Frame], groups: list[Group], group_of: Mapping[str, int]) -> None:
    """Raise InputError for fixed joints around a loop of rigid bodies that do not fit together."""
    same = _same_place(scene, frames)
    for name, joint in scene.joint.items():
        if joint.type != "fixed":
            continue
        a, b = (frames[f] for f in joint.between)
        if group_of[a.body] != group_of[b.body]:
            continue
        places = groups[group_of[a.body]].placements
        A, B = places[a.body].of(a.placement), places[b.body].of(b.placement)
        if not _close(A, B, same + _tolerance(scene, a.body, b.body)):
            angle = np.degrees(np.arccos(np.clip((np.trace(A.R.T @ B.R) - 1.0) / 2.0, -1.0, 1.0)))
            raise InputError(
                f"[joint.{name}.between]",
                f"other fixed joints place '{joint.between[0]}' and '{joint.between[1]}' "
                f"{np.linalg.norm(A.p - B.p):.3g} m and {angle:.3g} deg apart",
                "remove a fixed joint, or correct the frames",
            )


def _flood(root: str, neighbours: Mapping[str, list[tuple[str, Placement]]], places: dict[str, Placement]) -> None:
    places[root] = Placement()
    stack = [root]
    while stack:
        body = stack.pop()
        for other, relative in neighbours[body]:
            if other not in places:
                places[other] = places[body].of(relative)
                stack.append(other)


def _is_flexible(scene: Scene, body: str) -> bool:
    return isinstance(scene.body[body], FlexibleBody)


def rigid_inertia(scene: Scene, places: Mapping[str, Placement]) -> RigidInertia:
    """Return the inertia of rigid bodies that move as one; places: their placements in the requested frame."""
    mass, first = 0.0, np.zeros(3)
    parts = []
    for name, here in places.items():
        body = scene.body[name]
        if not isinstance(body, RigidBody):
            continue
        c = here.p + here.R @ np.array(body.com)
        parts.append((body.mass, c, here.R @ np.array(body.inertia) @ here.R.T))
        mass += body.mass
        first = first + body.mass * c
    com = first / mass if mass > 0.0 else parts[0][1]
    inertia = np.zeros((3, 3))
    for m, c, J in parts:
        d = c - com
        inertia += J + m * (d @ d * np.eye(3) - np.outer(d, d))
    return RigidInertia(mass, com, inertia)


def start_places(
    scene: Scene,
    groups: list[Group],
    group_of: Mapping[str, int],
    frames: Mapping[str, Frame],
    led: Mapping[str, Placement],
) -> list[Placement]:
    """Return the start pose of every group's host frame in the world.

    A group without given pose takes it from a joint to a group with a pose, the joint's frames coinciding, else from
    `led`, the poses of frames at the start of their paths.  Raises
    InputError for a group without any pose, and for a pose that contradicts the fixed joints.
    """
    known: dict[int, Placement] = {0: Placement()}
    same = _same_place(scene, frames)
    for i, group in enumerate(groups[1:], start=1):
        for name, placement in group.placements.items():
            pose = scene.body[name].pose  # type: ignore[union-attr]
            if pose is None:
                continue
            here = Placement(np.array(pose.position), quaternion_to_matrix(pose.as_quaternion())).of(
                placement.inverse()
            )
            if i in known and not _close(known[i], here, same + _tolerance(scene, *group.placements)):
                raise InputError(
                    f"[body.{name}.pose]",
                    "contradicts the poses of the bodies that it is fixed to",
                    "give only one body of a rigid group a pose",
                )
            known.setdefault(i, here)
    _propagate(scene, group_of, frames, groups, known)
    for name, place in led.items():
        frame = find_frame(frames, name, "[drive]")
        mine = group_of[frame.body]
        if mine not in known:
            known[mine] = place.of(groups[mine].placements[frame.body].of(frame.placement).inverse())
            _propagate(scene, group_of, frames, groups, known)
    missing = [groups[i].host for i in range(len(groups)) if i not in known]
    if missing:
        raise InputError(
            f"[body.{missing[0]}.pose]", f"{', '.join(missing)} have no start pose", "give poses, or joints"
        )
    return [known[i] for i in range(len(groups))]


def _same_place(scene: Scene, frames: Mapping[str, Frame]) -> float:
    """Return the distance [m] below which points coincide: 1e-9, but within 1e-9 and 1e-6 of the scene's extent."""
    poses = [pose.position for body in scene.body.values() if (pose := getattr(body, "pose", None)) is not None]
    origins = np.array([(0.0, 0.0, 0.0), *poses])
    span = max([*np.ptp(origins, axis=0), *(float(np.linalg.norm(f.placement.p)) for f in frames.values())])
    return float(np.clip(1e-9, 1e-9 * span, 1e-6 * span)) if span > 0.0 else 1e-9


def _tolerance(scene: Scene, *bodies: str) -> float:
    """Return the largest distance by which frames of some bodies may be moved [m]."""
    return max(getattr(scene.body[body], "frame_tolerance", 0.0) for body in bodies)


def _close(a: Placement, b: Placement, same: float) -> bool:
    """Return True when two placements coincide; same: distance that counts as none [m]."""
    return bool(np.allclose(a.p, b.p, rtol=0, atol=same) and np.allclose(a.R, b.R, rtol=0, atol=1e-9))


def _propagate(
    scene: Scene,
    group_of: Mapping[str, int],
    frames: Mapping[str, Frame],
    groups: list[Group],
    known: dict[int, Placement],
) -> None:
    # fixed joints determine a pose exactly, so they come first
    joints = sorted(scene.joint.items(), key=lambda item: item[1].type != "fixed")
    changed = True
    while changed:
        changed = False
        for name, joint in joints:
            a, b = (find_frame(frames, f, f"[joint.{name}.between]") for f in joint.between)
            ga, gb = group_of[a.body], group_of[b.body]
            if (ga in known) == (gb in known):
                continue
            (new, inner), (old, outer) = ((gb, b), (ga, a)) if ga in known else ((ga, a), (gb, b))
            there = known[old].of(groups[old].placements[outer.body]).of(outer.placement)
            known[new] = there.of(groups[new].placements[inner.body].of(inner.placement).inverse())
            changed = True
            break
