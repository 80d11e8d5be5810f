r"""Friction of ideal joints that follows their reactions.

What a bearing carries makes friction, and friction changes what it carries. At a given state every reaction is affine
in the normal forces N of all bearings, since sliding velocities, and hence friction per normal force, are known:

.. math:: R_j = R_{j0} + \sum_k N_k R_{jk}, \qquad N_e = g_e(R_{j(e)})

R_j0 comes from the solution without friction, R_jk from one more solution per bearing with the same factors. The loads
g_e are sums of magnitudes of forces, so Newton's method on these few equations ends after some steps, exactly. Where
the determinant of their slopes is positive, the solution is the one that grows out of that without friction; where it
has become zero on the way there is none, or more than one: friction jams the mechanism (Painleve's paradox), and the
evaluation says so.

A bearing is a pin, a slider, both (kinds 0, 1, 2), or a ball (3). With the axis n, the force F and the moment M about
the second frame's origin that the joint carries, and its length L,

.. math:: N = |F_\perp/2 - n\times M/L| + |F_\perp/2 + n\times M/L| + a|n\cdot F| + b|n\cdot M| + N_0

for the first three, and N = |F| + N_0 for a ball: two ends of a pin or slider, a collar (a: its radius over that of the
pin), pads that hold moments about the axis (b: one over their arm), and what presses always. Friction of a ball acts
against its turning, whatever the direction of the load. What the joint carries counts as pressed, friction included,
as is usual (a friction circle of radius mu r instead of r sin(atan mu)).

Source: Haug, Wu & Yang (1986), Mechanism and Machine Theory 21, 401-425 (friction in joints, and that it depends on the
reactions); Leine, Brogliato & Nijmeijer (2002), European Journal of Mechanics A/Solids 21, 869-896 (when not at all).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.choice import choose
from flexclear.pipeline.dynamics.equations.closures import respond
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.joints.bearings import BALL, PIN, SLIDER
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import (
    ZERO,
    accumulate,
    add,
    at,
    at9,
    axis,
    cross,
    dot,
    dot6,
    put,
    scale,
    sub,
    turn,
    turn_back,
)

#: Newton's iterations for the loads; the change of a load, as share of the largest, at which they end, and below which
#: they end when it shrinks no more, near a jam, where rounding grows; in how many strides friction is turned on where
#: they do not
ITERATIONS, CONVERGED, ROUNDED, STRIDES = 30, 1e-13, 1e-9, 32
#: below this share of their diagonal pivots of the slopes count as zero
SINGULAR_SLOPES = 1e-12


@kernel
def bearing_axis(h, w, e):
    """Unit vector along bearing e, world axes."""
    j = m.BEARINGS.joint(h, e)
    site = m.RUBBING.site_a(h, j) if m.BEARINGS.side(h, e) == 0 else m.RUBBING.site_b(h, j)
    return axis(at9(w, m.SITE_FRAMES.row(h, site) + m.FRAME.axes), m.BEARINGS.axis(h, e))


@kernel
def relative_twist(h, w, j):
    """Angular velocity of the second frame of joint j against the first, and velocity of its origin there."""
    a, b = m.SITE_FRAMES.row(h, m.RUBBING.site_a(h, j)), m.SITE_FRAMES.row(h, m.RUBBING.site_b(h, j))
    omega, r = at(w, a + m.FRAME.omega), sub(at(w, b + m.FRAME.origin), at(w, a + m.FRAME.origin))
    slide = sub(at(w, b + m.FRAME.velocity), add(at(w, a + m.FRAME.velocity), cross(omega, r)))
    return sub(at(w, b + m.FRAME.omega), omega), slide


def make_unit_wrench(traction: Callable) -> Callable:
    """The kernel unit_wrench(h, f, w, n, e) that writes BEARING: friction of bearing e per normal force."""

    @kernel
    def unit_wrench(h, f, w, n, e):
        o, numbers, j = m.BEARING.row(h, e), m.BEARING_NUMBERS.row(h, e), m.BEARINGS.joint(h, e)
        kind, radius, along = m.BEARINGS.kind(h, e), f[numbers + m.BEARING_NUMBERS.radius], bearing_axis(h, w, e)
        turning, sliding = relative_twist(h, w, j)
        a, b = m.SITE_FRAMES.row(h, m.RUBBING.site_a(h, j)), m.SITE_FRAMES.row(h, m.RUBBING.site_b(h, j))
        axes = at9(w, a + m.FRAME.axes)
        if kind == BALL:
            slip = turn_back(axes, scale(radius, turning))
        else:
            forth = dot(along, sliding) if kind != PIN else 0.0
            slip = (forth, radius * dot(along, turning) if kind != SLIDER else 0.0, 0.0)
        place, z = m.BEARINGS.bristle(h, e), ZERO
        if place >= 0:
            z = at(w, n[m.STATE] + place)
        p = numbers + m.BEARING_NUMBERS.law
        law = (f[p], f[p + 1], f[p + 2], f[p + 3], f[p + 4], f[p + 5])
        force, _, _, z_rate = traction(m.BEARINGS.law(h, e), z, slip, 1.0, law)
        if place >= 0:
            put(w, h[m.LEDGER_RATE] + place - h[m.NQ] - h[m.NV], z_rate)
        push, moment = ZERO, ZERO
        if kind == BALL:
            moment = scale(radius, turn(axes, force))
        else:
            push = scale(force[0], along)
            moment = add(scale(radius * force[1], along), cross(at(w, b + m.FRAME.origin), push))
        put(w, m.BENDS.row(h, e) + m.BENDS.sliding, slip)
        put(w, o + m.BEARING.unit_moment, moment)
        put(w, o + m.BEARING.unit_force, push)
        w[o + m.BEARING.slip], w[o + m.BEARING.loss] = np.sqrt(dot(slip, slip)), -dot(force, slip)

    return unit_wrench


@kernel
def no_loops(h, w):
    """No loop is closed."""


@kernel
def keep_closed(h, w):
    """Let loops stay closed: complete FORCE, which holds L^-1 f, by multipliers."""
    for k in range(h[m.N_KEPT_ROWS]):
        w[h[m.MULTIPLIER] + k] = 0.0
    respond(h, w)


@kernel
def load_coordinates(h, w, e, size):
    """Add the generalised forces of the friction of bearing e, at the normal force `size`, to FORCE."""
    j, o = m.BEARINGS.joint(h, e), m.BEARING.row(h, e) + m.BEARING.unit_moment
    first = m.RUBBING.entry0(h, j)
    for k in range(first, first + m.RUBBING.n_entries(h, j)):
        c, col = m.RUBBING_ENTRIES.coordinate(h, k), m.COLUMNS.row(h, m.RUBBING_ENTRIES.column(h, k))
        value = size * m.RUBBING_ENTRIES.sign(h, k) * dot6(w, o, w, col)
        if c < h[m.NV]:
            w[h[m.FORCE] + c] += value


@kernel
def closure_wrench(h, w, c, part):
    """Wrench of closure c on its second body, or of a coupling on its first joint (part 1)."""
    moment, force = ZERO, ZERO
    o = m.ROWS.row(h, m.CLOSURES.row0(h, c))
    if part == 1:
        o = m.ROWS.row(h, h[m.N_CLOSURE_ROWS] + m.CLOSURES.coupling(h, c))
    for k in range(m.CLOSURES.n_kept(h, c)):
        size = w[h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c) + k]
        moment, force = add(moment, scale(size, at(w, o + 6 * k))), add(force, scale(size, at(w, o + 6 * k + 3)))
    return moment, force


def make_reaction(demand: Callable) -> Callable:
    """The kernel reaction(d, j, acceleration, bearing) that writes the reaction of joint j to REACTIONS.

    At the accelerations in w from index `acceleration` and the present multipliers.  bearing: -1 for all but friction,
    else the friction alone of that bearing, of unit normal force.  demand: of what factors the mass matrix.
    """

    @kernel
    def reaction(d, j, acceleration, bearing):
        h, w = d.h, d.w
        closure = m.RUBBING.closure(h, j)
        rubbed = m.RUBBING.closure(h, m.BEARINGS.joint(h, bearing)) if bearing >= 0 else -1
        if closure >= 0:
            moment, force = closure_wrench(h, w, closure, 0)
            if rubbed == closure:
                o = m.BEARING.row(h, bearing)
                moment = add(moment, at(w, o + m.BEARING.unit_moment))
                force = add(force, at(w, o + m.BEARING.unit_force))
        else:
            moment, force = demand(d, j, acceleration, 1.0 if bearing < 0 else 0.0)
            first = m.RUBBING.loop0(h, j)
            for k in range(first, first + m.RUBBING.n_loops(h, j)):
                c, part = m.REACTION_LOOPS.closure(h, k), m.REACTION_LOOPS.part(h, k)
                sign, (around, along) = -1.0 * m.REACTION_LOOPS.sign(h, k), closure_wrench(h, w, c, part)
                if rubbed == c and part == 0:
                    o = m.BEARING.row(h, bearing)
                    around = add(around, at(w, o + m.BEARING.unit_moment))
                    along = add(along, at(w, o + m.BEARING.unit_force))
                moment, force = add(moment, scale(sign, around)), add(force, scale(sign, along))
            if m.RUBBING.reversed(h, j):
                moment, force = scale(-1.0, moment), scale(-1.0, force)
        middle = at(w, m.SITE_FRAMES.row(h, m.RUBBING.site_b(h, j)) + m.FRAME.origin)
        o = m.REACTIONS.row(h, j * (1 + h[m.N_BEARINGS]) + 1 + bearing)
        put(w, o, sub(moment, cross(middle, force)))
        put(w, o + 3, force)

    return reaction


@kernel
def _sized(v):
    """Magnitude of v, and the unit vector along it, zero where v is."""
    size = np.sqrt(dot(v, v))
    return size, scale(1.0 / size if size > 0.0 else 0.0, v)


@kernel
def note_bends(h, w, e, along, about, one_end, other_end):
    """Write what bearing e carries to BENDS; forces at its ends by their components across the axis."""
    o, j, k = m.BENDS.row(h, e), m.BEARINGS.joint(h, e), m.BEARINGS.axis(h, e)
    site = m.RUBBING.site_a(h, j) if m.BEARINGS.side(h, e) == 0 else m.RUBBING.site_b(h, j)
    axes = at9(w, m.SITE_FRAMES.row(h, site) + m.FRAME.axes)
    one, other = axis(axes, (k + 1) % 3), axis(axes, (k + 2) % 3)
    w[o + m.BENDS.along], w[o + m.BENDS.about] = along, about
    w[o + m.BENDS.one_end], w[o + m.BENDS.one_end + 1] = dot(one, one_end), dot(other, one_end)
    w[o + m.BENDS.other_end], w[o + m.BENDS.other_end + 1] = dot(one, other_end), dot(other, other_end)


@kernel
def load(h, f, w, e, M, F):
    """Normal force of bearing e for what its joint carries, and its gradients by M and F."""
    o = m.BEARING_NUMBERS.row(h, e)
    preload = f[o + m.BEARING_NUMBERS.preload]
    if m.BEARINGS.kind(h, e) == BALL:
        size, along_F = _sized(F)
        return size + preload, ZERO, along_F
    n, lever = bearing_axis(h, w, e), f[o + m.BEARING_NUMBERS.lever]
    along, about = dot(n, F), dot(n, M)
    half, tilt = scale(0.5, sub(F, scale(along, n))), scale(lever, cross(n, M))
    near, at_near = _sized(sub(half, tilt))
    far, at_far = _sized(add(half, tilt))
    axial, torsion = f[o + m.BEARING_NUMBERS.axial], f[o + m.BEARING_NUMBERS.torsion]
    note_bends(h, w, e, axial * along, torsion * about, sub(half, tilt), add(half, tilt))
    size = near + far + axial * abs(along) + torsion * abs(about) + preload
    by_M = scale(lever, cross(sub(at_far, at_near), n))
    by_M = add(by_M, scale(torsion if about >= 0.0 else -torsion, n))
    # both ends' forces lie across the axis
    by_F = add(scale(0.5, add(at_near, at_far)), scale(axial if along >= 0.0 else -axial, n))
    return size, by_M, by_F


@kernel
def balance(h, f, w, share):
    """Residuals of the bearings' loads, and their slopes, with a share of the friction's influence on the reactions."""
    bearings = h[m.N_BEARINGS]
    for e in range(bearings):
        first = m.REACTIONS.row(h, m.BEARINGS.joint(h, e) * (1 + bearings))
        M, F = at(w, first), at(w, first + 3)
        for k in range(bearings):
            o, size = first + 6 * (1 + k), share * w[m.BEARING.row(h, k)]
            M, F = add(M, scale(size, at(w, o))), add(F, scale(size, at(w, o + 3)))
        value, by_M, by_F = load(h, f, w, e, M, F)
        row = h[m.BEARING_SLOPES] + bearings * e
        for k in range(bearings):
            o = first + 6 * (1 + k)
            w[row + k] = -share * (dot(by_M, at(w, o)) + dot(by_F, at(w, o + 3)))
        w[row + e] += 1.0
        w[h[m.BEARING_RESIDUALS] + e] = w[m.BEARING.row(h, e)] - value


@kernel
def eliminate(w, A, b, size):
    """Solve A x = b in place (Gauss, partial pivoting); the sign of the determinant of A, 0 where it is singular."""
    sign = 1.0
    for k in range(size):
        p = k
        for i in range(k + 1, size):
            if abs(w[A + size * i + k]) > abs(w[A + size * p + k]):
                p = i
        if not abs(w[A + size * p + k]) > SINGULAR_SLOPES:
            return 0.0
        if p != k:
            sign = -sign
            for j in range(size):
                w[A + size * k + j], w[A + size * p + j] = w[A + size * p + j], w[A + size * k + j]
            w[b + k], w[b + p] = w[b + p], w[b + k]
        pivot = w[A + size * k + k]
        if pivot < 0.0:
            sign = -sign
        for i in range(k + 1, size):
            factor = w[A + size * i + k] / pivot
            for j in range(k, size):
                w[A + size * i + j] -= factor * w[A + size * k + j]
            w[b + i] -= factor * w[b + k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            w[b + k] -= w[A + size * k + j] * w[b + j]
        w[b + k] /= w[A + size * k + k]
    return sign


@kernel
def iterate(h, f, w, share):
    """Newton's method for the loads from those that are there; whether it finds the solution that friction grows to."""
    size, A, b, before = h[m.N_BEARINGS], h[m.BEARING_SLOPES], h[m.BEARING_RESIDUALS], np.inf
    for _ in range(ITERATIONS):
        balance(h, f, w, share)
        sign = eliminate(w, A, b, size)
        if sign == 0.0:
            return False
        change, largest = 0.0, 0.0
        for e in range(size):
            w[m.BEARING.row(h, e)] -= w[b + e]
            change, largest = max(change, abs(w[b + e])), max(largest, abs(w[m.BEARING.row(h, e)]))
        if not largest < np.inf:
            return False
        if change <= CONVERGED * largest or (change <= ROUNDED * largest and change > 0.5 * before):
            return sign > 0.0
        before = change
    return False


