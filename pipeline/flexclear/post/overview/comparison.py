"""Comparison of runs: their differences, the error of each run, and the figure of both.

Differences are taken at the output times that all runs have, never interpolated. The first run is the reference. Peaks
of an impact lie between those times. Where a force or velocity is larger in one run than its maximum in the other, the
two differ at least as much at that moment: the distance of largest values is a difference, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.artifacts.schema import require_complete
from flexclear.post.overview.curves import NOISE, Curve, curves, in_unit, readable_unit
from flexclear.post.plotting import style
from flexclear.post.plotting.table import Table
from flexclear.post.single_run.series import horizon_sentence, parameters
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import InputError

#: costs that a run reports, by attribute
COSTS = {"evaluations": "evaluations", "steps": "steps", "rejected_steps": "rejected steps"}


def assemble(
    runs: Mapping[str, xr.Dataset], tighter: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]
) -> xr.Dataset:
    """Return all runs on their common times as one dataset.

    runs: schema RUN by label, the reference first.  tighter: the same runs at a tighter tolerance. Variables over (run,
    quantity): `largest`, `error` (largest distance from the tighter run), `difference` (largest distance from the
    reference); over (run, quantity, time): `value`, as drawn, and `distance`; all in the SI units of the coordinate
    `unit`; NaN where a run lacks a quantity, infinite where the number of impacts differs.  Raises InputError when the
    runs have no time in common, or one was stopped before its end.
    """
    for label, run in runs.items():
        require_complete(run, label)
    labels = list(runs)
    time = _common_times(runs)
    shape = (len(labels), len(chosen))
    numbers = {name: np.full(shape, np.nan) for name in ("largest", "error", "difference")}
    series = {name: np.full((*shape, time.size), np.nan) for name in ("value", "distance")}
    reference = runs[labels[0]]
    for j, quantity in enumerate(chosen):
        drawn = curves(list(runs.values()), quantity)
        for i, (label, run) in enumerate(runs.items()):
            curve = drawn[i]
            if curve is not None:
                series["value"][i, j] = curve.values[_indices_at(curve.time, time)]
            if not quantities.has_quantity(run, quantity):
                continue
            numbers["largest"][i, j] = quantities.scale(run, quantity)
            if label in tighter:
                numbers["error"][i, j] = quantities.largest_distance(run, tighter[label], quantity)
            if quantities.has_quantity(reference, quantity):
                numbers["difference"][i, j] = _difference_of(run, reference, quantity)
                if quantity.over_time:
                    when, distance = quantities.deviation(run, reference, quantity)
                    series["distance"][i, j] = distance[_indices_at(when, time)]
    data: dict[str, tuple[tuple[str, ...], np.ndarray]]
    data = {name: (("run", "quantity"), values) for name, values in numbers.items()}
    data |= {name: (("run", "quantity", "time"), values) for name, values in series.items()}
    horizon = [float(run["horizon"]) if "horizon" in run else float(run["time"].values[-1]) for run in runs.values()]
    data["horizon"] = (("run",), np.array(horizon))
    for name in COSTS:
        data[name] = (("run",), np.array([float(run.attrs.get(name, np.nan)) for run in runs.values()]))
    data |= _impacts(runs)
    result = xr.Dataset(
        data,
        coords={
            "run": labels,
            "quantity": [quantity.name for quantity in chosen],
            # from the last run, the scene itself: the others may lack a joint with clearance or a drive
            "unit": ("quantity", [quantities.unit(list(runs.values())[-1], quantity) for quantity in chosen]),
            "time": ("time", time, {"units": "s"}),
        },
        attrs={"Conventions": "CF-1.11", "reference": labels[0]},
    )
    return result.assign_coords(contact=_contacts(runs))


def _difference_of(run: xr.Dataset, reference: xr.Dataset, quantity: Quantity) -> float:
    """Return the largest distance at common times; for vectors at least that of the largest values at any time.

    For vectors a, b over time, max |a - b| >= | max |a| - max |b| |, taken at the time of the larger one.
    """
    difference = quantities.largest_distance(run, reference, quantity)
    if not quantity.over_time or quantity.of_place:
        return difference
    return max(difference, abs(quantities.scale(run, quantity) - quantities.scale(reference, quantity)))


def _common_times(runs: Mapping[str, xr.Dataset]) -> np.ndarray:
    def both(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a[quantities.common_times(a, b)[0]]

    time = reduce(both, (run["time"].values for run in runs.values()))
    if time.size < 2:
        raise InputError(
            " and ".join(runs),
            "have no output times in common",
            "give the scenes the same [time] and [output] interval",
        )
    return time


def _indices_at(own: np.ndarray, requested: np.ndarray) -> np.ndarray:
    """Return indices of the common times among a run's own."""
    return quantities.common_times(own, requested)[0]


def _contacts(runs: Mapping[str, xr.Dataset]) -> list[str]:
    names = [str(name) for run in runs.values() if "contact" in run.coords for name in run["contact"].values]
    return list(dict.fromkeys(names))


