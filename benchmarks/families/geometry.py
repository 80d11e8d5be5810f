"""Layouts of the mechanism with the sensitivities of the paper's Table 8, and their other predictions.

Runs with rigid rods vary what the paper leaves open; ensembles have flexible rods.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from benchmarks import layouts
from benchmarks.family import REFUSED, Case, Family, Record, each
from benchmarks.layouts import DANGLE, DZ, Layout, answer, deviation_row
from benchmarks.page import Columns, csv_table, mean, table
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.stages import scenes as stages
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent
from papers.wang_wang_2019.deviations import ensemble_deviations, max_deviation
from papers.wang_wang_2019.models import JOINT, PLATFORM
from papers.wang_wang_2019.published import TABLE8, TABLE9

#: coarser grid [m], and stride at which layouts on this grid are simulated
COARSE, SHOWN = 0.02, 5


def members_rows() -> Iterator[Record]:
    """Yield one record with the family's extent on its grid, and one for the chosen layout."""
    found = layouts.family()
    record: Record = {"members": len(found), "on_the_plate": sum(map(layouts.on_the_plate, found))}
    for name in ("ax", "ay", "bx", "by", "height", "leg"):
        values = [getattr(layout, name) for layout in found]
        record |= {f"{name}_least": float(min(values)), f"{name}_most": float(max(values))}
    yield record
    yield _member(layouts.chosen(found))


def velocity_rows() -> Iterator[Record]:
    """Yield runs with clearance of some members and of the first layout; other choices are those of the scenes."""
    for layout in layouts.by_condition(layouts.family(COARSE))[::SHOWN]:
        yield _member(layout) | rigid(layout)
    yield _member(layouts.FIRST) | rigid(layouts.FIRST) | {"first": True}


def open_rows() -> Iterator[Record]:
    """Yield runs of the chosen layout over the other choices that the paper leaves open."""
    layout = layouts.chosen(layouts.family())
    for restitution, gravity, start in product(RESTITUTION, (False, True), STARTS):
        record = {"restitution": restitution, "gravity": gravity, "start": start}
        yield record | rigid(layout, restitution, start, gravity=gravity)


def flexible_rows() -> Iterator[Record]:
    """Yield ensembles of the chosen layout with a flexible rod and clearance."""
    layout = layouts.chosen(layouts.family())
    for name in FLEXIBLE:
        yield {"set": name, "count": MEMBERS} | flexible(layout, name)


def _member(layout: Layout) -> Record:
    return asdict(layout) | {"leg": layout.leg} | asdict(answer(layout))


ROWS: dict[str, Callable[[], Iterator[Record]]] = {
    "members": members_rows,
    "velocity": velocity_rows,
    "open": open_rows,
    "flexible": flexible_rows,
}


def show(records: list[Record]) -> dict[str, str]:
    """Return the parts of the page for the groups of rows that exist."""
    rows = {name: of for name in TABLES if (of := [r for r in records if r["case"] == name])}
    return {name: TABLES[name](of) for name, of in rows.items()}


def _mm(name: str, digits: int = 1) -> Callable[[Record], str]:
    return lambda r: f"{1e3 * r[name]:.{digits}f}"


JOINTS: Columns = {
    "A [mm]": lambda r: f"±{1e3 * r['ax']:.1f}, ±{1e3 * r['ay']:.1f}",
    "B [mm]": lambda r: f"±{1e3 * r['bx']:.1f}, ±{1e3 * r['by']:.1f}",
    "height [mm]": _mm("height"),
}
PLACE: Columns = {**JOINTS, "leg [mm]": _mm("leg")}
ERRORS: Columns = {
    "angle [mrad]": _mm("angle", 3),
    "z [mm]": _mm("displacement", 4),
    "v [mm/s]": _mm("velocity"),
    "peak force [N]": lambda r: f"{r['peak_force']:.0f}",
    "acceleration [m/s²]": lambda r: f"{r['peak_acceleration']:.0f}",
}


