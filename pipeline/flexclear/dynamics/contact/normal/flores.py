r"""Hertzian contact with a damping for soft and hard materials.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{8(1-c_r)}{5c_r}

Valid for the whole range except 0: for 0.5 it delivers 0.470, for 0.9 0.894; largest deviation 0.046 (at 0.24).
Source: Flores, Machado, Silva & Martins (2011), Multibody System Dynamics 25, 357-375.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 1.6 * (1.0 - c_r) / c_r, valid=(0.0, 1.0)).resolve
