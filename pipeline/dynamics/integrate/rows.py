"""Rows of the record: what holds within a step is recorded with it, also where the step's end changes a mode."""

from __future__ import annotations

from pipeline.dynamics.integrate.state import LATCHED0, MODE0, N_RECORDED, WATCH_SIZE
from pipeline.dynamics.tables import LATCHED, MODE, N_CONTACTS, NY, WATCH
from pipeline.dynamics.vectors import kernel


@kernel
def hold_modes(h, w, n):
    """Keep the modes and impact rates that hold within the step, which its end may change."""
    for c in range(h[N_CONTACTS]):
        o = h[WATCH] + WATCH_SIZE * c
        w[o + MODE0], w[o + LATCHED0] = n[n[MODE] + c], w[h[LATCHED] + c]


@kernel
def snapshot(h, w, n, rows, t, y):
    """Append a row to the record: time, modes and impact rates of the contacts as held, state."""
    row, contacts = rows[n[N_RECORDED]], h[N_CONTACTS]
    row[0] = t
    for c in range(contacts):
        o = h[WATCH] + WATCH_SIZE * c
        row[1 + c] = w[o + MODE0]
        row[1 + contacts + c] = w[o + LATCHED0]
    for k in range(h[NY]):
        row[1 + 2 * contacts + k] = w[y + k]
    n[N_RECORDED] += 1