def _members(rows: list[Record]) -> str:
    """Return the closed form in numbers, the family's extent and the chosen member."""
    (extent, taken), upright = rows, 1.0 / (4.0 * DZ)
    spans = "; ".join(
        f"{words} {1e3 * extent[f'{name}_least']:.0f} to {1e3 * extent[f'{name}_most']:.0f} mm"
        for name, words in (("ay", "ay"), ("bx", "bx"), ("by", "by"), ("height", "start height"), ("leg", "legs"))
    )
    return (
        f"Table 8 asks for dz/dL1 = {DZ:.4f} and dangle/dL1 = {DANGLE:.4f} rad/m. Hence ax = "
        f"{1e3 * taken['ax']:.1f} mm "
        f"and height / leg = {upright:.4f}, legs {np.degrees(np.arccos(upright)):.1f} degrees from the "
        f"vertical.\n\n{extent['members']} layouts on a grid of {1e3 * layouts.STEP:g} mm are left: {spans}. "
        f"{extent['on_the_plate'] or 'None'} of them has all four joint centres over the plate, whatever way that is "
        f"turned.\n\nChosen: the layout with the least condition number over the stroke.\n\n"
        + table(
            [taken],
            {
                **PLACE,
                "condition": lambda r: f"{r['condition']:.2f}",
                "lift [mm]": _mm("lift"),
                "tilt [deg]": lambda r: f"{np.degrees(r['tilt']):.2f}",
                "distance of legs [mm]": _mm("room", 0),
            },
        )
    )


def _velocity(rows: list[Record]) -> str:
    """Return the runs of the family's members, and how near their velocity comes to Table 8."""
    of = [r for r in rows if "first" not in r and "velocity" in r]
    found = [1e3 * r["velocity"] for r in of]
    printed = f"{TABLE8.angle:.3e} rad, {TABLE8.displacement:.4f} mm, {TABLE8.velocity:.2f} mm/s"
    return (
        f"Table 8 prints {printed}. Angle and displacement of the {len(of)} members are "
        f"{min(r['angle'] for r in of) / TABLE8.angle:.2f} to {max(r['angle'] for r in of) / TABLE8.angle:.2f} and "
        f"{1e3 * min(r['displacement'] for r in of) / TABLE8.displacement:.2f} to "
        f"{1e3 * max(r['displacement'] for r in of) / TABLE8.displacement:.2f} times the printed ones, as identified; "
        f"the velocity is {min(found):.0f} to {max(found):.0f} mm/s, {min(found) / TABLE8.velocity:.1f} to "
        f"{max(found) / TABLE8.velocity:.1f} times the printed one."
    )


#: columns of the file with all runs of the family's members
MEMBER: Columns = {
    "layout": lambda r: "first" if r.get("first") else "family",
    **PLACE,
    "condition": lambda r: f"{r['condition']:.1f}",
    **ERRORS,
    "force, ideal [N]": lambda r: f"{r['ideal_reaction']:.0f}",
}


def files(records: list[Record]) -> Mapping[str, bytes]:
    """Return the table of the runs of the family's members, by path below docs/."""
    rows = [r for r in records if r["case"] == "velocity" and "velocity" in r]
    return {"geometry/velocity.csv": csv_table(rows, MEMBER)} if rows else {}


def _open(rows: list[Record]) -> str:
    columns: Columns = {
        "restitution": lambda r: f"{r['restitution']:g}",
        "gravity": lambda r: "yes" if r["gravity"] else "no",
        "ball starts": lambda r: r["start"],
        **ERRORS,
    }
    refused = [r for r in rows if "velocity" not in r]
    text = "".join(f"\nRefused: {r['restitution']:g}, {r['start']}: {r['reason']}\n" for r in refused)
    return table([r for r in rows if "velocity" in r], columns) + ("\n" + text if text else "")


