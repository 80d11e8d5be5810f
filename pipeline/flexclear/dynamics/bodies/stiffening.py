r"""Second-order motion of a flexible body by which forces and accelerations stiffen or soften it.

A bent rod of constant length is shorter: to second order its points move by :math:`\tfrac12 q^T G q`, and its frames
turn by another quadratic form, with the body frame held at one frame. The kinetic energy includes this motion where it
multiplies rigid motion alone, the only place where it is of the order of the terms that linear shapes keep. The forces
that follow are the geometric stiffness of each load: an acceleration a of the frame gives
:math:`a\cdot\int\rho\,G`, a force f at a frame :math:`-f\cdot G`, a moment likewise. Rotation of the frame is in the
moments of every body (`bodies.flexible`).

Source: Kane, Ryan & Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151; Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel


@kernel
def _rows(numbers, o, n, vector, first):
    """Return a row of three forms (n, n), a table's values from row o on, times n entries of an array from `first`."""
    x = y = z = 0.0
    for i in range(n):
        factor = vector[first + i]
        x += numbers[o + i].value * factor
        y += numbers[o + n * n + i].value * factor
        z += numbers[o + 2 * n * n + i].value * factor
    return (x, y, z)


@kernel
def first_moment(d, k, j, vector, first):
    """Return row j of int rho G of body k, times an array from `first` on."""
    body = d.flexes[k]
    n = body.n_modes
    return _rows(d.flex_data, body.data0 + (14 + n + j) * n, n, vector, first)


@kernel
def at_port(d, p, j, vector, first):
    """Return row j of the second-order displacement and rotation of port p, times an array from `first` on."""
    port = d.ports[p]
    n = d.flexes[port.flex].n_modes
    forms = port.shapes + (6 + j) * n
    return _rows(d.port_data, forms, n, vector, first), _rows(d.port_data, forms + 3 * n * n, n, vector, first)
