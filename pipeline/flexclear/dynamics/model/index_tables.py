"""Index tables of the equations: envelopes, supports of the closures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import arrays, flexible_bodies
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.mechanism import Closure
from flexclear.dynamics.model.numbering import Numbering


def mass_entries(numbering: Numbering) -> dict[Any, Any]:
    """Return the table ENVELOPE: a number per coordinate of a joint, and behind these the entries between the modes of
    each body."""
    first = list(range(numbering.nv))
    for i in range(1, len(numbering.mechanism.links)):
        if numbering.port_of(i - 1) >= 0:  # a carried link couples all moving shapes
            moving = numbering.moving(numbering.sites[i - 1].link)
            for c in moving:
                first[c] = min(first[c], *moving)
    for link, modes in numbering.modal_coordinates.items():
        # stiffness couples held and moving shapes (`projection`), and so does mass where the latter move the body
        if numbering.bases[link].held or flexible_bodies.coupled(numbering.mechanism, link):
            for c in numbering.moving(link):
                first[c] = min(first[c], modes.start)
    modal_rows = {c for modes in numbering.modal_coordinates.values() for c in modes}
    start, rows = numbering.nv, []
    for i, f in enumerate(first):
        rows.append((f, start - f) if i in modal_rows else (i, 0))
        start += i - f + 1 if i in modal_rows else 0
    return {m.ENVELOPE: rows}


def closures(
    numbering: Numbering, closing: Sequence[Closure | Coupling]
) -> tuple[dict[Any, Any], tuple[Closure | Coupling, ...]]:
    """Return the closures' tables, and the closures ordered for a thin envelope; closing: joints, then couplings."""
    ends = [[(numbering.site(a), numbering.site(b)) for a, b in one.ends] for one in closing]
    routes = [[closure_route(numbering, a, b) for a, b in parts] for parts in ends]
    order = _order([{c for route in parts for c, _, _ in route} for parts in routes])
    closure: list[tuple[int, ...]] = []
    rows: list[tuple[int, int, int]] = []
    support: list[int] = []
    entries: list[tuple[int, ...]] = []
    known: list[tuple[int, ...]] = []
    supports: list[list[int]] = []
    paths: list[tuple[int, ...]] = []
    row0 = jacobian0 = 0
    joints = sum(isinstance(one, Closure) for one in closing)
    for new, old in enumerate(order):
        (a, b), coupling, mine = ends[old][0], max(old - joints, -1), closing[old].rows
        slots = sorted({c for route in routes[old] for c, _, _ in route if c < numbering.nv})
        moved = [(*motion, part) for part, route in enumerate(routes[old]) for motion in uncommon(route)]
        entry0 = len(entries)
        entries += [(slots.index(c), col, sign, part) for c, col, sign, part in moved if c < numbering.nv]
        known += [(new, c - numbering.nv, col, sign, part) for c, col, sign, part in moved if c >= numbering.nv]
        n_entries = len(entries) - entry0
        where = (a, b, row0, len(mine), len(support), len(slots), jacobian0, entry0, n_entries)
        path = _path(numbering, slots, [site for ends_of_part in ends[old] for site in ends_of_part])
        closure.append((*where, row0, len(mine), threes(len(mine)), coupling, len(paths), len(path)))
        paths += path
        rows += mine
        support += slots
        supports.append(slots)
        row0 += len(mine)
        jacobian0 += 3 * threes(len(mine)) * len(slots)
    tables = {
        m.CLOSURES: closure,
        m.CLOSURE_ROWS: rows,
        m.SUPPORT: support,
        m.ENTRIES: entries,
        m.KNOWN_ENTRIES: known,
        m.PATHS: paths,
        **_couplings(arrays.named_rows(m.CLOSURES, closure), supports),
    }
    return tables, tuple(closing[k] for k in order)


