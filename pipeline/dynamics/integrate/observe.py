"""What is recorded of a state: true accelerations, joint forces, contacts, energies."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.assembly.places import JACOBIAN, JACOBIAN_SIZE, LAST_PIVOT, N_KEPT_ROWS, PIVOT
from pipeline.dynamics.integrate.project import BLIND, largest
from pipeline.dynamics.integrate.scales import keep_scales
from pipeline.dynamics.tables import (
    ACTIVE,
    BENT,
    DRIVE_FORCE,
    DU,
    EVALUATION,
    FLEX,
    FRAME_SIZE,
    GRAVITY,
    INERTIA_SIZE,
    KEPT0,
    LATCHED,
    LINK_FRAMES,
    LOAD,
    LOAD_SIZE,
    LOAD_STORED,
    MODE,
    MULTIPLIER,
    N_CLOSURE_ROWS,
    N_CLOSURES,
    N_CONTACTS,
    N_DRIVES,
    N_FLEX,
    N_KEPT,
    N_LAWS,
    N_LINKS,
    N_LOADS,
    N_SITES,
    NOT_CLOSED,
    NQ,
    NV,
    NY,
    OK,
    OWN,
    PARENT,
    RESIDUAL,
    ROW0,
    ROWS,
    SINGULAR,
    SITE_A,
    SITE_B,
    SITE_FRAMES,
    SLOPES,
    STORED,
    TOUCH,
    TOUCH_SIZE,
    WRENCH,
    U,
    X,
    Y,
    closure,
    link,
    site_link,
    touch,
    wrench,
)
from pipeline.dynamics.vectors import accumulate, at, dot, kernel


def widths(sizes: dict[str, int]) -> dict[str, int]:
    """Number of columns of each observed field, in their order, from the header's sizes by name."""
    drives = sizes["N_DRIVES"]
    return {
        "state": sizes["NY"],
        "coordinate": sizes["NQ"] + drives,
        "speed": sizes["NV"] + drives,
        "acceleration": sizes["NV"] + drives,
        "link_frame": FRAME_SIZE * sizes["N_LINKS"],
        "site_frame": FRAME_SIZE * sizes["N_SITES"],
        "link_wrench": 6 * sizes["N_LINKS"],
        "closure_wrench": 6 * sizes["N_CLOSURES"],
        "touch": TOUCH_SIZE * sizes["N_CONTACTS"],
        "load": LOAD_SIZE * sizes["N_LOADS"],
        "drive_force": drives,
        "energy": 3,  # kinetic, potential of gravity, elastic
        "jacobian": sizes["JACOBIAN_SIZE"],
        "residual": 1,
        "status": 1,
    }


@kernel
def no_energy(h, f, w):
    """No flexible body."""
    return 0.0, 0.0


@kernel
def no_modal(h, f, w):
    """No flexible body."""


def flexible_energies(energies: Callable) -> Callable:
    """Sum over the flexible bodies."""

    @kernel
    def run(h, f, w):
        kinetic = elastic = 0.0
        for k in range(h[N_FLEX]):
            a, b = energies(h, f, w, k)
            kinetic += a
            elastic += b
        return kinetic, elastic

    return run


def modal_inertias(inertia: Callable, modal_inertia: Callable) -> Callable:
    """Inertial wrenches of the flexible bodies at their full accelerations."""

    @kernel
    def run(h, f, w):
        for k in range(h[N_FLEX]):
            inertia(h, f, w, k)
            modal_inertia(h, f, w, k)

    return run


@kernel
def _copy(w, first, count, out, column):
    for k in range(count):
        out[column + k] = w[first + k]
    return column + count


