"""Mechanism of a scene: links in the order of a spanning tree, closures and contacts, before numbering."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexclear.dynamics.joints.conditions import rows
from flexclear.dynamics.model.chain import InboardJoint, chain, path_pose
from flexclear.dynamics.model.components import Components, components, coupled_frames
from flexclear.dynamics.model.driving import joint_type, prescribed_coordinates
from flexclear.dynamics.model.laws import checked_law
from flexclear.dynamics.model.merge import (
    Frame,
    Group,
    Placement,
    RigidInertia,
    find_frame,
    frames_of,
    merge,
    rigid_inertia,
    start_places,
)
from flexclear.dynamics.model.start_table import given_modes
from flexclear.dynamics.model.stops import End, ends
from flexclear.dynamics.model.tree import PATH, Branch, Edge, edges, span
from flexclear.scene.drives import PathDrive
from flexclear.scene.pairs import MIDDLE, Pair, Seat
from flexclear.scene.parts import Ground
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled


@dataclass(frozen=True)
class Site:
    """A frame on a link that a joint, contact or load uses; frame: its name when the link is flexible."""

    link: int
    placement: Placement
    frame: str | None


class Closure(NamedTuple):
    """A joint that closes a loop of the tree, between sites at its first and second frame."""

    edge: Edge
    a: Site
    b: Site

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.edge.name

    @property
    def ends(self) -> list[tuple[Site, Site]]:
        """Pairs of sites between which the closure acts."""
        return [(self.a, self.b)]

    @property
    def rows(self) -> list[tuple[int, int, int]]:
        """Rows of the table CLOSURE_ROWS."""
        return rows(joint_type(self.edge.kind))


class Contact(NamedTuple):
    """A pair of features of a clearance joint, or an end of a stop: its name, its surfaces and laws, and two sites.

    outer, inner: of the socket or journal, and of the ball or pin; of a stop, of the joint's first and second frame.
    others: likewise of the joint whose coordinate a stop subtracts.
    """

    name: str
    joint: Any
    outer: Site
    inner: Site
    others: tuple[Site, ...] = ()

    @property
    def family(self) -> str:
        """Family of the scene's parts that it belongs to."""
        return self.joint.family if isinstance(self.joint, End) else "joint"

    @property
    def words(self) -> str:
        """Name of the contact in messages."""
        return f"{self.family} {self.name}"

    @property
    def owner(self) -> str:
        """Name of the joint or stop."""
        return self.name.partition(".")[0]

    @property
    def place(self) -> str:
        """Key path of the joint or stop in the scene."""
        return f"{self.family}.{self.owner}"


@dataclass(frozen=True)
class Link:
    """One link of the tree, in its own frame.

    A rigid link's frame is its inboard joint frame; a flexible one's is its body frame.
    placements: frame of each of its bodies; none for a massless link within a joint (see `chain`).
    start: pose from the mechanism's origin, world axes.  inboard: site of its joint on the parent; None for the ground.
    inertia: of a rigid link, in its frame.  bundle: of a flexible one.
    """

    branch: Branch
    group: Group
    placements: dict[str, Placement]
    start: Placement
    joint: InboardJoint
    inboard: Site | None
    inertia: RigidInertia | None = None
    bundle: Labelled | None = None

    @property
    def kind(self) -> str:
        """Type of its inboard joint."""
        return self.joint.kind

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of its prescribed coordinates: none or all of its joint's."""
        return self.joint.drives

    @property
    def flexible(self) -> str | None:
        """Name of the flexible body that this link is, or None."""
        return self.group.host if self.group.flexible else None

    @cached_property
    def mass(self) -> float:
        """Mass [kg]; 0 for the ground and for massless links within a joint."""
        if self.bundle is not None:
            return float(self.bundle["mass"].values)
        return 0.0 if self.inertia is None else self.inertia.mass

    @cached_property
    def undeformed(self) -> RigidInertia | None:
        """Mass, centre of mass and inertia about it in the link's frame, undeformed; None for a massless link."""
        if self.bundle is None:
            return self.inertia
        if "inertia" in self.bundle:  # a bundle without modes
            return RigidInertia(self.mass, self.bundle["com"].values, self.bundle["inertia"].values)
        com = self.bundle["first_moment"].values / self.mass
        second = self.bundle["second_moment"].values - self.mass * np.outer(com, com)
        return RigidInertia(self.mass, com, np.trace(second) * np.eye(3) - second)

    @property
    def massless(self) -> bool:
        """True for the ground, and for a link that only connects two coordinates of a joint."""
        return self.inertia is None and self.bundle is None

    @property
    def on_path(self) -> bool:
        """True when a prescribed pose in the world replaces its joint."""
        return self.branch.edge is not None and self.branch.edge.kind == PATH


