r"""Shortening of a beam by bending: the quadratic motion along x that stiffens a rotating or pulled beam.

To second order a section of an inextensible axis moves along x of the body frame by

.. math:: \tfrac12 q^T B(x)\, q, \qquad B(x) = -\int_{x_0}^{x} (v'^T v' + w'^T w')\, ds

with the body frame held at x0. The kinetic energy includes it where it multiplies rigid motion alone, the only place
where it is of the order of the terms that linear shapes keep. The forces that follow are the geometric stiffness: an
axial acceleration a gives :math:`a\int\rho B`, a turn :math:`-(\omega_y^2+\omega_z^2)\int\rho x B`, and a force N
along x at a frame :math:`-N B`. They come from a Lagrangian, so power and energy agree to rounding.

Source: Kane, Ryan & Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151; Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel


@kernel
def _form(numbers, o, n, vector, first):
    """Return a row of a form, the n values of a table from row o on, times n entries of an array from `first` on."""
    total = 0.0
    for i in range(n):
        total += numbers[o + i].value * vector[first + i]
    return total


@kernel
def first_moment(d, k, j, vector, first):
    """Return row j of int rho B of body k, times an array from `first` on."""
    body = d.flexes[k]
    n = body.n_modes
    return _form(d.flex_data, body.data0 + (14 + n + j) * n, n, vector, first)


@kernel
def second_moment(d, k, j, vector, first):
    """Return row j of int rho x B of body k, times an array from `first` on."""
    body = d.flexes[k]
    n = body.n_modes
    return _form(d.flex_data, body.data0 + (14 + 2 * n + j) * n, n, vector, first)


@kernel
def at_port(d, p, j, vector, first):
    """Return row j of B at port p, times an array from `first` on."""
    port = d.ports[p]
    n = d.flexes[port.flex].n_modes
    return _form(d.port_data, port.shapes + (6 + j) * n, n, vector, first)
