"""Choice between the kinds present, as compiled branches; one kind needs no branch."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.vectors import kernel


def joints(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """motion(kind, w, x, u, du, joint, rate) over the kinds numbered from `first`."""
    head = kernels[0]
    if len(kernels) == 1:

        @kernel
        def only(kind, w, x, u, du, joint, rate):
            head(w, x, u, du, joint, rate)

        return only
    tail = joints(kernels[1:], first + 1)

    @kernel
    def choose(kind, w, x, u, du, joint, rate):
        if kind == first:
            head(w, x, u, du, joint, rate)
        else:
            tail(kind, w, x, u, du, joint, rate)

    return choose


def normals(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """force(kind, depth, rate, impact_rate, p)."""
    head = kernels[0]
    if len(kernels) == 1:

        @kernel
        def only(kind, depth, rate, impact_rate, p):
            return head(depth, rate, impact_rate, p)

        return only
    tail = normals(kernels[1:], first + 1)

    @kernel
    def choose(kind, depth, rate, impact_rate, p):
        if kind == first:
            return head(depth, rate, impact_rate, p)
        return tail(kind, depth, rate, impact_rate, p)

    return choose


def energies(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """stored(kind, depth, p)."""
    head = kernels[0]
    if len(kernels) == 1:

        @kernel
        def only(kind, depth, p):
            return head(depth, p)

        return only
    tail = energies(kernels[1:], first + 1)

    @kernel
    def choose(kind, depth, p):
        if kind == first:
            return head(depth, p)
        return tail(kind, depth, p)

    return choose


def frictions(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """coefficient(kind, speed, p); a contact without friction has the kind -1."""
    if not kernels:

        @kernel
        def none(kind, speed, p):
            return 0.0

        return none
    head, tail = kernels[0], frictions(kernels[1:], first + 1)

    @kernel
    def choose(kind, speed, p):
        if kind == first:
            return head(speed, p)
        return tail(kind, speed, p)

    return choose
