r"""A modally reduced body in the floating frame of reference, no coupling term dropped.

A point is at ``r = X + S q`` in the body frame. Everything the equations need follows from two
families of vectors that are linear in the state, with the invariants of the bundle,

.. math:: P_{kl} = \int\rho\, r_k S_l = E_{kl} + F_{kl} q, \qquad V_{kl} = \int\rho\, \dot r_k S_l = F_{kl}\dot q

after Shabana, *Dynamics of Multibody Systems*, ch. 5, and Wang & Wang (2019), eqs. (9)-(15).
"""

from __future__ import annotations

from pipeline.dynamics.tables import (
    ACCELERATION,
    ALPHA,
    AXES,
    DATA0,
    DEFORMATION,
    DU,
    ENVELOPE,
    FLEX_C0,
    FLEX_DATA,
    FLEX_INBOARD,
    FLEX_LINK,
    FLEX_NUMBERS,
    FLEX_Q0,
    INERTIA_SIZE,
    LEDGER_RATE,
    MASS,
    MODAL,
    MODAL_BIAS,
    MODAL_LOSS,
    MOMENT0,
    MOMENT_VALUES,
    MOMENTS,
    N_MODES,
    N_MOMENTS,
    OMEGA,
    ORIGIN,
    OWN,
    POSITION_RATE,
    SCRATCH,
    VELOCITY,
    U,
    X,
    column,
    flex,
    link_frame,
    momentum,
    wrench,
)
from pipeline.dynamics.vectors import (
    accumulate,
    add,
    at,
    at6,
    at9,
    congruence,
    cross,
    dot,
    dot6,
    index,
    kernel,
    put,
    scale,
    turn,
    turn_back,
    turn_symmetric,
)

_RATE = 9  # SCRATCH: second moment int rho r r^T (9), then D = int rho r rdot^T (9)


@kernel
def _places(h, k):
    """Number of modes, and where body k keeps positions, speeds and numbers."""
    n = flex(h, k, N_MODES)
    return n, h[X] + flex(h, k, FLEX_Q0), h[U] + flex(h, k, FLEX_C0), h[FLEX_DATA] + flex(h, k, DATA0)


@kernel
def invariants(h, f, w, k):
    """Fill MODAL with P (first 9 n) and V (next 9 n), row (3k + l) holding n values."""
    n, x, u, data = _places(h, k)
    P = h[MODAL]
    V = P + 9 * n
    for e in range(9 * n):
        w[index(P + e)] = f[index(data + 3 * n + e)]
        w[index(V + e)] = 0.0
    first, count = flex(h, k, MOMENT0), flex(h, k, N_MOMENTS)
    where, values = h[MOMENTS] + 2 * first, h[MOMENT_VALUES] + first
    for e in range(count):
        row, i, value = h[index(where + 2 * e)], h[index(where + 2 * e + 1)], f[index(values + e)]
        w[index(P + row)] += value * w[index(x + i)]
        w[index(V + row)] += value * w[index(u + i)]


@kernel
def _sums(h, f, w, k):
    """First moment and its rate; into SCRATCH the second moment and D (after `invariants`)."""
    n, x, u, data = _places(h, k)
    P, numbers, Q = h[MODAL], h[FLEX_NUMBERS] + 13 * k, h[SCRATCH]
    c, v = at(f, numbers + 1), (0.0, 0.0, 0.0)
    for j in range(n):
        shape = (f[index(data + j)], f[index(data + n + j)], f[index(data + 2 * n + j)])
        c = add(c, scale(w[index(x + j)], shape))
        v = add(v, scale(w[index(u + j)], shape))
    for a in range(3):
        for b in range(3):
            both, rate = f[index(numbers + 4 + 3 * a + b)], 0.0
            row, mirrored = P + (3 * a + b) * n, data + 3 * n + (3 * b + a) * n
            for j in range(n):
                # int r_a r_b = int X_a X_b + int X_b S_a q + int r_a S_b q
                both += (f[index(mirrored + j)] + w[index(row + j)]) * w[index(x + j)]
                rate += w[index(row + j)] * w[index(u + j)]
            w[index(Q + 3 * a + b)] = both
            w[index(Q + _RATE + 3 * a + b)] = rate
    return c, v


@kernel
def _tensor(w, Q):
    """Inertia tensor tr(Q) 1 - Q, as (xx, yy, zz, xy, xz, yz), of the second moment stored from Q."""
    return (
        w[index(Q + 4)] + w[index(Q + 8)],
        w[Q] + w[index(Q + 8)],
        w[Q] + w[index(Q + 4)],
        -w[index(Q + 1)],
        -w[index(Q + 2)],
        -w[index(Q + 5)],
    )


