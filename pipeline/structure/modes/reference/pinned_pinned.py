"""Body frame through two pinned interfaces: a simply supported body.

Six conditions: the first interface does not move and does not turn about the line to the second; the second moves
along that line only. Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (simply supported reference conditions).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given, holding, joined

WHERE = "modes.interfaces"


def condition(model: Model, given: Given) -> Condition:
    """Normal modes between two pins; InputError without two interfaces at different points."""
    first, second = joined(given, 2, "a pinned-pinned basis needs two interfaces")[:2]
    line = second.position - first.position
    length = float(np.linalg.norm(line))
    if length <= 1e-9 * np.ptp(model.position, axis=0).max():
        raise InputError(WHERE, f"'{first.name}' and '{second.name}' coincide", "pin the body at two different points")
    along, *across = _triad(line / length)
    held = sp.vstack(
        [
            first.motion[:3],
            sp.csr_array(along[None, :]) @ first.motion[3:],
            sp.csr_array(np.array(across)) @ second.motion[:3],
        ],
        format="csr",
    )
    held.eliminate_zeros()
    note = f"the body frame rides on the pins '{first.name}' and '{second.name}'; no rigid motion is left"
    return holding(sp.csr_array(held), note)


def _triad(along: np.ndarray) -> np.ndarray:
    """Rows: the direction and two across it, parallel to axes of the mesh frame where it is."""
    k = int(np.argmin(np.abs(along)))
    second = np.cross(along, np.eye(3)[k])
    second /= np.linalg.norm(second)
    triad = np.array([along, second, np.cross(along, second)])
    return np.where(np.abs(triad) < 1e-15, 0.0, triad)
