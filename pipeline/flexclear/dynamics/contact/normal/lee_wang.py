r"""Hertzian contact with half the damping of Hunt and Crossley.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \tfrac34(1-c_r)

It loses about half of the requested energy: for 0.9 it delivers 0.952, for 0.5 0.799, and at least 0.663.
From 0.91 up, the deviation is below 0.05.
Source: Lee & Wang (1983), Vehicle System Dynamics 12, 149-172; form with c_r: Machado
et al. (2012), Mech. Mach. Theory 53, 99-121.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 0.75 * (1.0 - c_r), valid=(0.91, 1.0)).resolve
