"""Steps of wear -> dataset, and figure over the cycles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import WEAR, conform
from flexclear.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``wear.nc`` (schema WEAR) and its figure.

    params: `title`; of each of the `joints` clearance and radius of the inner surface; of each of the `steps` the
    cycles, the error, and by joint depths and depths per cycle.  inputs: ``post0`` ..., of the runs of the steps.
    """
    from flexclear.post.overview.wear_figure import figure

    joints, steps = params["joints"], params["steps"]
    sizes = {name: np.shape(steps[0]["depths"][name]) for name in joints}
    bands, sectors = (max(size[k] for size in sizes.values()) for k in (1, 2))
    padded = {key: np.zeros((len(steps), 2, len(joints), bands, sectors)) for key in ("depths", "rates")}
    for key, array in padded.items():
        for (s, step), (k, name) in ((one, two) for one in enumerate(steps) for two in enumerate(joints)):
            _, rows, columns = sizes[name]
            array[s, :, k, :rows, :columns] = step[key][name]
    clearance = np.array([joint["clearance"] for joint in joints.values()])
    radius = np.array([joint["radius"] for joint in joints.values()])
    count = np.array([size[1] * size[2] for size in sizes.values()])
    depths, posts = padded["depths"], [inputs[f"post{k}"] for k in range(len(steps))]
    per_joint, per_map = ("step", "worn"), ("step", "worn", "band", "sector")
    data = xr.Dataset(
        {
            "cycles": ("step", np.array([step["cycles"] for step in steps])),
            "step_error": ("step", np.array([step["error"] for step in steps])),
            "worn_clearance": (per_joint, clearance + depths.sum(axis=(1, 3, 4)) / count),
            "worn_gap": (per_joint, clearance + depths.max(axis=(3, 4)).sum(axis=1)),
            "peak_force": (per_joint, np.array([_of_worn(post, "peak_force", "contact", joints) for post in posts])),
            "run_volume": (per_joint, np.array([_of_worn(post, "wear_volume", "worn", joints) for post in posts])),
            "wear_sectors": ("worn", np.array([size[2] for size in sizes.values()], dtype=np.int32)),
            "wear_bands": ("worn", np.array([size[1] for size in sizes.values()], dtype=np.int32)),
            "radius_outer": ("worn", radius + clearance),
            "radius_inner": ("worn", radius),
            **{f"depth_{side}": (per_map, depths[:, k]) for k, side in enumerate(("outer", "inner"))},
            **{f"rate_{side}": (per_map, padded["rates"][:, k]) for k, side in enumerate(("outer", "inner"))},
        },
        {"worn": list(joints)},
    )
    data = conform(data, WEAR, title=f"Wear: {params['title']}")
    return {"nc": data, **figure(data)}


def _of_worn(post: xr.Dataset, name: str, owner: str, joints: Mapping[str, Any]) -> list[float]:
    """Return the values of a variable for the joints."""
    names = [str(one) for one in post[owner].values]
    return [float(post[name].values[names.index(joint)]) for joint in joints]
