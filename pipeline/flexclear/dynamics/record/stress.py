r"""Section forces and peak stresses of flexible bodies, by mode acceleration.

The forces in a section balance, for all that lies beyond it, interface loads against inertia:

.. math:: F = \sum f_i - \int_{beyond}\rho\,(a - g)\,dV ,

with the acceleration of every slice of mass under rigid and modal motion. So the interface loads act in full, whatever
they excite, and omitted modes lack only their inertia, which falls with the square of the ratio of excitation to
natural frequency; stresses from the modal coordinates alone, :math:`E\,S' q`, lack the static response, too.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 11 (mode acceleration); Bisplinghoff, Ashley
& Halfman, *Aeroelasticity* (1955), sec. 10-3 (force summation).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics.equations.observation import Series, Variables
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import FrameWrench, Wrench, joint_wrenches, on_frames, path_wrenches
from flexclear.numerics.rotations import components, index_of_largest, matrices, principal, skew, von_mises
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled


@dataclass(frozen=True)
class Motion:
    """Motion of the body frame, in its own axes, and of the modal coordinates; each (time, 3) or (time, mode).

    a: acceleration of the origin minus gravity.
    """

    a: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray
    q: np.ndarray
    u: np.ndarray
    du: np.ndarray


@dataclass(frozen=True)
class Gauged:
    """Stress at a body's gauges: names, components (time, gauge, 6) in body axes, positions (time, gauge, 3)."""

    names: list[str]
    stress: np.ndarray
    position: np.ndarray


def record(motions: Motions, names: tuple[str, ...]) -> Series:
    """Return stresses of the bodies `names`, rods and solids: variables and coordinates of the run dataset.

    Raises InputError for a bundle without stress data.
    """
    bundles = {name: motions.model.links[motions.model.mechanism.link_of[name]].bundle for name in names}
    rods = {name: bundle for name, bundle in bundles.items() if bundle is not None and "section_place" in bundle}
    solids = {name: bundle for name, bundle in bundles.items() if bundle is not None and "stress_field" in bundle}
    for name in names:
        if name not in rods and name not in solids:
            raise InputError("[output] stress", f"the bundle of '{name}' has no stresses", "compute it from the scene")
    variables, coordinates, gauged = Variables(), dict[str, object](), dict[str, Gauged]()
    for those, made in ((rods, _section_forces_of_rods), (solids, _stress_factors_of_solids)):
        if those:
            more, named = made(motions, those, gauged)
            variables, coordinates = variables | more, coordinates | named
    more, named = _gauge_series(gauged) if gauged else ({}, {})
    return variables | more, coordinates | named


def _gauge_series(gauged: Mapping[str, Gauged]) -> Series:
    stress = np.concatenate([body.stress for body in gauged.values()], axis=1)
    dims = ("time", "gauge")
    variables: Variables = {"von_mises_stress": (dims, von_mises(stress))}
    for rank, values in zip(("first", "second", "third"), np.moveaxis(principal(stress), -1, 0), strict=True):
        variables[f"{rank}_principal_stress"] = (dims, values)
    position = np.concatenate([body.position for body in gauged.values()], axis=1)
    variables["stress_position"] = ((*dims, "axis"), position)
    variables["stress_tensor"] = ((*dims, "tensor"), stress)
    owners = [name for name, body in gauged.items() for _ in body.names]
    return variables, {
        "gauge": [name for body in gauged.values() for name in body.names],
        "gauge_body": ("gauge", owners),
    }


def _stress_factors_of_solids(motions: Motions, solids: Mapping[str, Labelled], gauged: dict[str, Gauged]) -> Series:
    """Return the factors of the stress fields; store the stresses at gauges in `gauged`."""
    every, fields, owners = [], list[str](), list[str]()
    for body, bundle in solids.items():
        factor = factors(bundle, *motion_and_loads(motions, body))
        gauges = gauge_nodes(bundle)
        stress, node = largest_stress_by_group(bundle["stress_field"].values, factor, list(gauges.values()))
        names = [f"{body}.{name}" if name else body for name in gauges]
        gauged[body] = Gauged(names, stress, bundle["node_position"].values[node])
        every.append(factor)
        fields += [f"{body}: {name}" for name in bundle["field"].values]
        owners += [body] * factor.shape[1]
    return {"stress_factor": (("time", "stress_field"), np.concatenate(every, axis=1))}, {
        "stress_field": fields,
        "stress_field_body": ("stress_field", owners),
    }


