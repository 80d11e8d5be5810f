"""One point of a cost study: a run of an edited scene, its costs, and the quantities that errors are computed from.

The cost of a point is that of its integration: the record has the same number of rows at every tolerance and step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.dynamics import analyses, simulate
from flexclear.scene.quantity import parse
from flexclear.stages.kernels import processor_time, warm
from flexclear.stages.simulation import bundles, rebuild
from flexclear.system.errors import SolverError
from flexclear.system.platforms import peak_memory
from flexclear.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Run the scene; return the recorded quantities, ``cpu_repeat(repeat)`` of the integration, and other costs as
    attributes, among them the median time of the recording.

    params: `simulate`, the parameters of the simulate stage, and names of `quantities`.  inputs: bundles; `kernels`,
    the artifact of `stages.kernels`; `run`, the same run, where it is known, whose horizon is then kept as well.  With
    events, whose phases begin anew, all work of the run is measured.  Where the solver refuses the run, the dataset is
    empty and its attribute `refused` holds the reason: that, too, is a result of the study.
    """
    scene = rebuild(params["simulate"], inputs)
    reduced = bundles(inputs)
    begun = processor_time()
    try:
        if scene.event:
            done, integration, recording = simulate(scene, reduced, progress), [processor_time() - begun], [0.0]
        else:
            warm(scene, reduced, progress)
            cost = analyses.cost(scene, reduced, progress)
            done, integration, recording = cost.run, [*cost.integration], [*cost.recording]
    except SolverError as error:
        return {"nc": xr.Dataset(attrs={"refused": str(error)})}
    kept = inputs.get("run", done)
    recorded = quantities.select_variables(kept, [parse(name, scene.owners()) for name in params["quantities"]])
    attributes = {"units": "s", "long_name": "processor time of the integration of a warm run"}
    recorded["cpu_repeat"] = (("repeat",), integration, attributes)
    costs = {"evaluations": done.attrs["evaluations"], "peak_memory": peak_memory()}
    costs["recording_seconds"] = float(np.median(recording))
    costs["compile_seconds"] = inputs["kernels"].attrs["compile_seconds"]
    return {"nc": recorded.assign_attrs(costs)}
