"""Parts of the equations of a flexible body that are the same whether bending shortens it or not."""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.rigid import carry
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import accumulate, add, at, at6, cross, dot, dot6, put, scale, turn_symmetric

RATE = 9  #: SCRATCH: second moment int rho r r^T (9), then D = int rho r rdot^T (9)


@kernel
def places(h, k):
    """Number of modes, and where body k keeps positions, speeds and numbers."""
    n = m.FLEXES.n_modes(h, k)
    return n, h[m.X] + m.FLEXES.q0(h, k), h[m.U] + m.FLEXES.c0(h, k), h[m.FLEX_DATA.place] + m.FLEXES.data0(h, k)


@kernel
def tensor(w, Q):
    """Inertia tensor tr(Q) 1 - Q, as (xx, yy, zz, xy, xz, yz), of the second moment stored from Q."""
    return (
        w[Q + 4] + w[Q + 8],
        w[Q] + w[Q + 8],
        w[Q] + w[Q + 4],
        -w[Q + 1],
        -w[Q + 2],
        -w[Q + 5],
    )


@kernel
def spin(w, P, n, j):
    """Antisymmetric part of column j of P (or V): int rho r x S_j (or rdot x S_j)."""
    return (
        w[P + 5 * n + j] - w[P + 7 * n + j],
        w[P + 6 * n + j] - w[P + 2 * n + j],
        w[P + n + j] - w[P + 3 * n + j],
    )


@kernel
def spatial(w, o, mass, p, c, J):
    """Store a spatial inertia; c, J: first moment and inertia about p, world axes."""
    w[o] = mass
    put(w, o + 1, add(scale(mass, p), c))
    square = mass * dot(p, p) + 2.0 * dot(p, c)
    for k in range(3):
        w[o + 4 + k] = J[k] + square - mass * p[k] * p[k] - 2.0 * p[k] * c[k]
    w[o + 7] = J[3] - mass * p[0] * p[1] - p[0] * c[1] - p[1] * c[0]
    w[o + 8] = J[4] - mass * p[0] * p[2] - p[0] * c[2] - p[2] * c[0]
    w[o + 9] = J[5] - mass * p[1] * p[2] - p[1] * c[2] - p[2] * c[1]


@kernel
def carried(h, w, k):
    """Shapes that also move the body frame: their columns carry the body's own wrench and inertia."""
    i, c0, held = m.FLEXES.link(h, k), m.FLEXES.c0(h, k), m.FLEXES.n_held(h, k)
    own = m.OWN.row(h, i)
    c, J = at(w, own + 1), at6(w, own + 4)
    for j in range(c0, c0 + m.FLEXES.n_modes(h, k)):
        s, o = m.COLUMNS.row(h, j), m.MOMENTA.row(h, j)
        # momentum of the deformation alone stays for the mass matrix
        for e in range(6):
            w[m.DEFORMATION.row(h, j) + e] = w[o + e]
        if j < c0 + held:
            continue
        w[h[m.MODAL_BIAS] + j] += dot6(w, s, w, m.WRENCH.row(h, i))
        omega, v = at(w, s), at(w, s + 3)
        accumulate(w, o, add(turn_symmetric(J, omega), cross(c, v)))
        accumulate(w, o + 3, add(scale(w[own], v), cross(omega, c)))


@kernel
def stiffness(h, f, w, k):
    """Elastic and damping forces join those on the modes; the power lost to damping joins the ledger."""
    n, x, u, data = places(h, k)
    K, bias, rate = data + 12 * n + n * n, h[m.MODAL] + 18 * n, h[m.POSITION_RATE] + m.FLEXES.q0(h, k)
    for j in range(n):
        speed = w[u + j]
        damping = f[K + n + j] * speed
        w[bias + j] += f[K + j] * w[x + j] + damping
        w[rate + j] = speed
        w[h[m.LEDGER_RATE] + m.FLEXES.book(h, k)] += damping * speed


@kernel
def body_mass_matrix(h, f, w, k):
    """Own part of the modal block of the mass matrix, into the envelope; right after `inertia`."""
    n, c0, held, moves = m.FLEXES.n_modes(h, k), m.FLEXES.c0(h, k), m.FLEXES.n_held(h, k), m.FLEXES.inboard(h, k)
    mass = h[m.INTERFACE_DATA.place] + m.FLEXES.interface0(h, k) + 3 * n
    for i in range(n):
        start = h[m.MASS] + m.ENVELOPE.origin(h, c0 + i) + c0
        for j in range(0 if m.FLEXES.coupled(h, k) and i >= held else i, i + 1):
            value = f[mass + i * n + j]
            if moves and j >= held:
                value += dot6(w, m.MOMENTA.row(h, c0 + i), w, m.COLUMNS.row(h, c0 + j))
            if moves and i >= held:
                value += dot6(w, m.COLUMNS.row(h, c0 + i), w, m.DEFORMATION.row(h, c0 + j))
            w[start + j] += value


@kernel
def port_load(h, w, i):
    """A link on a flexible parent also loads the parent's moving shapes, through its port."""
    p = m.LINKS.carried_by(h, i)
    if p < 0:
        return
    b = m.PORTS.flex(h, p)
    held, first = m.FLEXES.n_held(h, b), m.PORTS.column(h, p)
    c0 = m.FLEXES.c0(h, b) + held
    for j in range(m.FLEXES.n_modes(h, b) - held):
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
