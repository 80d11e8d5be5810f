r"""Velocities after coordinates are brought to given rates at once, with impulses and energy loss.

With the free motions Z of the mechanism, Z^T M Z = 1 and J Z = 0, and the rates C of the coordinates along them,

.. math:: \Delta u = Z C^T \Lambda, \quad (C C^T) \Lambda = r - c\,u, \quad D = \tfrac12 \Delta u^T M \Delta u

so that every other change of the velocities that gives the rates r takes more kinetic energy. An ideal drive that then
moves at the rate r does the work r Lambda; the kinetic energy T grows by this work less D.
Source: Pars (1965), A Treatise on Analytical Dynamics, ch. XIV (impulsive constraints, theorems of Carnot and Gauss).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flexclear.dynamics.linear.bench import inertia
from flexclear.dynamics.linear.tangent import free_motions
from flexclear.dynamics.run.coordinates import joint_coordinates
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.run.evaluation.start import NO_IMPACT, overlap_depths

#: singular values below this fraction of the largest are rounding
IMPULSE_RANK = 1e-9


class Impulses(NamedTuple):
    """State after the impulses; impulse [N s or N m s] on each coordinate; work of the drives and energy loss [J]."""

    y: np.ndarray
    impulses: dict[str, float]
    work: float
    lost: float


def rows(engine: Engine, states: np.ndarray, t: float) -> np.ndarray:
    """Return record rows for states at the start, all with the contacts with which a run from the first one begins."""
    modes, latched = np.zeros((2, len(engine.model.contacts)))
    for c in overlap_depths(engine, states[0]):
        speed = engine.model.contacts[c].joint.initial_approach_speed
        if speed is not None:
            modes[c], latched[c] = 1.0, speed or NO_IMPACT
    return rows_of(engine, states, t, modes, latched)


def apply_impulses(engine: Engine, y: np.ndarray, t: float, targets: Mapping[str, float]) -> Impulses:
    """Bring coordinates, by their names in records, to rates [m/s or rad/s] in the state y at time t."""
    model = engine.model
    closure_rows.evaluate(engine, y, t)
    Z = free_motions(*inertia(engine))[0]
    scale = np.maximum(np.abs(Z).max(axis=0, initial=0.0), np.finfo(float).tiny)
    states = np.tile(y, (1 + Z.shape[1], 1))
    states[1:, model.speeds] += (Z / scale).T
    series = joint_coordinates(model, observe(engine, rows(engine, states, t), after=True))
    rates = np.array([series[name][1] for name in targets]).reshape(len(targets), -1)
    C = (rates[:, 1:] - rates[:, :1]) * scale
    missing = np.array(list(targets.values())) - rates[:, 0]
    s = np.linalg.lstsq(C, missing, rcond=IMPULSE_RANK)[0]
    impulses = np.linalg.lstsq(C.T, s, rcond=IMPULSE_RANK)[0]
    after = y.copy()
    after[model.speeds] += Z @ s
    work = float(np.array(list(targets.values())) @ impulses)
    return Impulses(after, dict(zip(targets, impulses.tolist(), strict=True)), work, 0.5 * float(s @ s))
