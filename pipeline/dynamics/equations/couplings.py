r"""Closures among which are couplings: a joint coordinate that follows another one, as gears and racks make it.

.. math:: q_2 = r\,q_1 + c

A coupling is one row whose wrench on the second joint is that of a unit force along q_2, and on the first one that of
-r along q_1. Its multiplier is the force along q_2. All else is as in `closures`.
"""

from __future__ import annotations

from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations import closures
from flexclear.pipeline.dynamics.gauge import bias, counted
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import accumulate, at, dot6, put, scale


@kernel
def wrench_row(h, c, part):
    """Where the wrench of coupling c on its second joint stands (part 0), and that on its first one (part 1)."""
    return m.ROWS.row(h, m.CLOSURES.row0(h, c) if part == 0 else h[m.N_CLOSURE_ROWS] + m.CLOSURES.coupling(h, c))


@kernel
def row(h, f, w, c):
    """Wrenches, residual, its rate, and acceleration bias of coupling c."""
    g, k = m.CLOSURES.coupling(h, c), m.CLOSURES.row0(h, c)
    numbers = m.COUPLING_NUMBERS.row(h, g)
    ratio, offset = f[numbers + m.COUPLING_NUMBERS.ratio], f[numbers + m.COUPLING_NUMBERS.offset]
    first, second = m.COUPLINGS.first(h, g), m.COUPLINGS.second(h, g)
    q1, u1, moment1, force1 = counted(h, w, first)
    q2, u2, moment2, force2 = counted(h, w, second)
    put(w, wrench_row(h, c, 0), moment2)
    put(w, wrench_row(h, c, 0) + 3, force2)
    put(w, wrench_row(h, c, 1), scale(-ratio, moment1))
    put(w, wrench_row(h, c, 1) + 3, scale(-ratio, force1))
    w[h[m.RESIDUAL] + k] = q2 - ratio * q1 - offset
    w[h[m.RESIDUAL_RATE] + k] = u2 - ratio * u1
    w[h[m.GAMMA] + k] = ratio * bias(h, w, first) - bias(h, w, second)


@kernel
def jacobian(h, w, c):
    """J^T of coupling c on its support, if it is solved for."""
    start = h[m.JACOBIAN] + m.CLOSURES.jacobian0(h, c)
    if m.CLOSURES.n_kept(h, c) == 0:
        return
    for k in range(start, start + 3 * m.CLOSURES.n_support(h, c)):
        w[k] = 0.0
    first = m.CLOSURES.entry0(h, c)
    for e in range(first, first + m.CLOSURES.n_entries(h, c)):
        col, o = m.COLUMNS.row(h, m.ENTRIES.column(h, e)), wrench_row(h, c, m.ENTRIES.part(h, e))
        w[start + 3 * m.ENTRIES.slot(h, e)] += m.ENTRIES.sign(h, e) * dot6(w, o, w, col)


@kernel
def locate(h, f, w):
    """Rows and Jacobians of all closures."""
    for c in range(h[m.N_CLOSURES]):
        if m.CLOSURES.coupling(h, c) < 0:
            closures.rows(h, w, c)
            closures.jacobian(h, w, c)
        else:
            row(h, f, w, c)
            jacobian(h, w, c)


@kernel
def known_forces(h, w):
    """See `closures.known_forces`."""
    for e in range(h[m.N_KNOWN_ENTRIES]):
        c = m.KNOWN_ENTRIES.closure(h, e)
        o = m.ROWS.row(h, m.CLOSURES.row0(h, c))
        if m.CLOSURES.coupling(h, c) >= 0:
            o = wrench_row(h, c, m.KNOWN_ENTRIES.part(h, e))
        closures.take_share(h, w, e, o)


@kernel
def take_off_first_joints(h, w):
    """Take what couplings do to their first joints off the links that they act on."""
    for c in range(h[m.N_CLOSURES]):
        g = m.CLOSURES.coupling(h, c)
        if g >= 0 and m.CLOSURES.n_kept(h, c) > 0:
            size, o = w[h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)], wrench_row(h, c, 1)
            first = m.COUPLINGS.first(h, g)
            a = m.WRENCH.row(h, m.SITES.link(h, m.GAUGES.a(h, first)))
            b = m.WRENCH.row(h, m.SITES.link(h, m.GAUGES.b(h, first)))
            for half in range(0, 6, 3):
                accumulate(w, b + half, scale(-size, at(w, o + half)))
                accumulate(w, a + half, scale(size, at(w, o + half)))


def make_coupled_closing(tree: Any) -> closures.Closing:
    """Return the kernels of all closures, couplings among them; see `closures.make_closing`."""
    return closures.make_closing(tree, locate, known_forces)
