"""What is recorded of a state: true accelerations, joint forces, contacts, energies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies import rigid
from flexclear.pipeline.dynamics.equations.kinematics import make_kinematics
from flexclear.pipeline.dynamics.equations.prescribed_motion import make_laws, prescribe
from flexclear.pipeline.dynamics.equations.projection import BLIND, keep_scales, largest
from flexclear.pipeline.dynamics.equations.right_hand_side import make_forces, nothing, spread_state
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import accumulate, at, dot

#: kinetic energy, potential energy of gravity, energy stored in bodies, springs and contacts [J]
ENERGY = m.layout("kinetic potential elastic")
#: tolerance by which the loops of rows stay as they are, and nothing but frames is written
AS_RECORDED = -1.0


@dataclass(frozen=True)
class Observed:
    """What is observed of rows of the record; all over the rows, world axes, from the kernels' origin.

    state: with its loops closed, (rows, NY).  positions, speeds, accelerations: of all coordinates, free ones first.
    links, sites: their frames (LINK_FRAMES), of which accelerations are true ones less gravity; (rows, links or sites).
    link_wrenches: on each link through its inboard joint; closure_wrenches: on the closures' second bodies; moment
    about the kernels' origin (WRENCH).  touch, loads, bearings: what contacts, loads and bearings with friction do
    (TOUCH, LOAD, BEARING).
    drive_force: along the drives' coordinates in the tree [N or N m].  energy: ENERGY.
    jacobian: of the closure rows solved for, as the kernels store it.
    residual: largest violation of a closure, shape (rows,).  status: what an evaluation reports there, shape (rows,).
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
    """What `observe` writes, in its order: rows of which table, or floats (None), and how many of them."""
    drives = size(m.N_DRIVES)
    return {
        "state": (None, size(m.NY)),
        "positions": (None, size(m.NQ) + drives),
        "speeds": (None, size(m.NV) + drives),
        "accelerations": (None, size(m.NV) + drives),
        "links": (m.LINK_FRAMES, size(m.N_LINKS)),
        "sites": (m.SITE_FRAMES, size(m.N_SITES)),
        "link_wrenches": (m.WRENCH, size(m.N_LINKS)),
        "closure_wrenches": (m.WRENCH, size(m.N_CLOSURES)),
        "touch": (m.TOUCH, size(m.N_CONTACTS)),
        "loads": (m.LOAD, size(m.N_LOADS)),
        "bearings": (m.BEARING, size(m.N_BEARINGS)),
        "drive_force": (None, drives),
        "energy": (ENERGY, 1),
        "jacobian": (None, size(m.JACOBIAN_SIZE)),
        "residual": (None, 1),
        "status": (None, 1),
    }


class Frames(NamedTuple):
    """Frames of links and sites in rows of the record; of LINK_FRAMES without accelerations, (rows, links or sites)."""

    links: np.ndarray
    sites: np.ndarray


def frames_room(rows: int, size: Callable[[int], int]) -> np.ndarray:
    """Room for frames alone, shape (rows, columns)."""
    return np.empty((rows, m.FRAME.size * (size(m.N_LINKS) + size(m.N_SITES))))


def frames_by_name(out: np.ndarray, size: Callable[[int], int]) -> Frames:
    """Views of the frames that `observe` has written."""
    end = m.FRAME.size * size(m.N_LINKS)
    known = ["origin", "axes", "omega", "velocity"]
    return Frames(m.named(m.LINK_FRAMES, out[:, :end])[known], m.named(m.SITE_FRAMES, out[:, end:])[known])


def room(rows: int, size: Callable[[int], int]) -> np.ndarray:
    """Zeros that `observe` can write on, shape (rows, columns); size: of a place in the header."""
    return np.zeros((rows, sum((table.size if table else 1) * count for table, count in _columns(size).values())))


def by_name(out: np.ndarray, size: Callable[[int], int]) -> Observed:
    """Views of what `observe` has written."""
    fields, end = dict[str, np.ndarray](), 0
    for name, (table, count) in _columns(size).items():
        begin, end = end, end + (table.size if table else 1) * count
        fields[name] = m.named(table, out[:, begin:end]) if table else out[:, begin:end]
    single = {name: fields[name][:, 0] for name in ("energy", "residual", "status")}
    return Observed(**fields | single)


