"""Tables of ideal joints with friction: with their bearings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.expression import numbers_of
from flexclear.dynamics.effects.declared import BEARINGS, SLIDER
from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.contacts import bristle, friction_law
from flexclear.dynamics.model.filling import Filling
from flexclear.dynamics.model.guards import Guard, speeds
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.scene.parts import IdealJoint

BENDS = m.NAMED["bends"]
#: load components of a bearing, by its field of BENDS, with the number of their components
PRESSES = {"along": 1, "about": 1, "one_end": 2, "other_end": 2}


def ledger(mechanism: Mechanism, energies: Floors, lengths: Floors) -> list[Group]:
    """Return the ledger groups: first the loss of each joint [J], then the bristles [m] of each bearing."""
    losses, bristles = list[Group](), list[Group]()
    for name, joint in mechanism.scene.joints_with_friction().items():
        part, size = mechanism.components.of(*(mechanism.site(f).link for f in joint.between)), bristle(name, joint)
        losses.append((energies[part], 1, part))
        bristles += [] if size is None else [(size, 3, part)] * len(BEARINGS[joint.type])
    return losses + bristles


def guards(mechanism: Mechanism) -> Iterator[Guard]:
    """Yield the guards of each bearing: speeds, reversals of sliding for laws with bristles, reversals of loads."""
    bearing = 0
    for joint in mechanism.scene.joints_with_friction().values():
        law = friction_law(joint)
        assert joint.friction is not None
        for _ in BEARINGS[joint.type]:
            row = bearing * BENDS.size
            yield from speeds(BENDS, row + BENDS.sliding, 3, law.kinks(joint.friction))
            if law.bristle(joint.friction) is not None:
                yield (BENDS.at, row + BENDS.sliding, 3, -1, -1), 0.0, law.stick_speed(joint.friction)
            for pressing, count in PRESSES.items():
                yield (BENDS.at, row + getattr(BENDS, pressing), count, -1, bearing), 0.0, 0.0
            bearing += 1


def fill(filling: Filling) -> dict[str, Any]:
    """Tabulate the joints with friction and their bearings."""
    numbering, closures = filling.numbering, filling.closures
    mechanism, laws = numbering.mechanism, filling.parts.kinds("joint_friction")
    slot = numbering.nq + numbering.nv + filling.slots["joint_friction"] + len(mechanism.scene.joints_with_friction())
    tables: dict[str, list[Any]] = defaultdict(list)
    for number, (name, joint) in enumerate(mechanism.scene.joints_with_friction().items()):
        a, b = (mechanism.site(frame) for frame in joint.between)
        sites = numbering.site(a), numbering.site(b)
        link, reverse = _link(mechanism, name)
        closure = next((c for c, one in enumerate(closures) if one.name == name), -1)
        where = len(tables["bearings"]), len(BEARINGS[joint.type])
        tables["rubbing"].append((*sites, link, int(reverse), closure, *where))
        for kind, side, axis in BEARINGS[joint.type]:
            size = bristle(name, joint)
            law = laws.index(joint.friction.kind) if joint.friction is not None else -1
            tables["bearings"].append((number, kind, law, side, axis, slot if size is not None else -1))
            tables["bearing_numbers"].append(_numbers(name, joint, kind))
            tables["bearing_tables"] += [x for one in numbers_of(joint.friction) for x in one]
            slot += 3 if size is not None else 0
    return tables


def _numbers(name: str, joint: IdealJoint, kind: int) -> list[float]:
    """Return a row of the table BEARING_NUMBERS."""
    friction = joint.friction
    assert friction is not None
    radius = friction.radius or 0.0
    axial = (friction.axial_radius or radius) / radius if joint.type == "revolute" else 0.0
    torsion = 1.0 / radius if kind == SLIDER and radius else 0.0
    lever = 1.0 / friction.length if friction.length else 0.0
    return [radius, lever, axial, torsion, friction.preload, *friction_law(joint).parameters(friction)]


def _link(mechanism: Mechanism, name: str) -> tuple[int, bool]:
    """Return the link whose inboard joint this is (last of a chain), and True if it is on the first frame's side."""
    bearings = [
        (i, link.branch.reverse)
        for i, link in enumerate(mechanism.links)
        if link.branch.edge is not None and link.branch.edge.name == name
    ]
    return bearings[-1] if bearings else (-1, False)
