"""What is written here instead of imported from SciPy, since importing takes longer than a run, does the same."""

from __future__ import annotations

import math
import platform

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.csgraph import reverse_cuthill_mckee as scipy_order

from flexclear.pipeline.core.roots import root_between
from flexclear.pipeline.core.sparse_graphs import components, reverse_cuthill_mckee


@given(st.floats(0.01, 30.0), st.floats(0.0, 1.0), st.sampled_from([1e-300, 1e-17, 1e-9]))
def test_a_root_is_scipys_to_the_last_bit(stretch: float, fraction: float, xtol: float) -> None:
    """Flat, steep and ordinary crossings; both take the same steps, so there is no tolerance.

    But where SciPy's compiler may fuse products and sums, as for ARM: there each is as near to the root as is asked.
    """

    def f(x: float) -> float:
        return math.atan(stretch * (x - fraction)) + 0.1 * (x - fraction) ** 3

    low, high = -1.0, 2.0
    found, known = root_between(f, low, high, xtol, 1e-15), brentq(f, low, high, xtol=xtol, rtol=1e-15, maxiter=1000)
    if platform.machine() in ("x86_64", "AMD64"):
        assert found == known
    assert abs(found - known) <= 20.0 * (xtol + 1e-15 * abs(known))  # on either side of it by once that


def test_a_root_at_an_end_is_found_and_none_is_told() -> None:
    assert root_between(lambda x: x - 1.0, 1.0, 2.0, 1e-12, 1e-15) == 1.0
    assert root_between(lambda x: x - 2.0, 1.0, 2.0, 1e-12, 1e-15) == 2.0
    with pytest.raises(ValueError, match="same sign"):
        root_between(lambda x: x, 1.0, 2.0, 1e-12, 1e-15)


@given(st.integers(2, 25), st.floats(0.0, 0.6), st.booleans(), st.integers(0, 10**6))
def test_parts_and_order_of_a_graph_are_scipys_node_by_node(nodes: int, fraction: float, own: bool, seed: int) -> None:
    joined = np.random.default_rng(seed).random((nodes, nodes)) < fraction
    joined = joined | joined.T | (np.eye(nodes, dtype=bool) & own)
    graph = csr_array(joined.astype(float))
    assert reverse_cuthill_mckee(joined) == scipy_order(graph, symmetric_mode=True).tolist()
    parts, of = connected_components(graph, directed=False)
    assert components(joined) == [np.flatnonzero(of == part).tolist() for part in range(parts)]
