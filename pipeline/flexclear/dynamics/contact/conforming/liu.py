r"""Pin in a tight journal, from the pressure on an arc that grows with the penetration.

.. math:: F = \frac{\pi}{2}E^*L\,\delta\sqrt{\frac{\delta}{2(\Delta R+\delta)}}

Meant for contacts on a large part of the circumference; in an open joint it is too soft.
Source: Liu, Zhang & Yang (2007), Mechanism and Machine Theory 42, 183-197.
"""

from __future__ import annotations

from math import pi

from flexclear.dynamics.contact.conforming.conforming import Conforming, effective_modulus, require_journal
from flexclear.scene.loose_joints import ClearanceRevolute


def resolve(joint: ClearanceRevolute) -> Conforming:
    """Return the elastic force."""
    require_journal(joint)
    return Conforming("liu", (0.5 * pi * effective_modulus(joint) * joint.length, joint.clearance))
