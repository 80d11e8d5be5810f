"""Rows of the record: what holds within a step is recorded with it, also where the step's end changes a mode."""

from __future__ import annotations

from pipeline.dynamics import memory as m
from pipeline.dynamics.kernels import kernel


@kernel
def hold_modes(h, w, n):
    """Keep the modes and impact rates that hold within the step, which its end may change."""
    for c in range(h[m.N_CONTACTS]):
        o = m.WATCH.row(h, c)
        w[o + m.WATCH.mode0], w[o + m.WATCH.latched0] = n[n[m.MODE] + c], w[h[m.LATCHED] + c]


@kernel
def snapshot(h, w, n, rows, t, y):
    """Append a row to the record: time, modes and impact rates of the contacts as held, state."""
    row, contacts = rows[n[m.N_RECORDED]], h[m.N_CONTACTS]
    row[0] = t
    for c in range(contacts):
        o = m.WATCH.row(h, c)
        row[1 + c] = w[o + m.WATCH.mode0]
        row[1 + contacts + c] = w[o + m.WATCH.latched0]
    for k in range(h[m.NY]):
        row[1 + 2 * contacts + k] = w[y + k]
    n[m.N_RECORDED] += 1
