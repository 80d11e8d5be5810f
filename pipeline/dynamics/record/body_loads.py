"""How a flexible body moves, and what acts on its frames meanwhile: what its stresses follow from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.dynamics.record.motion import Motions
from flexclear.pipeline.dynamics.record.wrenches import Acting, joint_wrenches, on_frames, path_wrenches


@dataclass(frozen=True)
class Motion:
    """Motion of the body frame, its own axes, and of the modal coordinates; each (time, 3) or (time, mode).

    a: acceleration of the origin less gravity.
    """

    a: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray
    q: np.ndarray
    u: np.ndarray
    du: np.ndarray


def motion_and_loads(motions: Motions, name: str) -> tuple[Motion, np.ndarray, np.ndarray]:
    """Motion of a flexible body, and moments about its origin [N m] and forces [N] on its frames, body axes.

    Both of shape (time, frame, 3), frames in the order of the mechanism, as the bundle has them.
    """
    model = motions.model
    link = model.mechanism.link_of[name]
    frame, state = motions.link(link), motions.modal(link)
    R_BW = np.swapaxes(frame.R, 1, 2)
    a, omega, alpha = (np.einsum("tij,tj->ti", R_BW, x) for x in (frame.a - model.gravity, frame.omega, frame.alpha))
    names = [frame for frame in model.mechanism.frames if frame.startswith(f"{name}.")]
    moment, force = np.zeros((len(a), len(names), 3)), np.zeros((len(a), len(names), 3))
    for at, n, f in _loads(motions, name):
        k = names.index(at)
        moment[:, k] += np.einsum("tij,tj->ti", R_BW, n - np.cross(frame.p, f))
        force[:, k] += np.einsum("tij,tj->ti", R_BW, f)
    return Motion(a, omega, alpha, state.q, state.u, state.du), moment, force


def _loads(motions: Motions, name: str) -> list[Acting]:
    """What joints, paths and loads do to a body: its frame, moment about the kernels' origin, force, world axes."""
    model, seen, acting = motions.model, motions.seen, list[Acting]()
    for joint, (n, f) in joint_wrenches(motions).items():
        between = model.scene.joint[joint].between
        about_origin = n + np.cross(motions.frame_positions[between[1]], f)
        acting += [(at, sign * about_origin, sign * f) for at, sign in zip(between, (-1.0, 1.0), strict=True)]
    acting += path_wrenches(model, seen)
    acting += on_frames(model, seen, name)
    return [load for load in acting if model.mechanism.frames[load[0]].body == name]
