"""The tables of a system: all its wiring and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.effects import Parts
from pipeline.dynamics.model import contacts as contact_numbers
from pipeline.dynamics.model import flexible_bodies as flexible
from pipeline.dynamics.model import laws as lawful
from pipeline.dynamics.model import loads as loading
from pipeline.dynamics.model import wiring
from pipeline.dynamics.model.arrays import Arrays, pack
from pipeline.dynamics.model.assembly import assembled
from pipeline.dynamics.model.driving import drive_laws, joint_class, prescribed
from pipeline.dynamics.model.mechanism import Link, Mechanism
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.numbering import Numbering, number

if TYPE_CHECKING:
    from pipeline.dynamics.contact.law import Resolved

NONE: Mapping[str, Pieces] = MappingProxyType({})


@dataclass(frozen=True)
class Model:
    """A system ready to be evaluated. `closure_order`: row of the closure table -> closure of the system.

    laws: the normal law of every contact.
    """

    mechanism: Mechanism
    numbering: Numbering
    parts: Parts
    arrays: Arrays
    closure_order: np.ndarray
    laws: tuple[Resolved, ...]

    @property
    def scene(self) -> Scene:
        """The scene that the mechanism was built from."""
        return self.mechanism.scene

    @property
    def speed_scales(self) -> np.ndarray:
        """Size of a large displacement of each free coordinate: the mechanism's size, or a radian; shape (nv,)."""
        nq, nv = self.numbering.nq, self.numbering.nv
        groups = self.arrays.table(m.GROUPS)["group"][nq : nq + nv]
        return np.asarray(self.arrays.table(m.FLOORS)["magnitude"][groups])

    @property
    def drive_scales(self) -> np.ndarray:
        """The same of each prescribed coordinate, shape (drives,)."""
        length = self.mechanism.length
        return np.array([1.0 if one.dimension == "angle" else length for one in prescribed(self.scene)])

    @property
    def row_scales(self) -> np.ndarray:
        """The same of what each closure row holds, shape (rows,)."""
        along = self.arrays.table(m.CLOSURE_ROWS)["kind"] == 0
        return np.where(along, self.mechanism.length, 1.0)


def tabulate(mechanism: Mechanism, given: Mapping[str, Pieces] = NONE) -> Model:
    """Place a system's links so that its joints fit, number it and fill its tables.

    given: laws of prescribed coordinates, and of loads along joints as ``load.NAME``, that replace the scene's.
    """
    mechanism = assembled(mechanism, given)
    numbering = number(mechanism)
    normals = contact_numbers.resolve(mechanism)
    site_pairs = [(e.kind, numbering.site(a), numbering.site(b)) for e, a, b in mechanism.closures]
    touching = [(numbering.site(a), numbering.site(b)) for _, _, a, b in mechanism.contacts]
    closures, order = wiring.closures(numbering, site_pairs)
    loaded = loading.tabulate(mechanism, numbering, given)
    laws = drive_laws(mechanism.scene, given)
    signs = {name: link.stage.sign for link in mechanism.links if link.stage for name in link.drives}
    signed = [law.times(signs[name]) for name, law in zip(mechanism.drives, laws, strict=True)]
    law_tables = lawful.fill([*signed, *loaded.laws])
    turns, slot = loaded.turns, contact_numbers.ledger_size(mechanism)
    loads = loading.LEDGER if mechanism.scene.forces() else 0
    groups, floors = _error_groups(numbering, loads, turns)
    sites = [(s.link, numbering.port_of(k)) for k, s in enumerate(numbering.sites)]
    parts = _parts(mechanism, normals, any(law.harmonic for law in [*laws, *loaded.laws]), loaded.kinds)
    arrays = pack(
        {
            m.NQ: numbering.nq,
            m.N_LEDGER: slot + loads + turns,
            m.N_DRIVES: numbering.known,
            m.N_TURNS: turns,
            m.LOAD_SLOT: slot,
            m.MOST_MODES: max(numbering.modes.values(), default=0),
        },
        {
            m.LINKS: _links(numbering, parts),
            m.LINK_NUMBERS: [_link_numbers(link) for link in mechanism.links],
            m.SITES: sites,
            m.SITE_NUMBERS: [_pose_row(s.place) for s in numbering.sites],
            **flexible.fill(numbering),
            **wiring.mass_entries(numbering),
            **closures,
            **contact_numbers.fill(numbering, parts, normals, touching),
            **law_tables,
            **loaded.tables,
            m.GRAVITY: loading.gravity(mechanism.scene),
            m.GROUPS: groups,
            m.FLOORS: floors,
        },
        numbering.columns,
    )
    return Model(mechanism, numbering, parts, arrays, order, normals)


