r"""Elastic mounts: force and torque from six displacements s of a frame G in the axes of a frame F.

.. math:: s = (x, \theta), \quad R_{FG} = \exp\tilde\theta, \quad \omega = T\dot\theta, \quad
          T^{-1} = 1 - \tfrac12\tilde\theta + e\,\tilde\theta\tilde\theta

The force is -(K s + C ds/dt) along x, the torque T^-T times that along theta (`loads.bushing`).
Source: Bauchau (2011), Flexible Multibody Dynamics, sec. 13.3.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.loads.bushing import continued, rotation_vector, tangent_part
from flexclear.dynamics.mechanics.trees import Motion, Numbers
from flexclear.dynamics.mechanics.vectors import Vector, Wrench, cross
from flexclear.dynamics.routines.symbols import shared


def bushing(numbers: Numbers, before: Numbers, F: Motion, G: Motion) -> tuple[Wrench, Any, Any, Numbers, Any]:
    """Return the wrench on G, power of the unsymmetric stiffness, lost power [W], the rotation vector's rate, and the
    stored energy [J].

    numbers: K, C and (K^T - K)/2, row by row.  before: rotation vector that the present one continues, if any.
    """
    K, C, circulating = (numbers[k : k + 36] for k in (0, 36, 72))
    R_FW, r = F.R_WB.T, G.p_WB - F.p_WB
    slide = G.v - F.v - cross(F.omega, r)
    x, x_rate, spin = R_FW @ r, R_FW @ slide, R_FW @ (G.omega - F.omega)
    theta = shared(rotation_vector)(R_FW @ G.R_WB)
    theta = Vector(shared(continued)(theta, before) if before else theta)
    e = shared(tangent_part)(theta)

    def turned(v: Vector, half: float) -> Vector:
        """Return T^-1 v for half = -0.5, T^-T v for 0.5."""
        swung = cross(theta, v)
        return v + half * swung + e * cross(theta, swung)

    theta_rate = turned(spin, -0.5)
    s, s_rate = [*x, *theta], [*x_rate, *theta_rate]
    elastic, damped = _product(K, s), _product(C, s_rate)
    along = [-(one + other) for one, other in zip(elastic, damped, strict=True)]
    wrench = Wrench(F.R_WB @ turned(Vector(along[3:]), 0.5), F.R_WB @ Vector(along[:3]))
    power, rates = _dot(_product(circulating, s), s_rate), theta_rate if before else ()
    return wrench, power, _dot(damped, s_rate), rates, 0.5 * _dot(elastic, s)


def _product(A: Numbers, s: Numbers) -> list[Any]:
    """Return a 6x6 matrix times six numbers."""
    return [_dot(A[k : k + 6], s) for k in range(0, 36, 6)]


def _dot(a: Numbers, b: Numbers) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
