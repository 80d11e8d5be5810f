r"""Closure constraints including couplings: one joint coordinate follows another, as with gears and racks.

.. math:: q_2 = r\,q_1 + c

A coupling is one row whose wrench on the second joint is that of a unit force along q_2, and on the first one that of
-r along q_1. Its multiplier is the force along q_2. All other terms are as in `closures`.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.equations import closures
from flexclear.dynamics.equations.closures import wrench_row
from flexclear.dynamics.gauge import bias, counted
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import dot_wrench, scale


@kernel
def row(d, c):
    """Store wrenches, residual, its rate, and acceleration bias of coupling c."""
    closure = d.closures[c]
    coupling, numbers, k = d.couplings[closure.coupling], d.coupling_numbers[closure.coupling], closure.row0
    ratio, (on_second, on_first) = numbers.ratio, (d.rows[wrench_row(d, c, 0)], d.rows[wrench_row(d, c, 1)])
    q1, u1, moment1, force1 = counted(d, coupling.first)
    q2, u2, moment2, force2 = counted(d, coupling.second)
    on_second.moment, on_second.force = moment2, force2
    on_first.moment, on_first.force = scale(-ratio, moment1), scale(-ratio, force1)
    d.residual[k] = q2 - ratio * q1 - numbers.offset
    d.residual_rate[k] = u2 - ratio * u1
    d.gamma[k] = ratio * bias(d, coupling.first) - bias(d, coupling.second)


@kernel
def jacobian(d, c):
    """Store J^T of coupling c on its support, if the coupling is solved for."""
    closure = d.closures[c]
    start = closure.jacobian0
    if closure.n_kept == 0:
        return
    for k in range(start, start + 3 * closure.n_support):
        d.jacobian[k] = 0.0
    for e in range(closure.entry0, closure.entry0 + closure.n_entries):
        entry = d.entries[e]
        wrench = d.rows[wrench_row(d, c, entry.part)]
        d.jacobian[start + 3 * entry.slot] += entry.sign * dot_wrench(wrench, d.columns[entry.column])


@kernel
def locate(d):
    """Store rows and Jacobians of all closures."""
    for c in range(d.n_closures):
        if d.closures[c].coupling < 0:
            closures.rows(d, c)
            closures.jacobian(d, c)
        else:
            row(d, c)
            jacobian(d, c)


def make_coupled_closing(tree: Any) -> closures.Closing:
    """Build the kernels of all closures including couplings; see `closures.make_closing`."""
    return closures.make_closing(tree, locate)
