r"""Lankarani and Nikravesh's contact with a damping corrected for small restitution.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \tfrac34(1-c_r^2)e^{2(1-c_r)}

For 0.9 it delivers 0.896, for 0.5 0.483, for 0.2 0.266, and at least 0.178; the deviation is below 0.05
from 0.24 up.
Source: Zhiying & Qishao (2006), after Lankarani & Nikravesh (1990); Machado et al. (2012), Mech. Mach. Theory
53, 99-121.
"""

from __future__ import annotations

from math import exp

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 0.75 * (1.0 - c_r**2) * exp(2.0 * (1.0 - c_r)), valid=(0.24, 1.0)).resolve
