"""Figures of a sweep: curves over one parameter, maps over two, clouds of samples."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from pathlib import PurePath

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from flexclear.post.plotting.style import INK, SOFT, files, heading, panels, set_plain_numbers, set_style
from flexclear.scene import units
from flexclear.scene.load import FAMILIES
from flexclear.scene.quantity import KINDS

LINE, REFUSED = "#0072B2", "#D55E00"
#: factors for handy numbers on an axis
HANDY = {"m": (1e3, "mm"), "N": (1.0, "N"), "s": (1e3, "ms")}
NAME = "sweep"
#: fraction of the largest component of a vector below which another one is zero but for rounding
ZERO = 1e-9


def figures(sweep: xr.Dataset) -> dict[str, bytes]:
    """Draw ``sweep.png`` and ``.svg``; none for too many dimensions, for text parameters alone, or without points."""
    parameters = [str(name) for name in sweep["status"].dims]
    # values may have any order in a sweep; along an axis they go up
    sweep = sweep.sortby([name for name in parameters if name in sweep.coords and sweep[name].dtype.kind in "fiu"])
    draw = _drawing_function(sweep, parameters)
    shown = _panels(sweep, sections=draw is _curve)
    if draw is None or not shown or not (sweep["status"] == 0).any():
        return {}
    columns = min(2, len(shown))
    with set_style():
        figure, axes = panels(len(shown), columns, 9.6, 1.0, 2.9 if columns > 1 else 4.2)
        for ax, name in zip(axes, shown, strict=True):
            draw(figure, ax, shown[name], name)
            ax.set_title(_in_words(name))
        refused = int((sweep["status"] == 1).sum())
        missing = int((sweep["status"] == 2).sum())
        sentences = [f"{sweep['status'].size} points of {sweep.attrs['scene']}"]
        sentences += [f"{refused} refused"] if refused else []
        sentences += [f"{missing} not run"] if missing else []
        sentences += _constant_components(sweep, shown)
        if draw is _curve:
            sentences += [text for end, text in BANDS.items() if any(f"{name}{end}" in sweep for name in shown)][:1]
        heading(figure, sweep.attrs.get("title", sweep.attrs["sweep"]), ", ".join(sentences))
        return files(NAME, figure)


#: meaning of the band about a curve, by its variable
BANDS = {".deviation": "bands: ± the members' standard deviation", ".error": "bands: ± the error of time integration"}
Draw = Callable[[Figure, Axes, xr.Dataset, str], None]


def _panels(sweep: xr.Dataset, *, sections: bool) -> dict[str, xr.Dataset]:
    """Return the sweep by panel, with the panel's values as a variable of that name.

    One number for each point or section; vectors component by component.  Series are left to the user's own figures.
    """
    dims, panels = sweep["status"].dims, dict[str, xr.Dataset]()
    for name in map(str, sweep.data_vars):
        inner = tuple(dim for dim in sweep[name].dims if dim not in dims)
        has_units = "units" in sweep[name].attrs and not name.endswith((".error", ".deviation"))
        if not has_units or ("section" in inner and not sections):
            continue
        if inner in ((), ("section",)):
            panels[name] = sweep
        elif inner in (("axis",), ("section", "axis")):
            for axis in _varying_components(sweep[name]):
                panels[f"{name} {axis}"] = sweep.assign({f"{name} {axis}": sweep[name].sel(axis=axis, drop=True)})
    return panels


def _varying_components(vector: xr.DataArray) -> list[str]:
    """Return components that are not zero at all points, but for rounding; all of them where nothing moves."""
    sizes = abs(vector).max([dim for dim in vector.dims if dim != "axis"])
    axes = [str(axis) for axis in vector["axis"].values[(sizes > ZERO * sizes.max()).values]]
    return axes or list(map(str, vector["axis"].values))


def _constant_components(sweep: xr.Dataset, panels: Collection[str]) -> list[str]:
    """Return sentences on components without a panel."""
    constant = []
    for name in map(str, sweep.data_vars):
        drawn = {panel.removeprefix(f"{name} ") for panel in panels if panel.startswith(f"{name} ")}
        if drawn:
            away = [str(axis) for axis in sweep["axis"].values if axis not in drawn]
            constant += [f"{' and '.join(away)} of {name} {'are' if len(away) > 1 else 'is'} 0"] if away else []
    return constant


def _drawing_function(sweep: xr.Dataset, parameters: list[str]) -> Draw | None:
    if parameters == ["point"]:
        names = _numeric_parameters(sweep)
        if not names:
            return None
        ordered = len(names) > 1 and _is_path(sweep, names)
        return _curve if len(names) == 1 or ordered else _cloud
    text = [name for name in parameters if sweep[name].dtype.kind not in "fiu"]
    if text:
        return _family if len(parameters) == 2 and len(text) == 1 else None
    return {1: _curve, 2: _map}.get(len(parameters))


def _numeric_parameters(sweep: xr.Dataset) -> list[str]:
    """Return the numeric parameters of points, in the order of the sweep."""
    own = [str(name) for name in sweep.coords if sweep[name].dims == ("point",)]
    return [name for name in own if sweep[name].dtype.kind in "fiu"]


def _is_path(sweep: xr.Dataset, names: list[str]) -> bool:
    """Return True when all parameters rise, or fall, from point to point: then one determines the others."""
    steps = [np.diff(sweep[name].values) for name in names]
    return all(bool((step > 0).all() or (step < 0).all()) for step in steps)


def _curve(figure: Figure, ax: Axes, sweep: xr.Dataset, name: str) -> None:
    parameter = _parameter(sweep)
    x, y = sweep[parameter].values * _scale(sweep, parameter)[0], sweep[name].values
    if "section" in sweep[name].dims:
        every = sweep[name].transpose(..., "section").values
        ax.plot(np.repeat(x, every.shape[-1]), every.ravel(), ".", color=LINE, ms=1.6, mew=0.0)
    else:
        for spread in [sweep[f"{name}{end}"].values for end in BANDS if f"{name}{end}" in sweep][:1]:
            ax.fill_between(x, y - spread, y + spread, color=LINE, alpha=0.22, lw=0.0)
        ax.plot(x, y, color=LINE, marker="o", ms=3.0)
    if name.endswith(".count"):
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    for value in x[sweep["status"].values == 1]:
        ax.axvline(value, color=REFUSED, lw=0.8, ls=":")
    if _in_decades(x):
        ax.set_xscale("log")
        set_plain_numbers(ax.xaxis)
    _label(ax, sweep, parameter, name)


def _family(figure: Figure, ax: Axes, sweep: xr.Dataset, name: str) -> None:
    """Draw a curve for each value that is text."""
    text, numeric = sorted((str(dim) for dim in sweep["status"].dims), key=lambda dim: sweep[dim].dtype.kind in "fiu")
    x = sweep[numeric].values * _scale(sweep, numeric)[0]
    for value in sweep[text].values:
        ax.plot(x, sweep[name].sel({text: value}).values, marker="o", ms=3.0, label=PurePath(str(value)).stem)
    ax.legend(fontsize="small", frameon=False)
    _label(ax, sweep, numeric, name)


def _parameter(sweep: xr.Dataset) -> str:
    dims = [str(dim) for dim in sweep["status"].dims]
    return _numeric_parameters(sweep)[0] if dims == ["point"] else dims[0]


def _map(figure: Figure, ax: Axes, sweep: xr.Dataset, name: str) -> None:
    rows, columns = (str(dim) for dim in sweep["status"].dims)
    x, y = (sweep[dim].values * _scale(sweep, dim)[0] for dim in (columns, rows))
    mesh = ax.pcolormesh(_edges(x), _edges(y), sweep[name].values, cmap="viridis")
    for axis, values, scale in ((ax.xaxis, x, ax.set_xscale), (ax.yaxis, y, ax.set_yscale)):
        if _in_decades(values):
            scale("log")
            set_plain_numbers(axis)
        # 8: largest number of values along the axis of a map that are all written
        if len(values) <= 8:  # the cells' own values, which may be uneven
            axis.set_ticks(values, labels=[f"{value:.6g}" for value in values])
            axis.set_ticks([], minor=True)
    _color_bar(figure, ax, mesh, _unit_text(sweep[name].attrs["units"]))
    ax.grid(False)
    refused = np.argwhere(sweep["status"].values == 1)
    ax.plot(x[refused[:, 1]], y[refused[:, 0]], "x", color=REFUSED, ms=4.0)
    ax.set(xlabel=_axis(sweep, columns), ylabel=_axis(sweep, rows))


def _in_decades(values: np.ndarray) -> bool:
    """Return True for values that a logarithmic axis shows better."""
    # 8.0: ratio of a parameter's largest to its least value above which its axis is logarithmic
    return bool(values.min() > 0.0 and values.max() > 8.0 * values.min())


def _edges(values: np.ndarray) -> np.ndarray:
    """Return the borders of cells about values that go up: halfway between them, on the scale of their axis."""
    logarithmic = _in_decades(values)
    at = np.log(values) if logarithmic else values
    step = np.diff(at) if at.size > 1 else np.array([1.0])
    borders = np.concatenate([[at[0] - 0.5 * step[0]], at[:-1] + 0.5 * np.diff(at), [at[-1] + 0.5 * step[-1]]])
    return np.exp(borders) if logarithmic else borders


def _cloud(figure: Figure, ax: Axes, sweep: xr.Dataset, name: str) -> None:
    """Draw values by the first parameter, coloured by the second; mean and 5 % and 95 % quantiles as lines."""
    first, second = _numeric_parameters(sweep)[:2]
    y, scale = sweep[name].values, _scale(sweep, second)[0]
    points = ax.scatter(
        sweep[first].values * _scale(sweep, first)[0], y, c=sweep[second].values * scale, s=11.0, cmap="viridis"
    )
    _color_bar(figure, ax, points, _axis(sweep, second))
    known = y[np.isfinite(y)]
    if len(known):
        ax.axhline(known.mean(), color=INK, lw=0.9)
        for quantile in np.quantile(known, (0.05, 0.95)):
            ax.axhline(quantile, color=INK, lw=0.7, ls=(0, (4, 3)))
    _label(ax, sweep, first, name)


def _color_bar(figure: Figure, ax: Axes, drawn: ScalarMappable, label: str) -> None:
    bar = figure.colorbar(drawn, ax=ax)
    bar.set_label(label, color=SOFT)
    bar.outline.set_visible(False)


def _label(ax: Axes, sweep: xr.Dataset, parameter: str, name: str) -> None:
    ax.set(xlabel=_axis(sweep, parameter), ylabel=_unit_text(sweep[name].attrs["units"]))


def _scale(sweep: xr.Dataset, parameter: str) -> tuple[float, str]:
    unit, written = (sweep[parameter].attrs.get(key, "") for key in ("units", "written_units"))
    if written and (known := units.unit(written)):
        return 1.0 / known[0], written
    return HANDY.get(unit, (1.0, _unit_text(unit)))


def _unit_text(unit: str) -> str:
    """Return the units of a dataset in common notation: ``m/s`` for ``m s-1``, nothing for ``1``."""
    parts = [] if unit == "1" else unit.split()
    over, under = ([p for p in parts if ("-" in p) == below] for below in (False, True))
    powers = re.compile(r"(?<=[A-Za-z])-?(\d+)")
    written = [powers.sub(lambda m: "" if m[1] == "1" else f"$^{m[1]}$", " ".join(some)) for some in (over, under)]
    return "/".join([written[0] or "1", *written[1:]] if under else written[:1])


def _axis(sweep: xr.Dataset, parameter: str) -> str:
    unit = _scale(sweep, parameter)[1]
    return f"{_part_in_words(parameter)} ({unit})" if unit else _part_in_words(parameter)


def _part_in_words(path: str) -> str:
    """Return a key path in words: ``clearance of pin`` for ``joint.pin.clearance``."""
    first, *keys = path.replace("_", " ").split(".")
    return f"{' '.join(keys[1:])} of {keys[0]}" if first in FAMILIES and len(keys) > 1 else " ".join([first, *keys])


def _in_words(name: str) -> str:
    """Return a recorded quantity in words: ``platform: velocity, largest`` for ``platform.velocity.largest``."""
    path, blank, axis = name.partition(" ")
    parts = path.split(".")
    kind = next((k for k, part in enumerate(parts) if part in KINDS), 0)
    if not kind or "(" in name:
        return name
    words = ", ".join(part.replace("_", " ") for part in parts[kind:])
    return f"{'.'.join(parts[:kind])}: {words}{blank}{axis}"
