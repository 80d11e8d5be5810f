"""Choice between the kinds present, as compiled branches; one kind needs no branch. And what is repeated."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def nothing(*given):
    """Do what the parts do of which a mechanism has none."""


@kernel
def repeat(turn, d):
    """Call the kernel `turn` as long as it returns true; on a tape that is a loop (`specialise.trace`)."""
    while turn(d):
        pass


def choose(kernels: tuple[Callable, ...], first: int = 0) -> Callable:
    """chosen(kind, *arguments) over the kernels of the kinds, numbered from `first`."""
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