@dataclass(frozen=True)
class Mechanism:
    """Links in tree order, closures and contacts of a scene; lengths in the world's axes.

    origin: point of the world, close to the mechanism, from which positions count.  length: size of the mechanism [m].
    components: its independent mechanisms.
    start_residual: largest residual of a joint or drive in the poses that the scene gives [m, rad or a sine].
    placed: frames of all links as the scene gives them, before joints and drives are made to fit.
    choice: sentence on the choice among several assemblies, and on frames moved to fit; empty without these.
    deformation: modal coordinates at the start of the flexible links to which the scene gives some.
    """

    scene: Scene
    frames: dict[str, Frame]
    links: list[Link]
    link_of: dict[str, int]
    closures: list[Closure]
    contacts: list[Contact]
    origin: np.ndarray
    length: float
    components: Components
    start_residual: float = 0.0
    placed: tuple[Placement, ...] = ()
    deformation: Mapping[int, np.ndarray] = field(default_factory=dict)
    choice: str = ""

    @cached_property
    def drives(self) -> tuple[str, ...]:
        """Names of the prescribed coordinates, in the order of the scene."""
        return tuple(one.name for one in prescribed_coordinates(self.scene))

    @cached_property
    def drive_signs(self) -> np.ndarray:
        """Factor from a drive's coordinate in the scene to that in the tree, shape (drives,).

        It is -1 where the tree meets the joint from its second frame, otherwise 1.
        """
        signs = {name: link.joint.sign for link in self.links for name in link.drives}
        return np.array([signs[name] for name in self.drives])

    @cached_property
    def moving_bodies(self) -> list[str]:
        """Names of all bodies but the ground, as the scene lists them."""
        return [name for name, body in self.scene.body.items() if not isinstance(body, Ground)]

    @property
    def has_paths(self) -> bool:
        """True when the pose of a frame in the world is prescribed."""
        return any(link.on_path for link in self.links)

    @property
    def all_rigid(self) -> bool:
        """True when no body is flexible."""
        return not any(link.flexible for link in self.links)

    def site(self, frame: str) -> Site:
        """Return the site at a named frame."""
        return _site(self.frames, self.links, self.link_of, frame)

    def touching(self, pairs: Mapping[str, Pair]) -> list[Contact]:
        """Return the contacts of pairs; raise InputError for a feature beside a frame of a flexible body."""
        return _contacts(pairs, self.site)


def _site(frames: Mapping[str, Frame], links: list[Link], link_of: Mapping[str, int], name: str) -> Site:
    frame = find_frame(frames, name, "frame")
    i = link_of[frame.body]
    placement = links[i].placements[frame.body].of(frame.placement)
    return Site(i, placement, name if links[i].flexible else None)


def build(scene: Scene, bundles: Mapping[str, Labelled]) -> Mechanism:
    """Return the mechanism of a scene; raise InputError for a scene that cannot be built.

    bundles: reduced flexible bodies by name.
    """
    require_bodies(scene)
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    starts = start_places(scene, groups, group_of, frames, _poses_on_paths(scene))
    masses = [0.0, *(_mass(scene, group, bundles) for group in groups[1:])]
    branches, closing = span(masses, edges(scene, frames, group_of))
    origin = _centre(starts)
    links: list[Link] = []
    link_of: dict[str, int] = {}
    carried: list[int] = []  # link that carries each branch's group
    for branch in branches:
        group, start = groups[branch.group], Placement(starts[branch.group].p - origin, starts[branch.group].R)
        placed = replace(branch, parent=carried[branch.parent] if branch.parent >= 0 else -1)
        body = _Body(scene, group, start, bundles[group.host] if group.flexible else None)
        if branch.edge is None:
            links.append(_free_link(body, placed))
        else:
            links += _links_of_group(body, placed, frames, links, link_of, origin)
        carried.append(len(links) - 1)
        link_of.update(dict.fromkeys(group.placements, len(links) - 1))

    def at(frame: str) -> Site:
        return _site(frames, links, link_of, frame)

    closures = [Closure(e, at(e.frame_a), at(e.frame_b)) for e in closing]
    length, parts = sizes(scene, links, link_of, frames)
    far = {
        name: parts.lengths[parts.of(*_links_of(scene.joint[name], link_of))]
        for name in {stop.joint for stop in scene.stops().values()} & scene.joint.keys()
    }
    contacts = _contacts(scene.pairs(), at)
    for name, end in ends(scene, far):
        outer, inner, *others = (at(frame) for frame in end.frames)
        contacts.append(Contact(name, end, outer, inner, tuple(others)))
    deformation = {link_of[name]: q for name, q in given_modes(scene, bundles).items()}
    return Mechanism(scene, frames, links, link_of, closures, contacts, origin, length, parts, deformation=deformation)


