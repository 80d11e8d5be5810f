"""One point of a cost study: a run of an edited scene, what it took, and of its result what errors need."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stages.s4_simulate import bundles, rebuild

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene
    from pipeline.core.workflow.execute import Progress

#: a run is timed so often, the median counts; once when it takes longer than LONG
REPEATS, LONG = 3, 5.0  # [1], [s]


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The kept part of the run with ``cpu_repeat(repeat)`` and the other costs as attributes.

    params: `simulate`, as of the simulate stage, and the `quantities` of the study.  A run that the solver refuses
    leaves an empty dataset whose attribute `refused` says why: that, too, is a result of the study.
    """
    import time

    import xarray as xr

    from pipeline import dynamics
    from pipeline.core import quantities
    from pipeline.core.errors import SolverError
    from pipeline.dynamics.run import engine_of

    scene = rebuild(params["simulate"])
    reduced = bundles(inputs)
    begun = time.process_time()
    engine_of(scene, reduced, progress)
    compile_seconds = time.process_time() - begun
    seconds: list[float] = []
    try:
        while not seconds or (len(seconds) < REPEATS and seconds[0] < LONG):
            begun = time.process_time()
            done = dynamics.simulate(scene, reduced, progress if not seconds else _silent)
            seconds.append(time.process_time() - begun)
    except SolverError as error:
        return {"nc": xr.Dataset(attrs={"refused": str(error)})}
    chosen = [quantities.parse(name, scene.owners()) for name in params["quantities"]]
    kept = quantities.keep(done, chosen)
    kept["cpu_repeat"] = (("repeat",), seconds, {"units": "s", "long_name": "processor time of a warm run"})
    costs = {"evaluations": done.attrs["evaluations"], "compile_seconds": compile_seconds, "peak_memory": _memory()}
    return {"nc": kept.assign_attrs(**costs, **_twin(done), **_contacts(scene))}


def _silent(fraction: float | None, text: str) -> None:
    """Reports would be part of what is measured."""


def _memory() -> int:
    """Largest resident memory of this process so far [B]."""
    import resource
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def _twin(run: xr.Dataset) -> dict[str, float]:
    """Growth of a displacement of the start into velocities up to the horizon [1/s], of runs with contacts."""
    if "twin_separation" not in run:
        return {}
    believed = run["twin_time"].values <= float(run["horizon"])
    return {"growth": float(run["twin_separation"].values[believed].max()) / float(run.attrs["twin_perturbation"])}


def _contacts(scene: Scene) -> dict[str, float]:
    """Largest clearance [m], of scenes with contacts."""
    clearances = [joint.clearance for joint in scene.contacts().values()]
    return {"clearance": max(clearances)} if clearances else {}
