"""Kinetic energy of a vibration by body."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.core.scene.parts import RigidBody
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.record.motion import Motion, body_motions, modal

Seen = dict[str, np.ndarray]


def by_body(model: Model, rows: Seen, links: list[Motion]) -> dict[str, np.ndarray]:
    """Twice the kinetic energy of every moving body in states, by name, shape (rows - 1,) each.

    rows: the pose with its drives' motion alone, which is taken off, then with the speeds of vibrations.
    The shortening of bent beams, which is of second order here, is left out.
    """
    found: dict[str, np.ndarray] = {}
    motions = body_motions(model, rows, links)
    for name, body in model.scene.rigid().items():
        found[name] = _rigid(body, motions[name])
    for i in sorted(model.numbering.modes):
        name = str(model.mechanism.links[i].flexible)
        state = modal(model, i, rows)
        found[name] = _flexible(model.mechanism.bundles[name], links[i], state.q[0], state.u[1:] - state.u[0])
    return found


def _relative(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and angular velocity in body axes, the first row's taken off."""
    parts = (motion.v[1:] - motion.v[0], motion.omega[1:] - motion.omega[0])
    return parts[0] @ motion.R[0], parts[1] @ motion.R[0]


def _rigid(body: RigidBody, motion: Motion) -> np.ndarray:
    v, omega = _relative(motion)
    return body.mass * np.sum(v * v, axis=1) + np.einsum("ti,ij,tj->t", omega, np.array(body.inertia), omega)


def _flexible(bundle: xr.Dataset, frame: Motion, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Twice the kinetic energy of a modally reduced body whose frame moves; see `bodies.flexible`."""
    v, omega = _relative(frame)
    E, F, C = (bundle[n].values for n in ("position_mode_moment", "mode_mode_moment", "modal_first_moment"))
    P = E + np.einsum("klij,i->klj", F, q)
    half = np.einsum("klj,j->kl", E, q)
    second = bundle["second_moment"].values + half + half.T + np.einsum("klij,i,j->kl", F, q, q)
    inertia = np.trace(second) * np.eye(3) - second
    first, rate = bundle["first_moment"].values + C @ q, u @ C.T
    spin = np.array([P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]])
    energy = float(bundle["mass"]) * np.sum(v * v, axis=1)
    energy += 2.0 * np.sum(v * (np.cross(omega, first) + rate), axis=1)
    energy += np.einsum("ti,ij,tj->t", omega, inertia, omega) + 2.0 * np.sum(omega * (u @ spin.T), axis=1)
    return energy + np.einsum("ti,ij,tj->t", u, bundle["modal_mass"].values, u)
