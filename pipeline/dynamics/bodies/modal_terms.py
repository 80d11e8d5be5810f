"""Parts of the equations of a flexible body that are the same whether bending shortens it or not."""

from __future__ import annotations

from pipeline.dynamics.tables import (
    DATA0,
    DEFORMATION,
    ENVELOPE,
    FLEX_C0,
    FLEX_DATA,
    FLEX_INBOARD,
    FLEX_LINK,
    FLEX_Q0,
    INERTIA_SIZE,
    LEDGER_RATE,
    MASS,
    MODAL_BIAS,
    MODAL_LOSS,
    N_MODES,
    OWN,
    POSITION_RATE,
    U,
    X,
    column,
    flex,
    momentum,
    wrench,
)
from pipeline.dynamics.vectors import (
    accumulate,
    add,
    at,
    at6,
    cross,
    dot,
    dot6,
    kernel,
    put,
    scale,
    turn_symmetric,
)

RATE = 9  #: SCRATCH: second moment int rho r r^T (9), then D = int rho r rdot^T (9)


@kernel
def places(h, k):
    """Number of modes, and where body k keeps positions, speeds and numbers."""
    n = flex(h, k, N_MODES)
    return n, h[X] + flex(h, k, FLEX_Q0), h[U] + flex(h, k, FLEX_C0), h[FLEX_DATA] + flex(h, k, DATA0)


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
    """Modes that also move the body frame: their columns carry the body's own wrench and inertia."""
    i, c0 = flex(h, k, FLEX_LINK), flex(h, k, FLEX_C0)
    own = h[OWN] + INERTIA_SIZE * i
    c, J = at(w, own + 1), at6(w, own + 4)
    for j in range(c0, c0 + flex(h, k, N_MODES)):
        s, o = column(h, j), momentum(h, j)
        w[h[MODAL_BIAS] + j] += dot6(w, s, w, wrench(h, i))
        omega, v = at(w, s), at(w, s + 3)
        # momentum of the deformation alone stays for the mass matrix
        for e in range(6):
            w[h[DEFORMATION] + 6 * j + e] = w[o + e]
        accumulate(w, o, add(turn_symmetric(J, omega), cross(c, v)))
        accumulate(w, o + 3, add(scale(w[own], v), cross(omega, c)))


@kernel
def stiffness(h, f, w, k):
    """Elastic and damping forces join the modal forces; the power lost to damping joins the ledger."""
    n, x, u, data = places(h, k)
    K = data + 12 * n + n * n
    bias, rate = h[MODAL_BIAS] + flex(h, k, FLEX_C0), h[POSITION_RATE] + flex(h, k, FLEX_Q0)
    for j in range(n):
        speed = w[u + j]
        damping = f[K + n + j] * speed
        w[bias + j] += f[K + j] * w[x + j] + damping
        w[rate + j] = speed
        w[h[LEDGER_RATE] + MODAL_LOSS] += damping * speed


@kernel
def mass_matrix(h, f, w, k):
    """Own part of the modal block of the mass matrix, into the envelope; right after `inertia`."""
    n, _, _, data = places(h, k)
    c0, moves = flex(h, k, FLEX_C0), flex(h, k, FLEX_INBOARD)
    for i in range(n):
        e = h[ENVELOPE] + 2 * (c0 + i)
        start = h[MASS] + h[e + 1] - h[e] + c0
        for j in range(i + 1):
            value = f[data + 12 * n + i * n + j]
            if moves:
                value += dot6(w, momentum(h, c0 + i), w, column(h, c0 + j))
                value += dot6(w, column(h, c0 + i), w, h[DEFORMATION] + 6 * (c0 + j))
            w[start + j] += value
