"""The right-hand side: accelerations of all coordinates, composed from the parts present.

Order: known motion, kinematics, inertia, contacts, then the tree from its leaves to the ground,
mass matrix, closures, accelerations, and the forces that the drives supply.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics import memory as m
from pipeline.dynamics.equations.envelope import backward, factor, forward
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import accumulate, add, at, at6, cross, dot6, put, scale, turn_symmetric

#: pivots of M below this share of their diagonal mean a coordinate that moves no mass
MASSLESS_PIVOT = 1e-15


@kernel
def no_flexible(h, f, w):
    """No flexible body."""


@kernel
def no_port_load(h, w, i):
    """No flexible parent."""


@kernel
def no_modal(h, w):
    """No modes."""


@kernel
def no_contacts(h, f, w, n):
    """No clearance joint."""


def both(contacts: Callable, loads: Callable) -> Callable:
    """Forces of contacts and of loads."""

    @kernel
    def run(h, f, w, n):
        contacts(h, f, w, n)
        loads(h, f, w)

    return run


@kernel
def no_closures(h, w, n):
    """A tree needs no multipliers."""


@kernel
def no_known_forces(h, w):
    """No closure loads a drive."""


@kernel
def carry(h, w, i, k):
    """Store the momentum of the subtree of link i moving with column k."""
    I, s, o = m.INERTIA.row(h, i), m.COLUMNS.row(h, k), m.MOMENTA.row(h, k)
    omega, v, c = at(w, s), at(w, s + 3), at(w, I + m.INERTIA.moment)
    put(w, o, add(turn_symmetric(at6(w, I + m.INERTIA.inertia), omega), cross(c, v)))
    put(w, o + 3, add(scale(w[I + m.INERTIA.mass], v), cross(omega, c)))


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
def gather_port(h, w, i):
    """A link on a flexible parent also loads the parent's modes, through its port."""
    p = m.LINKS.carried_by(h, i)
    if p < 0:
        return
    b = m.PORTS.flex(h, p)
    c0, first = m.FLEXES.c0(h, b), m.PORTS.column(h, p)
    for j in range(m.FLEXES.n_modes(h, b)):
        k = first + j
        carry(h, w, i, k)
        accumulate(w, m.MOMENTA.row(h, c0 + j), at(w, m.MOMENTA.row(h, k)))
        accumulate(w, m.MOMENTA.row(h, c0 + j) + 3, at(w, m.MOMENTA.row(h, k) + 3))
        w[h[m.MODAL_BIAS] + c0 + j] += dot6(w, m.COLUMNS.row(h, k), w, m.WRENCH.row(h, i))


@kernel
def modal_forces(h, w):
    """Generalised forces of the modes."""
    for b in range(h[m.N_FLEX]):
        c0 = m.FLEXES.c0(h, b)
        for j in range(c0, c0 + m.FLEXES.n_modes(h, b)):
            w[h[m.BIAS] + j] = w[h[m.MODAL_BIAS] + j]


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


def flexible_inertia(inertia: Callable, mass_matrix: Callable) -> Callable:
    """The kernel that treats all flexible bodies."""

    @kernel
    def run(h, f, w):
        for k in range(h[m.N_FLEX]):
            inertia(h, f, w, k)
            mass_matrix(h, f, w, k)

    return run


def compose(
    known_motion: Callable,
    kinematics: Callable,
    rigid_inertia: Callable,
    flexible: Callable,
    port_load: Callable,
    modal: Callable,
    contacts: Callable,
    close: Callable,
    known_forces: Callable,
) -> Callable:
    """The kernel evaluate(h, f, w, n, t, y, dy), from the parts that the scene has."""

    @kernel
    def spread_state(h, w, y):
        for k in range(h[m.NQ]):
            w[h[m.X] + k] = w[y + k]
        for k in range(h[m.NV]):
            w[h[m.U] + k] = w[y + h[m.NQ] + k]
            w[h[m.DU] + k] = 0.0
        for k in range(h[m.N_TURNS]):
            w[h[m.TURN] + k] = w[y + h[m.NQ] + h[m.NV] + h[m.N_LEDGER] - h[m.N_TURNS] + k]

    @kernel
    def forces(h, f, w, n):
        """Inertia, contacts, then the tree from its leaves to the ground."""
        for k in range(h[m.MASS], h[m.MASS] + h[m.MASS_SIZE]):
            w[k] = 0.0
        for e in range(6):
            w[m.WRENCH.row(h, 0) + e] = 0.0
        for i in range(1, h[m.N_LINKS]):
            if m.LINKS.flex(h, i) < 0:
                rigid_inertia(h, f, w, i)
        flexible(h, f, w)
        contacts(h, f, w, n)
        for k in range(m.INERTIA.size * h[m.N_LINKS]):
            w[h[m.INERTIA.place] + k] = w[h[m.OWN.place] + k]
        for i in range(h[m.N_LINKS] - 1, 0, -1):
            port_load(h, w, i)
            gather(h, w, i)
        modal(h, w)

    @kernel
    def rates(h, w, dy):
        """Positions' rates, accelerations, and the ledger's powers."""
        power = 0.0
        for d in range(h[m.N_DRIVES]):
            power += w[h[m.DRIVE_FORCE] + d] * w[h[m.U] + h[m.NV] + d]
        w[h[m.LEDGER_RATE] + m.DRIVE_WORK] = power
        for k in range(h[m.NQ]):
            w[dy + k] = w[h[m.POSITION_RATE] + k]
        for k in range(h[m.NV]):
            w[dy + h[m.NQ] + k] = w[h[m.DU] + k]
        for k in range(h[m.N_LEDGER]):
            w[dy + h[m.NQ] + h[m.NV] + k] = w[h[m.LEDGER_RATE] + k]

    @kernel
    def evaluate(h, f, w, n, t, y, dy):
        """Rates dy of the state y at time t, both places in w; n[EVALUATION] says whether it could."""
        n[m.STATE] = y
        spread_state(h, w, y)
        known_motion(h, f, w, n, t)
        for k in range(h[m.N_LEDGER]):
            w[h[m.LEDGER_RATE] + k] = 0.0
        kinematics(h, f, w)
        forces(h, f, w, n)
        assemble_mass(h, w)
        n[m.EVALUATION] = m.OK
        if not factor(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], MASSLESS_PIVOT) > MASSLESS_PIVOT:
            n[m.EVALUATION] = m.NOT_POSITIVE
            return
        for k in range(h[m.NV]):
            w[h[m.FORCE] + k] = -w[h[m.BIAS] + k]
        forward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], h[m.FORCE])
        close(h, w, n)
        backward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], h[m.FORCE])
        for k in range(h[m.NV]):
            w[h[m.DU] + k] = w[h[m.FORCE] + k]
        drive_forces(h, w)
        known_forces(h, w)
        rates(h, w, dy)

    return evaluate
