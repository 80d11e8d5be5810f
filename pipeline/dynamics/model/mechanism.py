"""The merged mechanism as Python objects: what `layout` turns into tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from pipeline.core.errors import InputError
from pipeline.core.scene.clearance import Clearance
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.model.chain import Stage, stages
from pipeline.dynamics.model.driving import prescribed
from pipeline.dynamics.model.merge import (
    Frame,
    Group,
    Placement,
    find_frame,
    frames_of,
    merge,
    rigid_inertia,
    start_places,
)
from pipeline.dynamics.model.tree import PATH, Branch, Edge, edges, span

#: share of the largest radius of gyration below which the distances of a scene are no size of it
NOTHING = 1e-9


@dataclass(frozen=True)
class Site:
    """A frame on a link that something uses; `frame` names it when the link is flexible."""

    link: int
    place: Placement
    frame: str | None


@dataclass(frozen=True)
class Link:
    """One link of the tree, in its own frame.

    A rigid link's frame is its inboard joint frame; a flexible one's is its body frame.
    places: frame of each of its bodies; none for a massless link within a joint (see `chain`).
    start: pose in the world.  stage: its part of the joint; None for a body that nothing holds.
    """

    branch: Branch
    group: Group
    places: dict[str, Placement]
    start: Placement
    inertia: tuple[float, np.ndarray, np.ndarray] | None
    kind: str
    inboard: Site | None
    stage: Stage | None = None

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of its prescribed coordinates: none, or all that it has."""
        return () if self.stage is None else self.stage.drives

    @property
    def flexible(self) -> str | None:
        """Name of the flexible body that this link is, or None."""
        return self.group.host if self.group.flexible else None


@dataclass(frozen=True)
class Mechanism:
    """Links in tree order, closures, contacts and drives of a scene; lengths in the world's axes.

    origin: point of the world that the kernels use as theirs, near the mechanism.  length: size of the mechanism [m].
    start_residual: largest residual of a joint in the poses that the scene gives [m, or the sine of an angle].
    """

    scene: Scene
    bundles: Mapping[str, xr.Dataset]
    frames: dict[str, Frame]
    links: list[Link]
    link_of: dict[str, int]
    closures: list[tuple[Edge, Site, Site]]
    contacts: list[tuple[str, Clearance, Site, Site]]
    origin: np.ndarray
    length: float
    start_residual: float = 0.0

    @property
    def drives(self) -> list[str]:
        """Names of the prescribed coordinates, in their order."""
        return [one.name for one in prescribed(self.scene)]

    def site(self, frame: str) -> Site:
        """The site at a named frame."""
        return _site(self.frames, self.links, self.link_of, frame)


def _site(frames: Mapping[str, Frame], links: list[Link], link_of: Mapping[str, int], name: str) -> Site:
    frame = find_frame(frames, name, "frame")
    i = link_of[frame.body]
    place = links[i].places[frame.body].of(frame.place)
    return Site(i, place, name if links[i].flexible else None)


