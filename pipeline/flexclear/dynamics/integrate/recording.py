"""The record of a run: rows of its motion at output times and events, and rows of its events.

A row of the motion contains the time, the contacts' modes and impact rates, and the state; modes are those within the
step, also when its end changes one.

Outputs may meet a motion where it is always the same, as a vibration once per period. So rows between them are stored
as well, at the end of the array: wherever a part of the state is so much further from the start than in any earlier row
that energies and speeds may be larger. Of these, the last few count, and users do not receive them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel

#: largest number of rows between outputs, for which the array has room at its end: the last ones are those that count
BETWEEN = 128
#: steps over many vibrations are examined inside, too: the first ones, then one of so many, at fractions that the
#: golden ratio spreads evenly
FIRST_STEPS, SOME_STEPS, GOLDEN = 32, 8, 0.6180339887498949


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
    # recorded states are projected to this fraction of rtol times the mechanism's size; it grows by so many times rtol,
    # up to the second fraction: a residual that the run itself left needs no evaluation in every row
    return min(0.1, max(1e-3, 1e3 * rtol))


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
    put_row(d, rows[d.n_recorded], t, y)
    d.n_recorded += 1


@kernel
def put_row(d, row, t, y):
    """Store time, modes and impact rates of the contacts as stored, and state, in a row of the motion."""
    mode, latched, state = m.record_columns(d.n_contacts)
    row[0] = t
    for c in range(d.n_contacts):
        watch = d.watch[c]
        row[mode + c] = watch.mode0
        row[latched + c] = watch.latched0
    for k in range(d.ny):
        row[state + k] = d.w[y + k]


@kernel
def keep_largest(d, rows, t, y):
    """Store a row at the end of the array if an error group is further from the start than in any row before."""
    first, (_, _, state), further = rows[0], m.record_columns(d.n_contacts), False
    for g in range(d.n_groups):
        d.excursion[g].now = (d.rtol * d.floors[g].magnitude) ** 2  # less than what a run resolves is no motion
    for k in range(d.ny):
        d.excursion[d.groups[k].group].now += (d.w[y + k] - first[state + k]) ** 2
    for g in range(d.n_groups):
        group = d.excursion[g]
        # growth of the square of an error group's distance from the start after which a row is stored
        if group.now > 2.0 * group.largest:
            group.largest, further = group.now, True
    if further:
        put_row(d, rows[rows.shape[0] - 1 - d.n_between % BETWEEN], t, y)
        d.n_between += 1


@kernel
def add_event(d, events, c, kind, t):
    """Append an event of contact c; return its number."""
    row = d.n_events
    event = events[row]
    event[m.EVENT.time], event[m.EVENT.contact], event[m.EVENT.kind] = t, c, kind
    d.n_events = row + 1
    return row


def make_record_outputs(extend: Callable, interpolate: Callable, long: bool) -> Callable:
    """Build the kernel record_outputs(d, step, ready, outputs, rows, t_end); long: steps span many vibrations."""

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
        if long and (d.steps <= FIRST_STEPS or d.steps % SOME_STEPS == 0):
            if not ready:
                extend(d, step)
            inside = (GOLDEN * d.steps) % 1.0
            interpolate(d, inside, d.at_y_stage)
            keep_largest(d, rows, t + inside * step, d.at_y_stage)

    return record_outputs
