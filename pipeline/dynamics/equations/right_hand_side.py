"""The right-hand side: accelerations of all coordinates, composed from the parts present.

Order: known motion, kinematics, inertia, contacts, then the tree from its leaves to the ground,
mass matrix, closures, accelerations, and the forces that the drives supply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies import rigid
from flexclear.pipeline.dynamics.bodies.rigid import carry
from flexclear.pipeline.dynamics.equations.envelope import backward, factor, forward
from flexclear.pipeline.dynamics.equations.kinematics import make_kinematics
from flexclear.pipeline.dynamics.equations.prescribed_motion import make_laws, prescribe
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import accumulate, at, dot6

#: pivots of M below this share of their diagonal mean a coordinate that moves no mass
MASSLESS_PIVOT = 1e-15


@kernel
def nothing(h, f, w, n):
    """Stands for the forces of parts that a mechanism does not have."""


@kernel
def no_modal_mass(h, f, w):
    """No modes."""


@kernel
def no_modal_forces(h, w):
    """No modes."""


@kernel
def no_modal_rates(h, f, w, dy):
    """No modes."""


@kernel
def no_link_load(h, w, i):
    """No link is carried by a flexible one."""


@kernel
def no_closures(h, f, w, n):
    """A tree needs no multipliers."""


@kernel
def no_known_forces(h, w):
    """No closure loads a drive."""


@kernel
def spread_state(h, w, y):
    """Positions, speeds and internal states from the state at place y; no accelerations yet."""
    for k in range(h[m.NQ]):
        w[h[m.X] + k] = w[y + k]
    for k in range(h[m.NV]):
        w[h[m.U] + k] = w[y + h[m.NQ] + k]
        w[h[m.DU] + k] = 0.0
    for k in range(h[m.N_INTERNAL]):
        w[h[m.INTERNAL] + k] = w[y + h[m.NQ] + h[m.NV] + h[m.N_LEDGER] - h[m.N_INTERNAL] + k]


@kernel
def gather(h, w, i):
    """Force and momentum of link i's coordinates; then take its subtree to its parent."""
    o = m.WRENCH.row(h, i)
    first = m.LINKS.c0(h, i)
    for k in range(first, first + m.LINKS.n_speeds(h, i)):
        carry(h, w, i, k)
        w[h[m.BIAS] + k] = dot6(w, m.COLUMNS.row(h, k), w, o)
    parent = m.LINKS.parent(h, i)
    up, tree = m.WRENCH.row(h, parent), m.INERTIA.row(h, parent)
    accumulate(w, up, at(w, o))
    accumulate(w, up + 3, at(w, o + 3))
    for e in range(m.INERTIA.size):
        w[tree + e] += w[m.INERTIA.row(h, i) + e]


@kernel
def assemble_mass(h, w):
    """Mass matrix in its envelope, from momenta and columns."""
    for p in range(h[m.N_PAIRS]):
        momentum, column = m.MOMENTA.row(h, m.PAIRS.momentum(h, p)), m.COLUMNS.row(h, m.PAIRS.column(h, p))
        w[h[m.MASS] + m.PAIRS.entry(h, p)] += dot6(w, momentum, w, column)


@kernel
def drive_forces(h, w):
    """Forces that the prescribed coordinates need: their rows of the equations of motion."""
    for d in range(h[m.N_DRIVES]):
        w[h[m.DRIVE_FORCE] + d] = w[h[m.BIAS] + h[m.NV] + d]
    for p in range(h[m.N_KNOWN_PAIRS]):
        momentum, column = m.MOMENTA.row(h, m.KNOWN_PAIRS.momentum(h, p)), m.COLUMNS.row(h, m.KNOWN_PAIRS.column(h, p))
        acceleration = w[h[m.DU] + m.KNOWN_PAIRS.coordinate(h, p)]
        w[h[m.DRIVE_FORCE] + m.KNOWN_PAIRS.drive(h, p)] += dot6(w, momentum, w, column) * acceleration


def make_forces(
    flexible: Any = None,
    contacts: Callable | None = None,
    loads: Callable | None = None,
    stops: Callable | None = None,
) -> Callable:
    """The kernel forces(h, f, w, n): inertia and applied forces of all links, before the tree gathers them."""
    flexible_inertia = nothing if flexible is None else flexible.inertia
    contact_forces = nothing if contacts is None else contacts
    applied = nothing if loads is None else loads
    stop_forces = nothing if stops is None else stops

    @kernel
    def forces(h, f, w, n):
        for e in range(6):
            w[m.WRENCH.row(h, 0) + e] = 0.0
        for i in range(1, h[m.N_LINKS]):
            if m.LINKS.flex(h, i) < 0:
                rigid.inertia(h, f, w, i)
        flexible_inertia(h, f, w, n)
        contact_forces(h, f, w, n)
        applied(h, f, w, n)
        stop_forces(h, f, w, n)

    return forces