def _section_forces_of_rods(motions: Motions, rods: Mapping[str, Labelled], gauged: dict[str, Gauged]) -> Series:
    """Return section forces and peak stresses; the latter only when all sections have a known outline.

    Stores the largest stress of all sections in `gauged`, at the centre of its section.
    """
    forces, peaks, owners = [], [], []
    for name, bundle in rods.items():
        force = section_forces(bundle, *motion_and_loads(motions, name))
        forces.append(force)
        owners += [name] * force.shape[1]
        if "fibre_stress" in bundle:
            axial, mises, stress = peak_stresses(bundle, force)
            peaks.append((axial, mises))
            worst = np.argmax(mises, axis=1)
            R = bundle["section_rotation"].values[worst]
            turned = R @ matrices(stress[np.arange(len(worst)), worst]) @ np.swapaxes(R, 1, 2)
            position = bundle["section_position"].values[worst]
            gauged[name] = Gauged([name], components(turned)[:, None], position[:, None])
    every = np.concatenate(forces, axis=1)
    variables: Variables = {
        "section_force": (("time", "section", "axis"), every[..., :3]),
        "section_moment": (("time", "section", "axis"), every[..., 3:]),
    }
    if len(peaks) == len(rods):
        for k, name in enumerate(("peak_axial_stress", "peak_von_mises_stress")):
            variables[name] = (("time", "section"), np.concatenate([peak[k] for peak in peaks], axis=1))
    places = np.concatenate([bundle["section_place"].values for bundle in rods.values()])
    return variables, {
        "section": np.arange(len(owners)),
        "section_body": ("section", owners),
        "section_place": ("section", places, {"units": "m", "long_name": "position along the rod"}),
    }


def motion_and_loads(motions: Motions, name: str) -> tuple[Motion, np.ndarray, np.ndarray]:
    """Return motion of a flexible body, and moments about its origin [N m] and forces [N] on its frames, body axes.

    Shape (time, frame, 3) each, frames in the order of the mechanism and of the bundle.
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


def _loads(motions: Motions, name: str) -> list[FrameWrench]:
    """Return wrenches on a body by joints, paths and loads: frame, moment about the mechanism's origin, force."""
    model, seen, acting = motions.model, motions.seen, list[FrameWrench]()
    for joint, (n, f) in joint_wrenches(motions).items():
        between = model.scene.joint[joint].between
        about_origin = n + np.cross(motions.positions([between[1]])[:, 0], f)
        acting += [(at, sign * about_origin, sign * f) for at, sign in zip(between, (-1.0, 1.0), strict=True)]
    acting += path_wrenches(model, seen)
    acting += on_frames(model, seen, name)
    return [load for load in acting if model.mechanism.frames[load[0]].body == name]


