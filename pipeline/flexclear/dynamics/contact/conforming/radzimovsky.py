r"""Two cylinders, compressed between their axes, with the width of their contact.

.. math:: \delta = \frac{F}{\pi E^*L}\left[\frac23 + \ln\frac{4R_o}{b} + \ln\frac{4R_i}{b}\right], \quad
          b = 1.6\sqrt{\frac{2R_oR_i}{\Delta R}\frac{F}{E^*L}}

b is the whole width. Publications that leave out the factor 2 in it take a softer contact.
Source: Radzimovsky (1953), Stress distribution and strength condition of two rolling cylinders, University of Illinois
Bulletin 408; Young & Budynas (2002), Roark's Formulas for Stress and Strain, table 14.1.
"""

from __future__ import annotations

from flexclear.dynamics.contact.conforming.conforming import Conforming, by_clearance
from flexclear.scene.loose_joints import ClearanceRevolute


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force."""
    return by_clearance(joint, 16.0 / (2.0 * 1.6**2), 2.0 / 3.0)
