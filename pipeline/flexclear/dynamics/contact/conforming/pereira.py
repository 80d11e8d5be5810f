r"""Pin in a journal: a power fitted to Johnson's formula, in N, mm and MPa.

.. math:: F = \frac{(0.965\Delta R + 0.0965)LE^*}{\Delta R}\delta^n, \quad n = Y\Delta R^{-0.005}, \quad
          Y = \begin{cases}1.51[\ln(1000\Delta R)]^{-0.151} & 0.005 \le \Delta R < 0.34954\\
              0.0151\Delta R + 1.151 & \Delta R \le 10\end{cases}

Source: Pereira, Ramalho & Ambrosio (2015), Multibody System Dynamics 35, 277-298.
"""

from __future__ import annotations

from math import log

from flexclear.dynamics.contact.conforming.conforming import Conforming, effective_modulus, require_journal
from flexclear.scene.loose_joints import ClearanceRevolute

#: clearances of the fit [mm], and where its two parts meet
LEAST, MEETING, LARGEST = 0.005, 0.34954, 10.0


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force; raise ValueError for a clearance outside of the fit."""
    require_journal(joint)
    c = 1e3 * joint.clearance
    if not LEAST <= c <= LARGEST:
        raise ValueError(
            f"the form 'pereira' is fitted to clearances of {LEAST:g} to {LARGEST:g} mm, not to {c:.4g} mm; "
            "choose 'johnson'"
        )
    slope = 1.51 * log(1e3 * c) ** -0.151 if c < MEETING else 0.0151 * c + 1.151
    exponent = slope * c**-0.005
    per_length = (0.965 * c + 0.0965) * 1e3 * joint.length * 1e-6 * effective_modulus(joint) / c
    return Conforming(stiffness=per_length * 1e3**exponent, exponent=exponent)
