r"""Mean axes: elastic modes of the free body, free of linear and angular momentum.

.. math:: \int\rho\, S\,dV = 0, \qquad \int\rho\, (X - X_c)\times S\,dV = 0

Source: Wang & Wang (2019), sec. 3.4 and Table 5; mean axes after Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given, floating


def condition(model: Model, given: Given) -> Condition:
    """Normal modes of the free body; `given` plays no part."""
    return floating(model, "the six rigid-body modes below the gap in the free body's frequencies were left out")
