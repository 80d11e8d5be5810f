r"""The interface basis of a flexible body: where the equations have its modes, while the state has eigenmodes.

Most combinations of many modes move none of the frames by which a body is held and loaded. With an orthogonal T,
:math:`q = T\,p`, the coordinates p come in two kinds: first those of held shapes, which leave every such frame at rest,
then those of the few moving shapes. Modal masses are one, so that T leaves them so, and held shapes share no entry of
the mass matrix with each other nor with what the body carries: eliminated first, they cost as much as there are of
them. An orthogonal change of coordinates loses no digits, however heavy what is carried.

The state keeps eigenmodes, whose stiffness and damping are diagonal. Forces and momenta are taken to the interface
basis after they have been found, accelerations back from there.

Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319 (held shapes are fixed-interface modes).
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def _gather(h, f, w, k, first, source, out):
    """Entries of T^T times a vector, from the entry `first` of T on."""
    end = m.FLEXES.basis0(h, k) + m.FLEXES.n_basis(h, k)
    for e in range(first, end):
        w[out + m.BASIS.shape(h, e)] += f[m.BASIS_VALUES.row(h, e)] * w[source + m.BASIS.mode(h, e)]


@kernel
def in_interface(h, f, w, k, source, out):
    """T^T of body k: what w holds of each mode from `source` on, of each shape from `out` on."""
    for j in range(m.FLEXES.n_modes(h, k)):
        w[out + j] = 0.0
    _gather(h, f, w, k, m.FLEXES.basis0(h, k), source, out)


@kernel
def in_modes(h, f, w, k, source, out):
    """T of body k: what w holds of each shape from `source` on, of each mode from `out` on."""
    for i in range(m.FLEXES.n_modes(h, k)):
        w[out + i] = 0.0
    first = m.FLEXES.basis0(h, k)
    for e in range(first, first + m.FLEXES.n_basis(h, k)):
        w[out + m.BASIS.mode(h, e)] += f[m.BASIS_VALUES.row(h, e)] * w[source + m.BASIS.shape(h, e)]


@kernel
def deform(h, f, w):
    """Coordinates of the moving shapes and their rates, INTERFACE_X and INTERFACE_U, from X and U."""
    for k in range(h[m.N_FLEX]):
        c0, first = m.FLEXES.c0(h, k), m.FLEXES.moving0(h, k)
        for j in range(m.FLEXES.n_held(h, k), m.FLEXES.n_modes(h, k)):
            w[h[m.INTERFACE_X] + c0 + j] = w[h[m.INTERFACE_U] + c0 + j] = 0.0
        _gather(h, f, w, k, first, h[m.X] + m.FLEXES.q0(h, k), h[m.INTERFACE_X] + c0)
        _gather(h, f, w, k, first, h[m.U] + c0, h[m.INTERFACE_U] + c0)


@kernel
def to_interface(h, f, w, b):
    """What w holds of each coordinate from place b on, modes as eigenmodes: now in the interface basis."""
    for k in range(h[m.N_FLEX]):
        place = b + m.FLEXES.c0(h, k)
        in_interface(h, f, w, k, place, h[m.MODAL])
        for j in range(m.FLEXES.n_modes(h, k)):
            w[place + j] = w[h[m.MODAL] + j]


@kernel
def to_modes(h, f, w, b):
    """What w holds of each coordinate from place b on, modes in the interface basis: now as eigenmodes."""
    for k in range(h[m.N_FLEX]):
        place = b + m.FLEXES.c0(h, k)
        in_modes(h, f, w, k, place, h[m.MODAL])
        for j in range(m.FLEXES.n_modes(h, k)):
            w[place + j] = w[h[m.MODAL] + j]


@kernel
def modal_rates(h, f, w, dy):
    """Accelerations of the eigenmodes into the rates dy of the state, from DU."""
    for k in range(h[m.N_FLEX]):
        c0 = m.FLEXES.c0(h, k)
        in_modes(h, f, w, k, h[m.DU] + c0, dy + h[m.NQ] + c0)
