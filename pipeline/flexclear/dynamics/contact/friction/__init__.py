"""Friction laws. To add one: a module here with a `LAW` (see `law.Friction`), a line in the table, its parameters in
scene/clearance, and a case in tests/properties/test_dynamics_friction and test_dynamics_clearance.

A joint without friction names none.
"""

from __future__ import annotations

from flexclear.dynamics.contact.expression import Laws
from flexclear.dynamics.contact.friction import ambrosio, expression, lugre, modified_coulomb

FRICTION_LAWS = Laws(
    {
        "modified-coulomb": modified_coulomb.LAW,
        "ambrosio": ambrosio.LAW,
        "lugre": lugre.LAW,
    },
    expression.law_of,
)
