r"""Section forces and peak stresses of flexible bodies, by mode acceleration.

The forces in a section balance, for all that lies beyond it, interface loads against inertia:

.. math:: F = \sum f_i - \int_{beyond}\rho\,(a - g)\,dV ,

with the acceleration of every slice of mass under rigid and modal motion. So the interface loads act in full, whatever
they excite, and modes that were left out lack only by their inertia, which falls with the square of frequency over
theirs; stresses from the modal coordinates alone, :math:`E\,S' q`, lack the static answer too.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 11 (mode acceleration); Bisplinghoff, Ashley
& Halfman, *Aeroelasticity* (1955), sec. 10-3 (force summation).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.algebra import first_largest, skew
from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.dynamics.record.acting import on_frames
from flexclear.pipeline.dynamics.record.motion import Motions
from flexclear.pipeline.dynamics.record.wrenches import Wrench, joint_wrenches, path_wrenches

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import Labelled

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


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


def record(motions: Motions, names: tuple[str, ...]) -> tuple[Variables, dict[str, object]]:
    """Section forces and peak stresses of the bodies `names`: variables and coordinates of the run dataset.

    Peak stresses are left out when a body has a section without known outline. InputError for a bundle that was made
    without what this needs.
    """
    forces, peaks, places, owners = [], [], [], []
    for name in names:
        bundle = motions.model.links[motions.model.mechanism.link_of[name]].bundle
        if bundle is None or "section_place" not in bundle:
            raise InputError("[output] stress", f"the bundle of '{name}' has no sections", "make it with the scene")
        force = section_forces(bundle, *_motion_and_loads(motions, name))
        forces.append(force)
        places.append(bundle["section_place"].values)
        owners += [name] * force.shape[1]
        if "fibre_stress" in bundle:
            peaks.append(peak_stresses(bundle, force))
    every = np.concatenate(forces, axis=1)
    variables: Variables = {
        "section_force": (("time", "section", "axis"), every[..., :3]),
        "section_moment": (("time", "section", "axis"), every[..., 3:]),
    }
    if len(peaks) == len(names):
        for k, name in enumerate(("peak_axial_stress", "peak_von_mises_stress")):
            variables[name] = (("time", "section"), np.concatenate([peak[k] for peak in peaks], axis=1))
    return variables, {
        "section": np.arange(len(owners)),
        "section_body": ("section", owners),
        "section_place": ("section", np.concatenate(places), {"units": "m", "long_name": "position along the rod"}),
    }


def section_forces(bundle: Labelled, motion: Motion, moment: np.ndarray, force: np.ndarray) -> np.ndarray:
    """N, Qy, Qz [N], T, My, Mz [N m] of every section, in axes of the deformed section, shape (time, section, 6).

    moment, force: of joints and loads at every named frame, body axes, moments about the body's origin [N m, N],
    shape (time, frame, 3).
    """
    slices, frames = (bundle[f"{name}_beyond"].values.astype(float) for name in ("slice", "frame"))
    spin, push = _inertia(bundle, motion)
    F = np.einsum("sf,tfi->tsi", frames, force) - np.einsum("sp,tpi->tsi", slices, push, optimize=True)
    M = np.einsum("sf,tfi->tsi", frames, moment) - np.einsum("sp,tpi->tsi", slices, spin, optimize=True)
    centre = bundle["section_position"].values + _moved(bundle, "section_translation_shape", motion.q)
    R_BS = _turn(_moved(bundle, "section_rotation_shape", motion.q)) @ bundle["section_rotation"].values
    M = M - np.cross(centre, F)
    return np.concatenate([np.einsum("tsij,tsi->tsj", R_BS, part) for part in (F, M)], axis=-1)


def peak_stresses(bundle: Labelled, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axial stress that is largest in size, and largest von Mises stress [Pa], shape (time, section) each.

    forces: as `section_forces` returns them.  A round section is turned so that a fibre lies in the plane of bending.
    Of axial stresses that are equally large that of the first fibre counts.
    """
    axial, mises = np.empty(forces.shape[:2]), np.empty(forces.shape[:2])
    maps, is_round = bundle["fibre_stress"].values, bundle["section_round"].values
    for s, fibres in enumerate(maps):
        loads = _in_plane_of_bending(forces[:, s]) if is_round[s] else forces[:, s]
        sigma, tau_y, tau_z = np.moveaxis(np.einsum("fcl,tl->tfc", fibres, loads, optimize=True), -1, 0)
        worst = first_largest(np.abs(sigma), axis=1)
        axial[:, s] = np.take_along_axis(sigma, worst[:, None], axis=1)[:, 0]
        mises[:, s] = np.sqrt(sigma**2 + 3.0 * (tau_y**2 + tau_z**2)).max(axis=1)
    return axial, mises


