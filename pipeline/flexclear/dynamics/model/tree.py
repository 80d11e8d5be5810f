"""Spanning tree of links and joints; the joints that the tree does not use are closures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flexclear.dynamics.joints import HELD
from flexclear.dynamics.model.driving import joint_drives, joint_type
from flexclear.dynamics.model.merge import Frame, Group, find_frame
from flexclear.scene.drives import PathDrive
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

#: kind of an edge for a frame's pose in the world, prescribed in part or whole, instead of a joint of the scene
PATH = "path"


@dataclass(frozen=True)
class Edge:
    """A joint between two groups, or the path of a frame in the world (PATH).

    drives: prescribed coordinate of each freedom, or None; empty when none is prescribed.
    vector: True when the path gives a rotation vector.
    """

    name: str
    kind: str
    a: int
    b: int
    frame_a: str
    frame_b: str
    drives: tuple[str | None, ...] = ()
    vector: bool = False


@dataclass(frozen=True)
class Branch:
    """A link of the tree: its group, its parent link, and the joint that carries the link.

    reverse: the joint's second frame is on the parent.  edge: None for a body without joint.
    """

    group: int
    parent: int
    edge: Edge | None
    reverse: bool = False

    @property
    def frame(self) -> str | None:
        """The joint's frame on the link itself; None for a body without joint."""
        return None if self.edge is None else self.edge.frame_a if self.reverse else self.edge.frame_b


def edges(scene: Scene, frames: Mapping[str, Frame], group_of: Mapping[str, int]) -> list[Edge]:
    """Return joints between different groups, and paths; of a clearance joint, its constraints beyond the contact."""
    driven = joint_drives(scene)
    result = []
    contacts = scene.contacts()
    for name, joint in scene.joint.items():
        a, b = (find_frame(frames, f, f"[joint.{name}.between]") for f in joint.between)
        if a.body == b.body:
            raise InputError(f"[joint.{name}.between]", f"joins '{a.body}' to itself", "name frames of two bodies")
        kind = HELD.get(joint.type) if name in contacts else joint.type
        if kind is None:
            continue
        ga, gb = group_of[a.body], group_of[b.body]
        if ga == gb:
            if kind != "fixed":
                raise InputError(
                    f"[joint.{name}]", "its two bodies are already rigidly connected", "remove it, or a fixed joint"
                )
            continue
        result.append(Edge(name, kind, ga, gb, *joint.between, driven.get(name, ())))
    return result + _paths(scene, frames, group_of)


def _paths(scene: Scene, frames: Mapping[str, Frame], group_of: Mapping[str, int]) -> list[Edge]:
    """Return edges from the ground to the frames whose pose is prescribed."""
    result: list[Edge] = []
    for name, drive in scene.drive.items():
        if not isinstance(drive, PathDrive):
            continue
        path = f"[drive.{name}.frame]"
        group = group_of[find_frame(frames, drive.frame, path).body]
        if group == 0:
            raise InputError(path, f"'{drive.frame}' belongs to the ground, which does not move", "name another frame")
        if group in (e.b for e in result):
            raise InputError(path, f"the body of '{drive.frame}' has a path already", "remove one of the two")
        laws = dict(drive.components())
        parts = [f"{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"]
        drives = tuple(f"{name}.{part}" if part in laws else None for part in parts)
        vector = drive.angles == "rotation-vector" and any(drives[3:])
        result.append(Edge(f"drive.{name}", PATH, 0, group, "", drive.frame, drives, vector))
    return result


def span(groups: list[Group], joints: list[Edge]) -> tuple[list[Branch], list[Edge]]:
    """Return links, parents first (link 0 is the ground), and the closures.

    The tree takes joints with prescribed coordinates first, then those with the fewest free coordinates, then those
    nearest to the ground: that keeps the unknowns few and the chains short.
    """
    branches = [Branch(0, -1, None)]
    link_of = {0: 0}
    depth = [0]
    left = list(joints)
    while len(branches) < len(groups):
        frontier = [e for e in left if (e.a in link_of) != (e.b in link_of)]
        if frontier:
            best = min(
                frontier, key=lambda e: (not any(e.drives), _freedom(e), depth[link_of[e.a if e.a in link_of else e.b]])
            )
            left.remove(best)
            reverse = best.a not in link_of
            parent, group = (best.b, best.a) if reverse else (best.a, best.b)
            branches.append(Branch(group, link_of[parent], best, reverse))
        else:
            group = next(g for g in range(len(groups)) if g not in link_of)
            branches.append(Branch(group, 0, None))
        link_of[group] = len(branches) - 1
        depth.append(depth[branches[-1].parent] + 1)
    for edge in left:
        if any(edge.drives):
            drive = next(d for d in edge.drives if d).partition(".")[0]
            raise InputError(
                f"[drive.{drive}]",
                f"'{edge.name}' closes a loop of which all other joints are driven",
                "remove a drive",
            )
    return branches, left


def _freedom(edge: Edge) -> int:
    if edge.kind == PATH:
        return edge.drives.count(None)
    return len(joint_type(edge.kind).SPEEDS) - sum(d is not None for d in edge.drives)