def _path(numbering: Numbering, slots: list[int], sites: list[int]) -> list[tuple[int, ...]]:
    """Return the rows of the table PATHS from some sites to the ground; slots: coordinates of the closure's support."""
    links: set[int] = set()
    for site in sites:
        link = numbering.sites[site].link
        while link:
            links.add(link)
            link = numbering.mechanism.links[link].branch.parent

    def slot(coordinates: range) -> int:
        """Return the slot of the first of some coordinates, or -1 where none of them is free."""
        return slots.index(coordinates.start) if coordinates and coordinates.start < numbering.nv else -1

    shapes = {i: slot(numbering.moving(i)) for i in links & numbering.bases.keys()}
    carrier = {i: shapes.get(numbering.mechanism.links[i].branch.parent, -1) for i in links}
    return [(i, slot(numbering.coordinates[i]), shapes.get(i, -1), carrier[i]) for i in sorted(links)[::-1]]


def threes(count: int) -> int:
    """Return the number of groups of three, the last perhaps smaller, that hold `count` rows of a closure."""
    return -(-count // 3)


def closure_route(numbering: Numbering, a: int, b: int) -> list[tuple[int, int, int]]:
    """Return (coordinate, column, sign) of all motions that move site b (sign 1) or site a (sign -1)."""
    return [(c, col, 1) for c, col in numbering.route(b)] + [(c, col, -1) for c, col in numbering.route(a)]


def uncommon(route: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Return a route without the motions that move both sides, which cancel."""
    plus = {col for _, col, sign in route if sign > 0}
    minus = {col for _, col, sign in route if sign < 0}
    return [(c, col, sign) for c, col, sign in route if col not in plus & minus]


def _order(supports: list[set[int]]) -> list[int]:
    """Return an order of the closures for a thin envelope; closures that share a coordinate are neighbours."""
    n = len(supports)
    if n < 2:
        return list(range(n))
    return reverse_cuthill_mckee(np.array([[bool(a & b) for b in supports] for a in supports]))


def reverse_cuthill_mckee(joined: np.ndarray) -> list[int]:
    """Return an order of the nodes for a thin envelope; joined: symmetric (n, n), true between neighbours.

    Breadth first from nodes of low degree, neighbours by rising degree, then reversed.  A node that is its own
    neighbour counts twice, as in `scipy.sparse.csgraph`, whose import takes 0.7 s of a run's 2.5 s.
    Source: Cuthill & McKee (1969), Proc. 24th Nat. Conf. ACM, 157-172; George & Liu (1981), sec. 4.3.
    """
    degree = (joined.sum(axis=1) + np.diag(joined)).astype(np.int32)
    order, seen = list[int](), set[int]()
    for seed in np.argsort(degree).tolist():
        if seed in seen:
            continue
        seen.add(seed)
        level = [seed]
        while level:
            order += level
            above, level = level, []
            for node in above:
                new = [k for k in np.flatnonzero(joined[node]).tolist() if k not in seen]
                seen.update(new)
                level += sorted(new, key=lambda k: int(degree[k]))
    return order[::-1]


def _couplings(closure: np.ndarray, supports: list[list[int]]) -> dict[Any, Any]:
    """Return the tables of pairs of closures with common coordinates, of the common slots, and of the envelope."""
    pairs: list[tuple[int, ...]] = []
    common: list[tuple[int, int]] = []
    users: dict[int, list[int]] = {}
    for b, support in enumerate(supports):
        for a in sorted({b, *(a for c in support for a in users.get(c, []))}):
            shared = sorted(set(supports[a]) & set(support))
            pairs.append((a, b, len(common), len(shared)))
            common += [(supports[a].index(c), support.index(c)) for c in shared]
        for c in support:
            users.setdefault(c, []).append(b)
    return {
        m.CLOSURE_PAIRS: pairs,
        m.COMMON: common,
        m.CLOSURE_ENVELOPE: closure_envelope(closure, arrays.named_rows(m.CLOSURE_PAIRS, pairs)),
    }


def closure_envelope(closures: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return first column and origin of each selected row of J M^-1 J^T, (rows, 2); pairs: rows of CLOSURE_PAIRS."""
    first = closures["kept0"].copy()
    for a, b in zip(pairs["a"], pairs["b"], strict=True):
        first[b] = min(first[b], closures["kept0"][a])
    rows, start = [], 0
    for b, closure in enumerate(closures):
        for k in range(closure["kept0"], closure["kept0"] + closure["n_kept"]):
            rows.append((first[b], start - first[b]))
            start += k - first[b] + 1
    return arrays.rows(m.CLOSURE_ENVELOPE, rows)
