"""The record of a run: rows of its motion at output times and events, and rows of its events.

A row of the motion contains the time, the contacts' modes and impact rates, and the state; modes are those within the
step, also when its end changes one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel

#: recorded states are projected to this fraction of rtol times the mechanism's size; it grows by so many times rtol, up
#: to the second fraction: a residual that the run itself left needs no evaluation in every row
RECORD_SHARE, MOST_SHARE, LOOSER_FACTOR = 1e-3, 0.1, 1e3


class Record(NamedTuple):
    """Columns of the record, all views.

    time: [s], shape (rows,).  modes, latched: 1 of closed contacts and 0 of open ones, and their impact rates [m/s];
    shape (rows, contacts).  state: shape (rows, NY).
    """

    time: np.ndarray
    modes: np.ndarray
    latched: np.ndarray
    state: np.ndarray


def record(rows: np.ndarray, contacts: int) -> Record:
    """Return the columns of rows of the record, shape (rows, columns), by name."""
    mode, latched, state = m.columns_of_record(contacts)
    return Record(rows[:, 0], rows[:, mode:latched], rows[:, latched:state], rows[:, state:])


def empty_record(rows: int, contacts: int, ny: int) -> np.ndarray:
    """Return rows of the record, all zero, shape (rows, columns)."""
    return np.zeros((rows, m.columns_of_record(contacts)[-1] + ny))


def record_share(rtol: float) -> float:
    """Return the fraction of rtol times the mechanism's size to which the loops of recorded states are closed."""
    return min(MOST_SHARE, max(RECORD_SHARE, LOOSER_FACTOR * rtol))


share_of_records = kernel(record_share)


@kernel
def hold_modes(d):
    """Store the modes and impact rates of the step before an event at its end changes them."""
    for c in range(d.n_contacts):
        watch = d.watch[c]
        watch.mode0, watch.latched0 = d.mode[c], d.latched[c]


@kernel
def snapshot(d, rows, t, y):
    """Append a row of the motion: time, modes and impact rates of the contacts as stored, state."""
    row, (mode, latched, state) = rows[d.n_recorded], m.record_columns(d.n_contacts)
    row[0] = t
    for c in range(d.n_contacts):
        watch = d.watch[c]
        row[mode + c] = watch.mode0
        row[latched + c] = watch.latched0
    for k in range(d.ny):
        row[state + k] = d.w[y + k]
    d.n_recorded += 1


@kernel
def add_event(d, events, c, kind, t):
    """Append an event of contact c; return its number."""
    row = d.n_events
    event = events[row]
    event[m.EVENT.time], event[m.EVENT.contact], event[m.EVENT.kind] = t, c, kind
    d.n_events = row + 1
    return row


def make_record_outputs(extend: Callable, interpolate: Callable) -> Callable:
    """Build the kernel record_outputs(d, step, ready, outputs, rows, t_end)."""

    @kernel
    def record_outputs(d, step, ready, outputs, rows, t_end):
        """Append rows at the output times up to t_end, from the dense output; ready: whether it is prepared."""
        t = d.time
        while d.next_output < outputs.shape[0] and outputs[d.next_output] <= t_end:
            t_output = outputs[d.next_output]
            if t_output > t:
                if not ready:
                    extend(d, step)
                    ready = True
                interpolate(d, (t_output - t) / step, d.at_y_stage)
                snapshot(d, rows, t_output, d.at_y_stage)
            d.next_output += 1

    return record_outputs
