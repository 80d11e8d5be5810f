r"""A linear spring and a linear damper in parallel.

.. math:: F_N = \max(0,\; K\,\delta + C\,\dot\delta), \quad C = 2\zeta\sqrt{K m}

The exponent is 1. C is given as `damping`, or follows from the restitution that a free
impact of the effective mass m must have; the closed form is exact, so that this law delivers
the requested restitution. The force does not pull: the contact ends where K d + C d' = 0, before the
surfaces separate (no adhesion). It jumps where the contact begins, unlike that of real surfaces; valid
for soft layers and as the usual linear comparison.
Source: Goldsmith (1960), Impact, ch. 1; restitution without adhesion: Schwager & Poeschel (2007),
Granular Matter 9, 465-469.
"""

from __future__ import annotations

import math

from flexclear.dynamics.contact import restitution
from flexclear.dynamics.contact.law import Numbers, Resolved
from flexclear.scene.clearance import KelvinVoigt


def resolve(law: KelvinVoigt, stiffness: float, mass: float | None) -> Resolved:
    """Return the law for the scene's numbers; raise ValueError, in words, when it cannot deliver them."""
    mass = mass if law.effective_mass is None else law.effective_mass
    critical = None if mass is None else 2.0 * math.sqrt(stiffness * mass)
    if law.damping is not None:
        damping = law.damping
    elif critical is None or law.given_restitution is None:
        raise ValueError("no mass is known on either side of this joint; give an effective_mass, or a damping [N s/m]")
    else:
        damping = critical * restitution.damping_ratio(law.given_restitution)
    delivered = None if critical is None else restitution.linear_delivered(damping / critical)
    return Resolved("linear-damper", Numbers(stiffness, 1.0, damping), law.given_restitution, delivered)
