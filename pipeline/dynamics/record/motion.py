"""Motion of the named bodies and frames, from that of the links that carry them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from flexclear.pipeline.core.algebra import cross, matrix_to_quaternion, turned
from flexclear.pipeline.core.scene.parts import Ground, RigidBody
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.flexible_bodies import bow, shift
from flexclear.pipeline.dynamics.model.merge import Placement
from flexclear.pipeline.dynamics.model.model import Model


@dataclass(frozen=True)
class Motion:
    """Motion of a point of a body and of the body's axes, over time; world axes, kernels' origin.

    p, v, a, omega, alpha: shape (time, 3); R: rotation body -> world, shape (time, 3, 3). Of several bodies at once,
    all of them have a dimension of bodies after that of time.  In Fortran's order, see `core.algebra.cross`.
    """

    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    a: np.ndarray
    alpha: np.ndarray

    def of(self, k: int) -> Motion:
        """Motion of one of several bodies."""
        return Motion(self.p[:, k], self.R[:, k], self.v[:, k], self.omega[:, k], self.a[:, k], self.alpha[:, k])

    def taken(self, numbers: Sequence[int]) -> Motion:
        """Motion of several of several bodies, copied."""
        every = (self.p, self.R, self.v, self.omega, self.a, self.alpha)
        return Motion(*(values.T[..., list(numbers), :].T for values in every))

    def at(self, arm: np.ndarray, turn: np.ndarray | None = None) -> Motion:
        """Motion of a fixed point `arm`, and of axes turned by `turn`, both given in the body.

        arm: (3,); of several bodies, of each its own, (body, 3).  turn: (3, 3) or (body, 3, 3).
        """
        r = turned(self.R, arm)
        swing = cross(self.omega, r)
        a = self.a + cross(self.alpha, r) + cross(self.omega, swing)
        return Motion(
            self.p + r, self.R if turn is None else _product(self.R, turn), self.v + swing, self.omega, a, self.alpha
        )

    def moving(self, arm: np.ndarray, rate: np.ndarray, second: np.ndarray) -> Motion:
        """Motion of a point that moves in the body: its place, rate and second rate there, (time, 3)."""
        r, s, t = (turned(self.R, x) for x in (arm, rate, second))
        swing = cross(self.omega, r)
        a = self.a + cross(self.alpha, r) + cross(self.omega, swing + 2.0 * s) + t
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
    def every_link(self) -> Motion:
        """Motion of every link's frame, (time, link, ...), gravity's upward acceleration of the ground taken out."""
        known = ("origin", "axes", "velocity", "omega", "acceleration", "alpha")
        p, R, v, omega, a, alpha = (np.asfortranarray(self.seen.links[field]) for field in known)
        return Motion(p, R, v, omega, a + self.model.gravity, alpha)

    @cached_property
    def links(self) -> list[Motion]:
        """The same of each."""
        return [self.every_link.of(i) for i in range(self.seen.links.shape[1])]

    def modal(self, link: int) -> Modal:
        """Modal coordinates of a flexible link."""
        numbering, seen = self.model.numbering, self.seen
        q, c = numbering.modal_positions[link], numbering.modal_coordinates[link]
        return Modal(seen.positions[:, q], seen.speeds[:, c], seen.accelerations[:, c])

    @cached_property
    def moving_bodies(self) -> list[str]:
        """Names of all bodies but the ground, as the scene lists them."""
        return [name for name, body in self.model.scene.body.items() if not isinstance(body, Ground)]

    @cached_property
    def every_body(self) -> Motion:
        """Motion of each moving body's centre of mass and axes, (time, body, ...)."""
        return self.several(self.moving_bodies)

    @cached_property
    def bodies(self) -> dict[str, Motion]:
        """The same by name."""
        return {name: self.every_body.of(k) for k, name in enumerate(self.moving_bodies)}

    def body(self, name: str) -> Motion:
        """Motion of one moving body's centre of mass and axes."""
        return self.several([name]).of(0)

    def several(self, names: Sequence[str]) -> Motion:
        """Motion of the centres of mass and axes of some moving bodies, (time, body, ...)."""
        rigid = [k for k, name in enumerate(names) if isinstance(self.model.scene.body[name], RigidBody)]
        found = self._rigid([names[k] for k in rigid])
        if len(rigid) == len(names):
            return found
        bending = {k: self._flexible(name) for k, name in enumerate(names) if k not in rigid}
        whole = dict[str, np.ndarray]()
        for field in (field.name for field in fields(Motion)):
            values = getattr(found, field)
            whole[field] = np.empty((len(values), len(names), *values.shape[2:]), order="F")
            whole[field][:, rigid] = values
            for k, motion in bending.items():
                whole[field][:, k] = getattr(motion, field)
        return Motion(**whole)

    def _rigid(self, names: Sequence[str]) -> Motion:
        model, arms, turns = self.model, np.zeros((len(names), 3)), np.zeros((len(names), 3, 3))
        numbers = [model.mechanism.link_of[name] for name in names]
        for k, name in enumerate(names):
            place, body = model.links[numbers[k]].places[name], model.scene.body[name]
            assert isinstance(body, RigidBody)
            arms[k], turns[k] = place.p + place.R @ np.array(body.com), place.R
        return self.every_link.taken(numbers).at(arms, turns)

    def _flexible(self, name: str) -> Motion:
        i = self.model.mechanism.link_of[name]
        link = self.model.links[i]
        assert link.bundle is not None
        shape, first = link.bundle["modal_first_moment"].values, link.bundle["first_moment"].values
        arm, rate, second = self.modal(i).shift(shape, bow(self.model.mechanism, i))
        return self.links[i].moving((first + arm) / link.mass, rate / link.mass, second / link.mass)

    def positions(self, names: Sequence[str]) -> np.ndarray:
        """Origins of named frames, kernels' origin, shape (time, frame, 3), in Fortran's order."""
        found = np.empty((len(self.seen.state), len(names), 3), order="F")
        of_link = dict[int, dict[int, np.ndarray]]()
        for k, name in enumerate(names):
            frame = self.model.mechanism.frames[name]
            i = self.model.mechanism.link_of[frame.body]
            body = self.model.links[i].places[frame.body]
            of_link.setdefault(i, {})[k] = body.p + body.R @ frame.place.p
        for i, arms in of_link.items():
            link, bundle, places = self.links[i], self.model.links[i].bundle, np.array(list(arms.values()))
            if bundle is None:
                found[:, list(arms)] = link.p[:, None] + turned(link.R[:, None], places)
                continue
            for k, arm in arms.items():
                label = names[k].partition(".")[2]
                S = bundle["frame_translation_shape"].sel(frame=label).values
                bent = arm + self.modal(i).shift(S, bow(self.model.mechanism, i, label))[0]
                found[:, k] = link.p + turned(link.R, bent)
        return found

    @cached_property
    def every_frame(self) -> np.ndarray:
        """Origin of every named frame of the mechanism, as `positions` has them."""
        return self.positions(list(self.model.mechanism.frames))

    @cached_property
    def frame_positions(self) -> dict[str, np.ndarray]:
        """The same by name, shape (time, 3) each."""
        return {name: self.every_frame[:, k] for k, name in enumerate(self.model.mechanism.frames)}

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
            turning = turned(link.R, _angular_velocity(state.q @ P.T, state.u @ P.T))
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
    swing = cross(theta, rate)
    return rate + first * swing + second * cross(theta, swing)


def _product(R: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """R turn, in Fortran's order."""
    out = np.empty(R.shape, order="F")
    for k in range(3):
        out[..., k] = turned(R, turn[..., k])
    return out


def quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation matrices (time, ..., 3, 3), without jumps of sign; w >= 0 at first."""
    q = matrix_to_quaternion(R)
    flips = np.where(np.sum(q[1:] * q[:-1], axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips, axis=0)
    return q


def motion_series(bodies: Motion, origin: np.ndarray) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Position, orientation, velocities and acceleration of several bodies over time, by variable."""
    series = {
        ("position", "axis"): bodies.p + origin,
        ("quaternion", "quat"): quaternions(bodies.R),
        ("velocity", "axis"): bodies.v,
        ("angular_velocity", "axis"): bodies.omega,
        ("acceleration", "axis"): bodies.a,
    }
    return {name: (("time", "body", dim), np.ascontiguousarray(values)) for (name, dim), values in series.items()}
