"""The figure of runs next to each other: each watched quantity, and how far the others are from the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.post.overview.curves import NOISE, Curve, curves, scaled
from flexclear.pipeline.post.overview.figures import CONTACTS, centre, orbit
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.single_run.series import derive, parameters

#: of the runs, the reference first: distinguished by colour-blind readers, too
COLORS = ("#111111", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: of models of one mechanism, by what they have next to the ideal one; the same as in the figures about the paper
IDEAL, CLEARANCE = "#111111", "#E69F00"
MODES = {"free-free": "#0072B2", "fixed-fixed": "#D55E00", "craig-bampton": "#009E73"}
#: opacity of a curve beyond the horizon of its run
PALE = 0.35


def colors(runs: Mapping[str, xr.Dataset]) -> list[str]:
    """A colour for each run: that of its model, where it is the first with that; else one that none has."""
    chosen: list[str] = []
    for run in runs.values():
        parts = parameters(run)
        flexible = [body["modes"]["reference"] for body in parts.get("body", {}).values() if body["type"] == "flexible"]
        own = MODES.get(flexible[0], COLORS[4]) if flexible else CLEARANCE if "contact" in run.sizes else IDEAL
        free = [color for color in COLORS if color not in chosen] or list(COLORS)
        chosen.append(own if own not in chosen else free[0])
    return chosen


def make(name: str, runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> dict[str, bytes]:
    """``name.png`` and ``name.svg``; runs: schema RUN by label, the reference first."""
    drawn = _panels(runs, chosen)
    with style.style():
        figure, axes = style.grid(len(drawn), 2, (11.0, 1.0 + 2.3 * len(drawn)), width_ratios=[1.5, 1.0])
        for row, (quantity, lines) in zip(axes, drawn, strict=True):
            _overlay(row[0], runs, lines)
            _apart(row[1], runs, quantity, lines)
        pale = "beyond the predictability horizon of a run"
        if any(float(run["horizon"]) < float(run["time"][-1]) for run in runs.values() if "horizon" in run):
            axes[0, 0].plot([], [], color=style.SOFT, alpha=PALE, label=pale)
        if any(len(curve.peaks) for _, lines in drawn for curve in lines if curve is not None):
            axes[0, 0].plot([], [], ".", color=style.INK, label="peak of a contact shorter than the outputs show")
        style.shared_legend(figure, axes[0, 0], min(len(runs), 3), pale)
        style.heading(figure, "Runs next to each other", f"right: distance from {next(iter(runs))}")
        files = style.files(name, figure)
        return files | _orbits(f"{name}_contacts", runs)


def _panels(runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> list[tuple[Quantity, list[Curve | None]]]:
    """Each quantity with its curves; what a contact has several of is drawn once."""
    panels: dict[str, tuple[Quantity, list[Curve | None]]] = {}
    for quantity in chosen:
        mine = curves(list(runs.values()), quantity)
        title = next((curve.title for curve in mine if curve is not None), None)
        if title is not None:
            panels.setdefault(title, (quantity, mine))
    return list(panels.values())


def _overlay(axes: style.Axes, runs: Mapping[str, xr.Dataset], lines: Sequence[Curve | None]) -> None:
    there = [curve for curve in lines if curve is not None]
    factor, unit = scaled(max(float(np.abs(curve.values).max(initial=0.0)) for curve in there), there[0].unit)
    own = colors(runs)
    for k, ((label, run), curve) in enumerate(zip(runs.items(), lines, strict=True)):
        if curve is None:
            continue
        color, last = own[k], _horizon(run)
        firm = curve.time <= last
        # dashes over the others, so that none hides what lies below it
        look: dict[str, Any] = {"color": color} | (
            {"lw": 1.2, "ls": (0, (5, 3)), "zorder": 2.5} if k == 0 else {"lw": 1.1}
        )
        axes.plot(1e3 * curve.time[firm], factor * curve.values[firm], label=label, **look)
        axes.plot(1e3 * curve.time[~firm], factor * curve.values[~firm], alpha=PALE, **look)
        axes.plot(1e3 * curve.peaks[:, 0], factor * curve.peaks[:, 1], ".", ms=2.5, color=color)
    time = there[0].time
    axes.set(xlim=(1e3 * time[0], 1e3 * time[-1]), xlabel="time (ms)")
    axes.set_title(f"{there[0].title} ({unit})")


def _apart(
    axes: style.Axes, runs: Mapping[str, xr.Dataset], quantity: Quantity, curves_drawn: Sequence[Curve | None]
) -> None:
    """Distance of the whole quantity, all its components, from the reference; of a force its difference."""
    (_, reference), *others = runs.items()
    lines: list[tuple[int, np.ndarray, np.ndarray]] = []
    for k, (_, run) in enumerate(others, start=1):
        if quantity.over_time and quantities.has(run, quantity) and quantities.has(reference, quantity):
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
    factor, written = scaled(max(float(values.max(initial=0.0)) for _, _, values in lines), unit)
    own = colors(runs)
    for k, time, values in lines:
        axes.plot(1e3 * time, factor * values, color=own[k], lw=0.9)
    time = lines[0][1]
    axes.set(xlim=(1e3 * time[0], 1e3 * time[-1]), xlabel="time (ms)")
    axes.set_ylim(bottom=0.0)
    axes.set_title(f"from the reference ({written})")


def _orbits(name: str, runs: Mapping[str, xr.Dataset]) -> dict[str, bytes]:
    orbits = [
        (label, run, k)
        for label, run in runs.items()
        if "contact" in run.sizes
        for k in range(min(run.sizes["contact"], CONTACTS))
    ]
    if not orbits:
        return {}
    columns = min(len(orbits), 4)
    figure, panels = style.panels(len(orbits), columns, max(4.0, 2.75 * columns), 0.6, 3.0)
    for panel, (label, run, k) in zip(panels, orbits, strict=True):
        orbit(panel, run, float(derive(run)["clearance"].values[k]), k)
        panel.set_title(f"{run['contact'].values[k]}: {label}\n{centre(run, k)}")
    return style.files(name, figure)


def _horizon(run: xr.Dataset) -> float:
    return float(run["horizon"]) if "horizon" in run else float(run["time"].values[-1])
