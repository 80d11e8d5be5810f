"""The tables of a system: all its wiring and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.registry import lookup
from pipeline.dynamics import memory as m
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.integrate.method import Method
from pipeline.dynamics.model import contacts as contact_numbers
from pipeline.dynamics.model import flexible_bodies as flexible
from pipeline.dynamics.model import laws as lawful
from pipeline.dynamics.model import loads as loading
from pipeline.dynamics.model import wiring
from pipeline.dynamics.model.arrays import Arrays, pack
from pipeline.dynamics.model.assembly import assembled
from pipeline.dynamics.model.contacts import ContactKinds
from pipeline.dynamics.model.driving import drive_laws, joint_class
from pipeline.dynamics.model.mechanism import Link, System
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.numbering import Layout, number

if TYPE_CHECKING:
    from pipeline.dynamics.contact.law import Resolved

INTEGRATORS = "pipeline.dynamics.integrate"
NONE: Mapping[str, Pieces] = MappingProxyType({})


@dataclass(frozen=True)
class Kinds:
    """Which kinds of parts a system has: all that its compiled code depends on."""

    joints: tuple[str, ...]
    contacts: ContactKinds
    flexible: bool
    closures: bool
    harmonics: bool = False
    loads: tuple[str, ...] = ()
    stiffening: bool = False


@dataclass(frozen=True)
class Tables:
    """A system ready to be evaluated. `closure_order`: row of the closure table -> closure of the system.

    laws: the normal law of every contact.
    """

    system: System
    layout: Layout
    kinds: Kinds
    packed: Arrays
    method: Method
    closure_order: np.ndarray
    laws: tuple[Resolved, ...]


def tabulate(system: System, given: Mapping[str, Pieces] = NONE) -> Tables:
    """Place a system's links so that its joints fit, number it and fill its tables.

    given: laws of prescribed coordinates, and of loads along joints as ``load.NAME``, that replace the scene's.
    """
    system = assembled(system, given)
    layout = number(system)
    normals = contact_numbers.resolve(system)
    site_pairs = [(e.kind, layout.site(a), layout.site(b)) for e, a, b in system.closures]
    touching = [(layout.site(a), layout.site(b)) for _, _, a, b in system.contacts]
    closures, order = wiring.closures(layout, site_pairs)
    loaded = loading.tabulate(system, layout, given)
    laws = drive_laws(system.scene, given)
    signs = {name: link.stage.sign for link in system.links if link.stage for name in link.drives}
    signed = [law.times(signs[name]) for name, law in zip(system.drives, laws, strict=True)]
    law_tables = lawful.fill([*signed, *loaded.laws])
    turns, slot = loaded.turns, contact_numbers.ledger_size(system)
    loads = loading.LEDGER if system.scene.forces() else 0
    groups, floors = _error_groups(layout, loads, turns)
    sites = [(s.link, layout.port_of(k)) for k, s in enumerate(layout.sites)]
    method = lookup(INTEGRATORS, system.scene.solver.integrator, where="[solver.integrator]")
    kinds = _kinds(system, normals, any(law.harmonic for law in [*laws, *loaded.laws]), loaded.kinds)
    packed = pack(
        {
            m.NQ: layout.nq,
            m.N_LEDGER: slot + loads + turns,
            m.N_DRIVES: layout.known,
            m.N_TURNS: turns,
            m.LOAD_SLOT: slot,
            m.MOST_MODES: max(layout.modes.values(), default=0),
        },
        {
            m.LINKS: _links(layout, kinds),
            m.LINK_NUMBERS: [_link_numbers(link) for link in system.links],
            m.SITES: sites,
            m.SITE_NUMBERS: [_pose_row(s.place) for s in layout.sites],
            **flexible.fill(layout),
            **wiring.mass_entries(layout),
            **closures,
            **contact_numbers.fill(layout, kinds.contacts, normals, touching),
            **law_tables,
            **loaded.tables,
            m.GRAVITY: loading.gravity(system.scene),
            m.GROUPS: groups,
            m.FLOORS: floors,
        },
        method.room,
        layout.columns,
    )
    return Tables(system, layout, kinds, packed, method, order, normals)


def _kinds(system: System, normals: tuple[Resolved, ...], harmonics: bool, loads: tuple[str, ...]) -> Kinds:
    return Kinds(
        joints=tuple(sorted({link.kind for link in system.links[1:]})),
        contacts=contact_numbers.kinds(system, normals),
        flexible=any(link.flexible for link in system.links),
        closures=bool(system.closures),
        harmonics=harmonics,
        loads=loads,
        stiffening=any(b.stiffening is not None for b in system.scene.flexible().values()),
    )


def _pose_row(place: Placement) -> np.ndarray:
    return np.concatenate([place.p, place.R.ravel()])


def _links(layout: Layout, kinds: Kinds) -> list[tuple[int, ...]]:
    rows: list[tuple[int, ...]] = []
    flexible = sorted(layout.modes)
    for i, link in enumerate(layout.system.links):
        joint = kinds.joints.index(link.kind) if i else -1
        flex = flexible.index(i) if i in layout.modes else -1
        inboard = layout.port_of_inboard(i) if flex >= 0 else -1
        port = layout.port_of(i - 1) if i else -1
        speeds = layout.n_speeds(i)
        rows.append((link.branch.parent, joint, layout.q0[i], layout.c0[i], speeds, flex, inboard, port))
    return rows


def _link_numbers(link: Link) -> np.ndarray:
    if link.inertia is None:
        return np.zeros(10)
    mass, com, J = link.inertia
    return np.array([mass, *com, J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


def _error_groups(layout: Layout, loads: int, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Group of every state variable, and the floor below which a group is resolved absolutely.

    A vector is one group, so that turning the scene hardly changes a step.  Floors: the mechanism's
    size, one radian, both per second, and the energy of moving its mass by its size in a second.
    loads: number of the loads' energies; turns: number of angles after them.
    """
    L = layout.system.length
    groups: list[int] = []
    floors: list[float] = []
    nq = layout.nq
    q_group, v_group = np.zeros(nq, dtype=np.int64), np.zeros(layout.nv, dtype=np.int64)

    def fill(target: np.ndarray, first: int, letters: str) -> None:
        for k, letter in enumerate(letters):
            if k == 0 or letters[k - 1] != letter:
                floors.append(L if letter == "t" else 1.0)
            target[first + k] = len(floors) - 1

    for i, link in enumerate(layout.system.links[1:], start=1):
        declared = joint_class(link.kind)
        if layout.driven(i) < 0:
            fill(q_group, layout.q0[i], declared.POSITIONS)
            fill(v_group, layout.c0[i], declared.SPEEDS)
        if i in layout.modes:
            mass = float(layout.system.bundles[str(link.flexible)]["mass"])
            for target, first in ((q_group, layout.flex_q0[i]), (v_group, layout.flex_c0[i])):
                floors.append(L * mass**0.5)
                target[first : first + layout.modes[i]] = len(floors) - 1
    groups = [*q_group, *v_group]
    energy = _mass(layout.system) * L**2
    tail = [*contact_numbers.ledger_groups(layout.system, energy), *[(energy, 1)] * loads, *[(1.0, 1)] * turns]
    for floor, count in tail:
        floors.append(floor)
        groups += [len(floors) - 1] * count
    return np.array(groups, dtype=np.int64), np.array(floors)


def _mass(system: System) -> float:
    rigid = sum(link.inertia[0] for link in system.links if link.inertia is not None)
    return rigid + sum(float(system.bundles[str(link.flexible)]["mass"]) for link in system.links if link.flexible)
