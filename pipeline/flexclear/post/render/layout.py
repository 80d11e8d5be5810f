"""Where the parts of a drawn mechanism are: points of bodies, frames, and solids between two points, at one output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.post.render import surfaces
from flexclear.post.render.surfaces import Surface
from flexclear.scene.fields import Pose

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
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(run.quaternion.values[step, index])
    matrix[:3, 3] = run.position.values[step, index]
    return matrix


def part_pose(run: xr.Dataset, part: Part, step: int) -> np.ndarray:
    """Return the homogeneous matrix from the axes of a part's surface to the world; its z column may be stretched."""
    if part.ends is None:
        return _carrier(run, part.owner, part.frame, step)
    matrix, (start, end) = np.eye(4), (site.position(run, step) for site in part.ends)
    long = float(np.linalg.norm(end - start))
    if long > 0.0:
        matrix[:3, :3] = surfaces.along(end - start)
    matrix[:3, 2] *= 1.0 if part.length is None else max(long / part.length, THIN)
    matrix[:3, 3] = start
    return matrix


def _carrier(run: xr.Dataset, owner: int | None, frame: int | None, step: int) -> np.ndarray:
    """Return the homogeneous matrix from a body's axes, about its centre of mass or one of its frames, to the world."""
    matrix = np.eye(4) if owner is None else pose(run, owner, step)
    if frame is not None:
        matrix[:3, 3] = run.frame_position.values[step, frame]
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
