r"""Hertzian contact whose damping comes from a restitution near 1 that decreases with the speed.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \tfrac32(1-c_r)

Derived for c_r near 1 (1 - alpha v): for 0.8 it delivers 0.833, for 0.5 0.663, and at least 0.487.
From 0.75 up, the deviation is below 0.05.
Source: Hunt & Crossley (1975), J. Applied Mechanics 42, 440-445; form with c_r: Machado
et al. (2012), Mech. Mach. Theory 53, 99-121.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 1.5 * (1.0 - c_r), valid=(0.75, 1.0)).resolve
