"""All loads by one kernel: kind after kind, each kind's in a row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


def make_loads(kinds: tuple[Any, ...]) -> Callable:
    """The kernel loads(h, f, w, n) that applies the loads of all kinds present, given their modules."""
    apply = _in_order(tuple(kind.apply for kind in kinds))

    @kernel
    def loads(h, f, w, n):
        apply(h, f, w)

    return loads


def _in_order(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    if not kernels:

        @kernel
        def nothing(h, f, w):
            """No kind is left."""

        return nothing
    head, tail = kernels[0], _in_order(kernels[1:], first + 1)

    @kernel
    def loads(h, f, w):
        begin = m.LOAD_KINDS.load0(h, first)
        for k in range(begin, begin + m.LOAD_KINDS.n_loads(h, first)):
            head(h, f, w, k)
        tail(h, f, w)

    return loads
