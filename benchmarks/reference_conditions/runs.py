"""Bring all runs up to date through the store, and compute the numbers of the verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

import flexclear as fc
from benchmarks import family, layouts
from benchmarks.family import Record as Row
from benchmarks.layouts import deviation_row
from benchmarks.reference_conditions import design
from benchmarks.reference_conditions.cases import BODY
from flexclear.stages.workplace import Workplace, check, open_workplace
from papers.wang_wang_2019.deviations import ensemble_deviations, max_deviation

#: directions in the axes of the rod's frames, z along the rod: axial, bending, torsion
DIRECTIONS = ("z", "x", "rz")
#: number of compared vibrations of the mechanism
VIBRATIONS = 6


def cases(members: int) -> list[family.Case]:
    """Return one case for each group of rows on the page."""
    return [family.Case(name, (members,) if name in ENSEMBLES else ()) for name in GROUPS]


@family.each
def measure(case: family.Case) -> list[Row]:
    """Return the rows of a group."""
    return list(GROUPS[case.name](*case.of))


def bring(cases: list[design.Case], place: Workplace) -> dict[design.Case, xr.Dataset]:
    """Return the datasets of the cases, from the cache where they are up to date."""
    tasks = {case: design.task(case) for case in cases}
    outcome = place.bring(list(tasks.values()))
    check(outcome)
    return {case: place.store.load(outcome.records[task]) for case, task in tasks.items()}


def identity(case: design.Case) -> Row:
    """Return the fields that identify a row."""
    reference = case.condition not in (design.FULL, design.RIGID)
    return {
        "place_mm": case.place,
        "condition": case.condition,
        "count": case.count if reference else 0,
        "finer": case.finer,
    }


def static_rows() -> Iterator[Row]:
    """Yield the full rod's compliance [m/N, rad/(N m)] at the top, with the frame of the prismatic joint held.

    Further rows hold the fraction of this compliance that each mode set has, for all whole counts.
    """
    for place in design.PLACES:
        full = design.solved(design.Case(place, design.FULL))
        row = {"highest": float(full["frequency"].max())} | _compliance(full["compliance_full"], place)
        yield {"place_mm": place, "condition": design.FULL, "count": 0} | row
        for condition in design.CONDITIONS:
            for count in range(1, max(design.COUNTS) + 1):
                if not design.is_whole(design.Case(place, condition, count)):
                    continue
                fraction = design.solved(design.Case(place, condition, count))["compliance_share"]
                yield {"place_mm": place, "condition": condition, "count": count} | _compliance(fraction, place)


def _compliance(values: xr.DataArray, place: int) -> Row:
    found = values.sel(frame=design.TOP, frame_held=design.PLACES[place])
    return {direction: float(found.sel(direction=direction)) for direction in DIRECTIONS}


def mesh_rows() -> Iterator[Row]:
    """Yield frequencies [Hz] of the Craig-Bampton set at 0 mm on finer meshes, the finest last."""
    for finer in design.FINER:
        found = design.solved(design.Case(0, "craig-bampton", design.COUNT, finer=finer))["frequency"]
        yield {"elements": finer * design.rod(1).sizes["cell"], "frequency": found.values.tolist()}


def frequency_rows() -> Iterator[Row]:
    """Yield the lowest frequencies [Hz] of the assembled mechanism with held drives, at each of `TIMES`."""
    for where in design.PLACES:
        sets = [design.Case(where, c, design.whole(where, c, design.COUNT)) for c in design.CONDITIONS] + [
            design.Case(where, design.FULL)
        ]
        for case in sets:
            for time in design.TIMES:
                found = fc.frequencies(design.scene(case), time)["undamped_frequency"].values
                elastic = np.sort(found[found > 1.0])[:VIBRATIONS]
                yield identity(case) | {"time": time, "frequency": elastic.tolist()}


def far_rows() -> Iterator[Row]:
    """Yield the deviations, with ideal joints, from the rigid mechanism and from the mechanism with the full rod."""
    runs = bring(design.far(), open_workplace())
    for case, run in runs.items():
        rigid, full = runs[design.Case(case.place, design.RIGID)], runs[design.Case(case.place, design.FULL)]
        effect = max_deviation(run, rigid, BODY)
        row = identity(case) | deviation_row(effect) | _costs(run)
        yield row | {
            "force": _largest(run, rigid),
            "force_error": _largest(run, full) / _largest(full, rigid),
            "velocity_error": max_deviation(run, full, BODY).velocity / max_deviation(full, rigid, BODY).velocity,
        }


def clearance_rows(members: int) -> Iterator[Row]:
    """Yield, with clearance at A1, means and standard deviations over the members of each set; one run for a rigid rod.

    members: size of each ensemble; sets of 25 or more coordinates have half as many.
    """
    place = open_workplace()
    runs = bring(design.clearance(members), place)
    rigid = bring([design.Case(where, design.RIGID) for where in design.PLACES], place)
    for case, run in runs.items():
        yield identity(case) | _with_clearance(case, run, rigid[design.Case(case.place, design.RIGID)])


def _with_clearance(case: design.Case, run: xr.Dataset, ideal: xr.Dataset) -> Row:
    """Return means and standard deviations over the members of one set, or the one run of the rigid rod."""
    if case.condition == design.RIGID:
        spread = {"peak_force": [float(run.attrs["peak_force"])], "impacts": [int(run.attrs["impacts"])]}
        effects = [max_deviation(run, ideal, BODY)]
        acceleration = [float(run.attrs["peak_acceleration"])]
    else:
        spread = {
            n: run[v].values[:, 0].tolist() for n, v in (("peak_force", "peak_force"), ("impacts", "impact_count"))
        }
        effects = ensemble_deviations(run, ideal, BODY)
        acceleration = run["peak_acceleration"].values[:, 0, 2].tolist()
    spread |= {name: [deviation_row(effect)[name] for effect in effects] for name in deviation_row(effects[0])}
    return _costs(run) | _statistics(spread | {"acceleration": acceleration}) | {"members": len(effects)}


def layout_rows(members: int) -> Iterator[Row]:
    """Yield runs with ideal joints (their deviations from rigid) and with clearance for each of `design.layouts`."""
    place = open_workplace()
    for number, layout in enumerate(design.layouts()):
        runs = bring(design.of_layout(layout, members), place)
        ideal = next(run for case, run in runs.items() if case.condition == design.RIGID and not case.clearance)
        which: Row = {"layout": number} | ({"first": True} if layout == layouts.FIRST else {})
        which |= asdict(layout)
        for case, run in runs.items():
            row = which | identity(case) | {"clearance": case.clearance}
            if case.clearance:
                yield row | _with_clearance(case, run, ideal)
            else:
                effects = deviation_row(max_deviation(run, ideal, BODY))
                yield row | effects | _costs(run) | {"force": _largest(run, ideal)}


def _costs(run: xr.Dataset) -> Row:
    """Return evaluations and processor time of the integration [s] of one run."""
    return {"evaluations": int(run.attrs["evaluations"]), "seconds": float(run.attrs["seconds"])}


def _largest(run: xr.Dataset, other: xr.Dataset) -> float:
    """Return the largest difference of the force at A1 [N]."""
    return float(np.linalg.norm(run["joint_force"].values - other["joint_force"].values, axis=1).max())


def _statistics(series: dict[str, Any]) -> Row:
    found = {}
    for name, values in series.items():
        found[name] = float(np.mean(values))
        found[f"{name}_std"] = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return found


GROUPS: dict[str, Callable[..., Iterator[Row]]] = {
    "statics": static_rows,
    "mesh": mesh_rows,
    "frequencies": frequency_rows,
    "far": far_rows,
    "clearance": clearance_rows,
    "layouts": layout_rows,
}
#: groups whose runs are ensembles
ENSEMBLES = ("clearance", "layouts")