@kernel
def no_energy(h, f, w):
    """Kinetic and elastic energy where no body is flexible."""
    return 0.0, 0.0


@kernel
def no_couplings(h, w):
    """No closure acts on four links."""


@kernel
def no_friction(h, w, out, column):
    """No joint rubs."""


@kernel
def _copy(w, first, count, out, column):
    for k in range(count):
        out[column + k] = w[first + k]
    return column + count


def make_observation(
    evaluate: Callable,
    project: Callable,
    joints: tuple[Any, ...],
    flexible: Any = None,
    contacts: Callable | None = None,
    loads: Callable | None = None,
    stops: Callable | None = None,
    harmonics: Callable | None = None,
    couplings: Any = None,
    friction: Callable | None = None,
) -> Callable:
    """The kernel observe(h, f, w, n, rows, pieces, tolerance, out); one row of `out` per row.

    With a tolerance of AS_RECORDED nothing is evaluated and only frames are written, of links and of sites.

    evaluate, project: as the stepper calls them; couplings: the module of that name; friction: of ideal joints, in
    closures (`equations.joint_friction`); the other arguments are those of `make_right_hand_side`.
    """
    kinematics, laws = make_kinematics(joints, flexible), make_laws(harmonics)
    forces = make_forces(flexible, contacts, loads, stops)
    modal_inertia = nothing if flexible is None else flexible.modal_inertia
    couple = no_couplings if couplings is None else couplings.take_off_first_joints
    rub = no_friction if friction is None else friction
    flexible_energy = no_energy if flexible is None else flexible.energies

    @kernel
    def closure_wrenches(h, w, out, column):
        """Wrench of every closure on its second body; taken off the links that it acts on."""
        for c in range(h[m.N_CLOSURES]):
            for e in range(6):
                total = 0.0
                for k in range(m.CLOSURES.n_kept(h, c)):
                    wrench_row = m.ROWS.row(h, m.CLOSURES.row0(h, c) + k)
                    total += w[wrench_row + e] * w[h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c) + k]
                out[column + 6 * c + e] = total
                w[m.WRENCH.row(h, m.SITES.link(h, m.CLOSURES.site_b(h, c))) + e] -= total
                w[m.WRENCH.row(h, m.SITES.link(h, m.CLOSURES.site_a(h, c))) + e] += total
        couple(h, w)
        rub(h, w, out, column)
        return column + 6 * h[m.N_CLOSURES]

    @kernel
    def joint_wrenches(h, f, w, n, out, column):
        """Wrench on every link through its inboard joint, at the accelerations of its frames (Newton-Euler)."""
        forces(h, f, w, n)
        modal_inertia(h, f, w, n)
        after = closure_wrenches(h, w, out, column + 6 * h[m.N_LINKS])
        for i in range(h[m.N_LINKS] - 1, 0, -1):
            up = m.WRENCH.row(h, m.LINKS.parent(h, i))
            accumulate(w, up, at(w, m.WRENCH.row(h, i)))
            accumulate(w, up + 3, at(w, m.WRENCH.row(h, i) + 3))
        _copy(w, h[m.WRENCH.place], 6 * h[m.N_LINKS], out, column)
        return after

    @kernel
    def energies(h, f, w, out, column):
        """Kinetic energy, potential of gravity, energy stored in bodies and contacts."""
        kinetic, elastic = flexible_energy(h, f, w)
        potential = 0.0
        for i in range(1, h[m.N_LINKS]):
            if m.LINKS.flex(h, i) < 0:
                kinetic += rigid.kinetic_energy(h, f, w, i)
            potential -= dot(at(f, h[m.GRAVITY.place]), at(w, m.OWN.row(h, i) + m.OWN.moment))
        for c in range(h[m.N_CONTACTS]):
            elastic += w[m.TOUCH.row(h, c) + m.TOUCH.stored] + w[m.TOUCH.row(h, c) + m.TOUCH.bent]
        for k in range(h[m.N_LOADS]):
            elastic += w[m.LOAD.row(h, k) + m.LOAD.stored]
        out[column], out[column + 1], out[column + 2] = kinetic, potential, elastic
        return column + 3

    @kernel
    def evaluate_closed(h, f, w, n, t, tolerance):
        """Evaluate the state in Y with its loops closed to `tolerance`."""
        evaluate(h, f, w, n, t, h[m.Y], h[m.SLOPES])
        if n[m.EVALUATION] == m.OK and project(h, f, w, n, t, h[m.Y], h[m.SLOPES], tolerance) < 0:
            n[m.EVALUATION] = m.NOT_CLOSED
        if n[m.EVALUATION] == m.OK and h[m.N_KEPT_ROWS] > 0 and w[h[m.PIVOT] + m.LAST_PIVOT] < BLIND:
            n[m.EVALUATION] = m.SINGULAR  # multipliers so near to a singular pose are mostly rounding

    @kernel
    def place(h, f, w, n, t):
        """Positions and speeds of the state in Y."""
        laws(h, f, w, n, t)
        spread_state(h, w, h[m.Y])
        prescribe(h, w)

    @kernel
    def copy_frames(h, w, line, column):
        """Copy the frames of links and sites."""
        o = _copy(w, h[m.LINK_FRAMES.place], m.FRAME.size * h[m.N_LINKS], line, column)
        return _copy(w, h[m.SITE_FRAMES.place], m.FRAME.size * h[m.N_SITES], line, o)

    @kernel
    def observe(h, f, w, n, rows, pieces, tolerance, out):
        mode, latched, state = m.record_columns(h[m.N_CONTACTS])
        for r in range(rows.shape[0]):
            row, line = rows[r], out[r]
            for c in range(h[m.N_CONTACTS]):
                n[n[m.MODE] + c] = int(row[mode + c])
                w[h[m.LATCHED] + c] = row[latched + c]
            for k in range(h[m.NY]):
                w[h[m.Y] + k] = row[state + k]
            for k in range(h[m.N_LAWS]):
                n[n[m.ACTIVE] + k] = pieces[r, k]
            if tolerance == AS_RECORDED:
                place(h, f, w, n, row[0])
            else:
                evaluate_closed(h, f, w, n, row[0], tolerance)
                if n[m.EVALUATION] == m.OK:
                    keep_scales(h, w)
            # at the accelerations in DU; written once, since twice would be compiled twice
            kinematics(h, f, w)
            if tolerance == AS_RECORDED:
                copy_frames(h, w, line, 0)
                continue
            status, residual = n[m.EVALUATION], largest(w, h[m.RESIDUAL], h[m.N_CLOSURE_ROWS])
            o = _copy(w, h[m.Y], h[m.NY], line, 0)
            o = _copy(w, h[m.X], h[m.NQ] + h[m.N_DRIVES], line, o)
            o = _copy(w, h[m.U], h[m.NV] + h[m.N_DRIVES], line, o)
            o = _copy(w, h[m.SLOPES] + h[m.NQ], h[m.NV], line, o)
            o = _copy(w, h[m.DU] + h[m.NV], h[m.N_DRIVES], line, o)
            o = copy_frames(h, w, line, o)
            o = joint_wrenches(h, f, w, n, line, o)
            o = _copy(w, h[m.TOUCH.place], m.TOUCH.size * h[m.N_CONTACTS], line, o)
            o = _copy(w, h[m.LOAD.place], m.LOAD.size * h[m.N_LOADS], line, o)
            o = _copy(w, h[m.BEARING.place], m.BEARING.size * h[m.N_BEARINGS], line, o)
            o = _copy(w, h[m.DRIVE_FORCE], h[m.N_DRIVES], line, o)
            o = energies(h, f, w, line, o)
            o = _copy(w, h[m.JACOBIAN], h[m.JACOBIAN_SIZE], line, o)
            line[o], line[o + 1] = residual, status

    return observe
