r"""Bending shortens a beam: the quadratic motion along x that stiffens it when it turns or is pulled.

To second order a section of an inextensible axis moves along x of the body frame by

.. math:: \tfrac12 q^T B(x)\, q, \qquad B(x) = -\int_{x_0}^{x} (v'^T v' + w'^T w')\, ds

with the body frame held at x0. In the kinetic energy it is kept where it multiplies rigid motion alone, the only place
where it is of the order of the terms that linear shapes keep. The forces that follow are the geometric stiffness: an
axial acceleration a gives :math:`a\int\rho B`, a turn :math:`-(\omega_y^2+\omega_z^2)\int\rho x B`, and a force N
along x at a frame :math:`-N B`. They come from a Lagrangian, so power and energy agree to rounding.

Source: Kane, Ryan & Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151; Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def _form(f, w, o, n, vector):
    """A row of a form, from place o, times a vector in w."""
    total = 0.0
    for i in range(n):
        total += f[o + i] * w[vector + i]
    return total


@kernel
def first_moment(h, f, w, k, j, vector):
    """Row j of int rho B of body k, times a vector in w."""
    n = m.FLEXES.n_modes(h, k)
    return _form(f, w, h[m.FLEX_DATA.place] + m.FLEXES.data0(h, k) + (14 + n + j) * n, n, vector)


@kernel
def second_moment(h, f, w, k, j, vector):
    """Row j of int rho x B of body k, times a vector in w."""
    n = m.FLEXES.n_modes(h, k)
    return _form(f, w, h[m.FLEX_DATA.place] + m.FLEXES.data0(h, k) + (14 + 2 * n + j) * n, n, vector)


@kernel
def at_port(h, f, w, p, j, vector):
    """Row j of B at port p, times a vector in w."""
    n = m.FLEXES.n_modes(h, m.PORTS.flex(h, p))
    return _form(f, w, h[m.PORT_DATA.place] + m.PORTS.shapes(h, p) + (6 + j) * n, n, vector)
