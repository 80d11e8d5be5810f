r"""Two cylinders by Hertz's pressure, compressed between their axes.

.. math:: \delta = \frac{F}{\pi E^*L}\left[\ln\frac{4\pi E^*L\,\Delta R}{F} - 1\right]

It has no force for more than 0.54 of the clearance, and is used up to 0.46 of it.
Source: Johnson (1985), Contact Mechanics, sec. 5.6; Pereira, Ramalho & Ambrosio (2011), Nonlinear Dynamics 63, 681-697.
"""

from __future__ import annotations

from math import pi

from flexclear.dynamics.contact.conforming.conforming import Conforming, by_clearance
from flexclear.scene.loose_joints import ClearanceRevolute


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force."""
    return by_clearance(joint, 4.0 * pi, -1.0)
