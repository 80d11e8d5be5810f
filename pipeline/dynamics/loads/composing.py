"""All loads by one kernel: kind after kind, each kind's in a row."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics import memory as m
from pipeline.dynamics.kernels import kernel


def compose(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """The kernel loads(h, f, w) that applies the loads of all kinds present, apply(h, f, w, load) each."""
    if not kernels:

        @kernel
        def nothing(h, f, w):
            """No kind is left."""

        return nothing
    head, tail = kernels[0], compose(kernels[1:], first + 1)

    @kernel
    def loads(h, f, w):
        begin = m.LOAD_KINDS.load0(h, first)
        for k in range(begin, begin + m.LOAD_KINDS.n_loads(h, first)):
            head(h, f, w, k)
        tail(h, f, w)

    return loads