def section_forces(bundle: Labelled, motion: Motion, moment: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return N, Qy, Qz [N], T, My, Mz [N m] of each section, in axes of the deformed section, (time, section, 6).

    moment, force: of joints and loads at every named frame, body axes, moments about the body's origin [N m, N], shape
    (time, frame, 3).
    """
    slices, frames = (bundle[f"{name}_beyond"].values.astype(float) for name in ("slice", "frame"))
    spin, push = _inertia(bundle, motion)
    F = np.einsum("sf,tfi->tsi", frames, force) - np.einsum("sp,tpi->tsi", slices, push, optimize=True)
    M = np.einsum("sf,tfi->tsi", frames, moment) - np.einsum("sp,tpi->tsi", slices, spin, optimize=True)
    centre = bundle["section_position"].values + _displacements(bundle, "section_translation_shape", motion.q)
    R_BS = _turn(_displacements(bundle, "section_rotation_shape", motion.q)) @ bundle["section_rotation"].values
    M = M - np.cross(centre, F)
    return np.concatenate([np.einsum("tsij,tsi->tsj", R_BS, part) for part in (F, M)], axis=-1)


def peak_stresses(bundle: Labelled, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return axial stress of largest magnitude, largest von Mises stress, (time, section), and its components [Pa].

    The six components are the stress at the fibre of the latter, axes of the section, (time, section, 6).
    forces: as `section_forces` returns them.  A round section is turned so that a fibre lies in the plane of bending.
    Among equally large stresses that of the first fibre counts.
    """
    axial, mises, stress = np.empty(forces.shape[:2]), np.empty(forces.shape[:2]), np.zeros(forces.shape)
    maps, is_round = bundle["fibre_stress"].values, bundle["section_round"].values
    for s, fibres in enumerate(maps):
        angle = _bending_angle(forces[:, s]) * is_round[s]
        loads = _forces_in_turned_axes(forces[:, s], angle) if is_round[s] else forces[:, s]
        sigma, tau_y, tau_z = np.moveaxis(np.einsum("fcl,tl->tfc", fibres, loads, optimize=True), -1, 0)
        axial[:, s] = _pick_by_row(sigma, index_of_largest(np.abs(sigma), axis=1))
        size = np.sqrt(sigma**2 + 3.0 * (tau_y**2 + tau_z**2))
        worst, c, d = np.argmax(size, axis=1), np.cos(angle), np.sin(angle)
        mises[:, s] = _pick_by_row(size, worst)
        along, y, z = (_pick_by_row(values, worst) for values in (sigma, tau_y, tau_z))
        stress[:, s, 0], stress[:, s, 4], stress[:, s, 5] = along, d * y + c * z, c * y - d * z
    return axial, mises, stress


def _pick_by_row(values: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return one value of each row."""
    result: np.ndarray = values[np.arange(len(values)), column]
    return result


def _bending_angle(forces: np.ndarray) -> np.ndarray:
    """Return the angle from y to the fibre with the largest tension by bending; forces: (time, 6)."""
    return np.arctan2(forces[:, 4], -forces[:, 5])


def _forces_in_turned_axes(forces: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return forces (time, 6) in axes turned about x by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    turned = forces.copy()
    for k in (1, 4):
        turned[:, k] = c * forces[:, k] + s * forces[:, k + 1]
        turned[:, k + 1] = c * forces[:, k + 1] - s * forces[:, k]
    return turned


def _inertia(bundle: Labelled, motion: Motion) -> Wrench:
    """Return each slice's rate of momentum minus weight: moment about the body's origin, force, (time, slice, 3)."""
    S = [_displacements(bundle, "slice_translation_shape", x) for x in (motion.q, motion.u, motion.du)]
    theta = [skew(_displacements(bundle, "slice_rotation_shape", x)) for x in (motion.q, motion.u, motion.du)]
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


def _displacements(bundle: Labelled, name: str, q: np.ndarray) -> np.ndarray:
    """Return shapes (point, 3, mode) times coordinates (time, mode): (time, point, 3)."""
    return np.einsum("pim,tm->tpi", bundle[name].values, q, optimize=True)


def _turn(v: np.ndarray) -> np.ndarray:
    """Return rotation matrices of rotation vectors (..., 3) (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    X = skew(v)
    return np.eye(3) + np.sinc(angle / np.pi) * X + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * (X @ X)


# Solids: the fields of their bundles times the factors of each row. These factors are modal coordinates, forces and
# moments of the frames, accelerations of the body frame and of the modes (`structure/stress/solid` explains why that is
# the method of mode acceleration)


def factors(bundle: Labelled, motion: Motion, moment: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the factor of each field of a solid's bundle, in SI, shape (time, field).

    moment, force: as `motion_and_loads` returns them.
    """
    loads = on_displaced_frames(bundle, motion, moment, force)
    W = skew(motion.omega)
    slope = skew(motion.alpha) + W @ W  # acceleration per position in the body
    rows = len(motion.a)
    return np.hstack([motion.q, loads.reshape(rows, -1), motion.a, slope.reshape(rows, 9), motion.du])


def on_displaced_frames(bundle: Labelled, motion: Motion, moment: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return forces, and moments about the frames' displaced origins, body axes, shape (time, frame, 6).

    moment, force: as `motion_and_loads` returns them.
    """
    origins = bundle["frame_position"].values + _displacements(bundle, "frame_translation_shape", motion.q)
    return np.concatenate([force, moment - np.cross(origins, force)], axis=2)


def gauge_nodes(bundle: Labelled) -> dict[str, np.ndarray]:
    """Return the nodes of each gauge, and by the empty name those of the whole surface where stress is no artefact."""
    nodes = {"": np.flatnonzero(bundle["node_doubtful"].values == 0)}
    for k, name in enumerate(bundle["gauge"].values.tolist()):
        nodes[name] = bundle["gauge_node"].values[bundle["gauge_index"].values == k]
    return nodes


def largest_stress_by_group(
    field: np.ndarray, factor: np.ndarray, groups: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return each group's stress at its node of largest von Mises stress (time, group, 6), and that node (time, group).

    field: shape (node, 6, field).  factor: shape (time, field).
    """
    tensor = np.empty((len(factor), len(groups), 6))
    node = np.empty((len(factor), len(groups)), dtype=np.int64)
    flat = np.ascontiguousarray(field.reshape(-1, field.shape[2]).T)
    # largest number of stress components of solids in memory
    step = max(1, 10_000_000 // flat.shape[1])
    for start in range(0, len(factor), step):
        part = slice(start, start + step)
        stress = (factor[part] @ flat).reshape(-1, *field.shape[:2])
        size, row = von_mises(stress), np.arange(len(stress))
        for k, nodes in enumerate(groups):
            node[part, k] = nodes[np.argmax(size[:, nodes], axis=1)]
            tensor[part, k] = stress[row, node[part, k]]
    return tensor, node
