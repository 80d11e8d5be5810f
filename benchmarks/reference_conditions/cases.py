"""One case: a run or an ensemble of a scene, reduced to what the verdict needs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from pipeline import dynamics
from pipeline.core.artifacts.event_kinds import CLOSING
from pipeline.core.scene.load import edited
from stages.s4_simulate import bundles, rebuild

Files = dict[str, Any]
JOINT, BODY = "A1", "platform"


def single(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Any) -> Files:
    """Motion of the platform and force of A1 at the regular times of one run, evaluations, processor time."""
    scene, reduced = rebuild(params, inputs), bundles(inputs)
    dynamics.simulate(edited(scene, {"time.end": scene.time.start + 1e-4}), reduced, progress)  # compiles
    begun = time.process_time()
    run = dynamics.simulate(scene, reduced, progress)
    seconds = time.process_time() - begun
    regular = np.arange(round((scene.time.end - scene.time.start) / scene.output.interval) + 1) * scene.output.interval
    kept = run[["position", "quaternion", "velocity", "acceleration"]].sel(body=[BODY])
    kept["joint_force"] = run["joint_force"].sel(joint=JOINT)
    kept = kept.sel(time=regular, method="nearest", tolerance=1e-9).assign_coords(time=regular).drop_vars("joint")
    if "event_peak_force" in run:
        kept.attrs["peak_force"] = float(run["event_peak_force"].max())
        kept.attrs["impacts"] = int(((run["event_kind"] == CLOSING) & (run["event_approach_speed"] > 1e-4)).sum())
    return {"nc": kept.assign_attrs(evaluations=int(run.attrs["evaluations"]), seconds=seconds)}


def members(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Any) -> Files:
    """Members of an ensemble: motion of the platform, peak contact force, impacts; cost of one run."""
    scene, reduced = rebuild(params, inputs), bundles(inputs)
    found = dynamics.ensemble(scene, reduced, progress)
    names = ["position", "quaternion", "velocity", "acceleration", "peak_force", "impact_count"]
    begun = time.process_time()
    run = dynamics.simulate(scene, reduced, progress)
    seconds = time.process_time() - begun
    return {"nc": found[names].assign_attrs(evaluations=int(run.attrs["evaluations"]), seconds=seconds)}
