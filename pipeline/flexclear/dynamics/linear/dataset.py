"""Datasets of an equilibrium and of the vibrations about it (schemas EQUILIBRIUM and LINEAR)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.labelled import Labelled
from flexclear.artifacts.schema import EQUILIBRIUM, LINEAR, conform
from flexclear.dynamics import memory as m
from flexclear.dynamics.linear.bench import Bench, observe, rows, state
from flexclear.dynamics.linear.equilibrium import Equilibrium
from flexclear.dynamics.linear.vibrations import Vibrations
from flexclear.dynamics.record.dataset import attributes, recorded, subject
from flexclear.dynamics.record.motion import Motion, Motions
from flexclear.dynamics.run.run import Run
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.numerics.rotations import first_largest
from flexclear.scene.parts import RigidBody

PARTS = ("real", "imaginary")


def equilibrium(bench: Bench, rest: Equilibrium, moving: bool) -> xr.Dataset:
    """Return the pose with its forces and reactions (schema EQUILIBRIUM)."""
    seen = observe(bench, state(bench, rest.at.q)[None, :])
    contacts, none = len(bench.model.contacts), m.named(m.EVENT, np.zeros((0, m.EVENT.size)))[:, 0]
    once = Trajectory(rows(bench, seen.state), none, contacts, {}, ((bench.time, bench.engine.selected.copy()),))
    still = recorded(Run(bench.scene, bench.engine, once, seen)).to_xarray().isel(time=0, drop=True)
    kept = [n for n in EQUILIBRIUM if n in still.variables]
    names = [n for n in still.coords if set(still[n].dims) <= set().union(*(still[k].dims for k in kept))]
    result = still[kept].assign_coords({n: still[n].variable for n in names})
    return conform(
        result,
        EQUILIBRIUM,
        title=f"Equilibrium of {subject(bench.scene)}",
        **attributes(bench.scene),
        time=bench.time,
        drives="moving" if moving else "held",
        residual=rest.residual,
        iterations=rest.iterations,
        mobility=rest.at.Z.shape[1],
        redundant_closure_rows=rest.at.redundant,
        undetermined_reactions=", ".join(n for n in bench.scene.joint if n in bench.engine.mobility.redundant_joints),
    )


def linear(bench: Bench, rest: Equilibrium, small: Vibrations, moving: bool) -> xr.Dataset:
    """Return the equilibrium with its natural vibrations (schema LINEAR)."""
    still = equilibrium(bench, rest, moving)
    value, w = small.value, small.shape
    translation, rotation, energy = motions(bench, rest, w)
    phase = _phase(translation, rotation, w)
    w, translation, rotation = w * phase, translation * phase[:, None, None], rotation * phase[:, None, None]
    size, parts = np.abs(value), list(energy)
    fraction = np.stack([energy[name] for name in parts], axis=1)
    most = first_largest(fraction, axis=1)
    data: dict[str, Any] = {
        "frequency": ("vibration", np.abs(value.imag) / (2.0 * np.pi)),
        "undamped_frequency": ("vibration", size / (2.0 * np.pi)),
        "decay_rate": ("vibration", 0.0 - value.real),
        "damping_ratio": ("vibration", np.where(size > 0.0, (0.0 - value.real) / np.where(size > 0.0, size, 1.0), 0.0)),
        "dominant": ("vibration", np.array(parts, dtype=str)[most]),
        "energy_share": (("vibration", "moving_body"), fraction),
        "frame_translation": (("vibration", "part", "frame", "axis"), _split(translation)),
        "frame_rotation": (("vibration", "part", "frame", "axis"), _split(rotation)),
    }
    numbering = bench.model.numbering
    if numbering.flexible:
        shapes = np.concatenate([w[modes] for modes in numbering.modal_coordinates.values()])
        data["modal_shape"] = (("vibration", "part", "mode"), _split(shapes.T))
    result = still.assign({n: xr.Variable(*v) for n, v in data.items()})
    result = result.assign_coords(
        vibration=np.arange(1, len(value) + 1),
        part=list(PARTS),
        moving_body=parts,
        frame=list(bench.model.mechanism.frames),
    )
    facts = still.attrs | {"title": f"Vibrations of {subject(bench.scene)}"}
    return conform(result, LINEAR, **facts, motions_without_stiffness=small.free, growth=small.growth)


def motions(bench: Bench, rest: Equilibrium, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return motions of every named frame in each vibration, and each body's fraction of the kinetic energy.

    Translations and rotations: world axes, complex, shape (n, frame, 3).
    """
    model, n = bench.model, w.shape[1]
    speeds = np.concatenate([np.zeros((1, len(w))), w.real.T, w.imag.T])
    seen = observe(bench, np.array([state(bench, rest.at.q, v) for v in speeds]))
    motions = Motions(model, seen)
    velocities = motions.frame_velocities

    def part(which: int) -> np.ndarray:
        every = np.array([velocity[which] for velocity in velocities.values()]).reshape(len(velocities), len(speeds), 3)
        moved = np.swapaxes(every - every[:, :1], 0, 1)[1:]
        return moved[:n] + 1j * moved[n:]

    energy = {name: values[:n] + values[n:] for name, values in _energies(motions).items()}
    whole = np.sum(list(energy.values()), axis=0)
    return part(0), part(1), {name: values / whole for name, values in energy.items()}


