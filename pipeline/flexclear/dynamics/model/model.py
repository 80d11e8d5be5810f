"""Model: a numbered mechanism whose topology and numbers are in tables, ready to be evaluated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.effects import Parts, most_parts
from flexclear.dynamics.model import contacts as contacting
from flexclear.dynamics.model import filling, flexible_bodies, guards, index_tables, laws, of_effects
from flexclear.dynamics.model import loads as loading
from flexclear.dynamics.model.arrays import Arrays, pack
from flexclear.dynamics.model.assembly import assemble
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.gauges import Gauges
from flexclear.dynamics.model.gears import Coupling, couplings
from flexclear.dynamics.model.loads import Load
from flexclear.dynamics.model.mechanism import Closure, Contact, Link, Mechanism
from flexclear.dynamics.model.numbering import Numbering, number
from flexclear.dynamics.model.stops import End
from flexclear.scene.films import actions_of
from flexclear.scene.schema import Scene

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Resolved


@dataclass(frozen=True)
class Model:
    """A mechanism ready to be evaluated, with derived quantities that other modules use often.

    links: parents first; link 0 is the ground.  closures, loads: in the order of their tables.
    laws: normal law of each contact.  drives: names of the prescribed coordinates; drive_signs: see `Mechanism`.
    gravity: acceleration [m/s^2], shape (3,).  length: size of the mechanism [m].
    nq, nv, ny: number of free positions, free coordinates and state variables.
    """

    mechanism: Mechanism
    numbering: Numbering
    parts: Parts
    arrays: Arrays
    scene: Scene
    links: list[Link]
    closures: tuple[Closure | Coupling, ...]
    contacts: list[Contact]
    laws: tuple[Resolved, ...]
    loads: tuple[Load, ...]
    drives: tuple[str, ...]
    drive_signs: np.ndarray
    gravity: np.ndarray
    length: float
    nq: int
    nv: int
    ny: int

    @property
    def speeds(self) -> slice:
        """Slice of the state with the speeds of the free coordinates, between positions and ledger."""
        return slice(self.nq, self.nq + self.nv)

    @property
    def state_scales(self) -> np.ndarray:
        """Natural unit of each state variable: the mechanism's size, 1 rad, these per second, ...; shape (NY,)."""
        return np.asarray(self.arrays.table(m.FLOORS)["natural"][self.arrays.table(m.GROUPS)["group"]])

    @property
    def speed_scales(self) -> np.ndarray:
        """Natural unit of each free coordinate's speed: the mechanism's size or 1 rad, per second; shape (nv,)."""
        return self.state_scales[self.speeds]

    def rows_of(self, *kinds: type) -> dict[str, np.ndarray]:
        """Return the rows of the table LOADS of all loads of the given types, by name, in the order of the scene."""
        rows = {name: row for (name, _), row in zip(self.loads, self.arrays.table(m.LOADS), strict=True)}
        return {name: rows[name] for name, load in actions_of(self.scene).items() if isinstance(load, kinds)}


def tabulate(mechanism: Mechanism, given: Mapping[str, Pieces] = laws.NO_LAWS) -> Model:
    """Assemble a mechanism, number it and fill its tables.

    given: laws that replace the scene's: of prescribed coordinates by name, and of loads along joints as ``load.NAME``.
    Raises InputError for a mechanism that cannot be built.
    """
    mechanism = assemble(mechanism, given)
    return fill_model(mechanism, number(mechanism), given)


