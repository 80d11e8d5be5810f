"""What is written here instead of imported from SciPy, since importing takes longer than a run, does the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.csgraph import reverse_cuthill_mckee as scipy_order

from flexclear.pipeline.dynamics.contact.restitution import root
from flexclear.pipeline.dynamics.model.interface_basis import _families
from flexclear.pipeline.dynamics.model.wiring import reverse_cuthill_mckee


@given(st.floats(0.01, 30.0), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0]))
def test_a_root_is_scipys(stretch: float, fraction: float, sign: float) -> None:
    """Flat, steep and ordinary crossings, rising and falling."""

    def f(x: float) -> float:
        return sign * (math.atan(stretch * (x - fraction)) + 0.1 * (x - fraction) ** 3)

    known = brentq(f, -1.0, 2.0, xtol=1e-300, rtol=1e-15, maxiter=1000)
    # f is rounded near its root: there each may stop where the rounded function changes its sign
    assert abs(root(f, -1.0, 2.0) - known) <= 1e-14 * max(1.0, 1.0 / stretch)


def test_a_root_at_an_end_is_a_root_and_equal_signs_are_an_error() -> None:
    assert root(lambda x: x - 1.0, 1.0, 2.0) == 1.0
    assert root(lambda x: x - 2.0, 1.0, 2.0) == 2.0
    assert root(lambda x: 2.0 - x, 1.0, 2.0) == 2.0
    for line in (lambda x: x, lambda x: -x):
        with pytest.raises(ValueError, match="same sign"):
            root(line, 1.0, 2.0)


@given(st.integers(2, 25), st.floats(0.0, 0.6), st.booleans(), st.integers(0, 10**6))
def test_parts_and_order_of_a_graph_are_scipys_node_by_node(nodes: int, fraction: float, own: bool, seed: int) -> None:
    joined = np.random.default_rng(seed).random((nodes, nodes)) < fraction
    joined = joined | joined.T | (np.eye(nodes, dtype=bool) & own)
    graph = csr_array(joined.astype(float))
    assert reverse_cuthill_mckee(joined) == scipy_order(graph, symmetric_mode=True).tolist()
    parts, of = connected_components(graph, directed=False)
    assert _families(joined) == [np.flatnonzero(of == part).tolist() for part in range(parts)]
