"""Recorded wear of contacts: sliding distance, load path, and direction of the contact on both surfaces."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.wear import LEDGER
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.model.model import Model


def wear_series(model: Model, seen: Observed) -> Series:
    """Return sliding distance [m] and load path [N m] since the start, and the contact's direction in both surfaces.

    A direction is a unit vector from the centre of a surface to the contact, in the axes of the surface's frame; zero
    while the centres coincide.
    """
    ledger, first = seen.state[:, model.speeds.stop :], model.arrays.size(m.SIZES["wear_slot"])
    rows = model.arrays.table(m.NAMED["worn"])["contact"]
    books = m.named(LEDGER, ledger[:, first : first + LEDGER.size * len(rows)])
    topology, offset = model.arrays.table(m.CONTACTS)[rows], seen.touch["offset"][:, rows]
    length = np.linalg.norm(offset, axis=-1, keepdims=True)
    outer = np.divide(offset, length, out=np.zeros_like(offset), where=length > 0.0)
    R_WO, R_WI = (seen.sites["axes"][:, topology[side]] for side in ("outer", "inner"))
    inner = np.einsum("tkji,tkjl,tkl->tki", R_WI, R_WO, outer)
    dims = ("time", "worn")
    return {
        "wear_sliding_distance": (dims, books["sliding"]),
        "wear_load_path": (dims, books["load_path"]),
        "wear_direction_outer": ((*dims, "axis"), outer),
        "wear_direction_inner": ((*dims, "axis"), inner),
    }, {"worn": list(model.scene.wearing_joints())}