def fill_model(
    mechanism: Mechanism,
    numbering: Numbering,
    given: Mapping[str, Pieces] = laws.NO_LAWS,
    like: Model | None = None,
) -> Model:
    """Return the model of an assembled mechanism; `given` as in `tabulate`.

    like: a model with the same links, joints, frames and flexible bodies, whose topology tables are reused.
    """
    normals = contacting.resolve(mechanism)
    closing: list[Closure | Coupling] = [*mechanism.closures, *couplings(mechanism)]
    looped, ordered = index_tables.closures(numbering, closing) if like is None else ({}, like.closures)
    site_pairs = [(numbering.site(c.outer), numbering.site(c.inner)) for c in mechanism.contacts]
    gauges = Gauges()
    loaded = loading.tabulate(mechanism, numbering, gauges, given)
    drive_laws = laws.drive_laws(mechanism.scene, given)
    in_tree = [law.times(sign) for law, sign in zip(drive_laws, mechanism.drive_signs, strict=True)]
    gravity, components = loading.gravity(mechanism.scene), mechanism.components
    parts = _parts(numbering, normals, any(law.harmonics.any() for law in [*drive_laws, *loaded.laws]))
    slots = of_effects.slots(mechanism, parts)
    books = _books(slots)
    tables = {
        m.LINK_NUMBERS: [_link_numbers(*one) for one in zip(mechanism.links, _borne(mechanism), strict=True)],
        **contacting.fill(numbering, parts, normals, site_pairs, gauges, slots["bristles"]),
        **laws.fill([*in_tree, *loaded.laws]),
        **loaded.tables,
        m.LOADS: _load_rows(mechanism, loaded, books),
        **of_effects.tables(filling.Filling(numbering, parts, ordered, gauges, slots)),
        **guards.fill(mechanism, of_effects.guards(mechanism, parts), loaded),
        m.GAUGES: gauges.rows,
        m.GRAVITY: gravity,
        m.BOOKS: books,
        m.DRIVES: _drives(mechanism, books),
        m.CLOSURE_NUMBERS: [
            components.lengths[components.of(*(site.link for both in one.ends for site in both))] for one in ordered
        ],
    }
    tables[m.GROUPS], tables[m.FLOORS] = _error_groups(numbering, parts, gauges)
    if like is None:
        tables |= _topology_tables(numbering, parts, books) | looped
    else:
        wired = {table for array in ("h", "f") for table in m.TABLES[array]} - tables.keys()
        tables |= {table: like.arrays.rows(table) for table in wired}
    ny = len(tables[m.GROUPS])
    sizes = {
        m.NQ: numbering.nq,
        m.NV: numbering.nv,
        m.N_LEDGER: ny - numbering.nq - numbering.nv,
        m.N_DRIVES: numbering.known,
        m.N_INTERNAL: gauges.internal,
        m.N_LOAD_BENDS: len(loaded.bends),
        m.N_SURFACES: sum(not isinstance(contact.joint, End) for contact in mechanism.contacts),
        **{m.SIZES[f"{effect.name}_slot"]: slots[effect.name] for effect in parts.present if effect.ledger},
    }
    arrays = pack(sizes, tables)
    of_mechanism = (mechanism.drives, mechanism.drive_signs, gravity, mechanism.length)
    made = (mechanism, numbering, parts, arrays, mechanism.scene, mechanism.links, ordered, mechanism.contacts, normals)
    return Model(*made, loaded.loads, *of_mechanism, numbering.nq, numbering.nv, ny)


def _symmetric(J: np.ndarray) -> list[float]:
    """Return the entries xx yy zz xy xz yz of a symmetric matrix."""
    return [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]


def _topology_tables(numbering: Numbering, parts: Parts, books: Books) -> dict[Any, Any]:
    """Return the tables that follow from links, joints, frames and flexible bodies; those of closures excluded."""
    return {
        m.LINKS: _links(numbering, parts),
        m.SITES: [(s.link, numbering.port_of(k)) for k, s in enumerate(numbering.sites)],
        m.SITE_NUMBERS: [np.concatenate([s.placement.p, s.placement.R.ravel()]) for s in numbering.sites],
        **flexible_bodies.fill(numbering, [book.loss for book in books]),
    }


def _parts(numbering: Numbering, normals: tuple[Resolved, ...], harmonics: bool) -> Parts:
    """Return the kinds of parts that the mechanism has, out of those that its scene may have."""
    mechanism = numbering.mechanism
    return replace(
        most_parts(mechanism.scene),
        joints=tuple(sorted({link.kind for link in mechanism.links[1:]})),
        forms=tuple(sorted({law.form for law in normals})),
        closures=bool(mechanism.closures or mechanism.scene.rigid_gears()),
        harmonics=harmonics,
    )


def _links(numbering: Numbering, parts: Parts) -> list[tuple[int, ...]]:
    """Return the rows of the table LINKS."""
    rows: list[tuple[int, ...]] = []
    for i, link in enumerate(numbering.mechanism.links):
        joint = parts.joints.index(link.kind) if i else -1
        flex = numbering.flexible.index(i) if link.flexible else -1
        inboard = numbering.port_of_inboard(i) if link.flexible else -1
        q, c = numbering.positions[i], numbering.coordinates[i]
        part = numbering.mechanism.components.of_link[i]
        rows.append((link.branch.parent, joint, q.start, c.start, len(c), flex, inboard, part))
    return rows


def _link_numbers(link: Link, borne: np.ndarray) -> np.ndarray:
    """Return a link's row of LINK_NUMBERS; the inertia of flexible links is zero here: they have other tables."""
    mass, com, J = link.inertia or (0.0, np.zeros(3), np.zeros((3, 3)))
    return np.array([mass, *com, *_symmetric(J), *borne])


def _borne(mechanism: Mechanism) -> np.ndarray:
    """Return mass and a bound of the polar moment about the link's origin of each link and its descendants, (links, 2).

    The bound holds in any pose: all links in one straight line, every slide extended by the mechanism's size.
    """
    sums, links = np.zeros((len(mechanism.links), 3)), mechanism.links  # mass, its first and second moment
    for i in range(len(links) - 1, 0, -1):
        link, above = links[i], links[links[i].branch.parent]
        if link.undeformed is not None:
            mass, com, J = link.undeformed
            sums[i] += mass, mass * np.linalg.norm(com), mass * com @ com + 0.5 * np.trace(J)
        mass, first, second = sums[i]
        joint = above.start.point(link.inboard.placement.p) if link.inboard is not None else link.start.p
        a = float(np.linalg.norm(link.start.p - joint) + np.linalg.norm(joint - above.start.p))
        if "t" in joint_type(link.kind).SPEEDS:
            a = max(a, mechanism.length)
        sums[link.branch.parent] += mass, first + mass * a, second + a * (2.0 * first + mass * a)
    return sums[:, ::2]


