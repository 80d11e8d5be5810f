r"""Hertzian contact whose damping is a rational fit of the exact restitution.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{3(1-c_r)(11-c_r)}{2(1+9c_r)}

Valid for nearly the whole range: for 0.9, 0.7 and 0.5 it delivers that to three digits, for 0.1 0.129, and at least
0.060. From 0.03 up, the deviation is below 0.05.
Source: Carvalho & Martins (2019), Mech. Mach. Theory 139, 185-194.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 1.5 * (1.0 - c_r) * (11.0 - c_r) / (1.0 + 9.0 * c_r), valid=(0.03, 1.0)).resolve