def build(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Mechanism:
    """The system that a scene describes; InputError for what cannot be built."""
    require_bodies(scene)
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    starts = start_places(scene, groups, group_of, frames)
    branches, closing = span(groups, edges(scene, frames, group_of))
    origin = _centre(starts)
    links: list[Link] = []
    link_of: dict[str, int] = {}
    carried: list[int] = []  # link that carries each branch's group
    for branch in branches:
        group, start = groups[branch.group], Placement(starts[branch.group].p - origin, starts[branch.group].R)
        placed = replace(branch, parent=carried[branch.parent] if branch.parent >= 0 else -1)
        if branch.edge is None:
            links.append(_unjoined(scene, group, placed, start))
        else:
            links += _joined(scene, group, placed, start, frames, links, link_of, origin)
        carried.append(len(links) - 1)
        link_of.update(dict.fromkeys(group.places, len(links) - 1))

    def at(frame: str) -> Site:
        return _site(frames, links, link_of, frame)

    closures = [(e, at(e.frame_a), at(e.frame_b)) for e in closing]
    contacts = [(n, j, at(j.between[0]), at(j.between[1])) for n, j in scene.contacts().items()]
    length = _length(scene, links, frames)
    return Mechanism(scene, bundles, frames, links, link_of, closures, contacts, origin, length)


def _centre(starts: list[Placement]) -> np.ndarray:
    """A point near the mechanism: moments about it lose no digits, wherever the scene stands."""
    moving = [s.p for s in starts[1:]]
    return np.mean(moving, axis=0) if moving else np.zeros(3)


def _unjoined(scene: Scene, group: Group, branch: Branch, start: Placement) -> Link:
    """The ground, or a body that nothing holds."""
    if branch.parent < 0:
        places = {n: start.of(p) for n, p in group.places.items()}
        return Link(branch, group, places, Placement(), None, "fixed", None)
    return _carrier(scene, group, branch, start, _centre_frame(scene, group), Site(0, Placement(), None), "free", None)


def _joined(
    scene: Scene,
    group: Group,
    branch: Branch,
    start: Placement,
    frames: Mapping[str, Frame],
    links: list[Link],
    link_of: Mapping[str, int],
    origin: np.ndarray,
) -> list[Link]:
    """The link of a group, preceded by the massless ones of a joint that is a chain."""
    edge = branch.edge
    assert edge is not None
    near, far = (edge.frame_b, edge.frame_a) if branch.reverse else (edge.frame_a, edge.frame_b)
    inboard = Site(0, Placement(-origin), None) if edge.kind == PATH else _site(frames, links, link_of, near)
    parts = stages(edge, branch.reverse, inboard.frame is not None, group.flexible)
    here = links[inboard.link].start.of(inboard.place)
    axes, made = np.eye(3), list[Link]()
    for k, part in enumerate(parts):
        turned = Placement(R=axes.T @ part.axes)
        site = Site(inboard.link, inboard.place.of(turned), inboard.frame)
        if k == len(parts) - 1:
            own = group.places[frames[far].body].of(frames[far].place).of(Placement(R=part.axes))
            last = replace(branch, parent=site.link)
            return [*made, _carrier(scene, group, last, start, own, site, part.kind, part)]
        axes = part.axes
        pose = here.of(Placement(R=axes))
        between = replace(branch, parent=site.link)
        made.append(Link(between, Group("", {}, False), {}, pose, None, part.kind, site, part))
        inboard = Site(len(links) + k, Placement(), None)
    raise AssertionError("a joint has at least one stage")


def _carrier(
    scene: Scene,
    group: Group,
    branch: Branch,
    start: Placement,
    own: Placement,
    inboard: Site,
    kind: str,
    stage: Stage | None,
) -> Link:
    """Choose the link's frame, `own` in the group's host unless it is flexible, and express its bodies in it."""
    if group.flexible:
        return Link(branch, group, dict(group.places), start, None, kind, inboard, stage)
    inertia = rigid_inertia(scene, group, own)
    outward = own.inverse()
    places = {n: outward.of(p) for n, p in group.places.items()}
    return Link(branch, group, places, start.of(own), inertia, kind, inboard, stage)


def _centre_frame(scene: Scene, group: Group) -> Placement:
    """Frame of a free group: at its centre of mass, so that rotation and translation part."""
    if group.flexible:
        return Placement()
    _, com, _ = rigid_inertia(scene, group, Placement())
    return Placement(com, np.eye(3))


def _length(scene: Scene, links: list[Link], frames: Mapping[str, Frame]) -> float:
    """Size of the mechanism [m], or of the clearance it moves in: what a length tolerance is relative to."""
    points = []
    for link in links:
        for name, place in link.places.items():
            points += [link.start.of(place.of(f.place)).p for f in frames.values() if f.body == name]
            if link.inertia is not None:
                points.append(link.start.of(Placement(link.inertia[1])).p)
    cloud = np.array(points) if points else np.zeros((1, 3))
    size = float(np.max(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1)))
    size = max(size, *(joint.clearance for joint in scene.contacts().values()), 0.0)
    # of a body held at its centre of mass, only rounding of its place is left
    gyration = max((np.sqrt(np.trace(J) / (2.0 * mass)) for mass, _, J in _inertias(links)), default=0.0)
    return size if size > NOTHING * gyration else float(gyration) or 1.0


def _inertias(links: list[Link]) -> list[tuple[float, np.ndarray, np.ndarray]]:
    return [link.inertia for link in links if link.inertia is not None]


def require_bodies(scene: Scene) -> None:
    """InputError when nothing can move, and for a body that has been left out of a mechanism."""
    moving = [*scene.rigid(), *scene.flexible()]
    if not moving:
        raise InputError("[body]", "the scene has no body that could move", "add a rigid or flexible body")
    frames = [f for part in (scene.joint, scene.load, scene.drive) for p in part.values() for f in _named_frames(p)]
    held = {f.partition(".")[0] for f in frames}
    for name in moving:
        if scene.joint and name not in held:
            raise InputError(
                f"[body.{name}]",
                f"'{name}' is joined to nothing: no joint, load or path names a frame of it",
                'join it; that a body shall fly freely is said by a joint of type "free"',
            )


def _named_frames(part: object) -> tuple[str, ...]:
    between = getattr(part, "between", None)
    frame = getattr(part, "frame", None)
    return tuple(between) if between is not None else (frame,) if frame is not None else ()
