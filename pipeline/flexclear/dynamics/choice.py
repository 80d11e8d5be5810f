"""Choice between kinds of parts, as compiled branches (one kind needs no branch), and repetition."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.kernels import kernel


@kernel
def nothing(*given):
    """No-op in place of a kernel for parts that a mechanism lacks."""


@kernel
def repeat(turn, d):
    """Call the kernel `turn` as long as it returns True; on a tape this is a loop (`specialise.trace`)."""
    while turn(d):
        pass


def choose(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """Build chosen(kind, *arguments), which calls the kernel of a kind; kinds are numbered from `first`."""
    head = kernels[0]
    if len(kernels) == 1:

        @kernel
        def only(kind, *arguments):
            return head(*arguments)

        return only
    tail = choose(kernels[1:], first + 1)

    @kernel
    def chosen(kind, *arguments):
        if kind == first:
            return head(*arguments)
        return tail(kind, *arguments)

    return chosen
