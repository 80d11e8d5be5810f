"""The right-hand side: accelerations of all coordinates, composed from the parts present.

Order: known motion, kinematics, inertia, contacts, then the tree from its leaves to the ground,
mass matrix, closures, accelerations, and the forces that the drives supply.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.assembly.envelope import backward, factor, forward
from pipeline.dynamics.tables import (
    BIAS,
    C0,
    CARRIED_BY,
    DRIVE_FORCE,
    DRIVE_WORK,
    DU,
    ENVELOPE,
    EVALUATION,
    FLEX,
    FLEX_C0,
    FORCE,
    INERTIA,
    INERTIA_SIZE,
    KNOWN_PAIRS,
    LEDGER_RATE,
    MASS,
    MASS_SIZE,
    MODAL_BIAS,
    N_DRIVES,
    N_FLEX,
    N_KNOWN_PAIRS,
    N_LEDGER,
    N_LINKS,
    N_MODES,
    N_PAIRS,
    N_SPEEDS,
    N_TURNS,
    NOT_POSITIVE,
    NQ,
    NV,
    OK,
    OWN,
    PAIRS,
    PARENT,
    PORT_COLUMN,
    PORT_FLEX,
    POSITION_RATE,
    STATE,
    TURN,
    U,
    X,
    column,
    flex,
    link,
    momentum,
    port,
    wrench,
)
from pipeline.dynamics.vectors import accumulate, add, at, at6, cross, dot6, kernel, put, scale, turn_symmetric

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
    I, s, o = h[INERTIA] + INERTIA_SIZE * i, column(h, k), momentum(h, k)
    omega, v, c = at(w, s), at(w, s + 3), at(w, I + 1)
    put(w, o, add(turn_symmetric(at6(w, I + 4), omega), cross(c, v)))
    put(w, o + 3, add(scale(w[I], v), cross(omega, c)))


@kernel
def gather(h, w, i):
    """Force and momentum of link i's coordinates; then take its subtree to its parent."""
    o = wrench(h, i)
    first = link(h, i, C0)
    for k in range(first, first + link(h, i, N_SPEEDS)):
        carry(h, w, i, k)
        w[h[BIAS] + k] = dot6(w, column(h, k), w, o)
    up, parent = wrench(h, link(h, i, PARENT)), h[INERTIA] + INERTIA_SIZE * link(h, i, PARENT)
    accumulate(w, up, at(w, o))
    accumulate(w, up + 3, at(w, o + 3))
    for e in range(INERTIA_SIZE):
        w[parent + e] += w[h[INERTIA] + INERTIA_SIZE * i + e]


@kernel
def gather_port(h, w, i):
    """A link on a flexible parent also loads the parent's modes, through its port."""
    p = link(h, i, CARRIED_BY)
    if p < 0:
        return
    b = port(h, p, PORT_FLEX)
    c0, first = flex(h, b, FLEX_C0), port(h, p, PORT_COLUMN)
    for j in range(flex(h, b, N_MODES)):
        k = first + j
        carry(h, w, i, k)
        accumulate(w, momentum(h, c0 + j), at(w, momentum(h, k)))
        accumulate(w, momentum(h, c0 + j) + 3, at(w, momentum(h, k) + 3))
        w[h[MODAL_BIAS] + c0 + j] += dot6(w, column(h, k), w, wrench(h, i))


@kernel
def modal_forces(h, w):
    """Generalised forces of the modes."""
    for b in range(h[N_FLEX]):
        c0 = flex(h, b, FLEX_C0)
        for j in range(c0, c0 + flex(h, b, N_MODES)):
            w[h[BIAS] + j] = w[h[MODAL_BIAS] + j]


@kernel
def assemble_mass(h, w):
    """Mass matrix in its envelope, from momenta and columns."""
    o = h[PAIRS]
    for p in range(h[N_PAIRS]):
        e = o + 3 * p
        w[h[MASS] + h[e + 2]] += dot6(w, momentum(h, h[e]), w, column(h, h[e + 1]))


