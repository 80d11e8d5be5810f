"""Which modes stay: whole clusters of equal frequencies only, rigid ones by count and gap."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.structure.modes.eigen import EQUAL, frequency

WHERE = "modes.count"
#: rigid eigenvalues are zero up to rounding; elastic ones lie at least this factor above them
RIGID_GAP = 1e4
#: modes to compute beyond those requested, to see where the last cluster ends
MARGIN = 8


@dataclass(frozen=True, slots=True)
class ModeRequest:
    """What decides the number of coordinates; nothing at all means every one that the mesh has.

    count: elastic coordinates, static ones included.  up_to: highest normal retained frequency [Hz].
    compliance: least fraction of the static compliance between the interfaces, in each direction.
    mass: least fraction of the mass that moves with the basis, in each direction.
    """

    count: int | None = None
    up_to: float | None = None
    compliance: float | None = None
    mass: float | None = None


def request(count: int | None, available: int, static: int = 0) -> int:
    """How many normal modes, of `available` ones, a basis of `count` coordinates needs; None asks for all.

    static: constraint modes that the count includes.  InputError for a count that the mesh cannot give.
    """
    if count is None:
        return available
    total = available + static
    if count > total:
        raise InputError(
            WHERE, f"{count} modes are asked for, the mesh has {total} elastic coordinates", f"ask for at most {total}"
        )
    least = max(static, 1)
    if count < least:
        reason = f": the {static} constraint modes of its interfaces belong to it" if static else ""
        raise InputError(WHERE, f"a basis of {count} modes is too small{reason}", f"ask for at least {least}")
    return count - static


def whole(values: np.ndarray, n: int, static: int = 0) -> int:
    """The number n of retained modes, or InputError when it would keep a part of a cluster of equal frequencies.

    values: ascending eigenvalues [rad^2/s^2] of the normal modes, more than are retained unless there are no more.
    static: as of `request`.
    """
    for start, stop in clusters(values):
        if start < n < stop:
            counts = [c + static for c in (start, stop) if c + static > 0]
            hertz = float(frequency(values[start : start + 1])[0])
            nearest = f"count is {counts[0]}" if len(counts) == 1 else f"counts are {counts[0]} and {counts[1]}"
            raise InputError(
                WHERE,
                f"{n + static} modes cut a cluster of {stop - start} equal frequencies at {hertz:.6g} Hz",
                f"the nearest whole {nearest}",
            )
    return n


def clusters(values: np.ndarray) -> list[tuple[int, int]]:
    """Ranges [start, stop) of equal eigenvalues; single ones are ranges of length one."""
    hertz = frequency(values)
    breaks = np.flatnonzero(np.diff(hertz) > EQUAL * hertz[1:]) + 1
    edges = [0, *breaks.tolist(), len(values)]
    return [(a, b) for a, b in pairwise(edges) if b > a]


def without_rigid(values: np.ndarray, rigid: int) -> None:
    """Check that exactly the first `rigid` eigenvalues are rigid: a gap of RIGID_GAP above them.

    Raises SolverError when the gap is not there (a mechanism inside the mesh, or rounding that hides it).
    """
    if not values[rigid] > RIGID_GAP * np.abs(values[:rigid]).max():
        last, first = frequency(values[rigid - 1 : rigid + 1])
        raise SolverError(
            f"modes: {rigid} rigid-body modes are expected below a gap, "
            f"but mode {rigid} is at {last:.3g} Hz and mode {rigid + 1} at {first:.3g} Hz"
        )
