"""Motion of the named bodies and frames, from that of the links that carry them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexclear.dynamics.equations.observation import Observed, Variables
from flexclear.dynamics.model.flexible_bodies import second_first_moment, second_motion, shift
from flexclear.dynamics.model.interface_basis import frame_index
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model
from flexclear.numerics.rotations import cross, matrix_to_quaternion, rotate, without_sign_jumps
from flexclear.scene.parts import RigidBody


@dataclass(frozen=True)
class Motion:
    """Motion of a point of a body and of the body's axes, over time; world axes, the mechanism's origin.

    p, v, a, omega, alpha: shape (time, 3); R: rotation body -> world, shape (time, 3, 3).  Fortran order, see
    `core.numerics.rotations.cross`.
    """

    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    a: np.ndarray
    alpha: np.ndarray

    def at(self, arm: np.ndarray, turn: np.ndarray | None = None) -> Motion:
        """Return the motion of a fixed point `arm` (3,) and of axes turned by `turn` (3, 3), given in the body."""
        r = rotate(self.R, arm)
        swing = cross(self.omega, r)
        a = self.a + cross(self.alpha, r) + cross(self.omega, swing)
        return Motion(self.p + r, self.R if turn is None else self.R @ turn, self.v + swing, self.omega, a, self.alpha)

    def moving(self, arm: np.ndarray, rate: np.ndarray, second: np.ndarray) -> Motion:
        """Return the motion of a point that moves in the body: its position, rate and second rate there, (time, 3)."""
        r, s, t = (rotate(self.R, x) for x in (arm, rate, second))
        swing = cross(self.omega, r)
        a = self.a + cross(self.alpha, r) + cross(self.omega, swing + 2.0 * s) + t
        return Motion(self.p + r, self.R, self.v + swing + s, self.omega, a, self.alpha)


@dataclass(frozen=True)
class Bodies:
    """Motion of the centres of mass and axes of several bodies, over time; world axes, the mechanism's origin.

    Shape (time, body, 3); quaternions w x y z (time, body, 4).
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray
    acceleration: np.ndarray
    alpha: np.ndarray


