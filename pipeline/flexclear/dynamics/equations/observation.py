"""Outputs of a state: true accelerations, joint forces, contacts, energies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.projection import BLIND, keep_scales, largest, open_by
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel

BEARING = m.NAMED["bearing"]
#: variables of a run's dataset with their dimensions, and coordinates
Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]
Series = tuple[Variables, dict[str, object]]
#: tolerance with which the loops of rows are not closed, and only frames of links are stored
AS_RECORDED = -1.0
#: one of so many rows is closed first; its change predicts those of the rows between, if the rows' distances in time
#: differ by at most this fraction
STRIDE, EVEN = 4, 1e-6


@dataclass(frozen=True)
class Observed:
    """Outputs at rows of the record; all over the rows, in world axes, from the mechanism's origin.

    state: with its loops closed, (rows, NY).  positions, speeds, accelerations: of all coordinates, free ones first.
    links, sites: their frames (LINK_FRAMES), of which accelerations are true ones less gravity; (rows, links or sites).
    link_wrenches: on each link through its inboard joint; closure_wrenches: on the closures' second bodies; moment
    about the mechanism's origin (WRENCH).  touch, loads, bearings: of contacts, loads and bearings with
    friction (TOUCH, LOAD, BEARING).
    drive_force: along the drives' coordinates in the tree [N or N m].  energy: ENERGY, (rows, independent
    mechanisms).
    jacobian: of the selected closure rows, as routines store it.
    residual: largest residual of a closure, shape (rows,).  status: of the evaluation, shape (rows,).
    """

    state: np.ndarray
    positions: np.ndarray
    speeds: np.ndarray
    accelerations: np.ndarray
    links: np.ndarray
    sites: np.ndarray
    link_wrenches: np.ndarray
    closure_wrenches: np.ndarray
    touch: np.ndarray
    loads: np.ndarray
    bearings: np.ndarray
    drive_force: np.ndarray
    energy: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    status: np.ndarray


def _columns(size: Callable[[int], int]) -> dict[str, tuple[Any, int]]:
    """Return the outputs of `observe` in order, with their kind and number per row.

    Kinds: rows of a table, vectors of so many numbers, or floats (None).
    """
    drives = size(m.N_DRIVES)
    return {
        "residual": (None, 1),
        "status": (None, 1),
        **_links(size),
        "sites": (m.SITE_FRAMES, size(m.N_SITES)),
        "state": (None, size(m.NY)),
        "positions": (None, size(m.NQ) + drives),
        "speeds": (None, size(m.NV) + drives),
        "free_accelerations": (None, size(m.NV)),
        "driven_accelerations": (None, drives),
        "link_wrenches": (m.WRENCH, size(m.N_LINKS)),
        "touch": (m.TOUCH, size(m.N_CONTACTS)),
        "loads": (m.LOAD, size(m.N_LOADS)),
        "bearings": (BEARING, size(m.SIZES["n_bearings"])),
        "drive_force": (None, drives),
        "closure_wrenches": (m.CLOSURE_WRENCH, size(m.N_CLOSURES)),
        "energy": (m.ENERGY, size(m.N_COMPONENTS)),
        "jacobian": (None, size(m.JACOBIAN_SIZE)),
    }


def _links(size: Callable[[int], int]) -> dict[str, tuple[Any, int]]:
    return {"links": (m.LINK_FRAMES, size(m.N_LINKS))}


#: outputs that `observe` has stored, each over the rows: (rows, numbers)
Blocks = dict[str, np.ndarray]


def room(rows: int, size: Callable[[int], int], *, frames: bool = False) -> tuple[np.ndarray, Blocks]:
    """Allocate zeros for `observe`, contiguous, and return them with their parts; size: returns a number of the header.

    Each quantity of all rows is contiguous, as datasets have it.  frames: whether only those of links are stored.
    """
    columns = _links(size) if frames else _columns(size)
    widths = [_numbers(kind) * count for kind, count in columns.values()]
    ends = rows * np.cumsum(widths)
    whole = np.zeros(int(ends[-1]))
    parts = np.split(whole, ends[:-1])
    return whole, {name: part.reshape(rows, w) for name, part, w in zip(columns, parts, widths, strict=True)}


def _numbers(kind: Any) -> int:
    return 1 if kind is None else getattr(kind, "size", kind)


def by_name(blocks: Blocks, size: Callable[[int], int]) -> Observed:
    """Return views of the outputs that `observe` has stored."""
    fields = {name: _named_rows(kind, count, blocks[name]) for name, (kind, count) in _columns(size).items()}
    accelerations = np.concatenate([fields.pop("free_accelerations"), fields.pop("driven_accelerations")], axis=1)
    single = {name: fields[name][:, 0] for name in ("residual", "status")}
    return Observed(**fields | single, accelerations=accelerations)


def _named_rows(kind: Any, count: int, block: np.ndarray) -> np.ndarray:
    if isinstance(kind, int):
        return block.reshape(len(block), count, kind)
    return block if kind is None else m.named(kind, block)


@kernel
def columns_before_state(d):
    """Return the number of columns of computed outputs, and of the frames of links and sites."""
    return 2 + m.FRAME.size * (d.n_links + d.n_sites)


@kernel
def place_of(k, count):
    """Return the k-th row in the order of processing: every fourth of `count` rows precedes the others."""
    first = (count + STRIDE - 1) // STRIDE
    return STRIDE * k if k < first else (k - first) + (k - first) // (STRIDE - 1) + 1


@kernel
def even(rows, first, last):
    """Return True when the rows from the first to the last have equal distances in time."""
    step = (rows[last, 0] - rows[first, 0]) / (last - first)
    most = 0.0
    for r in range(first, last):
        most = max(most, abs(rows[r + 1, 0] - rows[r, 0] - step))
    return most < EVEN * step


@kernel
def foresee(d, rows, r, state, closed, states):
    """Add the predicted change by closing the loops to the recorded state in Y; return True when there is one.

    The residual of the loops varies within a step as smoothly as the motion: the prediction is the cubic through the
    changes of two closed rows before and two after.  states: index of their states, row after row, in closed.
    """
    before, most = r - r % STRIDE, 0.0
    s = (r - before) / STRIDE
    outer, inner = -s * (1.0 - s) / 6.0, (1.0 + s) * (2.0 - s) / 2.0
    for k in range(d.nq + d.nv):
        change = 0.0
        for j in range(-1, 3):
            row = before + STRIDE * j
            # of Lagrange's interpolation between -1, 0, 1 and 2
            weight = inner * (1.0 - s if j == 0 else s) if 0 <= j <= 1 else outer * (2.0 - s if j < 0 else 1.0 + s)
            change += weight * (closed[states + d.ny * row + k] - rows[row, state + k])
        d.y[k] += change
        most = max(most, abs(change))
    return most > 0.0


def make_observation(evaluate: Callable, project: Callable) -> Callable:
    """Build the kernel observe(h, f, w, n, rows, pieces, tolerance, out), which fills the blocks of `room`.

    With a tolerance of AS_RECORDED only the frames of links are stored.

    evaluate: the right-hand side, which stores what the record has (`mechanics.record`).  project: as the stepper
    calls it.
    """

    @kernel
    def copy(d, out, every, r, column, frames):
        """Copy the sections of w that are outputs themselves, each to its row in its block.

        column: number of columns before them.  frames: whether only those of links.
        """
        known = d.n_drives
        stretches = (
            (d.at_link_frames, m.FRAME.size * d.n_links),
            (d.at_site_frames, m.FRAME.size * d.n_sites),
            (d.at_y, d.ny),
            (d.at_x, d.nq + known),
            (d.at_u, d.nv + known),
            (d.at_slopes + d.nq, d.nv),
            (d.at_du + d.nv, known),
            (d.at_wrench, m.WRENCH.size * d.n_links),
            (d.at_touch, m.TOUCH.size * d.n_contacts),
            (d.at_load, m.LOAD.size * d.n_loads),
            (d.at_bearing, BEARING.size * d.n_bearings),
            (d.at_drive_force, known),
            (d.at_closure_wrench, m.CLOSURE_WRENCH.size * d.n_closures),
            (d.at_energy, m.ENERGY.size * d.n_components),
            (d.at_jacobian, d.jacobian_size),
        )
        for s in range(1 if frames else len(stretches)):  # one loop: several would each be compiled
            first, count = stretches[s]
            o = every * column + count * r
            for k in range(count):
                out[o + k] = d.w[first + k]
            column += count

    @kernel
    def store(d, out, every, r):
        """Store the computed outputs of an evaluated row; return their number of columns."""
        out[r] = largest(d.residual, d.n_closure_rows)
        out[every + r] = d.evaluation
        return 2

    @kernel
    def select(d, row, pieces):
        """Set state, contacts' modes and pieces of the laws of a row of the record."""
        mode, latched, state = m.record_columns(d.n_contacts)
        for c in range(d.n_contacts):
            d.mode[c] = int(row[mode + c])
            d.latched[c] = row[latched + c]
        for k in range(d.n_laws):
            d.active[k] = pieces[k]
        for k in range(d.ny):
            d.y[k] = row[state + k]
        return state

    @kernel
    def close(d, t, tolerance):
        """Close the loops of the state in Y, which has been evaluated, to `tolerance`, and evaluate it again."""
        moved = project(d.h, d.f, d.w, d.n, t, d.at_y, d.at_slopes, tolerance) if d.evaluation == m.OK else 0
        if moved > 0:
            evaluate(d.h, d.f, d.w, d.n, t, d.at_y, d.at_slopes)
        if moved < 0:
            d.evaluation = m.NOT_CLOSED
        if d.evaluation == m.OK and d.n_kept_rows > 0 and d.last_pivot < BLIND:
            d.evaluation = m.SINGULAR  # multipliers so near to a singular pose are mostly rounding
        if d.evaluation == m.OK:
            keep_scales(d)

    @kernel
    def observe(h, f, w, n, rows, pieces, tolerance, out):
        d = data(h, f, w, n)
        every, uneven, states = rows.shape[0], -1, rows.shape[0] * columns_before_state(d)
        for turn in range(every):
            r = place_of(turn, every)
            first, last = r - r % STRIDE - STRIDE, r - r % STRIDE + 2 * STRIDE
            foreseen = tolerance != AS_RECORDED and r % STRIDE > 0 and first >= 0 and last < every and first != uneven
            foreseen = foreseen and even(rows, first, last)
            while True:
                state = select(d, rows[r], pieces[r])
                foreseen = foreseen and foresee(d, rows, r, state, out, states)
                evaluate(h, f, w, n, rows[r, 0], d.at_y, d.at_slopes)
                if tolerance == AS_RECORDED:
                    break
                if not foreseen or (d.evaluation == m.OK and open_by(d) <= tolerance):
                    close(d, rows[r, 0], tolerance)
                    break
                uneven, foreseen = first, False  # as where a step ends
            if tolerance == AS_RECORDED:
                copy(d, out, every, r, 0, True)
            else:
                copy(d, out, every, r, store(d, out, every, r), False)

    return observe
