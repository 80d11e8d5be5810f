r"""Hertzian contact whose damping comes from a restitution that falls with the speed, near 1.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \tfrac32(1-c_r)

Derived for c_r near 1 (1 - alpha v): asked for 0.8 it delivers 0.833, for 0.5 0.663, and never less than 0.487;
within 0.05 of what is asked from 0.75 up.
Source: Hunt & Crossley (1975), J. Applied Mechanics 42, 440-445; form with c_r: Machado
et al. (2012), Mech. Mach. Theory 53, 99-121.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.contact.law import Hysteresis

LAW = Hysteresis("hunt-crossley", lambda c_r: 1.5 * (1.0 - c_r), valid=(0.75, 1.0))
