r"""Two cylinders, compressed between their axes, by the guide for dimensions and deflections of line contacts.

.. math:: \delta = \frac{F}{\pi E^*L}\left[\ln\frac{4\pi E^*L\,\Delta R}{F} + 1\right]

It is used up to 3.4 times the clearance.
Source: ESDU 78035 (1978), Tribology Series; Pereira, Ramalho & Ambrosio (2011), Nonlinear Dynamics 63, 681-697.
"""

from __future__ import annotations

from math import pi

from flexclear.dynamics.contact.conforming.conforming import Conforming, by_clearance
from flexclear.scene.loose_joints import ClearanceRevolute


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force."""
    return by_clearance(joint, 4.0 * pi, 1.0)
