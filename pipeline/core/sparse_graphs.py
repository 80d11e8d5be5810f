"""Connected parts of small graphs, and an order of their nodes that keeps neighbours together.

As ``scipy.sparse.csgraph`` has them, node by node; importing that takes longer than a short run.
"""

from __future__ import annotations

import numpy as np


def components(joined: np.ndarray) -> list[list[int]]:
    """Nodes of each connected part, ascending, parts by their first node; joined: (n, n), true between neighbours."""
    waiting, groups = set(range(len(joined))), list[list[int]]()
    either = joined | joined.T
    while waiting:
        part, new = set[int](), {min(waiting)}
        while new:
            part |= new
            waiting -= new
            new = set(np.flatnonzero(either[sorted(new)].any(axis=0)).tolist()) & waiting
        groups.append(sorted(part))
    return groups


def reverse_cuthill_mckee(joined: np.ndarray) -> list[int]:
    """Order of the nodes for a thin envelope; joined: symmetric (n, n), true between neighbours.

    Breadth first from nodes of low degree, neighbours by rising degree, and all of it backwards.  A node that is its
    own neighbour counts twice.
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
