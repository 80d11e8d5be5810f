"""Datasets of an equilibrium and of the vibrations about it (schemas EQUILIBRIUM and LINEAR)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import EQUILIBRIUM, LINEAR, conform
from flexclear.dynamics import memory as m
from flexclear.dynamics.linear.bench import Bench, observe, rows, state
from flexclear.dynamics.linear.equilibrium import Equilibrium
from flexclear.dynamics.linear.shapes import motions
from flexclear.dynamics.linear.vibrations import Vibrations
from flexclear.dynamics.record.dataset import attributes, record_run, subject
from flexclear.dynamics.run.refusals import validity
from flexclear.dynamics.run.run import Run
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.numerics.rotations import index_of_largest

PARTS = ("real", "imaginary")


def equilibrium(bench: Bench, rest: Equilibrium, moving: bool) -> xr.Dataset:
    """Return the pose with its forces and reactions (schema EQUILIBRIUM)."""
    seen = observe(bench, state(bench, rest.at.q)[None, :])
    contacts, none = len(bench.model.contacts), m.named(m.EVENT, np.zeros((0, m.EVENT.size)))[:, 0]
    row = rows(bench, seen.state)
    once = Trajectory(row, row[:0], none, contacts, {}, ((bench.time, bench.engine.selected.copy()),))
    still = record_run(Run(bench.scene, bench.engine, once, seen)).to_xarray().isel(time=0, drop=True)
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
        warnings="\n".join(validity.warnings(bench.model, once.time, seen)),
        undetermined_reactions=", ".join(n for n in bench.scene.joint if n in bench.engine.mobility.redundant_joints),
    )


def linear(bench: Bench, rest: Equilibrium, small: Vibrations, moving: bool) -> xr.Dataset:
    """Return the equilibrium with its natural vibrations (schema LINEAR)."""
    still = equilibrium(bench, rest, moving)
    value, w = small.value, small.shape
    translation, rotation, energy = motions(bench, rest.at.q, w)
    phase = _phase(translation, rotation, w)
    w, translation, rotation = w * phase, translation * phase[:, None, None], rotation * phase[:, None, None]
    size, parts = np.abs(value), list(energy)
    fraction = np.stack([energy[name] for name in parts], axis=1)
    most = index_of_largest(fraction, axis=1)
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
    axes = "coordinates" if moving and not small.fixed else "fixed"
    return conform(
        result, LINEAR, **facts, motions_without_stiffness=small.free, growth=small.growth, frequency_axes=axes
    )


def _phase(translation: np.ndarray, rotation: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return a factor per vibration that makes its largest component real and positive, of frames, else of speeds."""
    phases = []
    for k in range(w.shape[1]):
        shown = translation[k].ravel() if np.abs(translation[k]).max(initial=0.0) > 0.0 else rotation[k].ravel()
        every = shown if np.abs(shown).max(initial=0.0) > 0.0 else w[:, k]
        largest = every[index_of_largest(np.abs(every))]
        phases.append(np.conj(largest) / abs(largest))
    return np.array(phases, dtype=complex)


def _split(values: np.ndarray) -> np.ndarray:
    """Return complex values (vibration, ...) as real and imaginary part along a second dimension."""
    return np.stack([values.real, values.imag], axis=1)
