"""Motion of the named bodies and frames, from that of the links that carry them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexclear.pipeline.core.algebra import matrix_to_quaternion
from flexclear.pipeline.core.scene.parts import Ground, RigidBody
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.flexible_bodies import bow, shift
from flexclear.pipeline.dynamics.model.merge import Placement
from flexclear.pipeline.dynamics.model.model import Model


@dataclass(frozen=True)
class Motion:
    """Motion of a point of a body and of the body's axes, over time; world axes, kernels' origin.

    p, v, a, omega, alpha: shape (time, 3); R: rotation body -> world, shape (time, 3, 3).
    """

    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    a: np.ndarray
    alpha: np.ndarray

    def at(self, arm: np.ndarray, turn: np.ndarray | None = None) -> Motion:
        """Motion of a fixed point `arm`, and of axes turned by `turn`, both given in the body."""
        r = self.R @ arm
        swing = np.cross(self.omega, r)
        a = self.a + np.cross(self.alpha, r) + np.cross(self.omega, swing)
        R = self.R if turn is None else self.R @ turn
        return Motion(self.p + r, R, self.v + swing, self.omega, a, self.alpha)

    def moving(self, arm: np.ndarray, rate: np.ndarray, second: np.ndarray) -> Motion:
        """Motion of a point that moves in the body: its place, rate and second rate there, (time, 3)."""
        r, s, t = (np.einsum("tij,tj->ti", self.R, x) for x in (arm, rate, second))
        swing = np.cross(self.omega, r)
        a = self.a + np.cross(self.alpha, r) + np.cross(self.omega, swing + 2.0 * s) + t
        return Motion(self.p + r, self.R, self.v + swing + s, self.omega, a, self.alpha)


@dataclass(frozen=True)
class Modal:
    """Modal coordinates of a flexible link, their rates and second rates; shape (time, mode)."""

    q: np.ndarray
    u: np.ndarray
    du: np.ndarray

    def shift(self, shape: np.ndarray, bow: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement of a point in the body frame, its rate and second rate; see `model.flexible_bodies.shift`."""
        return shift(shape, bow, self.q, self.u, self.du)


@dataclass(frozen=True)
class Motions:
    """Motions of all links, bodies and named frames in observed rows, each worked out when it is first asked for."""

    model: Model
    seen: Observed

    @cached_property
    def links(self) -> list[Motion]:
        """Motion of every link's frame, gravity's upward acceleration of the ground taken out."""
        gravity = self.model.gravity
        return [
            Motion(f["origin"], f["axes"], f["velocity"], f["omega"], f["acceleration"] + gravity, f["alpha"])
            for f in self.seen.links.T
        ]

    def modal(self, link: int) -> Modal:
        """Modal coordinates of a flexible link."""
        numbering, seen = self.model.numbering, self.seen
        q, c = numbering.modal_positions[link], numbering.modal_coordinates[link]
        return Modal(seen.positions[:, q], seen.speeds[:, c], seen.accelerations[:, c])

    @cached_property
    def bodies(self) -> dict[str, Motion]:
        """Motion of each moving body's centre of mass and axes, by name."""
        return {name: self.body(name) for name, body in self.model.scene.body.items() if not isinstance(body, Ground)}

    def body(self, name: str) -> Motion:
        """Motion of one moving body's centre of mass and axes."""
        i, body = self.model.mechanism.link_of[name], self.model.scene.body[name]
        link = self.model.links[i]
        if isinstance(body, RigidBody):
            place = link.places[name]
            return self.links[i].at(place.p + place.R @ np.array(body.com), place.R)
        assert link.bundle is not None
        shape, first = link.bundle["modal_first_moment"].values, link.bundle["first_moment"].values
        arm, rate, second = self.modal(i).shift(shape, bow(self.model.mechanism, i))
        return self.links[i].moving((first + arm) / link.mass, rate / link.mass, second / link.mass)

    @cached_property
    def frame_positions(self) -> dict[str, np.ndarray]:
        """Origin of every named frame, kernels' origin, shape (time, 3)."""
        return {name: self.frame_position(name) for name in self.model.mechanism.frames}

    def frame_position(self, name: str) -> np.ndarray:
        """Origin of one named frame, kernels' origin, shape (time, 3)."""
        i, place = self._place(name)
        link, bundle = self.links[i], self.model.links[i].bundle
        arm = np.broadcast_to(place.p, link.p.shape)
        if bundle is not None:
            label = name.partition(".")[2]
            S = bundle["frame_translation_shape"].sel(frame=label).values
            arm = arm + self.modal(i).shift(S, bow(self.model.mechanism, i, label))[0]
        return link.p + np.einsum("tij,tj->ti", link.R, arm)

    @cached_property
    def frame_velocities(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Velocity of the origin and angular velocity of every named frame, world axes, shape (time, 3) each."""
        velocities = {}
        for name in self.model.mechanism.frames:
            i, place = self._place(name)
            link, bundle = self.links[i], self.model.links[i].bundle
            if bundle is None:
                velocities[name] = link.at(place.p).v, link.omega
                continue
            label, state = name.partition(".")[2], self.modal(i)
            S, P = (bundle[f"frame_{k}_shape"].sel(frame=label).values for k in ("translation", "rotation"))
            arm, rate, second = state.shift(S, bow(self.model.mechanism, i, label))
            turning = np.einsum("tij,tj->ti", link.R, _angular_velocity(state.q @ P.T, state.u @ P.T))
            velocities[name] = link.moving(place.p + arm, rate, second).v, link.omega + turning
        return velocities

    def _place(self, name: str) -> tuple[int, Placement]:
        """Link of a named frame, and the frame's undeformed place there."""
        frame = self.model.mechanism.frames[name]
        i = self.model.mechanism.link_of[frame.body]
        return i, self.model.links[i].places[frame.body].of(frame.place)


def _angular_velocity(theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Angular velocity, parent axes, of rotations exp(theta) whose vectors change at `rate`; shape (time, 3)."""
    angle = np.linalg.norm(theta, axis=1, keepdims=True)
    small = angle < 1e-4  # both series are exact to rounding there with their first two terms
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    swing = np.cross(theta, rate)
    return rate + first * swing + second * np.cross(theta, swing)


def quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation matrices (time, 3, 3), without jumps of sign; w >= 0 at first."""
    q = matrix_to_quaternion(R)
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(flips)])[:, None]
