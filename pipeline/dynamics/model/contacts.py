"""The tables of the contacts: wiring, numbers of their laws, and their share of the state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipeline.core.errors import InputError
from pipeline.core.registry import lookup
from pipeline.core.scene.clearance import Clearance
from pipeline.dynamics import memory as m
from pipeline.dynamics.effects import Parts
from pipeline.dynamics.model.mechanism import Mechanism, Site
from pipeline.dynamics.model.numbering import Numbering

if TYPE_CHECKING:
    from pipeline.dynamics.contact.law import Resolved

NORMAL = "pipeline.dynamics.contact.normal"
FRICTION = "pipeline.dynamics.contact.friction"
SURFACES = "pipeline.dynamics.contact"
#: wiring of a contact but for the kinds of its laws
Touching = Sequence[tuple[int, int]]


def resolve(mechanism: Mechanism) -> tuple[Resolved, ...]:
    """The normal law of every contact with its numbers; InputError for a law that cannot be had."""
    return tuple(_resolve(mechanism, name, joint, (a, b)) for name, joint, a, b in mechanism.contacts)


def fill(numbering: Numbering, parts: Parts, laws: Sequence[Resolved], touching: Touching) -> dict[Any, Any]:
    """The tables CONTACTS and CONTACT_NUMBERS, given (outer site, inner site) of every contact."""
    mechanism = numbering.mechanism
    places = bristle_places(numbering)
    rows, reals = [], []
    for (name, joint, _, _), law, sites, place in zip(mechanism.contacts, laws, touching, places, strict=True):
        friction_kind, numbers, stick = -1, (0.0,) * 6, 0.0
        if joint.friction is not None:
            friction = _friction(name, joint)
            friction_kind = parts.frictions.index(joint.friction.law)
            numbers, stick = friction.parameters(joint.friction), friction.stick_speed(joint.friction)
        kinds_of = (parts.forms.index(law.form), friction_kind, parts.surfaces.index(joint.type))
        rows.append((*sites, *kinds_of, place))
        reals.append([joint.clearance, joint.radius, joint.floor, stick, *law.numbers, *numbers])
    return {m.CONTACTS: rows, m.CONTACT_NUMBERS: reals}


def ledger_groups(mechanism: Mechanism, energy: float) -> list[tuple[float, int]]:
    """(floor, number of variables) of every error group after positions and speeds: ledger, then bristles."""
    contact = [(energy, 1), (energy, 1), (energy / mechanism.length, 1)]  # losses [J], impulse [N s]
    ledger = [(energy, 1)] * m.CONTACT_SLOTS + contact * len(mechanism.contacts)
    return ledger + [(size, 3) for size in _bristles(mechanism) if size is not None]


def ledger_size(mechanism: Mechanism) -> int:
    """Variables of the ledger up to the contacts' and their bristles, where those of the loads begin."""
    return sum(count for _, count in ledger_groups(mechanism, 0.0))


def bristle_places(numbering: Numbering) -> list[int]:
    """Where in the state each contact's deflection of bristles starts, or -1."""
    place = numbering.nq + numbering.nv + m.CONTACT_SLOTS + m.PER_CONTACT * len(numbering.mechanism.contacts)
    found = []
    for size in _bristles(numbering.mechanism):
        found.append(-1 if size is None else place)
        place += 0 if size is None else 3
    return found


def _bristles(mechanism: Mechanism) -> list[float | None]:
    return [
        None if joint.friction is None else _friction(name, joint).bristle(joint.friction)
        for name, joint, _, _ in mechanism.contacts
    ]


def _friction(name: str, joint: Clearance) -> Any:
    assert joint.friction is not None
    return lookup(FRICTION, joint.friction.law, where=f"[joint.{name}.friction]")


def _resolve(mechanism: Mechanism, name: str, joint: Clearance, sites: tuple[Site, Site]) -> Resolved:
    place = f"[joint.{name}.normal]"
    normal = lookup(NORMAL, joint.normal.law, where=place)
    surfaces = lookup(SURFACES, joint.type, where=place)
    exponent = normal.exponent if joint.normal.exponent is None else joint.normal.exponent
    try:
        return normal.resolve(joint.normal, surfaces.stiffness(joint, exponent), _reduced_mass(mechanism, sites))
    except ValueError as error:
        raise InputError(place, str(error)) from None


def _reduced_mass(mechanism: Mechanism, sites: tuple[Site, Site]) -> float | None:
    """Of the links on both sides [kg], the ground's being infinite; None when both are."""
    inverse = sum(1.0 / mass for mass in (_mass(mechanism, site.link) for site in sites) if mass > 0.0)
    return 1.0 / inverse if inverse > 0.0 else None


def _mass(mechanism: Mechanism, i: int) -> float:
    link = mechanism.links[i]
    if link.inertia is not None:
        return float(link.inertia[0])
    return float(mechanism.bundles[link.flexible]["mass"]) if link.flexible else 0.0
