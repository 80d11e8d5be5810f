"""Stage 8: the runs of a study -> one dataset with table and figure: effects, costs of accuracy, wear."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.system.progress import Progress

Names = frozenset[str]


def effects(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effects.nc``, table and chart.

    params: `variants` by the effects that they lack, with the `owners` of their quantities; `quantities` and their
    `units`; first time and interval of the `outputs`; contacts `staying` in all variants; how much `looser` than the
    scene's the tolerance is; `removed`, the effects that go with each one; `members`, their number with which each one
    is compared; `words` of each; those `undone`, in words; `added`, the effects (name, kind, within, joint) that are
    also added and combined in pairs. inputs: ``variant<k>/<n>``, as of `variant_runs.members`;
    ``own`` and ``tight``, where the scene's run can be repeated at a tighter tolerance.
    """
    from flexclear.post.answers import effect_answer, effect_sizes

    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    progress(None, "comparing")

    def pair(name: str, members: int) -> effect_sizes.Pair:
        gone = frozenset(params["removed"][name])
        full, without = (_point(params, inputs, names, chosen, members) for names in (frozenset[str](), gone))
        return effect_sizes.Pair(full, without, members)

    results = effect_sizes.assemble(
        {name: pair(name, members) for name, members in params["members"].items()},
        params["words"],
        chosen,
        params["units"],
        params["undone"],
        _times(params["outputs"], inputs),
        _error_of(params, inputs),
    )
    if added := [Effect(*text) for text in params["added"]]:
        every = [frozenset(names) for names in params["variants"]]
        points = {gone: _point(params, inputs, gone, chosen) for gone in every}
        results = effect_sizes.with_pairs(results, added, chosen, points, max(params["members"].values()))
    results.attrs["staying"] = effect_sizes.staying_contacts_sentence(params["staying"])
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    drawn = effect_sizes.chart("effects", shown, f"Effect sizes: {params['title']}")
    return {"nc": results} | files("effects", effect_answer.table(results)) | drawn


def _point(
    params: Mapping[str, Any],
    inputs: Mapping[str, xr.Dataset],
    gone: Names,
    chosen: Sequence[Quantity],
    members: float = math.inf,
) -> Point:
    """Return the point of the first members, all by default, of the variant without some effects."""
    from flexclear.artifacts.effect_size import point_of_members

    k = [frozenset(names) for names in params["variants"]].index(gone)
    used: list[xr.Dataset] = []
    known = 0
    while f"variant{k}/{len(used)}" in inputs and (known < members or not used):
        used.append(inputs[f"variant{k}/{len(used)}"])
        known += int(used[-1].attrs["members"])
    return point_of_members(used, params["owners"][k], chosen)


def _times(outputs: Sequence[float], inputs: Mapping[str, xr.Dataset]) -> list[float]:
    """Return the times of the outputs [s]. outputs: the first one and their interval."""
    start, interval = outputs
    return [
        start + interval * k for k in range(max((int(one.sizes.get("time", 0)) for one in inputs.values()), default=0))
    ]


def _error_of(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset]) -> Callable[[Quantity, float], float]:
    """Return the function that estimates the error of a member's time integration in a quantity up to a time [s]."""
    from flexclear.artifacts import quantities

    def error(quantity: Quantity, until: float) -> float:
        runs = [inputs[name] for name in ("own", "tight") if name in inputs]
        if len(runs) < 2 or not all(quantities.has_quantity(run, quantity) for run in runs):
            return 0.0
        return float(params["looser"]) * quantities.largest_distance(runs[0], runs[1], quantity, until)

    return error


def cost(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``cost.nc``, its table and its figure.

    params: `points` (key, integrator, rtol or step), `quantities` (owner, kind), `title`, the scene's `own` setting
    (own_integrator, own_rtol or own_step), in words what the budget left `undone`, and whether the study is `complete`.
    inputs: the scene's ``own`` run, and ``point<k>``.
    """
    from flexclear.post.cost import work_precision
    from flexclear.post.cost.study import OWN, MeasuredRun, assemble, price_list

    points = [MeasuredRun(**one) for one in params["points"]]
    runs = {OWN: inputs["own"]} | {point.key: inputs[f"point{k}"] for k, point in enumerate(points)}
    study = assemble(points, runs, [Quantity.from_json(data) for data in params["quantities"]])
    study.attrs |= params["own"] | {"undone": params["undone"], "complete": int(params["complete"])}
    title = params["title"]
    figure = work_precision.make("work_precision", study, f"Error against cost: {title}")
    return {"nc": study} | files("price", price_list(study, f"What accuracy costs: {title}")) | figure


def wear(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``wear.nc`` (schema WEAR) and its figure.

    params: `title`; of each of the `joints` clearance and radius of the inner surface; of each of the `steps` the
    cycles, the error, and by joint depths and depths per cycle.  inputs: ``post0`` ..., of the runs of the steps.
    """
    import xarray as xr

    from flexclear.artifacts.schema import WEAR, conform
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
