"""Motion of the named bodies and frames, from that of the links that carry them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.algebra import matrix_to_quaternion
from pipeline.core.scene.parts import RigidBody
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.deformation import shift
from pipeline.dynamics.model.flexible_bodies import bow
from pipeline.dynamics.model.model import Model


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


def link_motions(model: Model, frames: np.ndarray) -> list[Motion]:
    """Motion of every link's frame, gravity's upward acceleration of the ground taken out."""
    gravity = model.arrays.table(m.GRAVITY)["acceleration"][0]
    frames = frames.reshape(len(frames), -1, m.FRAME.size)
    found = []
    for i in range(frames.shape[1]):
        f = frames[:, i]
        R = f[:, m.FRAME.axes : m.FRAME.axes + 9].reshape(-1, 3, 3)
        p, omega, v, alpha, a = (
            f[:, o : o + 3]
            for o in (m.FRAME.origin, m.FRAME.omega, m.FRAME.velocity, m.FRAME.alpha, m.FRAME.acceleration)
        )
        found.append(Motion(p, R, v, omega, a + gravity, alpha))
    return found


@dataclass(frozen=True)
class Modal:
    """Modal coordinates of a flexible link, their rates and second rates; shape (time, mode)."""

    q: np.ndarray
    u: np.ndarray
    du: np.ndarray


def modal(model: Model, link: int, seen: dict[str, np.ndarray]) -> Modal:
    """Modal coordinates of a flexible link."""
    numbering = model.numbering
    q0, c0, n = numbering.flex_q0[link], numbering.flex_c0[link], numbering.modes[link]
    return Modal(
        seen["coordinate"][:, q0 : q0 + n], seen["speed"][:, c0 : c0 + n], seen["acceleration"][:, c0 : c0 + n]
    )


def body_motions(model: Model, seen: dict[str, np.ndarray], links: list[Motion]) -> dict[str, Motion]:
    """Motion of each moving body's centre of mass and axes, by name."""
    mechanism, found = model.mechanism, {}
    for name, body in mechanism.scene.body.items():
        i = mechanism.link_of[name]
        if isinstance(body, RigidBody):
            place = mechanism.links[i].places[name]
            found[name] = links[i].at(place.p + place.R @ np.array(body.com), place.R)
        elif i and mechanism.links[i].flexible == name:
            bundle, state = mechanism.bundles[name], modal(model, i, seen)
            C, mass = bundle["modal_first_moment"].values, float(bundle["mass"])
            arm, rate, second = shift(C, bow(mechanism, name), state.q, state.u, state.du)
            found[name] = links[i].moving((bundle["first_moment"].values + arm) / mass, rate / mass, second / mass)
    return found


def frame_positions(model: Model, seen: dict[str, np.ndarray], links: list[Motion]) -> dict[str, np.ndarray]:
    """Origin of every named frame, kernels' origin, shape (time, 3)."""
    mechanism, found = model.mechanism, {}
    for name, frame in mechanism.frames.items():
        i = mechanism.link_of[frame.body]
        place = mechanism.links[i].places[frame.body].of(frame.place)
        arm = np.broadcast_to(place.p, (len(links[i].p), 3))
        if mechanism.links[i].flexible:
            bundle, label = mechanism.bundles[frame.body], name.partition(".")[2]
            state = modal(model, i, seen)
            S = bundle["frame_translation_shape"].sel(frame=label).values
            arm = arm + shift(S, bow(mechanism, frame.body, label), state.q, state.u, state.du)[0]
        found[name] = links[i].p + np.einsum("tij,tj->ti", links[i].R, arm)
    return found


def quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation matrices (time, 3, 3), without jumps of sign; w >= 0 at first."""
    q = matrix_to_quaternion(R)
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(flips)])[:, None]
