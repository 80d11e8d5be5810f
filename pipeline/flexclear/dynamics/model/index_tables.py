"""Tables of the closures: their rows, and the coordinates on which they depend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.mechanism import Closure
from flexclear.dynamics.model.numbering import Numbering


def closures(
    numbering: Numbering, closing: Sequence[Closure | Coupling]
) -> tuple[dict[Any, Any], tuple[Closure | Coupling, ...]]:
    """Return the closures' tables, and the closures ordered for a thin envelope; closing: joints, then couplings."""
    routes = [[closure_route(numbering, *map(numbering.site, both)) for both in one.ends] for one in closing]
    order = _order([{c for route in parts for c, _, _ in route} for parts in routes])
    closure, rows, supports = list[tuple[int, ...]](), list[tuple[int, int, int]](), list[list[int]]()
    begin = jacobian0 = 0
    joints = sum(isinstance(one, Closure) for one in closing)
    for old in order:
        one, coupling = closing[old], max(old - joints, -1)
        slots, ends = sorted({c for route in routes[old] for c, _, _ in route if c < numbering.nv}), one.ends[0]
        where = (*map(numbering.site, ends), len(rows), len(one.rows), begin, len(slots), jacobian0)
        closure.append((*where, len(rows), len(one.rows), coupling))
        rows += one.rows
        supports.append(slots)
        begin += len(slots)
        jacobian0 += len(one.rows) * len(slots)
    tables = {
        m.CLOSURES: closure,
        m.CLOSURE_ROWS: rows,
        m.SUPPORT: [c for slots in supports for c in slots],
    }
    return tables, tuple(closing[k] for k in order)


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
