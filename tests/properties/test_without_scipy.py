"""What stands in for functions of SciPy, so that a run need not import them, gives the same to the last bit."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from flexclear.pipeline.core.roots import brent
from flexclear.pipeline.dynamics.model.wiring import _order


@pytest.mark.parametrize("seed", range(100))
def test_roots_are_those_of_scipy(seed: int) -> None:
    """Simple and multiple roots; steps of all three kinds are taken."""
    rng = random.Random(seed)
    low, high, power = rng.uniform(-3.0, 0.0), rng.uniform(0.0, 3.0), rng.choice([1, 2, 3, 5])
    root = rng.uniform(low, high)

    def f(x: float) -> float:
        return math.copysign(abs(x - root) ** power, x - root) + 0.1 * math.sin(x - root)

    for xtol, rtol in ((1e-300, 1e-15), (1e-12, 1e-9)):
        assert brent(f, low, high, xtol, rtol) == brentq(f, low, high, xtol=xtol, rtol=rtol)


def test_roots_at_the_ends_and_none() -> None:
    assert brent(lambda x: x, 0.0, 1.0, 1e-300, 1e-15) == 0.0
    assert brent(lambda x: x - 1.0, 0.0, 1.0, 1e-300, 1e-15) == 1.0
    with pytest.raises(ValueError, match="different signs"):
        brent(lambda x: x * x + 1.0, -1.0, 1.0, 1e-300, 1e-15)


@pytest.mark.parametrize("seed", range(100))
def test_closures_are_ordered_as_scipy_does_it(seed: int) -> None:
    """Also graphs of several parts, and closures that share nothing with themselves."""
    rng = random.Random(seed)
    coordinates = range(rng.randint(1, 40))
    supports = [
        set(rng.sample(coordinates, min(len(coordinates), rng.randint(seed % 2, 4)))) for _ in range(rng.randint(1, 30))
    ]
    graph = np.array([[bool(a & b) for b in supports] for a in supports], dtype=float)
    assert _order(supports) == reverse_cuthill_mckee(csr_array(graph), symmetric_mode=True).tolist()
