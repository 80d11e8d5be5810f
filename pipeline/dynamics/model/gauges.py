"""The table of the gauges, which measure joint coordinates, and the internal states of parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import Coordinate


@dataclass
class Gauges:
    """Gauges and internal states given out so far.

    rows: of the table GAUGES.  owners: sites, or -1, between which the part of each internal state acts; these states
    are at the end of the state.
    """

    rows: list[tuple[int, ...]] = field(default_factory=list)
    owners: list[tuple[int, int]] = field(default_factory=list)

    @property
    def internal(self) -> int:
        """Number of internal states."""
        return len(self.owners)

    def add(self, a: int, b: int, coordinate: Coordinate, *, counts: bool) -> int:
        """Number of a new gauge of a joint coordinate between sites; `counts`: whether full turns of an angle count."""
        turns = self.states(1, a, b) if counts and coordinate.turning else -1
        how = (coordinate.side, coordinate.axis, *coordinate.sine, *coordinate.cosine)
        self.rows.append((a, b, turns, int(coordinate.turning), *how))
        return len(self.rows) - 1

    def states(self, number: int, a: int, b: int) -> int:
        """First of so many new internal states of a part between sites."""
        first = self.internal
        self.owners += [(a, b)] * number
        return first


def angles(gauges: np.ndarray, sites: np.ndarray) -> dict[int, float]:
    """Angle [rad] in (-pi, pi] of every gauge that counts turns, by its internal state.

    gauges: rows of GAUGES; sites: frames of all sites, rows of SITE_FRAMES; both with named fields.
    """
    mine = gauges[gauges["turns"] >= 0]
    nothing = np.zeros(int(mine["turns"].max(initial=-1)) + 1)
    return {int(row["turns"]): angle for row, angle in zip(mine, values(mine, sites, nothing), strict=True)}


def values(gauges: np.ndarray, sites: np.ndarray, internal: np.ndarray) -> list[float]:
    """Coordinates [rad, or m] that gauges measure, full turns counted as the internal states say; as of `angles`."""
    entries = []
    for row in gauges:
        a, b = sites[row["a"]], sites[row["b"]]
        if row["turning"]:
            sine = float(a["axes"][:, row["sine_f"]] @ b["axes"][:, row["sine_g"]])
            cosine = float(a["axes"][:, row["cosine_f"]] @ b["axes"][:, row["cosine_g"]])
            angle = atan2(sine, cosine)
            turns = round((internal[row["turns"]] - angle) / (2.0 * np.pi)) if row["turns"] >= 0 else 0
            entries.append(angle + 2.0 * np.pi * turns)
        else:
            along = (b if row["side"] else a)["axes"][:, row["axis"]]
            entries.append(float(along @ (b["origin"] - a["origin"])))
    return entries
