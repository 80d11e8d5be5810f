"""Nested dissection: an elimination order that keeps the factors of three-dimensional meshes small.

Nodes are halved recursively along the longest side of their box; of each cut, the nodes of the side with fewer
neighbours across form the separator, which is eliminated after both halves.
Source: George (1973), SIAM J. Numer. Anal. 10, 345-363.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Tree:
    """Elimination tree, children before parents.

    order: rows of the matrix in the order of elimination, shape (n,).
    start: first position of each block in `order`, and n, shape (blocks + 1,).
    parent: of each block, the number of blocks for the root, shape (blocks,).
    """

    order: np.ndarray
    start: np.ndarray
    parent: np.ndarray


def dissect(pattern: sp.csr_array, positions: np.ndarray, last: int = 0) -> Tree:
    """Return the elimination tree of a symmetric matrix.

    pattern: shape (n, n).  positions: position of each row [m], shape (n, 3); rows at one position stay together. last:
    this many last rows come last in the order.
    """
    points, group = np.unique(positions[: len(positions) - last], axis=0, return_inverse=True)
    group = np.concatenate([group.ravel(), len(points) + np.arange(last)])
    points = np.concatenate([points, np.zeros((last, 3))])
    graph = _quotient(pattern, group, len(points))
    blocks, parent = _blocks(graph, points, last)
    rank = np.empty(len(points), dtype=np.int64)
    rank[np.concatenate(blocks)] = np.arange(len(points))
    order = np.argsort(rank[group], kind="stable")
    rows = np.bincount(group, minlength=len(points))
    sizes = [int(rows[block].sum()) for block in blocks]
    return Tree(order, np.concatenate([[0], np.cumsum(sizes)]), parent)


def _quotient(pattern: sp.csr_array, group: np.ndarray, count: int) -> sp.csr_array:
    """Return the coupling pattern of groups of rows, shape (count, count)."""
    ones = np.ones(len(group), dtype=np.int32)
    join = sp.csr_array((ones, (group, np.arange(len(group)))), shape=(count, len(group)))
    bare = sp.csr_array((np.ones(pattern.nnz, dtype=np.int32), pattern.indices, pattern.indptr), shape=pattern.shape)
    graph = (join @ bare @ join.T).tocsr()
    graph.data[:] = 1
    return graph


def _blocks(graph: sp.csr_array, points: np.ndarray, last: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the groups in each block and the parent of each block, children first."""
    degree = np.diff(graph.indptr)
    # 8: a node with this many times the usual number of neighbours is a hub (a rigid face) and is eliminated last
    hub = degree > 8 * np.median(degree)
    hub[len(points) - last :] = True
    root, rest = np.flatnonzero(hub), np.flatnonzero(~hub)
    # from the root downwards; reversed at the end
    blocks: list[np.ndarray] = [root]
    above = [-1]
    waiting = [(rest, 0)]
    side = np.zeros(len(points), dtype=np.int32)
    while waiting:
        nodes, parent = waiting.pop()
        parts: list[np.ndarray] = []
        separator = nodes
        # 32: largest set of nodes that is not divided further; small dense blocks are faster than deeper trees
        if len(nodes) > 32:
            *parts, separator = _halves(graph, points, nodes, side)
        blocks.append(separator)
        above.append(parent)
        waiting += [(part, len(blocks) - 1) for part in parts if len(part)]
    # downwards depth first, reversed, has children first; the root's parent becomes the number of blocks
    return blocks[::-1], len(blocks) - 1 - np.array(above[::-1])


def _halves(
    graph: sp.csr_array, points: np.ndarray, nodes: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return two uncoupled parts and their separator. `side` is scratch, all zero."""
    box = points[nodes]
    along = box[:, np.argmax(np.ptp(box, axis=0))]
    order = np.argsort(along, kind="stable")
    middle = len(nodes) // 2
    # avoid a cut through a plane of nodes
    middle = int(np.searchsorted(along[order], along[order[middle]] - 1e-9 * np.ptp(along)))
    if middle < len(nodes) // 4:
        middle = len(nodes) // 2
    low, high = nodes[order[:middle]], nodes[order[middle:]]
    side[high] = 1
    near_low = graph[low] @ side > 0
    side[high], side[low] = 0, 1
    near_high = graph[high] @ side > 0
    side[low] = 0
    if near_low.sum() <= near_high.sum():
        return low[~near_low], high, low[near_low]
    return low, high[~near_high], high[near_high]
