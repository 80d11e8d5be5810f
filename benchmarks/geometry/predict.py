"""What a layout predicts: runs with rigid rods over what the paper leaves open, and ensembles with flexible ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.family import REFUSED, Record
from benchmarks.geometry import scenes
from benchmarks.geometry.identify import Layout
from flexclear.commands import scenes as stages
from flexclear.papers.wang_wang_2019.deviations import Deviation, ensemble_deviations, max_deviation
from flexclear.papers.wang_wang_2019.models import JOINT, PLATFORM
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.stages.workplace import open_workplace

#: coefficients of restitution, none of which the paper prints
RESTITUTION = (0.5, 0.7, 0.9)
#: the ball starts in the middle of its socket, or so far off it [m]: nearly at rest at the bottom
STARTS = {"concentric": 0.0, "at the bottom": 0.45e-3}
GRAVITY = {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}
#: of each ensemble
MEMBERS = 4
FLEXIBLE = {"free-free": "far_csj_free", "fixed-fixed": "far_csj_fixed", "Craig-Bampton": "far_csj_cb"}


@dataclass(frozen=True)
class Open:
    """A choice of what the paper leaves open besides the layout."""

    restitution: float = 0.9
    gravity: bool = False
    start: str = "concentric"

    def edits(self) -> dict[str, Any]:
        """As edits of a scene with clearance."""
        found: dict[str, Any] = {"joint.A1.normal.restitution": self.restitution}
        return found | ({"load": {"gravity": GRAVITY}} if self.gravity else {})


def rigid(layout: Layout, choice: Open) -> Record:
    """Largest deviations from the ideal mechanism, largest force and acceleration of a run with clearance."""
    load = {"load": {"gravity": GRAVITY}} if choice.gravity else {}
    try:
        ideal = dynamics.simulate(scenes.scene("sps4/ideal", layout, load), {}, silent)
        requested = scenes.scene("sps4/csj", layout, choice.edits(), aside=STARTS[choice.start])
        run = dynamics.simulate(requested, {}, silent)
    except SolverError as error:
        return {"verdict": REFUSED, "reason": str(error)}
    return _told(max_deviation(run, ideal, PLATFORM)) | _peaks(run, ideal)


def flexible(layout: Layout, name: str) -> Record:
    """Means over an ensemble of each member's largest deviations from the ideal mechanism, and their spread."""
    requested = scenes.scene(f"sps4/{FLEXIBLE[name]}", layout, {"ensemble.members": MEMBERS})
    ideal = dynamics.simulate(scenes.scene("sps4/ideal", layout), {}, silent)
    members = dynamics.ensemble(requested, stages.bundles(requested, open_workplace(), jobs=None), silent)
    each = [_told(deviation) for deviation in ensemble_deviations(members, ideal, PLATFORM)]
    found = {name: [one[name] for one in each] for name in each[0]}
    found["peak_force"] = members.peak_force.sel(contact=JOINT).values.tolist()
    found["peak_acceleration"] = members.peak_acceleration.sel(body=PLATFORM, axis="z").values.tolist()
    means = {name: float(np.mean(values)) for name, values in found.items()}
    return means | {f"{name}_std": float(np.std(values, ddof=1)) for name, values in found.items()}


def _told(deviation: Deviation) -> Record:
    return {"angle": deviation.angle, "displacement": deviation.displacement, "velocity": deviation.velocity}


def _peaks(run: xr.Dataset, ideal: xr.Dataset) -> Record:
    def largest(one: xr.Dataset) -> float:
        return float(np.abs(one.acceleration.sel(body=PLATFORM, axis="z")).max())

    return {
        "peak_force": float(run.event_peak_force.max()),
        "peak_acceleration": largest(run),
        "ideal_acceleration": largest(ideal),
        "ideal_reaction": float(np.linalg.norm(ideal.joint_force.sel(joint=JOINT), axis=-1).max()),
    }
