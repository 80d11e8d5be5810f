r"""Hertzian contact with a damping from the energy lost, of compression and restitution separately.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{3(1-c_r)}{2c_r}

Valid for the whole range except 0: for 0.5 it delivers 0.488, for 0.9 0.900; largest deviation 0.035 (at 0.2).
Source: Hu & Guo (2015), Nonlinear Dynamics 82, 1617-1634.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 1.5 * (1.0 - c_r) / c_r, valid=(0.0, 1.0)).resolve
