"""Motions of frames, and kinetic energies of bodies, in small motions."""

from __future__ import annotations

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.linear.bench import Bench, observe, state
from flexclear.dynamics.record.motion import Motion, Motions
from flexclear.scene.parts import RigidBody


def motions(bench: Bench, q: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return motions of every named frame in each vibration, and each body's fraction of the kinetic energy.

    Translations and rotations: world axes, complex, shape (n, frame, 3).
    """
    model, n = bench.model, w.shape[1]
    speeds = np.concatenate([np.zeros((1, len(w))), w.real.T, w.imag.T])
    seen = observe(bench, np.array([state(bench, q, v) for v in speeds]))
    motions = Motions(model, seen)
    velocities = motions.frame_velocities

    def part(which: int) -> np.ndarray:
        every = np.array([velocity[which] for velocity in velocities.values()]).reshape(len(velocities), len(speeds), 3)
        moved = np.swapaxes(every - every[:, :1], 0, 1)[1:]
        return moved[:n] + 1j * moved[n:]

    energy = {name: values[:n] + values[n:] for name, values in _energies(motions).items()}
    whole = np.sum(list(energy.values()), axis=0)
    return part(0), part(1), {name: values / whole for name, values in energy.items()}


def _energies(motions: Motions) -> dict[str, np.ndarray]:
    """Return twice the kinetic energy of every moving body in states, by name, shape (rows - 1,) each.

    motions: first row: the drives' motion alone, which is subtracted; then those with the speeds of vibrations.
    What loads stiffen is of second order here and neglected.
    """
    energies = {
        name: _energy_of_rigid_body(body, motions.body(name)) for name, body in motions.model.scene.rigid().items()
    }
    for i in motions.model.numbering.flexible:
        link, state = motions.model.links[i], motions.modal(i)
        assert link.bundle is not None
        energies[str(link.flexible)] = _energy_of_flexible_body(
            link.bundle, motions.link(i), state.q[0], state.u[1:] - state.u[0]
        )
    return energies


def _relative(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and angular velocity in body axes, relative to those of the first row."""
    parts = (motion.v[1:] - motion.v[0], motion.omega[1:] - motion.omega[0])
    return parts[0] @ motion.R[0], parts[1] @ motion.R[0]


def _energy_of_rigid_body(body: RigidBody, motion: Motion) -> np.ndarray:
    v, omega = _relative(motion)
    return body.mass * np.sum(v * v, axis=1) + np.einsum("ti,ij,tj->t", omega, np.array(body.inertia), omega)


def _energy_of_flexible_body(bundle: Labelled, frame: Motion, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return twice the kinetic energy of a modally reduced body whose frame moves; see `mechanics.flexible`."""
    v, omega = _relative(frame)
    E, C = (bundle[n].values for n in ("position_mode_moment", "modal_first_moment"))
    F = bundle["mode_mode_moment"].values + bundle["second_order_moment"].values
    P = E + np.einsum("klij,i->klj", F, q)
    half = np.einsum("klj,j->kl", E, q)
    second = bundle["second_moment"].values + half + half.T + np.einsum("klij,i,j->kl", F, q, q)
    inertia = np.trace(second) * np.eye(3) - 0.5 * (second + second.T)
    first, rate = bundle["first_moment"].values + C @ q, u @ C.T
    spin = np.array([P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]])
    energy = float(bundle["mass"].values) * np.sum(v * v, axis=1)
    energy += 2.0 * np.sum(v * (np.cross(omega, first) + rate), axis=1)
    energy += np.einsum("ti,ij,tj->t", omega, inertia, omega) + 2.0 * np.sum(omega * (u @ spin.T), axis=1)
    return energy + np.einsum("ti,ij,tj->t", u, bundle["modal_mass"].values, u)