@dataclass(frozen=True)
class Modal:
    """Modal coordinates of a flexible link, their rates and second rates; shape (time, mode)."""

    q: np.ndarray
    u: np.ndarray
    du: np.ndarray

    def shift(self, shape: np.ndarray, second: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return displacement, rate and second rate of a point in the body frame; see `model.flexible_bodies.shift`."""
        return shift(shape, second, self.q, self.u, self.du)


@dataclass(frozen=True)
class Motions:
    """Motions of all links, bodies and named frames in observed rows, each computed at its first use."""

    model: Model
    seen: Observed

    @cached_property
    def _links(self) -> dict[int, Motion]:
        return {}

    def link(self, i: int) -> Motion:
        """Return the motion of a link's frame."""
        if i not in self._links:
            known = ("origin", "axes", "velocity", "omega", "acceleration", "alpha")
            p, R, v, omega, a, alpha = (np.asfortranarray(self.seen.links[field][:, i]) for field in known)
            # the equations represent gravity as an upward acceleration of the ground
            self._links[i] = Motion(p, R, v, omega, a + self.model.gravity, alpha)
        return self._links[i]

    def modal(self, link: int) -> Modal:
        """Return the modal coordinates of a flexible link."""
        numbering, seen = self.model.numbering, self.seen
        q, c = numbering.modal_positions[link], numbering.modal_coordinates[link]
        return Modal(seen.positions[:, q], seen.speeds[:, c], seen.accelerations[:, c])

    @cached_property
    def moving_bodies(self) -> list[str]:
        """Names of all bodies but the ground, as the scene lists them."""
        return self.model.mechanism.moving_bodies

    @cached_property
    def every_body(self) -> Bodies:
        """Motion of each moving body's centre of mass and axes."""
        return self._bodies(self.moving_bodies)

    def _bodies(self, names: Sequence[str]) -> Bodies:
        rows, bodies = len(self.seen.state), [self.body(name) for name in names]
        p, v, omega, a, alpha = (np.empty((rows, len(names), 3)) for _ in range(5))
        R = np.empty((rows, len(names), 3, 3))
        for k, one in enumerate(bodies):
            p[:, k], v[:, k], omega[:, k], a[:, k], alpha[:, k], R[:, k] = (
                one.p,
                one.v,
                one.omega,
                one.a,
                one.alpha,
                one.R,
            )
        return Bodies(p, matrix_to_quaternion(R), v, omega, a, alpha)

    def several(self, names: Sequence[str]) -> Bodies:
        """Return the motion of the centres of mass and axes of some moving bodies."""
        return self.every_body if names == self.moving_bodies else self._bodies(names)

    def body(self, name: str) -> Motion:
        """Return the motion of one moving body's centre of mass and axes."""
        i = self.model.mechanism.link_of[name]
        link, body = self.model.links[i], self.model.scene.body[name]
        if isinstance(body, RigidBody):
            placement = link.placements[name]
            return self.link(i).at(placement.point(np.array(body.com)), placement.R)
        assert link.bundle is not None
        shape, first = link.bundle["modal_first_moment"].values, link.bundle["first_moment"].values
        arm, rate, second = self.modal(i).shift(shape, second_first_moment(self.model.mechanism, i))
        return self.link(i).moving((first + arm) / link.mass, rate / link.mass, second / link.mass)

    def positions(self, names: Sequence[str]) -> np.ndarray:
        """Return the origins of named frames from the mechanism's origin, shape (time, frame, 3)."""
        positions = np.empty((len(self.seen.state), len(names), 3))
        for k, name in enumerate(names):
            i, placement = self._place(name)
            link, bundle, arm = self.link(i), self.model.links[i].bundle, placement.p
            if bundle is not None:
                label = name.partition(".")[2]
                S = bundle["frame_translation_shape"].values[frame_index(bundle, label)]
                arm = arm + self.modal(i).shift(S, second_motion(self.model.mechanism, i, label)[0])[0]
            positions[:, k] = link.p + rotate(link.R, arm)
        return positions

    @cached_property
    def frame_velocities(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Velocity of the origin and angular velocity of every named frame, world axes, shape (time, 3) each."""
        velocities = {}
        for name in self.model.mechanism.frames:
            i, placement = self._place(name)
            link, bundle = self.link(i), self.model.links[i].bundle
            if bundle is None:
                velocities[name] = link.at(placement.p).v, link.omega
                continue
            label, state = name.partition(".")[2], self.modal(i)
            at = frame_index(bundle, label)
            S, P = (bundle[f"frame_{k}_shape"].values[at] for k in ("translation", "rotation"))
            move, turn = second_motion(self.model.mechanism, i, label)
            arm, rate, second = state.shift(S, move)
            turning = rotate(link.R, _angular_velocity(*state.shift(P, turn)[:2]))
            velocities[name] = link.moving(placement.p + arm, rate, second).v, link.omega + turning
        return velocities

    def _place(self, name: str) -> tuple[int, Placement]:
        """Return the link of a named frame, and the frame's undeformed placement there."""
        frame = self.model.mechanism.frames[name]
        i = self.model.mechanism.link_of[frame.body]
        return i, self.model.links[i].placements[frame.body].of(frame.placement)


def _angular_velocity(theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the angular velocity, parent axes, of rotations exp(theta) with vectors' rates `rate`; shape (time, 3)."""
    angle = np.linalg.norm(theta, axis=1, keepdims=True)
    small = angle < 1e-4  # two terms of both series are exact to rounding there
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    swing = cross(theta, rate)
    return rate + first * swing + second * cross(theta, swing)


def motion_series(bodies: Bodies, origin: np.ndarray) -> Variables:
    """Return position, orientation, velocities and acceleration of several bodies over time, by variable."""
    series = {
        ("position", "axis"): points_in_world(bodies.position, origin),
        ("quaternion", "quat"): without_sign_jumps(bodies.quaternion),
        ("velocity", "axis"): bodies.velocity,
        ("angular_velocity", "axis"): bodies.omega,
        ("acceleration", "axis"): bodies.acceleration,
    }
    return {name: (("time", "body", dim), values) for (name, dim), values in series.items()}


def points_in_world(points: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Return points (time, point, 3), given from the mechanism's origin, in the world."""
    rows, count, _ = points.shape
    # added to whole rows, since three numbers at a time take five times as long
    return (points.reshape(rows, 3 * count) + np.tile(origin, count)).reshape(points.shape)
