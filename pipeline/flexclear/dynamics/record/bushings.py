"""Displacements and rotations of bushings in a run's dataset."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.model.bushings import nearest
from flexclear.dynamics.model.model import Model
from flexclear.scene.loads import Bushing


def bushing_series(model: Model, seen: Observed) -> Series:
    """Return displacement [m] and rotation vector [rad] of each second frame in the first one's axes; coordinates."""
    rows = model.rows_of(Bushing)
    displacement, rotation = (np.zeros((len(seen.state), len(rows), 3)) for _ in range(2))
    for k, row in enumerate(rows.values()):
        a, b = (seen.sites[:, row[end]] for end in ("a", "b"))
        to_first = np.swapaxes(a["axes"], 1, 2)
        displacement[:, k] = np.einsum("tij,tj->ti", to_first, b["origin"] - a["origin"])
        first = int(row["internal0"])
        at = model.ny - model.arrays.size(m.N_INTERNAL) + first
        # without resistance to rotation no state follows the rotation
        before = seen.state[:, at : at + 3] if first >= 0 else np.zeros((len(seen.state), 3))
        rotation[:, k] = [nearest(R, v) for R, v in zip(to_first @ b["axes"], before, strict=True)]
    dims = ("time", "bushing", "axis")
    return {"bushing_displacement": (dims, displacement), "bushing_rotation": (dims, rotation)}, {"bushing": list(rows)}
