r"""Two cylinders, compressed between their axes, with their length as the size of the contact's surroundings.

.. math:: \delta = \frac{F(\sigma_o+\sigma_i)}{L}\left[\ln\frac{L^3\Delta R}{F R_oR_i(\sigma_o+\sigma_i)} + 1\right],
          \quad \sigma = \frac{1-\nu^2}{\pi E}

With the third power of the length the logarithm is that of a number; some publications print the first one.
Source: Goldsmith (1960), Impact, ch. 4; Dubowsky & Freudenstein (1971), J. Engineering for Industry 93, 305-309.
"""

from __future__ import annotations

from flexclear.dynamics.contact.conforming.conforming import Conforming, logarithmic, require_journal
from flexclear.dynamics.contact.hertz import compliance, relative_radius
from flexclear.scene.loose_joints import ClearanceRevolute


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force."""
    require_journal(joint)
    return logarithmic(joint, joint.length**3 / (relative_radius(joint) * compliance(joint)), 1.0)
