r"""Mean axes: the body frame follows the body as a whole, and no shape has linear or angular momentum.

.. math:: \int\rho\, S\,dV = 0, \qquad \int\rho\, (X - X_c)\times S\,dV = 0

Sources: Canavin & Likins (1977), J. Spacecraft 14, 724-732 (Tisserand's or Buckens' frame); Shabana, *Dynamics of
Multibody Systems*, ch. 5; Wang & Wang (2019), sec. 3.4 and Table 5 (free-free modes).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexclear.scene.registry import lookup
from flexclear.structure.fe.model import Model, rows
from flexclear.structure.modes.condition import Condition, Given, distinct, interfaces_of
from flexclear.system.errors import InputError


def free_free(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes of the free body; `given` is not used."""
    return _free_condition(model, "the six rigid-body modes below the gap in the free body's frequencies were removed")


def craig_chang(model: Model, given: Given) -> Condition:
    """Return the condition for six inertia-relief attachment modes per interface and normal modes of the free body.

    The attachment modes are responses of the free body to unit forces and moments at the interfaces, balanced by its
    own inertia; with them the static response at the interfaces is exact. Their rigid motion depends on the supports
    of their computation and is removed by mass orthogonality.  Raises InputError without interfaces.
    Source: Craig & Chang (1977), NASA CR-2731; Craig & Kurdila (2006), ch. 17.
    """
    distinct(interfaces_of(given, 1, "attachment modes need an interface to load"))
    note = "six rigid-body modes were removed; the attachment modes' rigid motion was removed by mass orthogonality"
    return _free_condition(model, note, rows(given.interfaces, model.size))


def residual_flexibility(model: Model, given: Given) -> Condition:
    """Return the condition for six residual attachment modes per interface and normal modes of the free body.

    A residual attachment mode is the part of the response to a unit load at an interface that the normal modes miss; it
    is orthogonal to them. The space is Craig and Chang's; the shapes stay independent however many normal modes are
    retained.  Raises InputError without interfaces.
    Source: MacNeal (1971), Computers & Structures 1, 581-601; Rubin (1975), AIAA Journal 13, 995-1006.
    """
    return replace(craig_chang(model, given), residual=True)


def mean_axis(model: Model, given: Given) -> Condition:
    """Return the condition that `given.of` names, with linear and angular momentum removed from its shapes."""
    if given.of is None or given.of == "mean-axis":
        problem = "mean-axis changes the shapes of another condition; none is given"
        raise InputError("modes.of", problem, 'name it, as of = "craig-bampton"')
    from flexclear.structure.modes.reference import CONDITIONS  # here, since conditions are based on others

    based: Condition = lookup(CONDITIONS, given.of, kind="reference condition", where="modes.of")(model, given)
    note = f"shapes of {given.of}; their linear and angular momentum was removed"
    return replace(based, mean_axes=True, note=note)


def _free_condition(model: Model, note: str, loaded: sp.csr_array | None = None) -> Condition:
    """Return the condition for normal modes of the free body, and attachment modes for `loaded` functionals."""
    none = sp.csr_array((0, model.size))
    return Condition(none, note, np.empty(0, dtype=int), none if loaded is None else loaded, mean_axes=True)