def _in_plane_of_bending(forces: np.ndarray) -> np.ndarray:
    """Forces (time, 6) with y turned to the fibre that bending stretches most."""
    angle = np.arctan2(forces[:, 4], -forces[:, 5])
    c, s = np.cos(angle), np.sin(angle)
    turned = forces.copy()
    for k in (1, 4):
        turned[:, k] = c * forces[:, k] + s * forces[:, k + 1]
        turned[:, k + 1] = c * forces[:, k + 1] - s * forces[:, k]
    return turned


def _inertia(bundle: Labelled, motion: Motion) -> Wrench:
    """Rate of momentum of every slice less its weight: moment about the body's origin, force, (time, slice, 3)."""
    S = [_moved(bundle, "slice_translation_shape", x) for x in (motion.q, motion.u, motion.du)]
    theta = [skew(_moved(bundle, "slice_rotation_shape", x)) for x in (motion.q, motion.u, motion.du)]
    a, omega, alpha = (x[:, None] for x in (motion.a, motion.omega, motion.alpha))
    r = bundle["slice_position"].values + S[0]
    swing = np.cross(omega, np.cross(omega, r) + 2.0 * S[1])
    force = bundle["slice_mass"].values[:, None] * (a + np.cross(alpha, r) + swing + S[2])
    # a point of the slice lies at A rho from its centre and accelerates by B rho against it
    W, dW = skew(omega), skew(alpha)
    A = np.eye(3) + theta[0]
    B = (dW + W @ W) @ A + 2.0 * W @ theta[1] + theta[2]
    V = A @ bundle["slice_spread"].values @ np.swapaxes(B, -1, -2)
    own = np.stack([V[..., 1, 2] - V[..., 2, 1], V[..., 2, 0] - V[..., 0, 2], V[..., 0, 1] - V[..., 1, 0]], axis=-1)
    return np.cross(r, force) + own, force


def _moved(bundle: Labelled, name: str, q: np.ndarray) -> np.ndarray:
    """Shapes (point, 3, mode) times coordinates (time, mode): (time, point, 3)."""
    return np.einsum("pim,tm->tpi", bundle[name].values, q, optimize=True)


def _turn(v: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors (..., 3) (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    X = skew(v)
    return np.eye(3) + np.sinc(angle / np.pi) * X + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * (X @ X)


def _motion_and_loads(motions: Motions, name: str) -> tuple[Motion, np.ndarray, np.ndarray]:
    """What `section_forces` takes of a flexible body."""
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


def _loads(motions: Motions, name: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """What joints, paths and loads do to a body: its frame, moment about the kernels' origin, force, world axes."""
    model, seen, acting = motions.model, motions.seen, list[tuple[str, np.ndarray, np.ndarray]]()
    for joint, (n, f) in joint_wrenches(motions).items():
        between = model.scene.joint[joint].between
        about_origin = n + np.cross(motions.frame_positions[between[1]], f)
        acting += [(at, sign * about_origin, sign * f) for at, sign in zip(between, (-1.0, 1.0), strict=True)]
    acting += path_wrenches(model, seen)
    acting += on_frames(model, seen, name)
    return [load for load in acting if model.mechanism.frames[load[0]].body == name]
