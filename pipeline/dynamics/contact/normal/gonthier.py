r"""Hertzian contact whose damping is the closed form of the restitution, approximated.

.. math:: F_N = K\,\delta^n\left[1 + a\,\dot\delta/\dot\delta^{(-)}\right], \quad a = \frac{1-c_r^2}{c_r}

For the whole range except 0: asked for 0.5 it delivers 0.488, for 0.9 0.876; at most 0.033 off (at 0.77).
The equation that it approximates is what `delivered_restitution` solves exactly.
Source: Gonthier, McPhee, Lange & Piedboeuf (2004), Multibody System Dynamics 11, 209-233.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.contact.law import Hysteresis

LAW = Hysteresis("gonthier", lambda c_r: (1.0 - c_r**2) / c_r, valid=(0.0, 1.0))