def make_right_hand_side(harmonics: Callable | None = None, **parts: Any) -> Callable:
    """The kernel evaluate(h, f, w, n, t, y, dy), from the parts that a mechanism has.

    harmonics: adds those of the laws of time.  parts: see `make_rates`.
    """
    laws, rates = make_laws(harmonics), make_rates(**parts)

    @kernel
    def evaluate(h, f, w, n, t, y, dy):
        """Rates dy of the state y at time t, both places in w; n[EVALUATION] says whether it could."""
        laws(h, f, w, n, t)
        rates(h, f, w, n, y, dy)

    return evaluate


def make_rates(
    joints: tuple[Any, ...],
    flexible: Any = None,
    contacts: Callable | None = None,
    loads: Callable | None = None,
    stops: Callable | None = None,
    closures: Any = None,
    friction: tuple[Callable, Callable] | None = None,
) -> Callable:
    """The kernel rates(h, f, w, n, y, dy): `evaluate` at the present values of the laws of time.

    joints: modules of the joint types.  flexible: kernels of the flexible bodies.  contacts, loads, stops: the kernels
    that apply them.  closures: the module of that name.  friction: of ideal joints, on accelerations and on drives
    (`equations.joint_friction`).
    """
    kinematics = make_kinematics(joints, flexible)
    forces = make_forces(flexible, contacts, loads, stops)
    port_load = no_link_load if flexible is None else flexible.port_load
    modal_mass = no_modal_mass if flexible is None else flexible.mass_matrix
    modal_rates = no_modal_rates if flexible is None else flexible.modal_rates
    modal = no_modal_forces if flexible is None else flexible.modal_forces
    close = no_closures if closures is None else closures.close
    known_forces = no_known_forces if closures is None else closures.known_forces
    rub, rub_drives = (nothing, no_known_forces) if friction is None else friction

    @kernel
    def gather_forces(h, f, w, n):
        """Forces of all parts, then the tree from its leaves to the ground."""
        for k in range(h[m.MASS], h[m.MASS] + h[m.MASS_SIZE]):
            w[k] = 0.0
        forces(h, f, w, n)
        modal_mass(h, f, w)
        for i in range(h[m.N_LINKS]):
            for e in range(m.INERTIA.size):
                w[m.INERTIA.row(h, i) + e] = w[m.OWN.row(h, i) + e]
        for i in range(h[m.N_LINKS] - 1, 0, -1):
            port_load(h, w, i)
            gather(h, w, i)
        modal(h, w)

    @kernel
    def store_rates(h, f, w, dy):
        """Positions' rates, accelerations, and the ledger's powers."""
        power = 0.0
        for d in range(h[m.N_DRIVES]):
            power += w[h[m.DRIVE_FORCE] + d] * w[h[m.U] + h[m.NV] + d]
        w[h[m.LEDGER_RATE] + m.DRIVE_WORK] = power
        for k in range(h[m.NQ]):
            w[dy + k] = w[h[m.POSITION_RATE] + k]
        for k in range(h[m.NV]):
            w[dy + h[m.NQ] + k] = w[h[m.DU] + k]
        modal_rates(h, f, w, dy)
        for k in range(h[m.N_LEDGER]):
            w[dy + h[m.NQ] + h[m.NV] + k] = w[h[m.LEDGER_RATE] + k]

    @kernel
    def rates(h, f, w, n, y, dy):
        n[m.STATE], n[m.ABRIDGED] = y, 0
        spread_state(h, w, y)
        prescribe(h, w)
        for k in range(h[m.N_LEDGER]):
            w[h[m.LEDGER_RATE] + k] = 0.0
        kinematics(h, f, w)
        gather_forces(h, f, w, n)
        assemble_mass(h, w)
        n[m.EVALUATION] = m.OK
        if not factor(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], MASSLESS_PIVOT):
            n[m.EVALUATION] = m.NOT_POSITIVE
            return
        for k in range(h[m.NV]):
            w[h[m.FORCE] + k] = -w[h[m.BIAS] + k]
        forward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], h[m.FORCE])
        close(h, f, w, n)
        backward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], h[m.FORCE])
        for k in range(h[m.NV]):
            w[h[m.DU] + k] = w[h[m.FORCE] + k]
        rub(h, f, w, n)
        drive_forces(h, w)
        known_forces(h, w)
        rub_drives(h, w)
        store_rates(h, f, w, dy)

    return rates
