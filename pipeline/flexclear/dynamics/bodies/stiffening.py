r"""Second-order motion of a flexible body by which forces and accelerations stiffen or soften it.

A bent rod of constant length is shorter: to second order its points move by :math:`\tfrac12 q^T G q`, and its frames
turn by another quadratic form, with the body frame held at one frame. The kinetic energy includes this motion where it
multiplies rigid motion alone, the only place where it is of the order of the terms that linear shapes keep. The forces
that follow are the geometric stiffness of each load: an acceleration a of the frame gives
:math:`a\cdot\int\rho\,G`, a force f at a frame :math:`-f\cdot G`, a moment likewise. Rotation of the frame is in the
moments of every body (`bodies.flexible`).

Rods resist bending in the axes of their twisted sections, and bending across bending twists them: the elastic energy
has this part beyond that of the modal stiffness (`structure.fe.beam_loads`).

Source: Kane, Ryan & Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151; Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.bodies.modal_terms import of_mode
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, at6, dot, scale, sub, turn_symmetric


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


@kernel
def _station(d, s):
    """Return rotation and curvature at a station, the curvature in axes of the section; sine, cosine of the twist."""
    body, b = d.flexes[d.stations[s].flex], d.stations[s].data
    n, turned, curved = body.n_modes, ZERO, ZERO
    for j in range(n):
        q = d.x[body.q0 + j]
        turned = add(turned, scale(q, of_mode(d.station_data, b, n, j)))
        curved = add(curved, scale(q, of_mode(d.station_data, b + 3 * n, n, j)))
    sine, cosine = np.sin(turned[0]), np.cos(turned[0])
    twist = curved[0] - 0.5 * (turned[1] * curved[2] - turned[2] * curved[1])
    bent = cosine * curved[1] + sine * curved[2], cosine * curved[2] - sine * curved[1]
    return turned, curved, (twist, bent[0], bent[1]), sine, cosine


@kernel
def couple(d):
    """Add the forces of the elastic energy beyond that of the modal stiffness to those on the modes."""
    for s in range(d.n_stations):
        body, b = d.flexes[d.stations[s].flex], d.stations[s].data
        stiffness = at6(d.station_stiffness[s].matrix, 0)
        turned, curved, strain, sine, cosine = _station(d, s)
        torque, m2, m3 = turn_symmetric(stiffness, strain)
        linear = turn_symmetric(stiffness, curved)
        on_rotation = (m2 * strain[2] - m3 * strain[1], -0.5 * torque * curved[2], 0.5 * torque * curved[1])
        on_bending = (
            cosine * m2 - sine * m3 + 0.5 * torque * turned[2],
            sine * m2 + cosine * m3 - 0.5 * torque * turned[1],
        )
        on_curvature = sub((torque, on_bending[0], on_bending[1]), linear)
        n = body.n_modes
        for j in range(n):
            force = dot(on_rotation, of_mode(d.station_data, b, n, j))
            force += dot(on_curvature, of_mode(d.station_data, b + 3 * n, n, j))
            # shapes are eigenmodes where loads stiffen a body
            d.modal_bias[body.c0 + j] += force