class Book(NamedTuple):
    """Indices in the ledger of the energy sums of one independent mechanism: see BOOKS."""

    work: int
    loss: int
    load: int


Books = list[Book]


def _books(slots: Mapping[str, int]) -> Books:
    """Return the ledger indices of the energy sums of each independent mechanism."""
    others = range(slots["books"], slots["end"], of_effects.OTHER_BOOKS)
    return [Book(m.DRIVE_WORK, m.MODAL_LOSS, slots["loads"]), *(Book(k, k + 1, k + 2) for k in others)]


def _load_rows(mechanism: Mechanism, loaded: loading.Loaded, books: Books) -> list[tuple[int, ...]]:
    """Return the rows of the table LOADS, with the ledger index of each load's energy sums."""
    links = [[mechanism.link_of[frame.partition(".")[0]] for frame in load.frames] for load in loaded.loads]
    parts = [mechanism.components.of(*both) for both in links]
    return [(*row, books[part].load) for row, part in zip(loaded.tables[m.LOADS], parts, strict=True)]


def _drives(mechanism: Mechanism, books: Books) -> list[int]:
    """Return the rows of the table DRIVES."""
    parts = {name: mechanism.components.of(i) for i, link in enumerate(mechanism.links) for name in link.drives}
    return [books[parts[name]].work for name in mechanism.drives]


def _error_groups(numbering: Numbering, parts: Parts, gauges: Gauges) -> tuple[np.ndarray, np.ndarray]:
    """Return each state variable's group, and the rows of FLOORS; gauges: have the internal states, which are last."""
    mechanism, of_link = numbering.mechanism, numbering.mechanism.components.of_link
    lengths, masses = np.array(mechanism.components.lengths), np.zeros(len(mechanism.components.lengths))
    for link, part in zip(mechanism.links[1:], of_link[1:], strict=True):
        masses[part] += link.mass
    whole = np.full(len(lengths), mechanism.length)
    groups, magnitudes, owners = _floors(numbering, parts, gauges, lengths, masses * lengths**2)
    natural = _floors(numbering, parts, gauges, whole, np.full(len(lengths), np.sum(masses)) * whole**2)[1]
    counts = np.bincount(owners[groups], minlength=len(lengths))
    return groups, np.stack([magnitudes, natural, np.sqrt(counts / len(groups))[owners]], axis=1)


def _floors(
    numbering: Numbering, parts: Parts, gauges: Gauges, lengths: np.ndarray, energies: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the group of each state variable, and each group's floor of the error scale and independent mechanism.

    Below its floor, a group is resolved absolutely. A vector is one group, so that turning the scene hardly changes a
    step.  Floors: the independent mechanism's size, one radian, both per second, and the energy of moving its mass by
    its size in a second.  lengths, energies: of each independent mechanism.
    """
    mechanism, of_link, rows = numbering.mechanism, numbering.mechanism.components.of_link, list[tuple[float, int]]()
    q_group, v_group = np.zeros(numbering.nq, dtype=np.int64), np.zeros(numbering.nv, dtype=np.int64)

    def fill(target: np.ndarray, places: range, letters: str, part: int) -> None:
        for k, letter in enumerate(letters):
            if k == 0 or letters[k - 1] != letter:
                rows.append((lengths[part] if letter == "t" else 1.0, part))
            target[places[k]] = len(rows) - 1

    for i, link in enumerate(mechanism.links[1:], start=1):
        declared = joint_type(link.kind)
        if not link.drives:
            fill(q_group, numbering.positions[i], declared.POSITIONS, of_link[i])
            fill(v_group, numbering.coordinates[i], declared.SPEEDS, of_link[i])
        if link.flexible:
            for target, mine in ((q_group, numbering.modal_positions[i]), (v_group, numbering.modal_coordinates[i])):
                rows.append((lengths[of_link[i]] * link.mass**0.5, of_link[i]))
                target[mine] = len(rows) - 1
    groups = [*q_group, *v_group]
    tail = [group for block in of_effects.blocks(mechanism, parts, energies, lengths).values() for group in block]
    acting = ([numbering.sites[site].link for site in sites if site >= 0] for sites in gauges.owners)  # -1: the world
    tail += [(1.0, 1, mechanism.components.of(*links)) for links in acting]
    for floor, count, part in tail:
        rows.append((floor, part))
        groups += [len(rows) - 1] * count
    floors, owners = zip(*rows, strict=True)
    return np.array(groups, dtype=np.int64), np.array(floors), np.array(owners)