def _flexible(rows: list[Record]) -> str:
    """Return the ensembles next to Table 9."""
    columns: Columns = {
        "mode set": lambda r: r["set"],
        "angle [mrad]": lambda r: mean(r, "angle", 1e3, 3),
        "angle, paper": lambda r: _printed(r, "angle", 1e3),
        "z [mm]": lambda r: mean(r, "displacement", 1e3, 4),
        "z, paper": lambda r: _printed(r, "displacement", 1.0),
        "v [mm/s]": lambda r: mean(r, "velocity", 1e3, 1),
        "v, paper": lambda r: _printed(r, "velocity", 1.0),
        "peak force [N]": lambda r: mean(r, "peak_force"),
        "acceleration [m/s²]": lambda r: mean(r, "peak_acceleration"),
    }
    return table(rows, columns)


def _printed(row: Record, name: str, factor: float) -> str:
    value: Any = getattr(TABLE9.get(row["set"]), name, None)
    return "–" if value is None else f"{factor * value:.4g}"


TABLES = {"members": _members, "velocity": _velocity, "open": _open, "flexible": _flexible}


#: coefficients of restitution, none of which the paper prints
RESTITUTION = (0.5, 0.7, 0.9)
#: the ball starts in the centre of its socket, or off centre by this distance [m]: nearly at rest at the bottom
STARTS = {"concentric": 0.0, "at the bottom": 0.45e-3}
GRAVITY = {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}
#: members of each ensemble
MEMBERS = 4
FLEXIBLE = {"free-free": "far_csj_free", "fixed-fixed": "far_csj_fixed", "Craig-Bampton": "far_csj_cb"}


def rigid(layout: Layout, restitution: float = 0.9, start: str = "concentric", *, gravity: bool = False) -> Record:
    """Return the largest deviations from the ideal mechanism, force and acceleration of a run with clearance."""
    load: dict[str, Any] = {"load": {"gravity": GRAVITY}} if gravity else {}
    changes = load | {"joint.A1.normal.restitution": restitution}
    try:
        ideal = dynamics.simulate(layouts.scene("sps4/ideal", layout, load), {}, silent)
        run = dynamics.simulate(layouts.scene("sps4/csj", layout, changes, aside=STARTS[start]), {}, silent)
    except SolverError as error:
        return {"verdict": REFUSED, "reason": str(error)}
    return deviation_row(max_deviation(run, ideal, PLATFORM)) | _peaks(run, ideal)


def flexible(layout: Layout, name: str) -> Record:
    """Return means and standard deviations over an ensemble of each member's largest deviations from the ideal one."""
    requested = layouts.scene(f"sps4/{FLEXIBLE[name]}", layout, {"ensemble.members": MEMBERS})
    ideal = dynamics.simulate(layouts.scene("sps4/ideal", layout), {}, silent)
    members = analyses.ensemble(requested, stages.bundles(requested), silent)
    each = [deviation_row(one) for one in ensemble_deviations(members, ideal, PLATFORM)]
    found = {name: [one[name] for one in each] for name in each[0]}
    found["peak_force"] = members.peak_force.sel(contact=JOINT).values.tolist()
    found["peak_acceleration"] = members.peak_acceleration.sel(body=PLATFORM, axis="z").values.tolist()
    means = {name: float(np.mean(values)) for name, values in found.items()}
    return means | {f"{name}_std": float(np.std(values, ddof=1)) for name, values in found.items()}


def _peaks(run: xr.Dataset, ideal: xr.Dataset) -> Record:
    def largest(one: xr.Dataset) -> float:
        return float(np.abs(one.acceleration.sel(body=PLATFORM, axis="z")).max())

    return {
        "peak_force": float(run.event_peak_force.max()),
        "peak_acceleration": largest(run),
        "ideal_acceleration": largest(ideal),
        "ideal_reaction": float(np.linalg.norm(ideal.joint_force.sel(joint=JOINT), axis=-1).max()),
    }


FAMILY = Family(
    what="layouts of the paper's mechanism that have the sensitivities of Table 8, and what they predict",
    takes="2 min",
    page="geometry.md",
    cases=lambda: [Case(name) for name in ROWS],
    measure=each(lambda case: list(ROWS[case.name]())),
    show=show,
    rows=r"^\| 0\.9 ",
    files=files,
    quick="members",
    times=False,
)
