r"""Friction of ideal joints from their reactions.

The load of a bearing causes friction, and friction changes the load. At a given state every reaction is affine
in the normal forces N of all bearings, since sliding velocities, and hence friction per normal force, are known:

.. math:: R_j = R_{j0} + \sum_k N_k R_{jk}, \qquad N_e = g_e(R_{j(e)})

R_j0 comes from the solution without friction, R_jk from one more solution per bearing with the same factors. The loads
g_e are sums of magnitudes of forces, so Newton's method on these few equations ends after some steps, exactly. Where
the determinant of their slopes is positive, the solution is the one that grows out of that without friction; where it
has become zero on the way, none or several exist: friction jams the mechanism (Painleve's paradox), and the
evaluation returns this status.

A bearing is a pin, a slider, both (kinds 0, 1, 2), or a ball (3). With the axis n, the force F and the moment M about
the second frame's origin that the joint transmits, and its length L,

.. math:: N = |F_\perp/2 - n\times M/L| + |F_\perp/2 + n\times M/L| + a|n\cdot F| + b|n\cdot M| + N_0

for the first three, and N = |F| + N_0 for a ball: two ends of a pin or slider, a collar (a: its radius over that of the
pin), pads that hold moments about the axis (b: one over their arm), and a preload. Friction of a ball acts
against its rotation, for any direction of the load. The whole wrench of the joint, with its friction, counts as load,
as is usual (a friction circle of radius mu r instead of r sin(atan mu)).

Source: Haug, Wu & Yang (1986), Mechanism and Machine Theory 21, 401-425 (friction in joints, and that it depends on the
reactions); Leine, Brogliato & Nijmeijer (2002), European Journal of Mechanics A/Solids 21, 869-896 (when not at all).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.choice import choose, nothing, repeat
from flexclear.dynamics.effects.joint_friction import BALL, PIN, SLIDER
from flexclear.dynamics.equations.closures import closure_wrench, respond
from flexclear.dynamics.gauge import relative_twist
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    at,
    axis,
    cross,
    dot,
    put,
    scale,
    sub,
    turn,
    turn_back,
)

#: largest number of Newton iterations for the loads; their change, as a fraction of the largest load, at which they
#: end; the change below which they end when it stops shrinking, near a jam, where rounding grows; the number of strides
#: in which friction is increased where they do not converge
ITERATIONS, CONVERGED, ROUNDED, STRIDES = 30, 1e-13, 1e-9, 32
#: outcome of one iteration for the loads
GOES_ON, FOUND, FAILED = 0, 1, 2
#: pivots of the slopes count as zero below this fraction of their diagonal
SINGULAR_SLOPES = 1e-12


@kernel
def bearing_frame(d, e):
    """Return the frame that carries the axis of bearing e."""
    bearing = d.bearings[e]
    joint = d.rubbing[bearing.joint]
    return d.site_frames[joint.site_a if bearing.side == 0 else joint.site_b]


@kernel
def bearing_axis(d, e):
    """Return the unit vector along bearing e, world axes."""
    return axis(bearing_frame(d, e).axes, d.bearings[e].axis)


def make_unit_wrench(traction: Callable) -> Callable:
    """Build the kernel unit_wrench(d, e) that writes BEARING: friction of bearing e per normal force."""

    @kernel
    def unit_wrench(d, e):
        bearing, numbers, now = d.bearings[e], d.bearing_numbers[e], d.bearing[e]
        joint, kind, radius, along = d.rubbing[bearing.joint], bearing.kind, numbers.radius, bearing_axis(d, e)
        a, b = d.site_frames[joint.site_a], d.site_frames[joint.site_b]
        turning, sliding = relative_twist(a, b)
        axes = a.axes
        if kind == BALL:
            slip = turn_back(axes, scale(radius, turning))
        else:
            forth = dot(along, sliding) if kind != PIN else 0.0
            slip = (forth, radius * dot(along, turning) if kind != SLIDER else 0.0, 0.0)
        z = ZERO
        if bearing.bristle >= 0:
            z = at(d.w, d.state + bearing.bristle)
        force, _, _, z_rate = traction(bearing.law, z, slip, 1.0, numbers.law)
        if bearing.bristle >= 0:
            put(d.ledger_rate, bearing.bristle - d.nq - d.nv, z_rate)
        push, moment = ZERO, ZERO
        if kind == BALL:
            moment = scale(radius, turn(axes, force))
        else:
            push = scale(force[0], along)
            moment = add(scale(radius * force[1], along), cross(b.origin, push))
        bends = d.bends[e]
        bends.sliding, now.unit_moment, now.unit_force = slip, moment, push
        now.slip, now.loss = np.sqrt(dot(slip, slip)), -dot(force, slip)

    return unit_wrench


@kernel
def keep_closed(d):
    """Keep loops closed: complete FORCE, which holds L^-1 f, by multipliers."""
    for k in range(d.n_kept_rows):
        d.multiplier[k] = 0.0
    respond(d)


@kernel
def unit_power(bearing, column):
    """Return the friction of a bearing (BEARING) per normal force, along a column."""
    return dot(bearing.unit_moment, column.angular) + dot(bearing.unit_force, column.linear)


@kernel
def load_coordinates(d, e, size):
    """Add the generalised forces of the friction of bearing e, at the normal force `size`, to FORCE."""
    joint = d.rubbing[d.bearings[e].joint]
    for k in range(joint.entry0, joint.entry0 + joint.n_entries):
        entry = d.rubbing_entries[k]
        value = size * entry.sign * unit_power(d.bearing[e], d.columns[entry.column])
        if entry.coordinate < d.nv:
            d.force[entry.coordinate] += value


def make_reaction(demand: Callable) -> Callable:
    """Build the kernel reaction(d, j, acceleration, bearing) that writes the reaction of joint j to REACTIONS.

    It takes the accelerations in w from index `acceleration` and the present multipliers.  bearing: -1 for the reaction
    without friction, else the friction of that bearing alone, at unit normal force.  demand: of the mass matrix module.
    """

    @kernel
    def reaction(d, j, acceleration, bearing):
        joint = d.rubbing[j]
        rubbed = d.rubbing[d.bearings[bearing].joint].closure if bearing >= 0 else -1
        if joint.closure >= 0:
            moment, force = closure_wrench(d, joint.closure, 0)
            if rubbed == joint.closure:
                moment = add(moment, d.bearing[bearing].unit_moment)
                force = add(force, d.bearing[bearing].unit_force)
        else:
            moment, force = demand(d, j, acceleration, 1.0 if bearing < 0 else 0.0)
            for k in range(joint.loop0, joint.loop0 + joint.n_loops):
                loop = d.reaction_loops[k]
                sign, (around, along) = -1.0 * loop.sign, closure_wrench(d, loop.closure, loop.part)
                if rubbed == loop.closure and loop.part == 0:
                    around = add(around, d.bearing[bearing].unit_moment)
                    along = add(along, d.bearing[bearing].unit_force)
                moment, force = add(moment, scale(sign, around)), add(force, scale(sign, along))
            if joint.reversed:
                moment, force = scale(-1.0, moment), scale(-1.0, force)
        reacted = d.reactions[j * (1 + d.n_bearings) + 1 + bearing]
        reacted.moment, reacted.force = sub(moment, cross(d.site_frames[joint.site_b].origin, force)), force

    return reaction


@kernel
def _sized(v):
    """Return the magnitude of v and the unit vector along v, zero where v is zero."""
    size = np.sqrt(dot(v, v))
    return size, scale(1.0 / size if size > 0.0 else 0.0, v)


@kernel
def note_bends(d, e, along, about, one_end, other_end):
    """Store the load components of bearing e in BENDS; the forces at its ends by their components across the axis."""
    bends, axes, k = d.bends[e], bearing_frame(d, e).axes, d.bearings[e].axis
    one, other = axis(axes, (k + 1) % 3), axis(axes, (k + 2) % 3)
    bends.along, bends.about = along, about
    bends.one_end[0], bends.one_end[1] = dot(one, one_end), dot(other, one_end)
    bends.other_end[0], bends.other_end[1] = dot(one, other_end), dot(other, other_end)


@kernel
def load(d, e, M, F):
    """Return the normal force of bearing e for the wrench of its joint, and its gradients by M and F."""
    numbers = d.bearing_numbers[e]
    if d.bearings[e].kind == BALL:
        size, along_F = _sized(F)
        return size + numbers.preload, ZERO, along_F
    n, lever, axial, torsion = bearing_axis(d, e), numbers.lever, numbers.axial, numbers.torsion
    along, about = dot(n, F), dot(n, M)
    half, tilt = scale(0.5, sub(F, scale(along, n))), scale(lever, cross(n, M))
    near, at_near = _sized(sub(half, tilt))
    far, at_far = _sized(add(half, tilt))
    note_bends(d, e, axial * along, torsion * about, sub(half, tilt), add(half, tilt))
    size = near + far + axial * abs(along) + torsion * abs(about) + numbers.preload
    by_M = scale(lever, cross(sub(at_far, at_near), n))
    by_M = add(by_M, scale(torsion if about >= 0.0 else -torsion, n))
    # the forces at both ends are across the axis
    by_F = add(scale(0.5, add(at_near, at_far)), scale(axial if along >= 0.0 else -axial, n))
    return size, by_M, by_F


@kernel
def balance(d, share):
    """Store residuals and slopes of the bearings' loads, for a fraction of the friction's effect on the reactions."""
    bearings = d.n_bearings
    for e in range(bearings):
        first = d.bearings[e].joint * (1 + bearings)
        M, F = d.reactions[first].moment, d.reactions[first].force
        for k in range(bearings):
            part, size = d.reactions[first + 1 + k], share * d.bearing[k].load
            M, F = add(M, scale(size, part.moment)), add(F, scale(size, part.force))
        value, by_M, by_F = load(d, e, M, F)
        row = bearings * e
        for k in range(bearings):
            part = d.reactions[first + 1 + k]
            d.bearing_slopes[row + k] = -share * (dot(by_M, part.moment) + dot(by_F, part.force))
        d.bearing_slopes[row + e] += 1.0
        d.bearing_residuals[e] = d.bearing[e].load - value


@kernel
def pivot_up(A, b, k, i, size):
    """Exchange rows k and i of A x = b if the pivot of row i is larger; return the factor, 1 or -1, of det A."""
    if not abs(A[size * i + k]) > abs(A[size * k + k]):
        return 1.0
    for j in range(k, size):
        A[size * k + j], A[size * i + j] = A[size * i + j], A[size * k + j]
    b[k], b[i] = b[i], b[k]
    return -1.0


@kernel
def sign_of(pivot):
    """Return the sign of a pivot, 0 where the pivot counts as zero."""
    if not abs(pivot) > SINGULAR_SLOPES:
        return 0.0
    return 1.0 if pivot > 0.0 else -1.0


@kernel
def eliminate(A, b, size):
    """Solve A x = b in place (Gauss, partial pivoting); return the sign of det A, 0 (no solution) for a singular A."""
    sign = 1.0
    for k in range(size):
        for i in range(k + 1, size):
            sign *= pivot_up(A, b, k, i, size)
        pivot = A[size * k + k]
        sign *= sign_of(pivot)
        for i in range(k + 1, size):
            factor = A[size * i + k] / pivot
            for j in range(k + 1, size):
                A[size * i + j] -= factor * A[size * k + j]
            b[i] -= factor * b[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            b[k] -= A[size * k + j] * b[j]
        b[k] /= A[size * k + k]
    return sign


@kernel
def verdict(sign, change, largest, before, turns):
    """Return the outcome of a Newton iteration: `GOES_ON`, `FOUND`, or `FAILED`."""
    if sign == 0.0 or not largest < np.inf:
        return FAILED
    if change <= CONVERGED * largest or (change <= ROUNDED * largest and change > 0.5 * before):
        return FOUND if sign > 0.0 else FAILED
    return GOES_ON if turns < ITERATIONS else FAILED


@kernel
def correct(d):
    """Do one Newton iteration for the loads from their present values, and return its outcome."""
    size, search = d.n_bearings, d.search[0]
    balance(d, search.share)
    sign = eliminate(d.bearing_slopes, d.bearing_residuals, size)
    change, largest = 0.0, 0.0
    for e in range(size):
        bearing, correction = d.bearing[e], d.bearing_residuals[e]
        bearing.load -= correction
        change, largest = max(change, abs(correction)), max(largest, abs(bearing.load))
    search.turns += 1.0
    made = verdict(sign, change, largest, search.change, search.turns)
    search.change = change
    return made


@kernel
def begin(d, share):
    """Start the search for the loads with a fraction of the friction."""
    search = d.search[0]
    search.share, search.turns, search.change = share, 0.0, np.inf


@kernel
def pursue(d):
    """Do one iteration of the search for the loads; return True while another one is needed. Where the search fails
    with full friction, it increases friction in strides."""
    made, search = correct(d), d.search[0]
    if made == GOES_ON:
        return True
    if made == FOUND:
        begin(d, search.share + 1.0 / STRIDES)
        return search.share <= 1.0
    if search.strides > 0.0:
        d.evaluation = m.JAMMED
        return False
    search.strides = 1.0
    without_feedback(d)
    begin(d, 1.0 / STRIDES)
    return True


@kernel
def without_feedback(d):
    """Store the loads of the bearings from the reactions without friction."""
    for e in range(d.n_bearings):
        bearing, smooth = d.bearing[e], d.reactions[d.bearings[e].joint * (1 + d.n_bearings)]
        bearing.load, _, _ = load(d, e, smooth.moment, smooth.force)


@kernel
def find_loads(d):
    """Find the loads of all bearings; set `JAMMED` where friction jams the joints."""
    without_feedback(d)
    d.search[0].strides = 0.0
    begin(d, 1.0)
    repeat(pursue, d)


def make_joint_friction(laws: tuple[Any, ...], closed: bool, tree: Any) -> Callable:
    """Build joint_friction(d): it completes accelerations, multipliers and ledger by friction in joints.

    It runs after accelerations and multipliers and before the drives' forces.  laws: modules of the laws present
    (`contact.friction`).  closed: True with closures.  tree: `equations.articulated`.
    """
    unit_wrench = make_unit_wrench(choose(tuple(law.traction for law in laws)))
    forward, backward = tree.forward, tree.backward
    close, transmit, reaction = keep_closed if closed else nothing, tree.transmit, make_reaction(tree.demand)

    @kernel
    def solve(d):
        """Store accelerations in FORCE from the generalised forces there, with their multipliers."""
        forward(d, d.at_force)
        close(d)
        backward(d, d.at_force)

    @kernel
    def influences(d):
        """Store reactions of all joints: of the present accelerations, then of the friction of each bearing alone."""
        transmit(d, d.at_du, 1.0)
        for j in range(d.n_rubbing):
            reaction(d, j, d.at_du, -1)
        for k in range(d.n_kept_rows):
            d.smooth_multiplier[k] = d.multiplier[k]
        for e in range(d.n_bearings):
            for k in range(d.nv):
                d.force[k] = 0.0
            load_coordinates(d, e, 1.0)
            solve(d)
            transmit(d, d.at_force, 0.0)
            for j in range(d.n_rubbing):
                reaction(d, j, d.at_force, e)

    @kernel
    def joint_friction(d):
        if d.evaluation != m.OK:
            return
        for e in range(d.n_bearings):
            unit_wrench(d, e)
        influences(d)
        find_loads(d)
        if d.evaluation != m.OK:
            return
        for k in range(d.nv):
            d.force[k] = 0.0
        for e in range(d.n_bearings):
            bearing = d.bearing[e]
            load_coordinates(d, e, bearing.load)
            d.ledger_rate[d.joint_friction_slot + d.bearings[e].joint] += bearing.load * bearing.loss
        solve(d)
        for k in range(d.nv):
            d.du[k] += d.force[k]
        for k in range(d.n_kept_rows):
            d.multiplier[k] += d.smooth_multiplier[k]

    return joint_friction


@kernel
def load_drives(d):
    """Subtract friction from the forces that the drives must supply: they work against it."""
    for j in range(d.n_rubbing):
        joint = d.rubbing[j]
        for k in range(joint.entry0, joint.entry0 + joint.n_entries):
            entry = d.rubbing_entries[k]
            drive = entry.coordinate - d.nv
            if drive < 0:
                continue
            for e in range(joint.bearing0, joint.bearing0 + joint.n_bearings):
                bearing = d.bearing[e]
                d.drive_force[drive] -= entry.sign * bearing.load * unit_power(bearing, d.columns[entry.column])
