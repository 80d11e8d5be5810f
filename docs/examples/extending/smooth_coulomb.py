r"""Coulomb friction that a hyperbolic tangent smooths through rest.

.. math:: F_t = -\mu_d\,\tanh(|v_t|/v_s)\,F_n\,v_t/|v_t|

It does not know sticking: a body on a slope creeps.
Source: Andersson, Soderberg & Bjorklund (2007), Tribology International 40, 580-587.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.friction.law import Friction, sliding
from flexclear.dynamics.specialise.symbols import tanh


def coefficient(speed: Any, p: Any) -> Any:
    """Mu [-] at the sliding speed [m/s] >= 0; p = (mu_d, v_s, -, -, -, -)."""
    return p[0] * tanh(speed / p[1])


LAW = Friction(sliding(coefficient), constants=lambda law: (law.dynamic, law.v_smooth))