def _parts(mechanism: Mechanism, normals: tuple[Resolved, ...], harmonics: bool, loads: tuple[str, ...]) -> Parts:
    contacts = [joint for _, joint, _, _ in mechanism.contacts]
    return Parts(
        joints=tuple(sorted({link.kind for link in mechanism.links[1:]})),
        surfaces=tuple(sorted({joint.type for joint in contacts})),
        forms=tuple(sorted({law.form for law in normals})),
        frictions=tuple(sorted({joint.friction.law for joint in contacts if joint.friction is not None})),
        loads=loads,
        closures=bool(mechanism.closures),
        flexible=any(link.flexible for link in mechanism.links),
        stiffening=any(b.stiffening is not None for b in mechanism.scene.flexible().values()),
        harmonics=harmonics,
    )


def _pose_row(place: Placement) -> np.ndarray:
    return np.concatenate([place.p, place.R.ravel()])


def _links(numbering: Numbering, parts: Parts) -> list[tuple[int, ...]]:
    rows: list[tuple[int, ...]] = []
    flexible = sorted(numbering.modes)
    for i, link in enumerate(numbering.mechanism.links):
        joint = parts.joints.index(link.kind) if i else -1
        flex = flexible.index(i) if i in numbering.modes else -1
        inboard = numbering.port_of_inboard(i) if flex >= 0 else -1
        port = numbering.port_of(i - 1) if i else -1
        speeds = numbering.n_speeds(i)
        rows.append((link.branch.parent, joint, numbering.q0[i], numbering.c0[i], speeds, flex, inboard, port))
    return rows


def _link_numbers(link: Link) -> np.ndarray:
    if link.inertia is None:
        return np.zeros(10)
    mass, com, J = link.inertia
    return np.array([mass, *com, J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


def _error_groups(numbering: Numbering, loads: int, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Group of every state variable, and the floor below which a group is resolved absolutely.

    A vector is one group, so that turning the scene hardly changes a step.  Floors: the mechanism's
    size, one radian, both per second, and the energy of moving its mass by its size in a second.
    loads: number of the loads' energies; turns: number of angles after them.
    """
    L = numbering.mechanism.length
    groups: list[int] = []
    floors: list[float] = []
    nq = numbering.nq
    q_group, v_group = np.zeros(nq, dtype=np.int64), np.zeros(numbering.nv, dtype=np.int64)

    def fill(target: np.ndarray, first: int, letters: str) -> None:
        for k, letter in enumerate(letters):
            if k == 0 or letters[k - 1] != letter:
                floors.append(L if letter == "t" else 1.0)
            target[first + k] = len(floors) - 1

    for i, link in enumerate(numbering.mechanism.links[1:], start=1):
        declared = joint_class(link.kind)
        if numbering.driven(i) < 0:
            fill(q_group, numbering.q0[i], declared.POSITIONS)
            fill(v_group, numbering.c0[i], declared.SPEEDS)
        if i in numbering.modes:
            mass = float(numbering.mechanism.bundles[str(link.flexible)]["mass"])
            for target, first in ((q_group, numbering.flex_q0[i]), (v_group, numbering.flex_c0[i])):
                floors.append(L * mass**0.5)
                target[first : first + numbering.modes[i]] = len(floors) - 1
    groups = [*q_group, *v_group]
    energy = _mass(numbering.mechanism) * L**2
    tail = [*contact_numbers.ledger_groups(numbering.mechanism, energy), *[(energy, 1)] * loads, *[(1.0, 1)] * turns]
    for floor, count in tail:
        floors.append(floor)
        groups += [len(floors) - 1] * count
    return np.array(groups, dtype=np.int64), np.array(floors)


def _mass(mechanism: Mechanism) -> float:
    rigid = sum(link.inertia[0] for link in mechanism.links if link.inertia is not None)
    return rigid + sum(
        float(mechanism.bundles[str(link.flexible)]["mass"]) for link in mechanism.links if link.flexible
    )