@kernel
def _spin(w, P, n, j):
    """Antisymmetric part of column j of P (or V): int rho r x S_j (or rdot x S_j)."""
    return (
        w[index(P + 5 * n + j)] - w[index(P + 7 * n + j)],
        w[index(P + 6 * n + j)] - w[index(P + 2 * n + j)],
        w[index(P + n + j)] - w[index(P + 3 * n + j)],
    )


@kernel
def inertia(h, f, w, k):
    """Spatial inertia, wrench, modal forces and modal momenta of flexible body k.

    As `rigid.inertia`, with the modal accelerations taken as zero; `modal_inertia` adds theirs.
    """
    i = flex(h, k, FLEX_LINK)
    invariants(h, f, w, k)
    first, first_rate = _sums(h, f, w, k)
    mass = f[index(h[FLEX_NUMBERS] + 13 * k)]
    frame, Q = link_frame(h, i), h[SCRATCH]
    R, p = at9(w, frame + AXES), at(w, frame + ORIGIN)
    J = _tensor(w, Q)
    omega, alpha = turn_back(R, at(w, frame + OMEGA)), turn_back(R, at(w, frame + ALPHA))
    a = turn_back(R, at(w, frame + ACCELERATION))
    _spatial(w, h[OWN] + INERTIA_SIZE * i, mass, p, turn(R, first), congruence(R, J))
    force = add(scale(mass, a), cross(alpha, first))
    force = add(force, cross(omega, add(cross(omega, first), scale(2.0, first_rate))))
    moment = add(cross(first, a), turn_symmetric(J, alpha))
    moment = add(moment, cross(omega, turn_symmetric(J, omega)))
    # 2 int rho r x (omega x rdot) = 2 (tr(D) omega - D^T omega)
    D = at9(w, Q + _RATE)
    twice = add(scale(D[0] + D[4] + D[8], omega), scale(-1.0, turn_back(D, omega)))
    moment = add(moment, scale(2.0, twice))
    o, force = wrench(h, i), turn(R, force)
    put(w, o, add(turn(R, moment), cross(p, force)))
    put(w, o + 3, force)
    _modes(h, f, w, k, R, p, a, alpha, omega)
    _stiffness(h, f, w, k)


@kernel
def _spatial(w, o, mass, p, c, J):
    """Store a spatial inertia; c, J: first moment and inertia about p, world axes."""
    w[index(o)] = mass
    put(w, o + 1, add(scale(mass, p), c))
    square = mass * dot(p, p) + 2.0 * dot(p, c)
    for k in range(3):
        w[index(o + 4 + k)] = J[k] + square - mass * p[k] * p[k] - 2.0 * p[k] * c[k]
    w[index(o + 7)] = J[3] - mass * p[0] * p[1] - p[0] * c[1] - p[1] * c[0]
    w[index(o + 8)] = J[4] - mass * p[0] * p[2] - p[0] * c[2] - p[2] * c[0]
    w[index(o + 9)] = J[5] - mass * p[1] * p[2] - p[1] * c[2] - p[2] * c[1]


@kernel
def _modes(h, f, w, k, R, p, a, alpha, omega):
    """Inertial forces on the modes, and the momentum that each mode's rate carries."""
    n, _, _, data = _places(h, k)
    c0, P = flex(h, k, FLEX_C0), h[MODAL]
    V = P + 9 * n
    x, y, z = omega
    xx, yy, zz = y * y + z * z, x * x + z * z, x * x + y * y
    for j in range(n):
        C = (f[index(data + j)], f[index(data + n + j)], f[index(data + 2 * n + j)])
        angular = _spin(w, P, n, j)
        centrifugal = x * y * (w[index(P + n + j)] + w[index(P + 3 * n + j)]) + x * z * (
            w[index(P + 2 * n + j)] + w[index(P + 6 * n + j)]
        )
        centrifugal += y * z * (w[index(P + 5 * n + j)] + w[index(P + 7 * n + j)])
        centrifugal -= xx * w[index(P + j)] + yy * w[index(P + 4 * n + j)] + zz * w[index(P + 8 * n + j)]
        coriolis = 2.0 * dot(_spin(w, V, n, j), omega)
        w[index(h[MODAL_BIAS] + c0 + j)] = dot(C, a) + dot(angular, alpha) + centrifugal + coriolis
        linear = turn(R, C)
        o = momentum(h, c0 + j)
        put(w, o, add(turn(R, angular), cross(p, linear)))
        put(w, o + 3, linear)
    if flex(h, k, FLEX_INBOARD):
        _carried(h, w, k)


