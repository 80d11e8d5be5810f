r"""Hertzian contact with a damping from the energy that is lost between compression and restitution.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{5(1-c_r)}{4c_r}

Source: Safaeifar & Farshidianfar (2020), Multibody System Dynamics 50, 233-257.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 1.25 * (1.0 - c_r) / c_r, valid=(0.6, 1.0)).resolve
