r"""Rigid surfaces with a thin elastic layer between them, a foundation of independent springs.

The pressure is the modulus times the layer's compression over its thickness. A pin or a ball in a round surface has the
exact geometry; on a plane, and at the walls of a slot, the gap is a parabola:

.. math:: F = \frac{4}{3}\frac{K}{h}L\sqrt{2R}\,\delta^{3/2}, \quad F = \pi\frac{K}{h}R\,\delta^2

of a pin and of a ball. It holds while the layer is thin against the width of the contact.
Source: Johnson (1985), Contact Mechanics, sec. 4.3.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

from flexclear.dynamics.contact.conforming.conforming import Conforming


def resolve(joint: Any) -> Conforming:
    """Return the elastic force."""
    bed, layer = joint.normal.layer.modulus / joint.normal.layer.thickness, joint.normal.layer
    deepest = 0.5 * layer.thickness  # half the layer's thickness: strains that no linear layer has
    if joint.type == "clearance-revolute":
        return Conforming("layer-round-pin", (bed * joint.radius * joint.length, joint.clearance), deepest=deepest)
    if joint.type == "clearance-spherical":
        stiffness = pi / 3.0 * bed * joint.radius**2
        return Conforming("layer-round-ball", (stiffness, joint.clearance), deepest=deepest)
    if joint.type == "clearance-slot":
        stiffness = 4.0 / 3.0 * bed * joint.length * sqrt(2.0 * joint.radius)
        return Conforming(stiffness=stiffness, exponent=1.5, deepest=deepest)
    return Conforming(stiffness=pi * bed * joint.radius, exponent=2.0, deepest=deepest)
