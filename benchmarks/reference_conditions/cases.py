"""One case: a run or an ensemble of a scene, reduced to the data that the verdict needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.dynamics import analyses
from flexclear.dynamics.record.cost import Cost
from flexclear.stages.simulation import bundles, rebuild

Files = dict[str, Any]
JOINT, BODY = "A1", "platform"


def single(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Any) -> Files:
    """Return the platform's motion and the force of A1 at the regular times of one run, and the cost of the run."""
    scene, reduced = rebuild(params, inputs), bundles(inputs)
    found = analyses.cost(scene, reduced, progress)
    run = found.run
    regular = np.arange(round((scene.time.end - scene.time.start) / scene.output.interval) + 1) * scene.output.interval
    kept = run[["position", "quaternion", "velocity", "acceleration"]].sel(body=[BODY])
    kept["joint_force"] = run["joint_force"].sel(joint=JOINT)
    kept = kept.sel(time=regular, method="nearest", tolerance=1e-9).assign_coords(time=regular).drop_vars("joint")
    if "event_peak_force" in run:
        kept.attrs["peak_acceleration"] = float(np.abs(run["acceleration"].sel(body=BODY, axis="z")).max())
        kept.attrs["peak_force"] = float(run["event_peak_force"].max())
        kept.attrs["impacts"] = int(((run["event_kind"] == "closing") & (run["event_approach_speed"] > 1e-4)).sum())
    return {"nc": kept.assign_attrs(_costs(found))}


def members(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Any) -> Files:
    """Return the platform's motion, peak contact forces and impacts of ensemble members, and the cost of one run."""
    scene, reduced = rebuild(params, inputs), bundles(inputs)
    found = analyses.ensemble(scene, reduced, progress)
    names = ["position", "quaternion", "velocity", "peak_acceleration", "peak_force", "impact_count"]
    return {"nc": found[names].assign_attrs(_costs(analyses.cost(scene, reduced, progress)))}


def _costs(found: Cost) -> dict[str, float]:
    """Return the evaluations of a run and the median processor time of its integration [s]."""
    return {"evaluations": int(found.run.attrs["evaluations"]), "seconds": float(np.median(found.integration))}
