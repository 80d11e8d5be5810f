"""Tables of the contacts: topology, numbers of their laws, and their variables in the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.conforming import CONFORMING
from flexclear.dynamics.contact.expression import numbers_of
from flexclear.dynamics.contact.form.expression import VALUES
from flexclear.dynamics.contact.friction import FRICTION_LAWS
from flexclear.dynamics.contact.friction.expression import check
from flexclear.dynamics.contact.normal import NORMAL_LAWS, expression
from flexclear.dynamics.contact.surfaces import SURFACES
from flexclear.dynamics.contact.validity import SHALLOW
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.gauges import Gauges
from flexclear.dynamics.model.mechanism import Contact, Mechanism
from flexclear.dynamics.model.numbering import Numbering
from flexclear.dynamics.model.stops import End, ends_an_angle
from flexclear.scene.loose_joints import Clearance
from flexclear.system.errors import InputError, all_or_errors

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Resolved

#: default impact floor, far below approach speeds in common machines [m/s or rad/s]; and its ratio to the size of a
#: mechanism of 10 cm [1/s]: in a mechanism of micrometres 1 um/s would be fast
LEAST_RATE, SLOW_IMPACT = 1e-6, 1e-5
#: (outer site, inner site) of each contact
SitePairs = Sequence[tuple[int, int]]


def resolve(mechanism: Mechanism) -> tuple[Resolved, ...]:
    """Return the normal law of each contact with its numbers; raise InputError for a law with impossible values."""
    all_or_errors(partial(_check_friction, name, joint.friction) for name, joint in mechanism.scene.joint.items())
    return tuple(all_or_errors(partial(resolve_one, mechanism, contact) for contact in mechanism.contacts))


def _check_friction(name: str, friction: Any) -> None:
    if friction is not None and friction.law == "expression":
        try:
            check(friction)
        except ValueError as error:
            raise InputError(f"[joint.{name}.friction]", str(error)) from None


def fill(
    numbering: Numbering, parts: Parts, laws: Sequence[Resolved], site_pairs: SitePairs, gauges: Gauges, slot: int
) -> dict[Any, Any]:
    """Return the tables CONTACTS, CONTACT_NUMBERS and CONTACT_TABLES.

    site_pairs: (outer, inner) sites of each contact.  gauges: receives those of the stops.  slot: ledger index of the
    first bristles.
    """
    mechanism, rows, reals, first = numbering.mechanism, [], [], numbering.nq + numbering.nv + slot
    looked_up = list[float]()
    for contact, law, sites in zip(mechanism.contacts, laws, site_pairs, strict=True):
        name, joint, *_ = contact
        length = mechanism.components.lengths[part_of(mechanism, contact)]
        friction_kind, numbers, stick = -1, (0.0,) * 6, 0.0
        if joint.friction is not None:
            friction = friction_law(joint)
            friction_kind = parts.frictions.index(joint.friction.kind)
            numbers, stick = friction.parameters(joint.friction), friction.stick_speed(joint.friction)
        subtracted = -1
        if isinstance(joint, End):
            surfaces = gauges.add(*sites, joint.coordinate, counts=True)
            if contact.others:
                a, b = (numbering.site(site) for site in contact.others)
                subtracted = gauges.add(a, b, joint.parts[1][1], counts=True)
            shape = joint.limit + start_centre(mechanism, contact), joint.sense, joint.ratio
        else:
            surfaces, shape = parts.surfaces.index(joint.type), joint.shape
        kinds_of = (parts.forms.index(law.form), friction_kind, surfaces)
        bends = bristle(name, joint) is not None
        rows.append((*sites, *kinds_of, first if bends else -1, subtracted))
        first += 3 * bends
        sizes = (joint.clearance, joint.arm, _floor(joint, length))
        reals.append([*sizes, stick, *law.numbers[:3], *law.numbers.values[:VALUES], *numbers, *shape, length])
        looked_up += [x for one in (*law.numbers.values[VALUES:], *numbers_of(joint.friction)) for x in one]
    return {m.CONTACTS: rows, m.CONTACT_NUMBERS: reals, m.CONTACT_TABLES: looked_up}


def start_centre(mechanism: Mechanism, contact: Contact) -> float:
    """Return the coordinate to which a stop's ends refer [m or rad]: 0, or that of the start for a gear's flanks."""
    if contact.joint.centre is not None:
        return float(contact.joint.centre)
    sites = contact.outer, contact.inner, *contact.others
    poses = (mechanism.links[site.link].start.of(start_place(mechanism, site)) for site in sites)
    return float(contact.joint.value(*poses))


def part_of(mechanism: Mechanism, contact: Contact) -> int:
    """Return the number of the independent mechanism that a contact belongs to."""
    return mechanism.components.of(contact.outer.link, contact.inner.link)


def ledger(mechanism: Mechanism, energies: Floors, lengths: Floors) -> dict[str, list[Group]]:
    """Return error groups of the contacts' variables in the ledger and of their bristles (`model.filling.blocks`)."""
    parts, ledger = [part_of(mechanism, contact) for contact in mechanism.contacts], list[Group]()
    for part in parts:
        floors = {"damping": energies, "friction": energies, "impulse": np.divide(energies, lengths)}  # [J], [N s]
        ledger += [(floors[name][part], 1, part) for name in m.row_type(m.CONTACT_LEDGER).names or ()]
    sizes = [bristle(name, joint) for name, joint, *_ in mechanism.contacts]
    bristles = [(size, 3, part) for size, part in zip(sizes, parts, strict=True) if size is not None]
    return {"contacts": ledger, "bristles": bristles}