def _impacts(runs: Mapping[str, xr.Dataset]) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Return impacts and largest force (torque for rotational stops) of each contact and run; NaN without clearance."""
    names = _contacts(runs)
    count, peak = (np.full((len(runs), len(names)), np.nan) for _ in range(2))
    for i, run in enumerate(runs.values()):
        for k, name in enumerate(names):
            if _has_contact(run, name):
                count[i, k] = len(quantities.contact_values(run, Quantity(name, "impact_times")))
                peak[i, k] = quantities.contact_values(run, Quantity(name, "peak_force"))[0]
    last = list(runs.values())[-1]
    units = [quantities.unit(last, Quantity(name, "peak_force")) if _has_contact(last, name) else "N" for name in names]
    return {
        "impact_count": (("run", "contact"), count),
        "peak_force": (("run", "contact"), peak),
        "peak_force_unit": (("contact",), np.array(units, dtype=object)),
    }


def _has_contact(run: xr.Dataset, contact: str) -> bool:
    return "contact" in run.coords and contact in run["contact"].values


def table(compared: xr.Dataset) -> Table:
    """Tabulate largest value, own error and largest difference from the reference, of each quantity and run."""
    labels = [str(label) for label in compared["run"].values]
    rows = []
    for j, name in enumerate(compared["quantity"].values):
        unit = str(compared["unit"].values[j])
        for i, label in enumerate(labels):
            part = compared.isel(run=i, quantity=j)
            if np.isnan(part["largest"]):
                rows.append((str(name), label, "–", "–", "–"))
                continue
            error = float(part["error"])
            against = "reference" if i == 0 else _difference(compared, i, j, unit)
            rows.append((str(name), label, in_unit(float(part["largest"]), unit), _error_text(error, unit), against))
    notes = [
        "Own error: the largest difference between this run and the same run at a ten times tighter tolerance "
        "(with fixed steps: at half the step). Difference: the largest difference from the reference run at the output "
        "times that both have; for forces and velocities also that of their peaks between output times. It is "
        "as uncertain as both runs' own errors together, and with impacts that of two single runs, not of means."
    ]
    end = float(compared["time"].values[-1])
    notes += [
        f"{label}: {horizon_sentence(float(horizon), end)} Later values hold for this run only."
        for label, horizon in zip(labels, compared["horizon"].values, strict=True)
        if horizon < end
    ]
    columns = ("quantity", "run", "largest", "own error", "difference")
    return Table("Differences from the reference, and the error of each run", columns, tuple(rows), tuple(notes))


def costs(compared: xr.Dataset) -> Table:
    """Tabulate the costs and impacts of each run."""
    names = [str(name) for name in compared["contact"].values]
    columns = ("run", *COSTS.values(), *(f"{name}: impacts" for name in names), *(f"{n}: peak force" for n in names))
    rows = []
    for i, label in enumerate(compared["run"].values):
        part = compared.isel(run=i)
        cells = [_count_text(float(part[name])) for name in COSTS]
        cells += [_count_text(float(value)) for value in part["impact_count"].values]
        cells += [
            "–" if np.isnan(value) else in_unit(float(value), str(unit))
            for value, unit in zip(part["peak_force"].values, part["peak_force_unit"].values, strict=True)
        ]
        rows.append((str(label), *cells))
    return Table("Events and costs", columns, tuple(rows))


def _difference(compared: xr.Dataset, run: int, quantity: int, unit: str) -> str:
    value = float(compared["difference"][run, quantity])
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "other number of impacts"
    return in_unit(value, unit)


def _error_text(error: float, unit: str) -> str:
    if np.isnan(error):
        return "–"
    return "other number of impacts" if np.isinf(error) else in_unit(error, unit, 2)


def _count_text(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:,.0f}"


#: colours of the runs, the reference first: distinguished by colour-blind readers, too
COLORS = ("#111111", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: colours of the models of one mechanism by their effects; the same as in the figures about the paper
IDEAL, CLEARANCE = "#111111", "#E69F00"
MODES = {"free-free": "#0072B2", "fixed-fixed": "#D55E00", "craig-bampton": "#009E73"}
#: opacity of a curve beyond the horizon of its run
PALE = 0.35


def colors(runs: Mapping[str, xr.Dataset]) -> list[str]:
    """Return a colour for each run: that of its model if still free; else another free one."""
    chosen: list[str] = []
    for run in runs.values():
        parts = parameters(run)
        flexible = [body["modes"]["reference"] for body in parts.get("body", {}).values() if body["type"] == "flexible"]
        own = MODES.get(flexible[0], COLORS[4]) if flexible else CLEARANCE if "contact" in run.sizes else IDEAL
        free = [color for color in COLORS if color not in chosen] or list(COLORS)
        chosen.append(own if own not in chosen else free[0])
    return chosen


def make(name: str, runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> dict[str, bytes]:
    """Draw ``name.png`` and ``name.svg``; runs: schema RUN by label, the reference first."""
    drawn = _panels(runs, chosen)
    with style.set_style():
        figure, axes = style.grid(len(drawn), 2, (11.0, 1.0 + 2.3 * len(drawn)), width_ratios=[1.5, 1.0])
        for row, (quantity, lines) in zip(axes, drawn, strict=True):
            _overlay(row[0], runs, lines)
            _distance(row[1], runs, quantity, lines)
        pale = "beyond the predictability horizon of a run"
        if any(float(run["horizon"]) < float(run["time"][-1]) for run in runs.values() if "horizon" in run):
            axes[0, 0].plot([], [], color=style.SOFT, alpha=PALE, label=pale)
        if any(len(curve.peaks) for _, lines in drawn for curve in lines if curve is not None):
            axes[0, 0].plot([], [], ".", color=style.INK, label="peak of a contact shorter than the outputs show")
        style.shared_legend(figure, axes[0, 0], min(len(runs), 3), pale)
        style.heading(figure, "Runs side by side", f"right: distance from {next(iter(runs))}")
        return style.files(name, figure)


def _panels(runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> list[tuple[Quantity, list[Curve | None]]]:
    """Return each quantity with its curves; quantities of a contact that share a curve are drawn once."""
    panels: dict[str, tuple[Quantity, list[Curve | None]]] = {}
    for quantity in chosen:
        mine = curves(list(runs.values()), quantity)
        title = next((curve.title for curve in mine if curve is not None), None)
        if title is not None:
            panels.setdefault(title, (quantity, mine))
    return list(panels.values())


def _overlay(axes: style.Axes, runs: Mapping[str, xr.Dataset], lines: Sequence[Curve | None]) -> None:
    drawn = [curve for curve in lines if curve is not None]
    factor, unit = readable_unit(max(float(np.abs(curve.values).max(initial=0.0)) for curve in drawn), drawn[0].unit)
    own = colors(runs)
    for k, ((label, run), curve) in enumerate(zip(runs.items(), lines, strict=True)):
        if curve is None:
            continue
        color, last = own[k], _horizon(run)
        firm = curve.time <= last
        # dashes over the others, so that none hides another
        look: dict[str, Any] = {"color": color} | (
            {"lw": 1.2, "ls": (0, (5, 3)), "zorder": 2.5} if k == 0 else {"lw": 1.1}
        )
        axes.plot(1e3 * curve.time[firm], factor * curve.values[firm], label=label, **look)
        axes.plot(1e3 * curve.time[~firm], factor * curve.values[~firm], alpha=PALE, **look)
        axes.plot(1e3 * curve.peaks[:, 0], factor * curve.peaks[:, 1], ".", ms=2.5, color=color)
    style.mark_only_zero(axes)
    time = drawn[0].time
    axes.set(xlim=(1e3 * time[0], 1e3 * time[-1]), xlabel="time (ms)", title=f"{drawn[0].title} ({unit})")


def _distance(
    axes: style.Axes, runs: Mapping[str, xr.Dataset], quantity: Quantity, curves_drawn: Sequence[Curve | None]
) -> None:
    """Draw the distance of the whole quantity, all components, from the reference; for a force its difference."""
    (_, reference), *others = runs.items()
    lines: list[tuple[int, np.ndarray, np.ndarray]] = []
    for k, (_, run) in enumerate(others, start=1):
        if (
            quantity.over_time
            and quantities.has_quantity(run, quantity)
            and quantities.has_quantity(reference, quantity)
        ):
            lines.append((k, *quantities.deviation(run, reference, quantity)))
        elif (mine := curves_drawn[k]) is not None and (theirs := curves_drawn[0]) is not None:
            i, j = quantities.common_times(mine.time, theirs.time)
            lines.append((k, mine.time[i], np.abs(mine.values[i] - theirs.values[j])))
    if not lines:
        axes.set_visible(False)
        return
    unit = next(curve.unit for curve in curves_drawn if curve is not None)
    size = max(float(np.abs(curve.values).max(initial=0.0)) for curve in curves_drawn if curve is not None)
    lines = [(k, time, np.where(values.max(initial=0.0) > NOISE * size, values, 0.0)) for k, time, values in lines]
    factor, written = readable_unit(max(float(values.max(initial=0.0)) for _, _, values in lines), unit)
    own = colors(runs)
    for k, time, values in lines:
        axes.plot(1e3 * time, factor * values, color=own[k], lw=0.9)
    time = lines[0][1]
    axes.set(xlim=(1e3 * time[0], 1e3 * time[-1]), xlabel="time (ms)")
    style.mark_only_zero(axes)
    axes.set_ylim(bottom=0.0)
    axes.set_title(f"from the reference ({written})")


def _horizon(run: xr.Dataset) -> float:
    return float(run["horizon"]) if "horizon" in run else float(run["time"].values[-1])