@kernel
def drive_forces(h, w):
    """Forces that the prescribed coordinates need: their rows of the equations of motion."""
    for d in range(h[N_DRIVES]):
        w[h[DRIVE_FORCE] + d] = w[h[BIAS] + h[NV] + d]
    for p in range(h[N_KNOWN_PAIRS]):
        e = h[KNOWN_PAIRS] + 4 * p
        entry = dot6(w, momentum(h, h[e]), w, column(h, h[e + 1]))
        w[h[DRIVE_FORCE] + h[e + 2]] += entry * w[h[DU] + h[e + 3]]


def flexible_inertia(inertia: Callable, mass_matrix: Callable) -> Callable:
    """The kernel that treats all flexible bodies."""

    @kernel
    def run(h, f, w):
        for k in range(h[N_FLEX]):
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
        for k in range(h[NQ]):
            w[h[X] + k] = w[y + k]
        for k in range(h[NV]):
            w[h[U] + k] = w[y + h[NQ] + k]
            w[h[DU] + k] = 0.0
        for k in range(h[N_TURNS]):
            w[h[TURN] + k] = w[y + h[NQ] + h[NV] + h[N_LEDGER] - h[N_TURNS] + k]

    @kernel
    def forces(h, f, w, n):
        """Inertia, contacts, then the tree from its leaves to the ground."""
        for k in range(h[MASS], h[MASS] + h[MASS_SIZE]):
            w[k] = 0.0
        for e in range(6):
            w[wrench(h, 0) + e] = 0.0
        for i in range(1, h[N_LINKS]):
            if link(h, i, FLEX) < 0:
                rigid_inertia(h, f, w, i)
        flexible(h, f, w)
        contacts(h, f, w, n)
        for k in range(INERTIA_SIZE * h[N_LINKS]):
            w[h[INERTIA] + k] = w[h[OWN] + k]
        for i in range(h[N_LINKS] - 1, 0, -1):
            port_load(h, w, i)
            gather(h, w, i)
        modal(h, w)

    @kernel
    def rates(h, w, dy):
        """Positions' rates, accelerations, and the ledger's powers."""
        power = 0.0
        for d in range(h[N_DRIVES]):
            power += w[h[DRIVE_FORCE] + d] * w[h[U] + h[NV] + d]
        w[h[LEDGER_RATE] + DRIVE_WORK] = power
        for k in range(h[NQ]):
            w[dy + k] = w[h[POSITION_RATE] + k]
        for k in range(h[NV]):
            w[dy + h[NQ] + k] = w[h[DU] + k]
        for k in range(h[N_LEDGER]):
            w[dy + h[NQ] + h[NV] + k] = w[h[LEDGER_RATE] + k]

    @kernel
    def evaluate(h, f, w, n, t, y, dy):
        """Rates dy of the state y at time t, both places in w; n[EVALUATION] says whether it could."""
        n[STATE] = y
        spread_state(h, w, y)
        known_motion(h, f, w, n, t)
        for k in range(h[N_LEDGER]):
            w[h[LEDGER_RATE] + k] = 0.0
        kinematics(h, f, w)
        forces(h, f, w, n)
        assemble_mass(h, w)
        n[EVALUATION] = OK
        if not factor(h, h[ENVELOPE], w, h[MASS], h[NV], MASSLESS_PIVOT) > MASSLESS_PIVOT:
            n[EVALUATION] = NOT_POSITIVE
            return
        for k in range(h[NV]):
            w[h[FORCE] + k] = -w[h[BIAS] + k]
        forward(h, h[ENVELOPE], w, h[MASS], h[NV], h[FORCE])
        close(h, w, n)
        backward(h, h[ENVELOPE], w, h[MASS], h[NV], h[FORCE])
        for k in range(h[NV]):
            w[h[DU] + k] = w[h[FORCE] + k]
        drive_forces(h, w)
        known_forces(h, w)
        rates(h, w, dy)

    return evaluate
