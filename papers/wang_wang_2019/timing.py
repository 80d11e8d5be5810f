"""Cost of warm runs of some scenes, one after the other: at equal error, at equal steps, at the paper's tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import flexclear as fc
from flexclear.applications import Progress, cost, scenes_of, silent, simulate

if TYPE_CHECKING:
    from flexclear.applications import Cost, Labelled

#: equal error: relative error of the velocity of the body with most joints, over this first fraction of the run, in
#: which all scenes can still be predicted point by point
EQUAL_ERROR, FRACTION = 1e-6, 0.05
#: this fraction of a run, unmeasured, loads the compiled code
WARM = 0.01
#: Wang & Wang (2019), sec. 5: predictor-corrector with this step [s]; they do not name the method
PAPER: Mapping[str, Any] = {"integrator": "adams-bashforth-moulton", "step": 1e-5}
#: their Table 6 also prints a tolerance of the integration [m], as variable steps have; a method that damps unresolved
#: motion then takes few steps where a rod rings. They do not say which length it refers to: the stroke of eq. (35) [m],
#: or the mechanism's size
TOLERANCE, DAMPED, STROKE = 4e-6, "radau", 0.06
#: the three settings, as variables are called
SETTINGS = ("equal", "step", "tolerance")


def run(params: Mapping[str, Any], inputs: Mapping[str, Labelled], progress: Progress) -> dict[str, Any]:
    """Stage: return CPU time [s] of integration and recording of warm runs, evaluations, steps, largest energy error.

    Variables begin with the setting: ``equal_*`` at equal error, ``step_*`` at equal steps, ``tolerance_*`` by a damped
    method at the paper's tolerance as a fraction of the stroke, whatever the energy error, ``size_*`` the same as a
    fraction of the mechanism's size.

    params, inputs: as `scenes_of` reads them; kernels must only exist.  A scene that cannot be integrated at a setting
    has NaN there, and the reason in the attribute `refused`; repeats that were not needed are NaN, too.
    """
    import xarray as xr

    costs: dict[str, dict[str, Cost | None]] = {setting: {} for setting in (*SETTINGS, "size")}
    tolerance: dict[str, dict[str, float]] = {"equal": {}, "tolerance": {}, "size": {}}
    refused = []
    for i, (name, scene, reduced) in enumerate(scenes_of(params, inputs)):
        progress(i / len(params), f"timing {name}")
        tolerance["equal"][name], equal = _at_equal_error(scene, reduced)
        costs["equal"][name] = equal
        damped = damped_scene(scene, TOLERANCE / STROKE)
        tolerance["tolerance"][name] = damped.solver.rtol
        tolerance["size"][name] = TOLERANCE / equal.length
        costs["size"][name], _ = _measured(damped_scene(scene, TOLERANCE / equal.length), reduced, checked=False)
        for setting, requested in (("step", paper_scene(scene)), ("tolerance", damped)):
            costs[setting][name], why = _measured(requested, reduced, checked=setting == "step")
            refused += [f"{name}: {why}"] if why else []
    data: dict[str, Any] = {}
    for setting, costs_of_setting in costs.items():
        data |= _variables(setting, list(costs_of_setting.values()))
    for setting, values in tolerance.items():
        data[f"{setting}_rtol"] = (("scene",), list(values.values()), {"units": "1"})
    attributes = {"Conventions": "CF-1.11", "equal_error": EQUAL_ERROR, "share": FRACTION, "step": PAPER["step"]}
    attributes |= {"tolerance": TOLERANCE, "damped": DAMPED, "refused": "; ".join(refused)}
    return {"nc": xr.Dataset(data, coords={"scene": list(params)}, attrs=attributes)}


def _variables(setting: str, costs: list[Cost | None]) -> dict[str, Any]:
    """Return the variables of one setting, in the order of the scenes."""
    import numpy as np

    def of_scenes(name: str) -> list[float]:
        return [float(one.run.attrs[name]) if one else float("nan") for one in costs]

    error = [float(np.abs(one.run["energy_error"]).max()) if one else float("nan") for one in costs]
    variables: dict[str, Any] = {
        f"{setting}_evaluations": (("scene",), of_scenes("evaluations"), {"units": "1"}),
        f"{setting}_steps": (("scene",), of_scenes("steps"), {"units": "1"}),
        f"{setting}_energy_error": (("scene",), error, {"units": "J"}),
    }
    for part, dim in (("integration", "repeat"), ("recording", "recorded")):
        repeats = [getattr(one, part) if one else () for one in costs]
        seconds = np.full((len(costs), max(1, *map(len, repeats))), np.nan)
        for row, values in zip(seconds, repeats, strict=True):
            row[: len(values)] = values
        variables[f"{setting}_{part}_seconds"] = (("scene", f"{setting}_{dim}"), seconds, {"units": "s"})
    return variables


def _measured(scene: fc.Scene, bundles: Mapping[str, Labelled], *, checked: bool) -> tuple[Cost | None, str]:
    """Return the cost of a run, or None and the reason."""
    try:
        # an unmeasured start loads the compiled code; reports would be part of the measured time
        simulate(_edited(scene, {"time.end": _share(scene, WARM)}), bundles, silent)
        return cost(scene, bundles, silent, checked=checked), ""
    except fc.SolverError as error:
        return None, str(error).partition(";")[0]  # the other warnings of such a run are of no use here


def _at_equal_error(scene: fc.Scene, bundles: Mapping[str, Labelled]) -> tuple[float, Cost]:
    """Return tolerance and cost at equal error; decade by decade tighter where the whole run is refused."""
    rtol = equal_tolerance(scene, bundles)
    while True:
        measured, why = _measured(_edited(scene, {"solver.rtol": rtol}), bundles, checked=True)
        if measured is not None:
            return rtol, measured
        if rtol < scene.solver.rtol:
            raise fc.SolverError(why)
        rtol *= 0.1


def equal_tolerance(scene: fc.Scene, bundles: Mapping[str, Labelled]) -> float:
    """Return the tolerance at which a scene has the common error over the first fraction of its run."""
    velocity = next(q.name for q in scene.requested_quantities() if q.kind == "velocity")
    requested = {"time.end": _share(scene, FRACTION), "accuracy": {velocity: {"relative": EQUAL_ERROR}}}
    return float(simulate(_edited(scene, requested), bundles, silent).attrs["accuracy_rtol"])


def _share(scene: fc.Scene, fraction: float) -> float:
    """Return the end of the first fraction of a run [s]."""
    return scene.time.start + fraction * (scene.time.end - scene.time.start)


def _edited(scene: fc.Scene, edit: Mapping[str, Any]) -> fc.Scene:
    return fc.edited(scene, {"accuracy": None, "ensemble": None, **edit})


def paper_solver(scene: fc.Scene) -> dict[str, Any]:
    """Return the paper's method as the table of a scene's solver; contacts are noticed at the ends of steps."""
    return {**PAPER, **({"events": "at step ends"} if scene.contacts() else {})}


def paper_scene(scene: fc.Scene) -> fc.Scene:
    """Return a scene with the paper's method."""
    return _edited(scene, {"solver": paper_solver(scene)})


def variants(scene: fc.Scene) -> tuple[fc.Scene, ...]:
    """Return the scenes that the timing alone runs, by their kernels; the runs compile those at equal error."""
    return paper_scene(scene), damped_scene(scene, scene.solver.rtol)


def damped_scene(scene: fc.Scene, rtol: float) -> fc.Scene:
    """Return a scene with the damped method at a tolerance."""
    return _edited(scene, {"solver": {"integrator": DAMPED, "rtol": rtol}})
