"""Friction along a joint coordinate: viscous, and Coulomb friction of given strength, regularised as in contacts.

The strength does not depend on the joint's reaction.  Source: Wang & Wang (2019), eqs. (27)-(29), for the
regularised coefficient.
"""

from __future__ import annotations

from functools import partial

from flexclear.dynamics.contact.friction.modified_coulomb import coefficient
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row, numbers
from flexclear.dynamics.specialise.symbols import select
from flexclear.scene.loads import JointFriction
from flexclear.system.errors import all_or_errors


def apply(given: Given) -> Load:
    """Return the force."""
    (viscous, *dry), (_, rate, unit) = given.numbers, given.coordinates[0]
    strength = coefficient(abs(rate), dry)
    size = -viscous * rate - select(rate >= 0.0, strength, -strength)
    return Load(unit * size, lost=-size * rate, bends=[rate])


def row(load: JointFriction, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: viscous coefficient [N s/m or N m s/rad], dry friction [N or N m] and its speeds."""
    speed, force = "angular velocity" if coordinate.turning else "velocity", coordinate.force
    given = [partial(numbers, load, path, viscous="torsional damping" if coordinate.turning else "damping")]
    if load.coulomb is not None:
        dimensions = {"static": force, "dynamic": force, "v_static": speed, "v_dynamic": speed}
        given.append(partial(numbers, load.coulomb, f"{path[:-1]}.coulomb]", **dimensions))
    (viscous,), *dry_friction = all_or_errors(given)
    if viscous < 0.0 or (viscous == 0.0 and load.coulomb is None):
        raise ValueError(f"viscous must not be negative, nor zero without coulomb; viscous = {viscous:.6g}")
    dry: tuple[float, ...] = (0.0, 0.0, 1.0, 2.0)
    kinks: tuple[float, ...] = ()
    if dry_friction:
        dry = tuple(dry_friction[0])
        kinks = dry[2:]
        if not 0.0 <= dry[1] <= dry[0]:
            raise ValueError(
                "coulomb: dynamic must not be negative, nor exceed static; "
                f"dynamic = {dry[1]:.6g}, static = {dry[0]:.6g}"
            )
        if not 0.0 < dry[2] < dry[3]:
            raise ValueError(
                "coulomb: v_static must be positive and below v_dynamic; "
                f"v_static = {dry[2]:.6g}, v_dynamic = {dry[3]:.6g}"
            )
    return Row(joint=load.joint, numbers=(viscous, *dry), bends=(kinks,))
