"""Spatial inertia and inertial wrench of a rigid link; default kernels for scenes without flexible bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.dynamics.choice import nothing
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    add_wrench,
    at6,
    congruence,
    cross,
    dot,
    scale,
    turn,
    turn_symmetric,
)


@kernel
def _no_site(d, s):
    return ZERO


@kernel
def _same_frame(d, i, p, R, omega, v, alpha, a):
    return p, R, omega, v, alpha, a


@dataclass(frozen=True)
class FlexibleBodies:
    """Kernels of all flexible bodies; the defaults are for scenes without any.

    deform(d): X and U to the interface basis, before all else.  site(d, s): motion of a frame, returns its arm from the
    link's origin.  inboard(d, i, ...): from the frame of a link's inboard joint to the link's own (see `ports`).
    inertia(d): spatial inertias, wrenches and modal forces, for zero modal accelerations. mass_matrix(d): modal blocks,
    right after `inertia`.  modal_rates(d, dy): modal accelerations into the state's rates.
    """

    deform: Callable = nothing
    site: Callable = _no_site
    inboard: Callable = _same_frame
    inertia: Callable = nothing
    mass_matrix: Callable = nothing
    modal_rates: Callable = nothing


def all_rigid(tree: Any) -> FlexibleBodies:
    """Return the kernels for scenes without flexible bodies."""
    return FlexibleBodies()


@kernel
def spatial(own, mass, c, J):
    """Store the spatial inertia (a row of OWN) of a mass at c with inertia J about c, world axes."""
    x, y, z = c
    own.mass, own.moment = mass, scale(mass, c)
    own.inertia[0] = J[0] + mass * (y * y + z * z)
    own.inertia[1] = J[1] + mass * (x * x + z * z)
    own.inertia[2] = J[2] + mass * (x * x + y * y)
    own.inertia[3] = J[3] - mass * x * y
    own.inertia[4] = J[4] - mass * x * z
    own.inertia[5] = J[5] - mass * y * z


def make_inertia(tree: Any) -> Callable:
    """Build inertia(d, i): spatial inertia of link i (OWN), and the wrench that its frame's accelerations need.

    Both are about the reference point of `tree`: the kernels' origin, or the link's own, near which they keep digits.
    Gravity enters as an acceleration of the ground.
    """
    origin, demand_of = tree.origin, tree.demand_of

    @kernel
    def inertia(d, i):
        frame, link = d.link_frames[i], d.link_numbers[i]
        R, omega, alpha, mass = frame.axes, frame.omega, frame.alpha, link.mass
        arm = turn(R, link.com)
        J = congruence(R, at6(link.inertia, 0))
        a = add(frame.acceleration, add(cross(alpha, arm), cross(omega, cross(omega, arm))))
        moment, force = add(turn_symmetric(J, alpha), cross(omega, turn_symmetric(J, omega))), scale(mass, a)
        c = add(origin(d, i), arm)
        spatial(d.own[i], mass, c, J)
        demand_of(d, i, add(moment, cross(c, force)), force)

    return inertia


@kernel
def apply_wrench(d, s, moment, force):
    """Apply a wrench (moment about the kernels' origin, force; world) to the link of site s, and to its modes."""
    site = d.sites[s]
    add_wrench(d.wrench[site.link], scale(-1.0, moment), scale(-1.0, force))
    if site.port >= 0:
        port = d.ports[site.port]
        body = d.flexes[port.flex]
        for j in range(body.n_modes - body.n_held):
            column = d.columns[port.column + j]
            d.modal_bias[body.c0 + body.n_held + j] -= dot(column.angular, moment) + dot(column.linear, force)


@kernel
def apply_between(d, a, b, moment, force):
    """Apply a wrench (as in `apply_wrench`) to site b, and the opposite wrench to site a."""
    apply_wrench(d, b, moment, force)
    apply_wrench(d, a, scale(-1.0, moment), scale(-1.0, force))
