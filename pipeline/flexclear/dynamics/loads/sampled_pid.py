r"""Sampling PID controller: it reads the error at t_k and holds its force until t_(k+1) = t_k + T.

.. math:: u_k = K_p e_k + z_k + K_d (e_k - e_{k-1})/T, \quad F_k = \min(\max(u_k, F_-), F_+), \quad
          z_{k+1} = z_k + T\,[K_i e_k + (F_k - u_k)/T_t]

The force, the integral part and the last error are internal states that change at samples only
(`run`), where steps end.
Source: Astrom & Hagglund (1995), PID Controllers: Theory, Design, and Tuning, 2nd ed., sec. 3.6.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.given import Given, Load, pushing
from flexclear.dynamics.loads.pid import settings
from flexclear.dynamics.loads.row import Row
from flexclear.scene.loads import SampledPid

#: number of its internal states
STATES = 3
#: indices of the internal states
FORCE, INTEGRAL, ERROR = range(3)


def apply(given: Given) -> Load:
    """Return the force that is held between samples."""
    return pushing(given, given.states[FORCE])._replace(states=[0.0] * len(given.states))


def row(load: SampledPid, path: str, coordinate: Coordinate, measured: Coordinate) -> Row:
    """Return the load's row: six numbers (`pid.settings`) and the period [s], the reference, three states."""
    reference = (load.reference, measured.dimension, f"{path[:-1]}.reference]")
    gains = (*settings(load, path, coordinate, measured), load.period)
    return Row(joint=load.joint, laws=(reference,), numbers=gains, states=STATES)


def sample(gains: np.ndarray, held: np.ndarray, error: float, *, first: bool) -> np.ndarray:
    """Return the internal states after a sample, from those before the sample and the error; shape (3,)."""
    proportional, integral, derivative, low, high, tracking, period = gains
    change = 0.0 if first else (error - held[ERROR]) / period
    asked = proportional * error + held[INTEGRAL] + derivative * change
    force = min(max(asked, low), high)
    grown = held[INTEGRAL] + period * (integral * error + tracking * (force - asked))
    return np.array([force, grown, error])
