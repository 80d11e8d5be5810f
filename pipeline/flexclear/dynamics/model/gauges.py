"""Table of the gauges, which measure joint coordinates, and the internal states of parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flexclear.dynamics.joints.conditions import Gauge, frame_motion, measure
from flexclear.dynamics.joints.coordinate import Coordinate


@dataclass
class Gauges:
    """Gauges and internal states, in the order in which they were added.

    rows: of the table GAUGES.  owners: sites, or -1 for the world, between which the part of each internal state acts.
    Internal states are at the end of the state.
    """

    rows: list[tuple[int, ...]] = field(default_factory=list)
    owners: list[tuple[int, int]] = field(default_factory=list)

    @property
    def internal(self) -> int:
        """Number of internal states."""
        return len(self.owners)

    def add(self, a: int, b: int, coordinate: Coordinate, *, counts: bool) -> int:
        """Add a gauge of a joint coordinate between sites, return its index; counts: count full turns of an angle."""
        turns = self.states(1, a, b) if counts and coordinate.turning else -1
        self.rows.append((a, b, turns, *coordinate.gauge))
        return len(self.rows) - 1

    def states(self, number: int, a: int, b: int) -> int:
        """Add `number` internal states of a part between sites a and b; return the index of the first."""
        first = self.internal
        self.owners += [(a, b)] * number
        return first


def angles(gauges: np.ndarray, sites: np.ndarray) -> dict[int, float]:
    """Return the angle [rad] in (-pi, pi] of each gauge that counts turns, by its internal state.

    gauges: rows of GAUGES; sites: frames of all sites, rows of SITE_FRAMES; both with named fields.
    """
    mine = gauges[gauges["turns"] >= 0]
    nothing = np.zeros(int(mine["turns"].max(initial=-1)) + 1)
    return {int(row["turns"]): angle for row, angle in zip(mine, values(mine, sites, nothing), strict=True)}


def values(gauges: np.ndarray, sites: np.ndarray, internal: np.ndarray) -> list[float]:
    """Return the coordinates [rad or m] of gauges, with full turns from internal states; arguments as of `angles`."""
    entries = []
    for row in gauges:
        how = Gauge(*(int(row[name]) for name in Gauge._fields))
        value = float(measure(how, *(frame_motion(sites[row[end]]) for end in "ab"))[0])
        turns = round((internal[row["turns"]] - value) / (2.0 * np.pi)) if row["turns"] >= 0 else 0
        entries.append(value + 2.0 * np.pi * turns)
    return entries
