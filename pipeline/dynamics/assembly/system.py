"""The merged mechanism as Python objects: what `layout` turns into tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.core.errors import InputError
from pipeline.core.scene.parts import ClearanceSpherical
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.assembly.merge import (
    Frame,
    Group,
    Placement,
    find_frame,
    frames_of,
    merge,
    rigid_inertia,
    start_places,
)
from pipeline.dynamics.assembly.tree import Branch, Edge, edges, span


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
    places: frame of each of its bodies.  start: pose in the world.
    """

    branch: Branch
    group: Group
    places: dict[str, Placement]
    start: Placement
    inertia: tuple[float, np.ndarray, np.ndarray] | None
    kind: str
    inboard: Site | None

    @property
    def flexible(self) -> str | None:
        """Name of the flexible body that this link is, or None."""
        return self.group.host if self.group.flexible else None


@dataclass(frozen=True)
class System:
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
    contacts: list[tuple[str, ClearanceSpherical, Site, Site]]
    origin: np.ndarray
    length: float
    start_residual: float = 0.0

    @property
    def drives(self) -> list[str]:
        """Names of the drives, in the order of their prescribed coordinates."""
        return list(self.scene.drive)

    def site(self, frame: str) -> Site:
        """The site at a named frame."""
        return _site(self.frames, self.links, self.link_of, frame)


def _site(frames: Mapping[str, Frame], links: list[Link], link_of: Mapping[str, int], name: str) -> Site:
    frame = find_frame(frames, name, "frame")
    i = link_of[frame.body]
    place = links[i].places[frame.body].of(frame.place)
    return Site(i, place, name if links[i].flexible else None)


def build(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> System:
    """The system that a scene describes; InputError for what cannot be built."""
    require_bodies(scene)
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    starts = start_places(scene, groups, group_of, frames)
    branches, closing = span(groups, edges(scene, frames, group_of))
    origin = _centre(starts)
    links: list[Link] = []
    link_of: dict[str, int] = {}
    for branch in branches:
        links.append(_link(scene, groups[branch.group], branch, starts[branch.group], frames, links, link_of, origin))
        link_of.update(dict.fromkeys(groups[branch.group].places, len(links) - 1))

    def at(frame: str) -> Site:
        return _site(frames, links, link_of, frame)

    closures = [(e, at(e.frame_a), at(e.frame_b)) for e in closing]
    contacts = [(n, j, at(j.between[0]), at(j.between[1])) for n, j in scene.contacts().items()]
    length = _length(links, frames)
    return System(scene, bundles, frames, links, link_of, closures, contacts, origin, length)


def _centre(starts: list[Placement]) -> np.ndarray:
    """A point near the mechanism: moments about it lose no digits, wherever the scene stands."""
    moving = [s.p for s in starts[1:]]
    return np.mean(moving, axis=0) if moving else np.zeros(3)


def _link(
    scene: Scene,
    group: Group,
    branch: Branch,
    start: Placement,
    frames: Mapping[str, Frame],
    links: list[Link],
    link_of: Mapping[str, int],
    origin: np.ndarray,
) -> Link:
    """Choose the link's frame and express its bodies in it."""
    here = Placement(start.p - origin, start.R)
    if branch.parent < 0:
        places = {n: here.of(p) for n, p in group.places.items()}
        return Link(branch, group, places, Placement(), None, "fixed", None)
    if branch.edge is None:
        inboard, own, kind = Site(0, Placement(), None), _centre_frame(scene, group), "free"
    else:
        near, far = branch.edge.frame_a, branch.edge.frame_b
        if branch.reverse:
            near, far = far, near
        inboard, kind = _site(frames, links, link_of, near), branch.edge.kind
        frame = frames[far]
        own = group.places[frame.body].of(frame.place)
    if group.flexible:
        return Link(branch, group, dict(group.places), here, None, kind, inboard)
    inertia = rigid_inertia(scene, group, own)
    outward = own.inverse()
    places = {n: outward.of(p) for n, p in group.places.items()}
    return Link(branch, group, places, here.of(own), inertia, kind, inboard)


def _centre_frame(scene: Scene, group: Group) -> Placement:
    """Frame of a free group: at its centre of mass, so that rotation and translation part."""
    if group.flexible:
        return Placement()
    _, com, _ = rigid_inertia(scene, group, Placement())
    return Placement(com, np.eye(3))


def _length(links: list[Link], frames: Mapping[str, Frame]) -> float:
    """Size of the mechanism [m]: the scale of what a length tolerance is relative to."""
    points = []
    for link in links:
        for name, place in link.places.items():
            points += [link.start.of(place.of(f.place)).p for f in frames.values() if f.body == name]
            if link.inertia is not None:
                points.append(link.start.of(Placement(link.inertia[1])).p)
    cloud = np.array(points) if points else np.zeros((1, 3))
    size = float(np.max(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1)))
    return size if size > 0.0 else 1.0


def require_bodies(scene: Scene) -> None:
    """InputError when nothing can move."""
    if not scene.rigid() and not scene.flexible():
        raise InputError("[body]", "the scene has no body that could move", "add a rigid or flexible body")
