"""How long the runs of some scenes take, warm, one after the other: at equal error, and at equal steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from pipeline.core.progress import Progress, silent
from stages.s4_simulate import bundles, rebuild

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene

#: each scene is run so often, as the median of three is not moved by one disturbed run; but a second run that takes
#: the same to within this share shows that nothing disturbs
REPEATS, CLOSE = 3, 0.02
#: equal error: of the velocity of the body with most joints, relative, over this first share of the run, where
#: all scenes can still be predicted point by point
EQUAL_ERROR, SHARE = 1e-6, 0.05
#: this share of a run, unmeasured, fetches its code
WARM = 0.01
#: Wang & Wang (2019), sec. 5: predictor-corrector with this step [s]; which one, they do not say
PAPER: Mapping[str, Any] = {"integrator": "adams-bashforth-moulton", "step": 1e-5}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """CPU time [s] of warm runs, evaluations, and the settings: ``equal_*`` at equal error, ``step_*`` at equal steps.

    params: one entry of `params` per scene.  inputs: bundles as ``<scene>:bundle/<body>``; kernels, which are only
    waited for.  A scene that the fixed step cannot integrate has NaN there, and the reason in the attribute `refused`;
    repeats that were not needed are NaN, too.
    """
    import numpy as np
    import xarray as xr

    from pipeline.core.errors import SolverError

    names = list(params)
    ways = ("equal", "step")
    seconds = {way: np.full((len(names), REPEATS), np.nan) for way in ways}
    evaluations = {way: np.full(len(names), np.nan) for way in ways}
    tolerance, refused = np.full(len(names), np.nan), []
    for i, name in enumerate(names):
        mine = {key.removeprefix(f"{name}:"): data for key, data in inputs.items() if key.startswith(f"{name}:")}
        scene = rebuild(params[name], mine)
        simulate = _simulation(bundles(mine))
        progress(i / len(names), f"timing {name}")
        tolerance[i], evaluations["equal"][i], seconds["equal"][i] = _timed_at_equal_error(scene, simulate)
        try:
            evaluations["step"][i], seconds["step"][i] = _timed(paper_scene(scene), simulate)
        except SolverError as error:
            refused.append(f"{name}: {error}")
    data: dict[str, Any] = {"equal_rtol": (("scene",), tolerance)}
    for way in ways:
        data[f"{way}_cpu_seconds"] = (("scene", "repeat"), seconds[way], {"units": "s"})
        data[f"{way}_evaluations"] = (("scene",), evaluations[way], {"units": "1"})
    attributes = {"Conventions": "CF-1.11", "equal_error": EQUAL_ERROR, "share": SHARE, "step": PAPER["step"]}
    attributes["refused"] = "; ".join(refused)
    return {"nc": xr.Dataset(data, coords={"scene": names}, attrs=attributes)}


def _timed_at_equal_error(scene: Scene, simulate: Callable[[Scene], xr.Dataset]) -> tuple[float, int, list[float]]:
    """Tolerance, evaluations and times at equal error; decade by decade tighter where the whole run is refused."""
    from pipeline.core.errors import SolverError

    rtol = equal_tolerance(scene, simulate)
    while True:
        try:
            return rtol, *_timed(_edited(scene, {"solver.rtol": rtol}), simulate)
        except SolverError:
            if rtol < scene.solver.rtol:
                raise
            rtol *= 0.1


def equal_tolerance(scene: Scene, simulate: Callable[[Scene], xr.Dataset]) -> float:
    """The tolerance at which a scene has the common error over the first share of its run."""
    velocity = next(q.name for q in scene.wanted() if q.kind == "velocity")
    end = scene.time.start + SHARE * (scene.time.end - scene.time.start)
    probe = _edited(scene, {"time.end": end, "accuracy": {velocity: {"relative": EQUAL_ERROR}}})
    return float(simulate(probe).attrs["accuracy_rtol"])


def _edited(scene: Scene, edit: Mapping[str, Any]) -> Scene:
    from pipeline.core.scene.load import edited

    return edited(scene, {"accuracy": None, "ensemble": None, **edit})


def paper_solver(scene: Scene) -> dict[str, Any]:
    """The paper's method as the table of a scene's solver; contacts are noticed at the ends of steps."""
    return {**PAPER, **({"events": "at step ends"} if scene.contacts() else {})}


def paper_scene(scene: Scene) -> Scene:
    """A scene with the paper's method."""
    return _edited(scene, {"solver": paper_solver(scene)})


def _simulation(bundles: Mapping[str, xr.Dataset]) -> Callable[[Scene], xr.Dataset]:
    from pipeline import dynamics

    # reports would be part of what is measured
    return lambda scene: dynamics.simulate(scene, bundles, silent)


def _timed(scene: Scene, simulate: Callable[[Scene], xr.Dataset]) -> tuple[int, list[float]]:
    """Evaluations of a run, and its processor times, NaN where none was needed; an unmeasured start comes first."""
    import time

    simulate(_edited(scene, {"time.end": scene.time.start + WARM * (scene.time.end - scene.time.start)}))
    seconds: list[float] = []
    while len(seconds) < REPEATS:
        begun = time.process_time()
        run = simulate(scene)
        seconds.append(time.process_time() - begun)
        if len(seconds) == REPEATS - 1 and max(seconds) - min(seconds) <= CLOSE * min(seconds):
            seconds.append(float("nan"))
    return int(run.attrs["evaluations"]), seconds