def _floor(joint: Clearance | End, length: float) -> float:
    """Return the least impact rate of a contact [m/s or rad/s]; length: size of its mechanism [m]."""
    if joint.floor is not None:
        return joint.floor
    return LEAST_RATE if ends_an_angle(joint) else min(LEAST_RATE, SLOW_IMPACT * length)


def friction_law(joint: Any) -> Any:
    """Return the friction law of a joint with friction."""
    return FRICTION_LAWS[joint.friction.kind]


def bristle(name: str, joint: Any) -> float | None:
    """Return the size of the bristles of a joint's friction [m]; None for a law without bristles."""
    if joint.friction is None:
        return None
    size: float | None = friction_law(joint).bristle(joint.friction)
    return size


def resolve_one(mechanism: Mechanism, contact: Contact) -> Resolved:
    """Return the normal law of a contact; raise InputError for impossible values."""
    ends = () if isinstance(contact.joint, End) else (contact.outer, contact.inner)
    radius, size = contact.joint.radius, mechanism.length
    # no mechanism has a tenth of the size of its pin of a metre: the unit is missing
    if not isinstance(contact.joint, End) and contact.joint.hollow and radius >= max(1.0, 10.0 * size):
        raise InputError(
            f"[{contact.place}.{contact.joint.surfaces[1]}_radius]",
            f"{radius:g} m is more than ten times the size of the mechanism",
            f'bare numbers are in metres; write "{radius:g} mm" for millimetres',
        )
    mass = _reduced_mass([mechanism.links[site.link].mass for site in ends])
    return resolve_law(contact.joint, mass, f"[{contact.place}.normal]")


def resolve_law(joint: Clearance | End, mass: float | None, path: str) -> Resolved:
    """Return the normal law of a contact; raise InputError, placed at `path`, for a law with impossible values.

    mass: that rebounds [kg], for laws whose damping depends on it.
    """
    normal, stiffness = joint.normal, joint.normal.stiffness
    try:
        if normal.law == "expression":
            return expression.resolve(normal, mass, SHALLOW * joint.radius or joint.clearance)
        tight = CONFORMING[normal.kind](joint) if normal.kind else None
        if tight is not None:
            stiffness = tight.stiffness
        elif not isinstance(joint, End):
            stiffness = SURFACES[joint.type].stiffness(joint, normal.exponent)
        law: Resolved = NORMAL_LAWS[normal.law](normal, stiffness, mass)
    except ValueError as error:
        raise InputError(path, str(error)) from None
    if tight is not None:
        numbers = law.numbers._replace(exponent=tight.exponent, values=(*tight.values, *law.numbers.values)[:12])
        law = replace(law, form=tight.form or law.form, numbers=numbers, deepest=tight.deepest)
    return law if isinstance(joint, End) else law.shared(joint.share)


def _reduced_mass(masses: Sequence[float]) -> float | None:
    """Return the reduced mass of the links on both sides [kg]; 0 means the ground, infinite. None when both are."""
    inverse = sum(1.0 / mass for mass in masses if mass > 0.0)
    return 1.0 / inverse if inverse > 0.0 else None


def arms(mechanism: Mechanism) -> np.ndarray:
    """Return the factor that makes each contact's gap a length: 1, or the size [m] for ends of angles."""
    turning = [getattr(contact.joint, "coordinate", None) for contact in mechanism.contacts]
    return np.array([mechanism.length if one is not None and one.turning else 1.0 for one in turning])
