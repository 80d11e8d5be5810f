"""The record of a run: rows of its motion at output times and events, and rows of its events.

A row of the motion holds the time, the contacts' modes and impact rates, and the state; modes are those within the
step, also where its end changes one.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel

#: recorded states are projected to this share of rtol times the mechanism's size; to more of a loose rtol, up to the
#: second share, as it grows by so many times rtol: what a run left open itself need not cost an evaluation in every row
RECORD_SHARE, MOST_SHARE, LOOSER = 1e-3, 0.1, 1e3


def record_share(rtol: float) -> float:
    """Share of rtol times the mechanism's size to which the loops of recorded states are closed."""
    return min(MOST_SHARE, max(RECORD_SHARE, LOOSER * rtol))


share_of_records = kernel(record_share)


@kernel
def holds_outputs(n, outputs, t):
    """Whether there are several output times up to t that have not been recorded."""
    return n[m.NEXT_OUTPUT] + 1 < outputs.shape[0] and outputs[n[m.NEXT_OUTPUT] + 1] <= t


@kernel
def hold_modes(h, w, n):
    """Keep the modes and impact rates that hold within the step, which its end may change."""
    for c in range(h[m.N_CONTACTS]):
        o = m.WATCH.row(h, c)
        w[o + m.WATCH.mode0], w[o + m.WATCH.latched0] = n[n[m.MODE] + c], w[h[m.LATCHED] + c]


@kernel
def snapshot(h, w, n, rows, t, y):
    """Append a row of the motion: time, modes and impact rates of the contacts as held, state."""
    row, (mode, latched, state) = rows[n[m.N_RECORDED]], m.record_columns(h[m.N_CONTACTS])
    row[0] = t
    for c in range(h[m.N_CONTACTS]):
        o = m.WATCH.row(h, c)
        row[mode + c] = w[o + m.WATCH.mode0]
        row[latched + c] = w[o + m.WATCH.latched0]
    for k in range(h[m.NY]):
        row[state + k] = w[y + k]
    n[m.N_RECORDED] += 1


@kernel
def add_event(events, n, c, kind, t):
    """Append a row to the events, of contact c; its number."""
    row = n[m.N_EVENTS]
    event = events[row]
    event[m.EVENT.time], event[m.EVENT.contact], event[m.EVENT.kind] = t, c, kind
    n[m.N_EVENTS] = row + 1
    return row


def make_record_outputs(extend: Callable, interpolate: Callable) -> Callable:
    """The kernel record_outputs(h, f, w, n, step, ready, outputs, rows, t_end)."""

    @kernel
    def record_outputs(h, f, w, n, step, ready, outputs, rows, t_end):
        """Snapshots at the output times up to t_end, from the dense output, which may be ready."""
        t = w[h[m.CONTROL] + m.TIME]
        while n[m.NEXT_OUTPUT] < outputs.shape[0] and outputs[n[m.NEXT_OUTPUT]] <= t_end:
            t_output = outputs[n[m.NEXT_OUTPUT]]
            if t_output > t:
                if not ready:
                    extend(h, f, w, n, step)
                    ready = True
                interpolate(h, w, (t_output - t) / step, h[m.Y_STAGE])
                snapshot(h, w, n, rows, t_output, h[m.Y_STAGE])
            n[m.NEXT_OUTPUT] += 1

    return record_outputs