def _contacts(pairs: Mapping[str, Pair], at: Callable[[str], Site]) -> list[Contact]:
    seats = {name: [_seated(name, at, *end) for end in pair.between] for name, pair in pairs.items()}
    return [Contact(name, pair.contact, seats[name][0], seats[name][1]) for name, pair in pairs.items()]


def _seated(name: str, at: Callable[[str], Site], frame: str, seat: Seat) -> Site:
    """Return the site of a feature of a contact called `name`, at its seat in a frame."""
    site = at(frame)
    if seat == MIDDLE:
        return site
    if site.frame is not None:
        raise InputError(
            f"[joint.{name.partition('.')[0]}.between]",
            f"'{frame}' is on a flexible body, and surfaces beside its frames are on rigid bodies only",
            "fix a rigid body to the frame by a fixed joint, and name a frame of that",
        )
    return replace(site, placement=site.placement.of(Placement(np.array(seat.origin), np.array(seat.axes))))


def _mass(scene: Scene, group: Group, bundles: Mapping[str, Labelled]) -> float:
    """Return the mass of a group of bodies [kg]."""
    return float(bundles[group.host]["mass"].values) if group.flexible else rigid_inertia(scene, group.placements).mass


def _poses_on_paths(scene: Scene) -> dict[str, Placement]:
    """Return the poses at the start of frames on a path, of bodies without a given pose."""
    places = {}
    for name, drive in scene.drive.items():
        body = scene.body.get(drive.frame.partition(".")[0]) if isinstance(drive, PathDrive) else None
        if isinstance(drive, PathDrive) and getattr(body, "pose", drive) is None:
            mine = [one for one in prescribed_coordinates(scene) if one.name.startswith(f"{name}.")]
            laws = {one.name: checked_law(scene, one.law, one.dimension, one.place) for one in mine}
            values = {one.removeprefix(f"{name}."): law.value(scene.time.start) for one, law in laws.items()}
            places[drive.frame] = path_pose(values, drive.angles == "rotation-vector")
    return places


def _centre(starts: list[Placement]) -> np.ndarray:
    """Return a point close to the mechanism: moments about it lose no digits, wherever the scene is."""
    moving = [s.p for s in starts[1:]]
    return np.mean(moving, axis=0) if moving else np.zeros(3)


@dataclass(frozen=True)
class _Body:
    """A group of bodies that becomes a link; start: pose of its host frame; bundle: of a flexible body."""

    scene: Scene
    group: Group
    start: Placement
    bundle: Labelled | None

    def link(self, branch: Branch, own: Placement, inboard: Site, joint: InboardJoint) -> Link:
        """Return the link; own: its frame in the host's, for rigid bodies."""
        if self.bundle is not None:
            places = dict(self.group.placements)
            return Link(branch, self.group, places, self.start, joint, inboard, bundle=self.bundle)
        outward = own.inverse()
        places = {n: outward.of(p) for n, p in self.group.placements.items()}
        inertia = rigid_inertia(self.scene, places)
        return Link(branch, self.group, places, self.start.of(own), joint, inboard, inertia)


def _free_link(body: _Body, branch: Branch) -> Link:
    """Return the ground, or a body without joint, with its frame at the centre of mass to decouple its motions."""
    if branch.parent < 0:
        places = {n: body.start.of(p) for n, p in body.group.placements.items()}
        return Link(branch, body.group, places, Placement(), InboardJoint("fixed"), None)
    rigid = body.bundle is None
    own = Placement(rigid_inertia(body.scene, body.group.placements).com) if rigid else Placement()
    return body.link(branch, own, Site(0, Placement(), None), InboardJoint("free"))


