"""All loads by one kernel: kind after kind, each kind's in a row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics.choice import nothing
from flexclear.pipeline.dynamics.kernels import kernel


def make_loads(kinds: tuple[Any, ...]) -> Callable:
    """The kernel loads(d) that applies the loads of all kinds present, given their modules."""
    return _in_order(tuple(kind.apply for kind in kinds))


def _in_order(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    if not kernels:
        return nothing
    head, tail = kernels[0], _in_order(kernels[1:], first + 1)

    @kernel
    def loads(d):
        kind = d.load_kinds[first]
        for k in range(kind.load0, kind.load0 + kind.n_loads):
            head(d, k)
        tail(d)

    return loads
