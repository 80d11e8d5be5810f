"""Composition of all loads in one kernel, kind after kind."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.choice import nothing
from flexclear.dynamics.kernels import kernel


def make_loads(kinds: tuple[Callable, ...], first: int = 0) -> Callable:
    """Build the kernel loads(d) that applies all loads of these kinds, from index `first` on; kinds: kernels
    `apply`."""
    if not kinds:
        return nothing
    head, tail = kinds[0], make_loads(kinds[1:], first + 1)

    @kernel
    def loads(d):
        kind = d.load_kinds[first]
        for k in range(kind.load0, kind.load0 + kind.n_loads):
            head(d, k)
        tail(d)

    return loads