@kernel
def without_feedback(h, f, w):
    """Loads of the bearings from the reactions without friction."""
    bearings = h[m.N_BEARINGS]
    for e in range(bearings):
        o = m.REACTIONS.row(h, m.BEARINGS.joint(h, e) * (1 + bearings))
        value, _, _ = load(h, f, w, e, at(w, o), at(w, o + 3))
        w[m.BEARING.row(h, e)] = value


@kernel
def find_loads(h, f, w):
    """Loads of all bearings; False where friction jams the joints."""
    without_feedback(h, f, w)
    if iterate(h, f, w, 1.0):
        return True
    without_feedback(h, f, w)
    found = True
    for k in range(1, STRIDES + 1):
        found = found and iterate(h, f, w, k / STRIDES)
    return found


def make_joint_friction(tractions: tuple[Callable, ...], closed: bool, tree: Any) -> Callable:
    """The kernel joint_friction(h, f, w, n): accelerations, multipliers and ledger, completed by friction in joints.

    To be called when accelerations and multipliers are there, before the drives' forces are.  tractions: kernels of the
    laws present (`contact.friction`).  closed: whether there are closures.  tree: what factors the mass matrix, the
    module `equations.articulated` or `equations.composite`.
    """
    unit_wrench, forward, backward = make_unit_wrench(choose(tractions)), tree.forward, tree.backward
    close, transmit, reaction = keep_closed if closed else no_loops, tree.transmit, make_reaction(tree.demand)

    @kernel
    def respond(d):
        """Accelerations in FORCE from the generalised forces there, and their multipliers."""
        forward(d, d.h[m.FORCE])
        close(d.h, d.w)
        backward(d, d.h[m.FORCE])

    @kernel
    def influences(h, f, w, n):
        """Reactions of all joints: of the present accelerations, then of the friction of each bearing alone."""
        transmit(data(h, f, w, n), h[m.DU], 1.0)
        for j in range(h[m.N_RUBBING]):
            reaction(data(h, f, w, n), j, h[m.DU], -1)
        for k in range(h[m.N_KEPT_ROWS]):
            w[h[m.SMOOTH_MULTIPLIER] + k] = w[h[m.MULTIPLIER] + k]
        for e in range(h[m.N_BEARINGS]):
            for k in range(h[m.NV]):
                w[h[m.FORCE] + k] = 0.0
            load_coordinates(h, w, e, 1.0)
            respond(data(h, f, w, n))
            transmit(data(h, f, w, n), h[m.FORCE], 0.0)
            for j in range(h[m.N_RUBBING]):
                reaction(data(h, f, w, n), j, h[m.FORCE], e)

    @kernel
    def joint_friction(h, f, w, n):
        if n[m.EVALUATION] != m.OK:
            return
        for e in range(h[m.N_BEARINGS]):
            unit_wrench(h, f, w, n, e)
        influences(h, f, w, n)
        if not find_loads(h, f, w):
            n[m.EVALUATION] = m.JAMMED
            return
        for k in range(h[m.NV]):
            w[h[m.FORCE] + k] = 0.0
        for e in range(h[m.N_BEARINGS]):
            size = w[m.BEARING.row(h, e)]
            load_coordinates(h, w, e, size)
            slot = h[m.LEDGER_RATE] + h[m.RUBBING_SLOT] + m.BEARINGS.joint(h, e)
            w[slot] += size * w[m.BEARING.row(h, e) + m.BEARING.loss]
        respond(data(h, f, w, n))
        for k in range(h[m.NV]):
            w[h[m.DU] + k] += w[h[m.FORCE] + k]
        for k in range(h[m.N_KEPT_ROWS]):
            w[h[m.MULTIPLIER] + k] += w[h[m.SMOOTH_MULTIPLIER] + k]

    return joint_friction


