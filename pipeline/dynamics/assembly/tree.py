"""Spanning tree of links and joints; what is left over are closures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.core.errors import InputError
from pipeline.core.registry import lookup
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.assembly.merge import Frame, Group, find_frame
from pipeline.dynamics.joints import HELD

JOINTS = "pipeline.dynamics.joints"


@dataclass(frozen=True)
class Edge:
    """A joint between two groups. `drive`: name of the drive that prescribes it, or None."""

    name: str
    kind: str
    a: int
    b: int
    frame_a: str
    frame_b: str
    drive: str | None


@dataclass(frozen=True)
class Branch:
    """A link of the tree: its group, its parent link, and the joint that carries it.

    reverse: the joint's second frame is on the parent.  edge: None for a body that nothing holds.
    """

    group: int
    parent: int
    edge: Edge | None
    reverse: bool = False


def edges(scene: Scene, frames: Mapping[str, Frame], group_of: Mapping[str, int]) -> list[Edge]:
    """Joints between different groups. Of a clearance joint, what it holds beside its contact, which is a force."""
    driven = _driven_joints(scene)
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
                    f"[joint.{name}]", "its two bodies are rigidly joined already", "remove it, or a fixed joint"
                )
            continue
        result.append(Edge(name, kind, ga, gb, *joint.between, driven.get(name)))
    return result


def _driven_joints(scene: Scene) -> dict[str, str]:
    driven: dict[str, str] = {}
    for name, drive in scene.drive.items():
        place = f"[drive.{name}.joint]"
        if drive.joint not in scene.joint:
            raise InputError(place, f"there is no joint '{drive.joint}'", f"known: {', '.join(scene.joint)}")
        kind = scene.joint[drive.joint].type
        if kind not in ("prismatic", "revolute"):
            raise InputError(
                place, f"a {kind} joint has no single coordinate to prescribe", "drive a prismatic or revolute joint"
            )
        if drive.joint in driven:
            raise InputError(
                place, f"joint '{drive.joint}' is driven already by '{driven[drive.joint]}'", "remove one drive"
            )
        driven[drive.joint] = name
    return driven


def span(groups: list[Group], joints: list[Edge]) -> tuple[list[Branch], list[Edge]]:
    """Links in an order where parents come first (link 0 is the ground), and the closures.

    The tree takes the joints with the fewest free coordinates first (driven ones have none), then
    those nearest to the ground: that keeps the unknowns and the chains short.
    """
    branches = [Branch(0, -1, None)]
    link_of = {0: 0}
    depth = [0]
    left = list(joints)
    while len(branches) < len(groups):
        frontier = [e for e in left if (e.a in link_of) != (e.b in link_of)]
        if frontier:
            best = min(frontier, key=lambda e: (_freedom(e), depth[link_of[e.a if e.a in link_of else e.b]]))
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
        if edge.drive is not None:
            raise InputError(
                f"[drive.{edge.drive}]",
                f"joint '{edge.name}' closes a loop whose other joints are all driven",
                "remove a drive",
            )
    return branches, left


def _freedom(edge: Edge) -> int:
    return 0 if edge.drive is not None else len(joint_class(edge.kind).SPEEDS)


def joint_class(kind: str) -> Any:
    """The class that declares a joint type."""
    return lookup(JOINTS, kind, where="joint")
