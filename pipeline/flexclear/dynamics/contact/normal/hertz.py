r"""Elastic contact without loss.

.. math:: F_N = K\,\delta^n

Valid while the contact area is small against the radii and nothing yields; a free impact rebounds
with its approach speed.
Source: Hertz (1882), J. reine angew. Math. 92, 156-171; Wang & Wang (2019), eq. (25) with c_r = 1.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import RESTITUTION_ERROR, Numbers, Resolved
from flexclear.scene.clearance import Hertz


def resolve(law: Hertz, stiffness: float, mass: float | None) -> Resolved:
    """Return the law for the scene's numbers."""
    warning = None
    if law.restitution is not None and 1.0 - law.restitution > RESTITUTION_ERROR:
        warning = f"'hertz' has no loss: its restitution is 1, not {law.restitution:g}"
    return Resolved("elastic", Numbers(stiffness, law.exponent, 0.0), None, 1.0, warning)