@kernel
def load_drives(h, w):
    """Take friction out of the forces that the drives must supply: they work against it."""
    for j in range(h[m.N_RUBBING]):
        first = m.RUBBING.entry0(h, j)
        for k in range(first, first + m.RUBBING.n_entries(h, j)):
            d = m.RUBBING_ENTRIES.coordinate(h, k) - h[m.NV]
            if d < 0:
                continue
            sign, col = m.RUBBING_ENTRIES.sign(h, k), m.COLUMNS.row(h, m.RUBBING_ENTRIES.column(h, k))
            for e in range(m.RUBBING.bearing0(h, j), m.RUBBING.bearing0(h, j) + m.RUBBING.n_bearings(h, j)):
                o = m.BEARING.row(h, e)
                w[h[m.DRIVE_FORCE] + d] -= sign * w[o] * dot6(w, o + m.BEARING.unit_moment, w, col)


@kernel
def take_off_closures(h, w, out, column):
    """Add friction of joints that close loops to the wrenches of these in out[column:]; take it off their links."""
    for e in range(h[m.N_BEARINGS]):
        j = m.BEARINGS.joint(h, e)
        c, o = m.RUBBING.closure(h, j), m.BEARING.row(h, e)
        if c < 0:
            continue
        a = m.WRENCH.row(h, m.SITES.link(h, m.RUBBING.site_a(h, j)))
        b = m.WRENCH.row(h, m.SITES.link(h, m.RUBBING.site_b(h, j)))
        for half in range(0, 6, 3):
            part = scale(w[o], at(w, o + m.BEARING.unit_moment + half))
            accumulate(out, column + 6 * c + half, part)
            accumulate(w, b + half, scale(-1.0, part))
            accumulate(w, a + half, part)
