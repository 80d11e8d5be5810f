r"""Hertzian contact with a damping fitted to the energy lost in one impact.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{6(1-c_r)}{(2c_r-1)^2+3}

For 0.8 it delivers 0.807, for 0.5 0.594, and at least 0.487. From 0.61 up, the deviation is below 0.05.
Source: Herbert & McWhannell (1977), J. Engineering for Industry 99, 792-798; Machado et al.
(2012), Mech. Mach. Theory 53, 99-121.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 6.0 * (1.0 - c_r) / ((2.0 * c_r - 1.0) ** 2 + 3.0), valid=(0.61, 1.0)).resolve