def _phase(translation: np.ndarray, rotation: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return a factor per vibration that makes its largest component real and positive, of frames, else of speeds."""
    phases = []
    for k in range(w.shape[1]):
        shown = translation[k].ravel() if np.abs(translation[k]).max(initial=0.0) > 0.0 else rotation[k].ravel()
        every = shown if np.abs(shown).max(initial=0.0) > 0.0 else w[:, k]
        largest = every[first_largest(np.abs(every))]
        phases.append(np.conj(largest) / abs(largest))
    return np.array(phases, dtype=complex)


def _split(values: np.ndarray) -> np.ndarray:
    """Return complex values (vibration, ...) as real and imaginary part along a second dimension."""
    return np.stack([values.real, values.imag], axis=1)


def _energies(motions: Motions) -> dict[str, np.ndarray]:
    """Return twice the kinetic energy of every moving body in states, by name, shape (rows - 1,) each.

    motions: first row: the drives' motion alone, which is subtracted; then those with the speeds of vibrations.
    Shortening of bent beams is of second order here and neglected.
    """
    energies = {name: _rigid(body, motions.body(name)) for name, body in motions.model.scene.rigid().items()}
    for i in motions.model.numbering.flexible:
        link, state = motions.model.links[i], motions.modal(i)
        assert link.bundle is not None
        energies[str(link.flexible)] = _flexible(link.bundle, motions.link(i), state.q[0], state.u[1:] - state.u[0])
    return energies


def _relative(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and angular velocity in body axes, relative to those of the first row."""
    parts = (motion.v[1:] - motion.v[0], motion.omega[1:] - motion.omega[0])
    return parts[0] @ motion.R[0], parts[1] @ motion.R[0]


def _rigid(body: RigidBody, motion: Motion) -> np.ndarray:
    v, omega = _relative(motion)
    return body.mass * np.sum(v * v, axis=1) + np.einsum("ti,ij,tj->t", omega, np.array(body.inertia), omega)


def _flexible(bundle: Labelled, frame: Motion, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return twice the kinetic energy of a modally reduced body whose frame moves; see `bodies.flexible`."""
    v, omega = _relative(frame)
    E, F, C = (bundle[n].values for n in ("position_mode_moment", "mode_mode_moment", "modal_first_moment"))
    P = E + np.einsum("klij,i->klj", F, q)
    half = np.einsum("klj,j->kl", E, q)
    second = bundle["second_moment"].values + half + half.T + np.einsum("klij,i,j->kl", F, q, q)
    inertia = np.trace(second) * np.eye(3) - second
    first, rate = bundle["first_moment"].values + C @ q, u @ C.T
    spin = np.array([P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]])
    energy = float(bundle["mass"].values) * np.sum(v * v, axis=1)
    energy += 2.0 * np.sum(v * (np.cross(omega, first) + rate), axis=1)
    energy += np.einsum("ti,ij,tj->t", omega, inertia, omega) + 2.0 * np.sum(omega * (u @ spin.T), axis=1)
    return energy + np.einsum("ti,ij,tj->t", u, bundle["modal_mass"].values, u)
