"""Any list of held motions of named frames, which together fix the body frame.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (reference conditions).
"""

from __future__ import annotations

import scipy.sparse as sp

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given, functional, holding


def condition(model: Model, given: Given) -> Condition:
    """Normal modes with the motions ``frame.direction`` of `given.held` at zero; InputError for unknown ones."""
    if not given.held:
        raise InputError("modes.held", "no motion is held", 'list at least six, as held = ["top.x", "top.rz", ...]')
    held = sp.csr_array(sp.vstack([functional(model.interfaces, name) for name in given.held], format="csr"))
    return holding(held, f"the body frame is fixed by {', '.join(given.held)}")
