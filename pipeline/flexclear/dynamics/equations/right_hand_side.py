"""The right-hand side: accelerations of all coordinates, composed from the parts present.

Order: known motion, kinematics, inertia, contacts, then the tree from its leaves to the ground,
closures, accelerations, and the forces that the drives supply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.bodies import rigid
from flexclear.dynamics.bodies.rigid import FlexibleBodies, all_rigid
from flexclear.dynamics.choice import nothing
from flexclear.dynamics.equations.kinematics import make_kinematics
from flexclear.dynamics.equations.prescribed_motion import prescribe
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO


@kernel
def spread_state(d, y):
    """Copy positions, speeds and internal states from the state at index y, and set accelerations to zero."""
    for k in range(d.nq):
        d.x[k] = d.w[y + k]
    for k in range(d.nv):
        d.u[k] = d.w[y + d.nq + k]
        d.du[k] = 0.0
    for k in range(d.n_internal):
        d.internal[k] = d.w[y + d.nq + d.nv + d.n_ledger - d.n_internal + k]


def make_forces(tree: Any, flexible: FlexibleBodies, contacts: Callable, loads: Callable, stops: Callable) -> Callable:
    """Build the kernel forces(d): inertia and applied forces of all links, before the elimination."""
    rigid_inertia, flexible_inertia = rigid.make_inertia(tree), flexible.inertia

    @kernel
    def forces(d):
        ground = d.wrench[0]
        ground.moment, ground.force = ZERO, ZERO
        for i in range(1, d.n_links):
            if d.links[i].flex < 0:
                rigid_inertia(d, i)
        flexible_inertia(d)
        contacts(d)
        loads(d)
        stops(d)

    return forces


def make_right_hand_side(laws: Callable, **parts: Any) -> Callable:
    """Build the kernel evaluate(h, f, w, n, t, y, dy) from the parts of a mechanism.

    laws: of time (`equations.prescribed_motion`).  parts: see `make_rates`.
    """
    rates = make_rates(**parts)

    @kernel
    def evaluate(h, f, w, n, t, y, dy):
        """Compute the rates dy of the state y at time t, both indices in w; n[EVALUATION] is the status."""
        laws(h, f, w, n, t)
        rates(h, f, w, n, y, dy)

    return evaluate


def make_rates(
    joints: tuple[Any, ...],
    tree: Any,
    flexible: Callable[[Any], FlexibleBodies] = all_rigid,
    contacts: Callable = nothing,
    loads: Callable = nothing,
    stops: Callable = nothing,
    closures: Any = None,
    friction: tuple[Callable, Callable] = (nothing, nothing),
) -> Callable:
    """Build the kernel rates(h, f, w, n, y, dy): `evaluate` at the present values of the laws of time.

    joints: modules of the joint types.  tree: `equations.articulated`.  flexible: makes the kernels of the flexible
    bodies, of that.  contacts, loads, stops: the kernels that apply them.  closures: kernels of all closures.
    friction: of ideal joints, on accelerations and on drives (`effects.joint_friction`).
    """
    bodies = flexible(tree)
    kinematics = make_kinematics(joints, tree, bodies)
    forces = make_forces(tree, bodies, contacts, loads, stops)
    eliminate, backward, drive_forces = tree.make_eliminate(bodies), tree.backward, tree.drive_forces
    modal_mass, modal_rates = bodies.mass_matrix, bodies.modal_rates
    close = nothing if closures is None else closures.close
    known_forces = nothing if closures is None else closures.known_forces
    rub, rub_drives = friction

    @kernel
    def store_rates(d, dy):
        """Store the positions' rates, the accelerations, and the ledger's powers."""
        for k in range(d.n_drives):
            d.ledger_rate[d.drives[k].book] += d.drive_force[k] * d.u[d.nv + k]
        for k in range(d.nq):
            d.w[dy + k] = d.position_rate[k]
        for k in range(d.nv):
            d.w[dy + d.nq + k] = d.du[k]
        modal_rates(d, dy)
        for k in range(d.n_ledger):
            d.w[dy + d.nq + d.nv + k] = d.ledger_rate[k]

    @kernel
    def rates(h, f, w, n, y, dy):
        """Compute the rates dy of the state y, both indices in w; Wang & Wang (2019), eqs. (32), (34)."""
        d = data(h, f, w, n)
        d.state, d.abridged = y, 0
        spread_state(d, y)
        prescribe(d)
        for k in range(d.n_ledger):
            d.ledger_rate[k] = 0.0
        kinematics(d)
        for k in range(d.mass_size):
            d.mass[k] = 0.0
        forces(d)
        modal_mass(d)
        d.evaluation = m.OK
        if not eliminate(d):
            d.evaluation = m.NOT_POSITIVE
            return
        close(d)
        backward(d, d.at_force)
        for k in range(d.nv):
            d.du[k] = d.force[k]
        rub(d)
        drive_forces(d)
        known_forces(d)
        rub_drives(d)
        store_rates(d, dy)

    return rates
