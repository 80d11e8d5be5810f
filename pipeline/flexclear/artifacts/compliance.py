r"""Static compliance of a reduced body at its frames, from the reduced matrices alone.

With frame j held and a force at frame i, rigid motion follows j. With the motion :math:`S_i` of the frames per modal
coordinate and the rigid transport :math:`R_i R_j^{-1}`,

.. math:: \Delta_{ij} = S_i - R_i R_j^{-1} S_j, \qquad C_{ij} = \Delta_{ij} K^{-1} \Delta_{ij}^T .

With nothing held (i = j) the inertia forces of the free body balance the load: :math:`\Delta_{ii} = S_i - R_i
(R^T M R)^{-1} R^T M \Phi`. By the principle of minimum energy no reduced compliance exceeds the full model's.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 17 (inertia relief).
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import skew

#: directions of a frame's motion, in its own axes
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def frame_compliance(motion: np.ndarray, rigid: np.ndarray, relief: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the compliance [m/N, rad/(N m)] of each frame with each held: diagonals, shape (p, p, 6).

    motion: of p frames per modal coordinate, axes of the frame, shape (p, 6, n). rigid: of the frames per rigid motion
    of the body, shape (p, 6, 6). relief: rigid motion in each shape, (R^T M R)^-1 R^T M Phi, shape (6, n). stiffness:
    modal, shape (n, n).
    """
    p = len(motion)
    result = np.empty((p, p, 6))
    for i in range(p):
        for j in range(p):
            rigid_motion = relief if i == j else np.linalg.solve(rigid[j], motion[j])
            deformation = motion[i] - rigid[i] @ rigid_motion
            result[i, j] = np.einsum("dn,nd->d", deformation, np.linalg.solve(stiffness, deformation.T))
    return result


def fractions(of_modes: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Return the modes' compliance over that of the full model; 1 where the latter is negligible."""
    negligible = full <= 1e-9 * full.max(axis=(0, 1), keepdims=True)
    return np.where(negligible, 1.0, of_modes / np.where(negligible, 1.0, full))


def of_bundle(bundle: xr.Dataset) -> np.ndarray:
    """Return the compliances of a bundle's frames as `frame_compliance` does, shape (frame, frame, 6)."""
    R_BF = bundle["frame_rotation"].values
    shapes = [np.swapaxes(R_BF, 1, 2) @ bundle[f"frame_{name}_shape"].values for name in ("translation", "rotation")]
    motion = np.concatenate(shapes, axis=1)
    arms = -skew(bundle["frame_position"].values)
    eye = np.broadcast_to(np.eye(3), arms.shape)
    rigid = np.block([[eye, arms], [np.zeros_like(arms), eye]])
    axes = np.zeros_like(rigid)
    axes[:, :3, :3] = axes[:, 3:, 3:] = np.swapaxes(R_BF, 1, 2)
    return frame_compliance(motion, axes @ rigid, _rigid_motions(bundle), bundle["modal_stiffness"].values)


def _rigid_motions(bundle: xr.Dataset) -> np.ndarray:
    """Return the rigid motion in each shape, about the origin of the body frame, shape (6, n)."""
    mass, first, second = (bundle[name].values for name in ("mass", "first_moment", "second_moment"))
    inertia = np.trace(second) * np.eye(3) - second
    arm = skew(first)
    moment = bundle["position_mode_moment"].values
    spin = np.stack([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    momentum = np.vstack([bundle["modal_first_moment"].values, spin])
    return np.linalg.solve(np.block([[mass * np.eye(3), -arm], [arm, inertia]]), momentum)
