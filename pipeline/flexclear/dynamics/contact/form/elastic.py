r"""Normal force without loss: :math:`F_N = K\,\delta^n`."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.kernels import kernel


@kernel
def power(depth, exponent):
    """Return depth^exponent for depth >= 0, fast for the Hertzian 3/2 and the linear 1."""
    if exponent == 1.5:
        return depth * np.sqrt(depth)
    return depth if exponent == 1.0 else depth**exponent


@kernel
def force(depth, rate, impact_rate, law):
    """Return the elastic force [N] >= 0, and zero damping; depth [m] >= 0, rates [m/s]."""
    return law.stiffness * power(depth, law.exponent), 0.0


@kernel
def stored(depth, law):
    """Return the energy [J] that the elastic part of the force stores."""
    return law.stiffness * depth * power(depth, law.exponent) / (law.exponent + 1.0)
