"""All loads by one kernel: kind after kind, each kind's in a row."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.loads.fields import LOAD_KINDS
from pipeline.dynamics.vectors import kernel


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
        o = h[LOAD_KINDS] + 2 * first
        begin = h[o]
        for k in range(begin, begin + h[o + 1]):
            head(h, f, w, k)
        tail(h, f, w)

    return loads