def compose(
    evaluate: Callable,
    project: Callable,
    kinematics: Callable,
    rigid: tuple[Callable, Callable],
    flexible: tuple[Callable, Callable],
    contacts: Callable,
) -> Callable:
    """The kernel observe(h, f, w, n, rows, pieces, tolerance, out); one row of `out` per row."""
    rigid_inertia, rigid_energy = rigid
    flexible_inertia, flexible_energy = flexible

    @kernel
    def closure_wrenches(h, w, out, column):
        """Wrench of every closure on its second body; taken off the links that it acts on."""
        for c in range(h[N_CLOSURES]):
            for e in range(6):
                total = 0.0
                for k in range(closure(h, c, N_KEPT)):
                    wrench_row = h[ROWS] + 6 * (closure(h, c, ROW0) + k)
                    total += w[wrench_row + e] * w[h[MULTIPLIER] + closure(h, c, KEPT0) + k]
                out[column + 6 * c + e] = total
                w[wrench(h, site_link(h, closure(h, c, SITE_B))) + e] -= total
                w[wrench(h, site_link(h, closure(h, c, SITE_A))) + e] += total
        return column + 6 * h[N_CLOSURES]

    @kernel
    def joint_wrenches(h, f, w, n, out, column):
        """Wrench on every link through its inboard joint, at the accelerations in DU (Newton-Euler)."""
        kinematics(h, f, w)
        for e in range(6):
            w[wrench(h, 0) + e] = 0.0
        for i in range(1, h[N_LINKS]):
            if link(h, i, FLEX) < 0:
                rigid_inertia(h, f, w, i)
        flexible_inertia(h, f, w)
        contacts(h, f, w, n)
        after = closure_wrenches(h, w, out, column + 6 * h[N_LINKS])
        for i in range(h[N_LINKS] - 1, 0, -1):
            up = wrench(h, link(h, i, PARENT))
            accumulate(w, up, at(w, wrench(h, i)))
            accumulate(w, up + 3, at(w, wrench(h, i) + 3))
        _copy(w, h[WRENCH], 6 * h[N_LINKS], out, column)
        return after

    @kernel
    def energies(h, f, w, out, column):
        """Kinetic energy, potential of gravity, energy stored in bodies and contacts."""
        kinetic, elastic = flexible_energy(h, f, w)
        potential = 0.0
        for i in range(1, h[N_LINKS]):
            if link(h, i, FLEX) < 0:
                kinetic += rigid_energy(h, f, w, i)
            potential -= dot(at(f, h[GRAVITY]), at(w, h[OWN] + INERTIA_SIZE * i + 1))
        for c in range(h[N_CONTACTS]):
            elastic += w[touch(h, c) + STORED] + w[touch(h, c) + BENT]
        for k in range(h[N_LOADS]):
            elastic += w[h[LOAD] + LOAD_SIZE * k + LOAD_STORED]
        out[column], out[column + 1], out[column + 2] = kinetic, potential, elastic
        return column + 3

    @kernel
    def settle(h, f, w, n, t, tolerance):
        """Evaluate the state in Y with its loops closed to `tolerance`."""
        evaluate(h, f, w, n, t, h[Y], h[SLOPES])
        if n[EVALUATION] == OK and project(h, f, w, n, t, h[Y], h[SLOPES], tolerance) < 0:
            n[EVALUATION] = NOT_CLOSED
        if n[EVALUATION] == OK and h[N_KEPT_ROWS] > 0 and w[h[PIVOT] + LAST_PIVOT] < BLIND:
            n[EVALUATION] = SINGULAR  # multipliers so near to a singular pose are mostly rounding

    @kernel
    def observe(h, f, w, n, rows, pieces, tolerance, out):
        contacts_count = h[N_CONTACTS]
        for r in range(rows.shape[0]):
            row, line = rows[r], out[r]
            for c in range(contacts_count):
                n[n[MODE] + c] = int(row[1 + c])
                w[h[LATCHED] + c] = row[1 + contacts_count + c]
            for k in range(h[NY]):
                w[h[Y] + k] = row[1 + 2 * contacts_count + k]
            for k in range(h[N_LAWS]):
                n[n[ACTIVE] + k] = pieces[r, k]
            settle(h, f, w, n, row[0], tolerance)
            if n[EVALUATION] == OK:
                keep_scales(h, w)
            status, residual = n[EVALUATION], largest(w, h[RESIDUAL], h[N_CLOSURE_ROWS])
            o = _copy(w, h[Y], h[NY], line, 0)
            o = _copy(w, h[X], h[NQ] + h[N_DRIVES], line, o)
            o = _copy(w, h[U], h[NV] + h[N_DRIVES], line, o)
            o = _copy(w, h[DU], h[NV] + h[N_DRIVES], line, o)
            frames = o
            o = joint_wrenches(h, f, w, n, line, o + FRAME_SIZE * (h[N_LINKS] + h[N_SITES]))
            frames = _copy(w, h[LINK_FRAMES], FRAME_SIZE * h[N_LINKS], line, frames)
            _copy(w, h[SITE_FRAMES], FRAME_SIZE * h[N_SITES], line, frames)
            o = _copy(w, h[TOUCH], TOUCH_SIZE * contacts_count, line, o)
            o = _copy(w, h[LOAD], LOAD_SIZE * h[N_LOADS], line, o)
            o = _copy(w, h[DRIVE_FORCE], h[N_DRIVES], line, o)
            o = energies(h, f, w, line, o)
            o = _copy(w, h[JACOBIAN], h[JACOBIAN_SIZE], line, o)
            line[o], line[o + 1] = residual, status

    return observe
