"""Motion of every named frame, those on flexible bodies included."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.model.deformation import shift
from pipeline.dynamics.model.flexible_bodies import bow
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.record.motion import Motion, modal


def frame_velocities(
    model: Model, seen: dict[str, np.ndarray], links: list[Motion]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Velocity of the origin and angular velocity of every named frame, world axes, shape (time, 3) each."""
    mechanism = model.mechanism
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, frame in mechanism.frames.items():
        i = mechanism.link_of[frame.body]
        place = mechanism.links[i].places[frame.body].of(frame.place)
        if not mechanism.links[i].flexible:
            motion = links[i].at(place.p)
            found[name] = motion.v, motion.omega
            continue
        bundle, label = mechanism.bundles[frame.body], name.partition(".")[2]
        state = modal(model, i, seen)
        S, P = (bundle[f"frame_{k}_shape"].sel(frame=label).values for k in ("translation", "rotation"))
        arm, rate, second = shift(S, bow(mechanism, frame.body, label), state.q, state.u, state.du)
        turning = _angular_velocity(state.q @ P.T, state.u @ P.T)
        found[name] = (
            links[i].moving(place.p + arm, rate, second).v,
            links[i].omega + np.einsum("tij,tj->ti", links[i].R, turning),
        )
    return found


def _angular_velocity(theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Angular velocity, parent axes, of rotations exp(theta) whose vectors change at `rate`; shape (time, 3)."""
    angle = np.linalg.norm(theta, axis=1, keepdims=True)
    small = angle < 1e-4  # both series are exact to rounding there with their first two terms
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    swing = np.cross(theta, rate)
    return rate + first * swing + second * np.cross(theta, swing)
