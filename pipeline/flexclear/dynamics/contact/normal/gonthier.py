r"""Hertzian contact whose damping approximates the closed form of the restitution.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{1-c_r^2}{c_r}

Valid for the whole range except 0: for 0.5 it delivers 0.488, for 0.9 0.876; largest deviation 0.033 (at 0.77).
`delivered_restitution` solves the approximated equation exactly.
Source: Gonthier, McPhee, Lange & Piedboeuf (2004), Multibody System Dynamics 11, 209-233.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: (1.0 - c_r**2) / c_r, valid=(0.0, 1.0)).resolve
