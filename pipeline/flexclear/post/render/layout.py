"""Where the parts of a drawn mechanism are: points of bodies, frames, and solids between two points, at one output."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.post.render import forms, surfaces
from flexclear.post.render.surfaces import Surface
from flexclear.scene.fields import Pose
from flexclear.scene.units import quantity

#: colours of joints, balls in sockets, loose parts at rest and in contact, the ground, loads
JOINT_COLOR, SOCKET_COLOR, CLEARANCE_COLOR, IMPACT_COLOR = "#3b4754", "#a9bccf", "#E69F00", "#d7191c"
GROUND_COLOR, LOAD_COLOR = "#8d98a4", "#7a4a00"
#: radius of pins as a fraction of the mechanism's size
PIN = 0.011
#: least drawn length of a part over its unstretched one; outputs at which the extent is measured
THIN, SAMPLES = 1e-3, 24


@dataclass(frozen=True, slots=True)
class Site:
    """A point of a body: origin [m] about its centre of mass, or about the origin of `frame`, in the body's axes; for
    the ground in the world."""

    owner: int | None  #: index of the body in the run; None for the ground
    origin: np.ndarray
    frame: int | None = None  #: index of a frame whose position is recorded

    def position(self, run: xr.Dataset, step: int) -> np.ndarray:
        """Return the position of the point in the world at an output [m]."""
        matrix = _carrier(run, self.owner, self.frame, step)
        return matrix[:3, :3] @ self.origin + matrix[:3, 3]


@dataclass(frozen=True, slots=True)
class Part:
    """A solid that moves with a body, or between two points.

    surface: about the body's centre of mass, or about the origin of `frame`, in the body's axes; for the ground in the
    world; with `ends` about the first one, z towards the second.  contact: its column among the contacts, where it
    shows a joint with clearance.  length: distance of the ends at which the surface is unstretched [m]; None: rigid.
    """

    owner: int | None  #: index of the body in the run; None for the ground
    surface: Surface
    color: str
    opacity: float = 1.0
    frame: int | None = None
    contact: int | None = None
    ends: tuple[Site, Site] | None = None
    length: float | None = None


@dataclass(frozen=True, slots=True)
class Layout:
    """Poses of the bodies and frames of a run. given: parameters of its scene.  bundles: by name of the body."""

    run: xr.Dataset
    given: Mapping[str, Any]
    bundles: Mapping[str, xr.Dataset]

    @property
    def bodies(self) -> list[str]:
        """Names of the moving bodies."""
        return names(self.run, "body")

    @property
    def frames(self) -> list[str]:
        """Names of the frames whose positions are recorded."""
        return names(self.run, "frame")

    def owner(self, frame: str) -> int | None:
        """Return the index of the body that has a frame; None for the ground."""
        body = frame.partition(".")[0]
        return self.bodies.index(body) if body in self.bodies else None

    def frame_in_body(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return origin [m] and axes (columns) of a frame in those of its body."""
        body, _, name = frame.partition(".")
        if body in self.bundles:
            data = self.bundles[body].sel(frame=name)
            return data["frame_position"].values, data["frame_rotation"].values
        pose = Pose.model_validate(self.given.get("body", {}).get(body, {}).get("frames", {}).get(name, {}))
        return np.array(pose.position), quaternion_to_matrix(pose.as_quaternion())

    def at_start(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return origin [m] and axes of a frame, in the world, at the first output."""
        (origin, axes), owner = self.frame_in_body(frame), self.owner(frame)
        if owner is None:
            return origin, axes
        matrix = pose(self.run, owner, 0)
        recorded = frame in self.frames
        where = self.run.frame_position.values[0, self.frames.index(frame)] if recorded else matrix[:3, 3]
        return where, matrix[:3, :3] @ axes

    def centre(self, body: str) -> np.ndarray:
        """Return the centre of mass of a moving body at rest, in its axes [m]."""
        if body in self.bundles:
            return centre_at_rest(self.bundles[body])
        return np.array(self.given["body"][body].get("com", (0.0, 0.0, 0.0)))

    def site(self, frame: str, offset: float = 0.0) -> Site:
        """Return the origin of a frame, or a point so far along its z axis [m]."""
        (origin, axes), owner = self.frame_in_body(frame), self.owner(frame)
        if owner is None:
            return Site(None, origin + offset * axes[:, 2])
        if frame in self.frames:
            return Site(owner, offset * axes[:, 2], self.frames.index(frame))
        return Site(owner, origin - self.centre(frame.partition(".")[0]) + offset * axes[:, 2])

    def part_at_frame(
        self, frame: str, part: Surface, color: str, contact: int | None = None, opacity: float = 1.0
    ) -> Part:
        """Return a part at a frame, given in the frame's axes."""
        site, axes = self.site(frame), self.frame_in_body(frame)[1]
        return Part(site.owner, surfaces.place(part, site.origin, axes), color, opacity, site.frame, contact)


def samples(run: xr.Dataset) -> list[int]:
    """Return the outputs at which the extent is measured."""
    return sorted({int(step) for step in np.linspace(0, run.sizes["time"] - 1, SAMPLES)})


def pose(run: xr.Dataset, index: int, step: int) -> np.ndarray:
    """Return the homogeneous matrix of a body, from axes through its centre of mass to the world."""
    matrix, known = np.eye(4), run.variables  # of which films read many: arrays with coordinates take longer to make
    matrix[:3, :3] = quaternion_to_matrix(known["quaternion"].values[step, index])
    matrix[:3, 3] = known["position"].values[step, index]
    return matrix


def part_pose(run: xr.Dataset, part: Part, step: int) -> np.ndarray:
    """Return the homogeneous matrix from the axes of a part's surface to the world; its z column may be stretched."""
    if part.ends is None:
        return _carrier(run, part.owner, part.frame, step)
    matrix, (start, end) = np.eye(4), (site.position(run, step) for site in part.ends)
    long = float(np.linalg.norm(end - start))
    if long > 0.0:
        matrix[:3, :3] = surfaces.axes_along(end - start)
    matrix[:3, 2] *= 1.0 if part.length is None else max(long / part.length, THIN)
    matrix[:3, 3] = start
    return matrix


def _carrier(run: xr.Dataset, owner: int | None, frame: int | None, step: int) -> np.ndarray:
    """Return the homogeneous matrix from a body's axes, about its centre of mass or one of its frames, to the world."""
    matrix = np.eye(4) if owner is None else pose(run, owner, step)
    if frame is not None:
        matrix[:3, 3] = run.variables["frame_position"].values[step, frame]
    return matrix


def travel_range(run: xr.Dataset, joint: str) -> tuple[float, float]:
    """Return least and largest displacement along a joint's axis [m], that of the assembled start included."""
    for name in (joint, f"{joint}.translation"):
        if "coordinate" in run.coords and name in run.coordinate.values:
            values = run.joint_position.sel(coordinate=name).values
            return min(0.0, float(values.min())), max(0.0, float(values.max()))
    return 0.0, 0.0


def names(run: xr.Dataset, dim: str) -> list[str]:
    """Return the names along a dimension; none where the run lacks the dimension."""
    return [str(name) for name in run[dim].values] if dim in run.coords else []


def centre_at_rest(bundle: xr.Dataset) -> np.ndarray:
    """Return the centre of mass in the bundle's axes [m]; it is the run's position, unlike the bundle's origin."""
    moment: np.ndarray = bundle.first_moment.values
    return moment / float(bundle.mass)


#: fractions of the mechanism's size: radius of coils, length of the springs of joints at the end of their travel;
#: length, in radii, below which nothing is drawn between two points
COIL, FREE, NEAR = 0.02, 0.25, 0.1


def loads(at: Layout, size: float, bodies: Sequence[Part]) -> Iterator[Part]:
    """Yield springs as coils, dampers as cylinders with pistons, bushings as rings, other tension as thin bars."""
    for load in at.given.get("load", {}).values():
        if load["type"] == "bushing":
            yield from _bushing(at, load, size)
        elif "between" in load:
            first, second = load["between"]
            yield from _spring_between(at.run, (at.site(first), at.site(second)), load, COIL * size)
        elif load["type"] == "joint-spring":
            yield from _spring_on_joint(at, load, size, bodies)


def _bushing(at: Layout, load: Mapping[str, Any], size: float) -> Iterator[Part]:
    """Yield a ring, about the axis across which its stiffnesses are most alike, and the pin that it holds."""
    first, second = load["between"]
    along = np.diagonal(load["stiffness"])
    axis = min((2, 0, 1), key=lambda k: abs(along[(k + 1) % 3] - along[(k + 2) % 3]))
    turn, pin = surfaces.axes_along(np.eye(3)[axis]), PIN * size
    ring = forms.ring(1.05 * pin, 2.8 * pin, 3.0 * pin)
    yield at.part_at_frame(first, surfaces.place(ring, np.zeros(3), turn), LOAD_COLOR)
    yield at.part_at_frame(second, surfaces.place(surfaces.cylinder(pin, 4.2 * pin), np.zeros(3), turn), JOINT_COLOR)


def _spring_on_joint(at: Layout, load: Mapping[str, Any], size: float, bodies: Sequence[Part]) -> Iterator[Part]:
    """Yield a spring along a joint's axis, on the side where it is pressed and around the body that slides, or a coil
    about the axis."""
    name, joint = load["joint"], at.given["joint"][load["joint"]]
    first, second = joint["between"]
    if joint["type"] in forms.SLIDING and load.get("coordinate") != "rotation":
        low, high = travel_range(at.run, name)
        side = 1.0 if 0.5 * (low + high) >= quantity(load.get("rest", 0.0), "length") else -1.0
        (origin, axes), centre = (
            at.frame_in_body(second),
            at.centre(second.partition(".")[0]) if at.owner(second) is not None else 0.0,
        )
        around = [
            surfaces.reach(
                (part.surface.points + centre - origin) @ axes, part.surface.triangles, side * FREE * size / 2
            )
            for part in bodies
            if part.owner == at.owner(second)
        ]
        radius = max([COIL * size, *(1.15 * one for one in around)])
        anchor = (high if side > 0.0 else low) + side * max(FREE * size, 3.0 * radius)
        yield from _spring_between(at.run, (at.site(first, anchor), at.site(second)), load, radius)
    elif load.get("stiffness"):
        radius, long = 2.2 * PIN * size, 3.0 * PIN * size
        coil = surfaces.place(forms.coil(radius, long, 0.2 * radius), np.array([0.0, 0.0, -0.5 * long]))
        yield at.part_at_frame(second, coil, LOAD_COLOR)


def _spring_between(run: xr.Dataset, ends: tuple[Site, Site], load: Mapping[str, Any], radius: float) -> Iterator[Part]:
    """Yield what acts along a line between two points: a coil of this radius [m], a cylinder with its piston, both, or
    a thin bar."""
    lengths = [float(np.linalg.norm(np.subtract(*(site.position(run, k) for site in ends)))) for k in samples(run)]
    long, owners = max(lengths), [site.owner for site in reversed(ends) if site.owner is not None]
    if not owners or long < NEAR * radius:
        return

    def part(surface: Surface, color: str, sites: tuple[Site, Site] = ends, length: float | None = None) -> Part:
        return Part(owners[0], surface, color, ends=sites, length=length)

    if load.get("stiffness"):
        yield part(forms.coil(radius, long, 0.2 * radius), LOAD_COLOR, length=long)
    if load.get("damping"):
        half = min(0.6 * long, 0.95 * min(lengths))
        for sites, thick, color in ((ends, 0.6, GROUND_COLOR), (ends[::-1], 0.3, JOINT_COLOR)):
            rod = surfaces.place(surfaces.cylinder(thick * radius, half), np.array([0.0, 0.0, 0.5 * half]))
            yield part(rod, color, (sites[0], sites[1]))
    if not load.get("stiffness") and not load.get("damping"):
        bar = surfaces.place(surfaces.cylinder(0.2 * radius, long), np.array([0.0, 0.0, 0.5 * long]))
        yield part(bar, LOAD_COLOR, length=long)
