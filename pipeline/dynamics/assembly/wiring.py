"""Index tables of the equations: mass-matrix entries, envelopes, closure supports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from pipeline.dynamics.assembly.driving import joint_class
from pipeline.dynamics.assembly.layout import Layout
from pipeline.dynamics.tables import KEPT0, N_KEPT


def integers(rows: Sequence[tuple[int, ...]], width: int) -> np.ndarray:
    """A contiguous integer table, also when it is empty."""
    return np.ascontiguousarray(np.array(rows, dtype=np.int64).reshape(-1, width))


def mass_entries(layout: Layout) -> dict[str, np.ndarray]:
    """The tables PAIRS, KNOWN_PAIRS and ENVELOPE.

    A coordinate's momentum (that of all it moves) times the column of a coordinate nearer to the
    ground is their entry of the mass matrix.
    """
    products: list[tuple[int, int, int, int]] = []  # momentum, column, their coordinates
    for i in range(1, len(layout.system.links)):
        own = list(range(layout.c0[i], layout.c0[i] + layout.n_speeds(i)))
        above = layout.route(i - 1)
        for n, c in enumerate(own):
            products += [(c, d, c, d) for d in own[: n + 1]]
            products += [(c, col, c, d) for d, col in above]
        if i in layout.modes:
            modal = range(layout.flex_c0[i], layout.flex_c0[i] + layout.modes[i])
            products += [(c, col, c, d) for c in modal for d, col in layout.joint_route(i)]
        products += _port_products(layout, i)
    first = list(range(layout.nv))
    for _, _, c, d in products:
        if c < layout.nv and d < layout.nv:
            first[max(c, d)] = min(first[max(c, d)], c, d)
    for i, n in layout.modes.items():
        for j in range(n):
            first[layout.flex_c0[i] + j] = min(first[layout.flex_c0[i] + j], layout.flex_c0[i])
    start, rows = 0, []
    for i, f in enumerate(first):
        rows.append((f, start))
        start += i - f + 1
    pairs, known = [], []
    for m, col, c, d in products:
        if c < layout.nv and d < layout.nv:
            i, j = max(c, d), min(c, d)
            pairs.append((m, col, rows[i][1] + j - rows[i][0]))
        elif c < layout.nv or d < layout.nv:
            pair = (max(c, d) - layout.nv, min(c, d))
            known.append((m, col, *pair))
    return {"PAIRS": integers(pairs, 3), "KNOWN_PAIRS": integers(known, 4), "ENVELOPE": integers(rows, 2)}


def _port_products(layout: Layout, i: int) -> list[tuple[int, int, int, int]]:
    """Entries between the modes of a flexible parent through the link i that it carries."""
    port = layout.port_of(i - 1)
    if port < 0:
        return []
    link = layout.sites[i - 1].link
    first, c0, n = layout.ports[port][2], layout.flex_c0[link], layout.modes[link]
    return [(first + j, first + k, c0 + j, c0 + k) for j in range(n) for k in range(j + 1)]


def closures(layout: Layout, site_pairs: list[tuple[str, int, int]]) -> dict[str, np.ndarray]:
    """Tables of the closures, given (joint type, site a, site b) each; ordered for a thin envelope."""
    routes = [closure_route(layout, a, b) for _, a, b in site_pairs]
    order = _order([{c for c, _, _ in route} for route in routes])
    closure: list[tuple[int, ...]] = []
    rows: list[tuple[int, int, int]] = []
    support: list[int] = []
    entries: list[tuple[int, int, int]] = []
    known: list[tuple[int, int, int, int]] = []
    supports: list[list[int]] = []
    row0 = jacobian0 = 0
    for new, old in enumerate(order):
        kind, a, b = site_pairs[old]
        declared = joint_class(kind)
        mine = [(0, axis, 0) for axis in declared.TRANSLATIONS] + [(1, k, n) for k, n in declared.ROTATIONS]
        slots = sorted({c for c, _, _ in routes[old] if c < layout.nv})
        moved = uncommon(routes[old])
        entry0 = len(entries)
        entries += [(slots.index(c), col, sign) for c, col, sign in moved if c < layout.nv]
        known += [(new, c - layout.nv, col, sign) for c, col, sign in moved if c >= layout.nv]
        n_entries = len(entries) - entry0
        closure.append((a, b, row0, len(mine), len(support), len(slots), jacobian0, entry0, n_entries, row0, len(mine)))
        rows += mine
        support += slots
        supports.append(slots)
        row0 += len(mine)
        jacobian0 += len(mine) * len(slots)
    return {
        "CLOSURES": integers(closure, 11),
        "CLOSURE_ROWS": integers(rows, 3),
        "SUPPORT": np.array(support, dtype=np.int64),
        "ENTRIES": integers(entries, 3),
        "KNOWN_ENTRIES": integers(known, 4),
        **_couplings(integers(closure, 11), supports),
        "order": np.array(order, dtype=np.int64),
    }


def closure_route(layout: Layout, a: int, b: int) -> list[tuple[int, int, int]]:
    """(coordinate, column, sign) of both sides."""
    return [(c, col, 1) for c, col in layout.route(b)] + [(c, col, -1) for c, col in layout.route(a)]


def uncommon(route: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """What is left after motions common to both sides cancel."""
    plus = {col for _, col, sign in route if sign > 0}
    minus = {col for _, col, sign in route if sign < 0}
    return [(c, col, sign) for c, col, sign in route if col not in plus & minus]


def _order(supports: list[set[int]]) -> list[int]:
    """Reverse Cuthill-McKee on "shares a coordinate"."""
    n = len(supports)
    if n < 2:
        return list(range(n))
    graph = np.array([[bool(a & b) for b in supports] for a in supports], dtype=float)
    return [int(k) for k in reverse_cuthill_mckee(csr_array(graph), symmetric_mode=True)]


def _couplings(closure: np.ndarray, supports: list[list[int]]) -> dict[str, np.ndarray]:
    """Pairs of closures with common coordinates, the common slots, and the envelope of J M^-1 J^T."""
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
    coupled = integers(pairs, 4)
    return {
        "CLOSURE_PAIRS": coupled,
        "COMMON": integers(common, 2),
        "CLOSURE_ENVELOPE": closure_envelope(closure, coupled),
    }


def closure_envelope(closures: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """First column and start of each kept row of J M^-1 J^T; pairs: first two columns are coupled closures."""
    first = closures[:, KEPT0].copy()
    for a, b in pairs[:, :2]:
        first[b] = min(first[b], closures[a, KEPT0])
    rows, start = [], 0
    for b, closure in enumerate(closures):
        for k in range(closure[KEPT0], closure[KEPT0] + closure[N_KEPT]):
            rows.append((first[b], start))
            start += k - first[b] + 1
    return integers(rows, 2)
