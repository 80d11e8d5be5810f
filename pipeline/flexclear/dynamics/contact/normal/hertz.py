r"""Elastic contact without loss.

.. math:: F_N = K\,\delta^n

Valid while the contact area is small against the radii and nothing yields; a free impact rebounds
with its approach speed.
Source: Hertz (1882), J. reine angew. Math. 92, 156-171; Wang & Wang (2019), eq. (25) with c_r = 1.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import RESTITUTION_ERROR, Numbers, Resolved, refuse_linear
from flexclear.scene.clearance import NormalLaw

#: default exponent
exponent = 1.5


def resolve(law: NormalLaw, stiffness: float, mass: float | None) -> Resolved:
    """Return the law for the scene's numbers; raise ValueError, in words, when it cannot deliver them."""
    refuse_linear("hertz", law)
    if law.delivered_restitution not in (None, 1.0):
        raise ValueError(
            f"the law 'hertz' has no loss and cannot deliver a restitution of {law.delivered_restitution:g}; "
            "choose a law with damping"
        )
    warning = None
    if law.restitution is not None and 1.0 - law.restitution > RESTITUTION_ERROR:
        warning = f"'hertz' has no loss: its restitution is 1, not {law.restitution:g}"
    power = exponent if law.exponent is None else law.exponent
    return Resolved("elastic", Numbers(stiffness, power, 0.0), None, 1.0, warning)
