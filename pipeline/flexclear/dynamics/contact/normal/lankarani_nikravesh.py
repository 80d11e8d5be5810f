r"""Hertzian contact whose damping follows from the coefficient of restitution.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \tfrac34(1-c_r^2)

Meant for c_r near 1: for 0.9 it delivers 0.913, for 0.5 0.725, and at least 0.663. From 0.8 up, the deviation
is below 0.05.
Source: Wang & Wang (2019), eq. (25), after Lankarani & Nikravesh (1990), J. Mechanical Design 112, 369-376.
"""

from __future__ import annotations

from flexclear.dynamics.contact.law import Hysteresis

resolve = Hysteresis(lambda c_r: 0.75 * (1.0 - c_r**2), valid=(0.8, 1.0)).resolve
