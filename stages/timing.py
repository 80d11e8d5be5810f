"""How long the runs of some scenes take, measured warm, one after the other in one process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stages.s4_simulate import rebuild

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.workflow.execute import Progress

#: each scene is run so often; the median of three is not moved by one disturbed run
REPEATS = 3


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """CPU time [s] of warm runs, ``cpu_seconds(scene, repeat)``, and ``evaluations(scene)`` of each.

    params: one entry of `params` per scene.  inputs: bundles as ``<scene>:bundle/<body>``.
    """
    import time

    import numpy as np
    import xarray as xr

    from pipeline import dynamics

    def silent(fraction: float | None, text: str) -> None:
        """Reports would be part of what is measured."""

    names = list(params)
    seconds, evaluations = np.zeros((len(names), REPEATS)), np.zeros(len(names), dtype=np.int64)
    for i, name in enumerate(names):
        scene = rebuild(params[name])
        bundles = {body: inputs[f"{name}:bundle/{body}"] for body in scene.flexible()}
        evaluations[i] = dynamics.simulate(scene, bundles, silent).attrs["evaluations"]  # compiles, if need be
        for repeat in range(REPEATS):
            progress((i + repeat / REPEATS) / len(names), f"timing {name}")
            begun = time.process_time()
            dynamics.simulate(scene, bundles, silent)
            seconds[i, repeat] = time.process_time() - begun
    data = {
        "cpu_seconds": (("scene", "repeat"), seconds, {"units": "s", "long_name": "processor time of a warm run"}),
        "evaluations": (("scene",), evaluations, {"units": "1", "long_name": "right-hand sides evaluated"}),
    }
    return {"nc": xr.Dataset(data, coords={"scene": names}, attrs={"Conventions": "CF-1.11"})}