@kernel
def _carried(h, w, k):
    """Modes that also move the body frame: their columns carry the body's own wrench and inertia."""
    i, c0 = flex(h, k, FLEX_LINK), flex(h, k, FLEX_C0)
    own = h[OWN] + INERTIA_SIZE * i
    c, J = at(w, own + 1), at6(w, own + 4)
    for j in range(c0, c0 + flex(h, k, N_MODES)):
        s, o = column(h, j), momentum(h, j)
        w[index(h[MODAL_BIAS] + j)] += dot6(w, s, w, wrench(h, i))
        omega, v = at(w, s), at(w, s + 3)
        # momentum of the deformation alone stays for the mass matrix
        for e in range(6):
            w[index(h[DEFORMATION] + 6 * j + e)] = w[index(o + e)]
        accumulate(w, o, add(turn_symmetric(J, omega), cross(c, v)))
        accumulate(w, o + 3, add(scale(w[index(own)], v), cross(omega, c)))


@kernel
def _stiffness(h, f, w, k):
    """Elastic and damping forces join the modal forces; the power lost to damping joins the ledger."""
    n, x, u, data = _places(h, k)
    K = data + 12 * n + n * n
    bias, rate = h[MODAL_BIAS] + flex(h, k, FLEX_C0), h[POSITION_RATE] + flex(h, k, FLEX_Q0)
    for j in range(n):
        speed = w[index(u + j)]
        damping = f[index(K + n + j)] * speed
        w[index(bias + j)] += f[index(K + j)] * w[index(x + j)] + damping
        w[index(rate + j)] = speed
        w[h[LEDGER_RATE] + MODAL_LOSS] += damping * speed


@kernel
def mass_matrix(h, f, w, k):
    """Own part of the modal block of the mass matrix, into the envelope; right after `inertia`."""
    n, _, _, data = _places(h, k)
    c0, moves = flex(h, k, FLEX_C0), flex(h, k, FLEX_INBOARD)
    for i in range(n):
        e = h[ENVELOPE] + 2 * (c0 + i)
        start = h[MASS] + h[index(e + 1)] - h[index(e)] + c0
        for j in range(i + 1):
            value = f[index(data + 12 * n + i * n + j)]
            if moves:
                value += dot6(w, momentum(h, c0 + i), w, column(h, c0 + j))
                value += dot6(w, column(h, c0 + i), w, h[DEFORMATION] + 6 * (c0 + j))
            w[index(start + j)] += value


@kernel
def modal_inertia(h, f, w, k):
    """Add what the modal accelerations in DU demand to the wrench on the body's link (after `inertia`)."""
    n, _, _, data = _places(h, k)
    i, du, P = flex(h, k, FLEX_LINK), h[DU] + flex(h, k, FLEX_C0), h[MODAL]
    invariants(h, f, w, k)
    frame = link_frame(h, i)
    R, p = at9(w, frame + AXES), at(w, frame + ORIGIN)
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(n):
        force = add(
            force, scale(w[index(du + j)], (f[index(data + j)], f[index(data + n + j)], f[index(data + 2 * n + j)]))
        )
        moment = add(moment, scale(w[index(du + j)], _spin(w, P, n, j)))
    force = turn(R, force)
    accumulate(w, wrench(h, i), add(turn(R, moment), cross(p, force)))
    accumulate(w, wrench(h, i) + 3, force)


@kernel
def energies(h, f, w, k):
    """Kinetic and elastic energy [J] of flexible body k."""
    n, x, u, data = _places(h, k)
    invariants(h, f, w, k)
    first, first_rate = _sums(h, f, w, k)
    frame, P = link_frame(h, flex(h, k, FLEX_LINK)), h[MODAL]
    R = at9(w, frame + AXES)
    omega, v = turn_back(R, at(w, frame + OMEGA)), turn_back(R, at(w, frame + VELOCITY))
    kinetic = 0.5 * f[index(h[FLEX_NUMBERS] + 13 * k)] * dot(v, v) + dot(v, add(cross(omega, first), first_rate))
    kinetic += 0.5 * dot(omega, turn_symmetric(_tensor(w, h[SCRATCH]), omega))
    elastic, M = 0.0, data + 12 * n
    K = M + n * n
    for i in range(n):
        kinetic += dot(omega, _spin(w, P, n, i)) * w[index(u + i)]
        elastic += 0.5 * f[index(K + i)] * w[index(x + i)] ** 2
        for j in range(n):
            kinetic += 0.5 * f[index(M + i * n + j)] * w[index(u + i)] * w[index(u + j)]
    return kinetic, elastic