def _links_of_group(
    body: _Body,
    branch: Branch,
    frames: Mapping[str, Frame],
    links: list[Link],
    link_of: Mapping[str, int],
    origin: np.ndarray,
) -> list[Link]:
    """Return the link of a group, preceded by the massless links of a joint that is a chain."""
    edge, far = branch.edge, branch.frame
    assert edge is not None
    assert far is not None
    path = edge.kind == PATH
    near = edge.frame_b if branch.reverse else edge.frame_a
    inboard = Site(0, Placement(-origin), None) if path else _site(frames, links, link_of, near)
    joints = chain(edge, branch.reverse, inboard.frame is not None, body.group.flexible)
    here = links[inboard.link].start.of(inboard.placement)
    axes, between = np.eye(3), list[Link]()
    for joint in joints:
        turned = Placement(R=axes.T @ joint.axes)
        site = Site(inboard.link, inboard.placement.of(turned), inboard.frame)
        placed, axes = replace(branch, parent=site.link), joint.axes
        if joint is joints[-1]:
            break
        pose = here.of(Placement(R=axes))
        between.append(Link(placed, Group("", {}, False), {}, pose, joint, site))
        inboard = Site(len(links) + len(between) - 1, Placement(), None)
    own = body.group.placements[frames[far].body].of(frames[far].placement).of(Placement(R=axes))
    return [*between, body.link(placed, own, site, joint)]


def sizes(
    scene: Scene, links: list[Link], link_of: Mapping[str, int], frames: Mapping[str, Frame]
) -> tuple[float, Components]:
    """Return the size of the scene [m] and its independent mechanisms with theirs; length tolerances refer to these.

    Frames on the ground count in the size of an independent mechanism only if that mechanism uses them.
    """
    result = components(scene, [link.branch.parent for link in links], link_of)
    contacts = scene.contacts().values()

    def size(number: int) -> float:
        mine = [link for link, of in zip(links, result.of_link, strict=True) if of in (number, -1)]
        known = {n: f for n, f in frames.items() if link_of.get(f.body) != 0 or n in result.frames[number]}
        loose = [j.clearance for j in contacts if result.of(*_links_of(j, link_of)) == number]
        return _size(mine, known, loose)

    whole = _size(links, frames, [joint.clearance for joint in contacts])
    return whole, replace(result, lengths=tuple(size(k) for k in range(len(result.frames))))


def _links_of(joint: Any, link_of: Mapping[str, int]) -> list[int]:
    """Return the links that a joint connects."""
    return [link_of[frame.partition(".")[0]] for frame in joint.between]


def _size(links: Sequence[Link], frames: Mapping[str, Frame], clearances: Sequence[float]) -> float:
    """Return the size of some links [m], which is at least their largest clearance."""
    points, of_body = list[np.ndarray](), dict[str, list[np.ndarray]]()
    for frame in frames.values():
        of_body.setdefault(frame.body, []).append(frame.placement.p)
    for link in links:
        for name, path in link.placements.items():
            points += [link.start.point(path.point(p)) for p in of_body.get(name, [])]
            if link.inertia is not None:
                points.append(link.start.point(link.inertia.com))
    cloud = np.array(points) if points else np.zeros((1, 3))
    size = float(np.max(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1)))
    size = max(size, *clearances, 0.0)
    # a body held at its centre of mass has no size but the rounding of its position
    gyration = max((np.sqrt(np.trace(J) / (2.0 * mass)) for mass, _, J in _inertias(links)), default=0.0)
    # a scene's distances count as its size only above this fraction of the largest radius of gyration
    return size if size > 1e-9 * gyration else float(gyration) or 1.0


def _inertias(links: Sequence[Link]) -> list[tuple[float, np.ndarray, np.ndarray]]:
    return [link.inertia for link in links if link.inertia is not None and link.inertia.mass > 0.0]


def require_bodies(scene: Scene) -> None:
    """Raise InputError when nothing can move, and for a body that no part connects to the mechanism."""
    moving = [*scene.rigid(), *scene.flexible()]
    if not moving:
        raise InputError("[body]", "the scene has no body that could move", "add a rigid or flexible body")
    held = {frame.partition(".")[0] for part in coupled_frames(scene) for frame in part}
    for name in moving:
        if scene.joint and name not in held:
            raise InputError(
                f"[body.{name}]",
                f"'{name}' is not connected: no joint, load or path names a frame of the body",
                'connect it to another body, or add a joint of type "free"',
            )
