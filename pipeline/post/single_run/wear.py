"""Wear of contacts: depths by Archard's law, and where on pin and socket it happens.

Totals are the run's own integrals. Over the surfaces they are spread along the way of the contact between recorded
rows, which are the outputs and all events; a contact that turns by more than a sector between two outputs is spread
along the shorter arc.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]
#: steps of the way between two rows, each of which goes to one sector; bands of a sphere, of equal area
PIECES, BANDS = 16, 18
SURFACES = ("outer", "inner")


def wear(run: xr.Dataset | LabelledArrays, joints: dict[str, Any]) -> Variables:
    """Variables ``wear_*`` of the post artifact; empty where nothing wears.

    joints: what the scene says of its joints.  Depths are those that a surface alone would have; both share the volume.
    """
    if "wear_load_path" not in run:
        return {}
    names = [str(name) for name in run["worn"].values]
    laws = [joints[name]["wear"] for name in names]
    sectors = max(int(law["sectors"]) for law in laws)
    bands = BANDS if any("ball_radius" in joints[name] for name in names) else 1
    shape = (len(names), bands, sectors)
    maps = {f"wear_{what}_{side}": np.zeros(shape) for what in ("depth", "impulse") for side in SURFACES}
    path, sliding = run["wear_load_path"].values, run["wear_sliding_distance"].values
    contacts = run["contact"].values.tolist()
    impulse = run["contact_impulse"].values[:, [contacts.index(name) for name in names]]
    volume = np.zeros(len(names))
    for k, (name, law) in enumerate(zip(names, laws, strict=True)):
        per_path, own = law["coefficient"] / law["hardness"], int(law["sectors"])
        rows = BANDS if "ball_radius" in joints[name] else 1
        volume[k] = per_path * (path[-1, k] - path[0, k])
        for side in SURFACES:
            direction = run[f"wear_direction_{side}"].values[:, k]
            area = _area(joints[name], side) / (own * rows)
            fractions = spread(direction, np.stack([path[:, k], impulse[:, k]], axis=1), own, rows)
            maps[f"wear_depth_{side}"][k, :rows, :own] = per_path * fractions[..., 0] / area
            maps[f"wear_impulse_{side}"][k, :rows, :own] = fractions[..., 1]
    totals: Variables = {
        "wear_volume": (("worn",), volume),
        "wear_distance": (("worn",), sliding[-1] - sliding[0]),
        "wear_sectors": (("worn",), np.array([int(law["sectors"]) for law in laws], dtype=np.int32)),
    }
    for side in SURFACES:
        deepest = maps[f"wear_depth_{side}"].reshape(len(names), -1).max(axis=1)
        totals[f"wear_deepest_{side}"] = (("worn",), deepest)
    mapped: Variables = {name: (("worn", "band", "sector"), values) for name, values in maps.items()}
    return totals | mapped


def _area(joint: dict[str, Any], side: str) -> float:
    """Area of a surface [m^2]; half a sphere is not distinguished from a whole one."""
    widened = float(joint["clearance"]) if side == "outer" else 0.0
    if "ball_radius" in joint:
        return float(4.0 * np.pi * (joint["ball_radius"] + widened) ** 2)
    return float(2.0 * np.pi * (joint["pin_radius"] + widened) * joint["length"])


def spread(direction: np.ndarray, totals: np.ndarray, sectors: int, bands: int) -> np.ndarray:
    """Increments of totals (time, what) in the sectors that a direction (time, 3) passes, (band, sector, what).

    Sector s holds angles about z from x on, s to s + 1 times 2 pi/sectors; band b z-components from -1 on.
    """
    distributed = np.zeros((bands, sectors, totals.shape[1]))
    growth, fraction = np.diff(totals, axis=0), (np.arange(PIECES) + 0.5) / PIECES
    grown = np.flatnonzero(np.any(growth != 0.0, axis=1))
    start, end = direction[grown], direction[grown + 1]
    # before a contact begins, or after it has ended, the centres may have been anywhere
    start = np.where(np.any(start != 0.0, axis=1, keepdims=True), start, end)
    between = start[:, None] + fraction[None, :, None] * (end - start)[:, None]
    angle = np.arctan2(between[..., 1], between[..., 0]) % (2.0 * np.pi)
    sector = np.minimum((angle / (2.0 * np.pi) * sectors).astype(int), sectors - 1)
    size = np.linalg.norm(between, axis=-1)
    height = np.divide(between[..., 2], size, out=np.zeros_like(size), where=size > 0.0)
    band = np.minimum(((height + 1.0) / 2.0 * bands).astype(int), bands - 1)
    for what in range(totals.shape[1]):
        values = np.repeat(growth[grown, what] / PIECES, PIECES)
        np.add.at(distributed[..., what], (band.ravel(), sector.ravel()), values)
    return distributed
