"""Figure of wear over many cycles: gap and clearance, largest force, and the shapes of the surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.post.overview.curves import by_unit
from flexclear.post.plotting import style

#: most joints that are drawn
JOINTS = 4
WHAT = {"outer": ("socket or journal", "#D55E00"), "inner": ("ball or pin", "#0072B2")}


def figure(data: xr.Dataset) -> dict[str, bytes]:
    """Return PNG and SVG of a dataset (schema WEAR), by file name."""
    with style.set_style():
        count = min(data.sizes["worn"], JOINTS)
        drawn, axes = style.grid(count, 3, (11.0, 0.9 + 2.4 * count))
        for k, row in enumerate(axes):
            _joint(row, data.isel(worn=k))
        gap, cycles = data["worn_gap"].values[:, :count], float(data["cycles"][-1])
        factor, unit = by_unit({"": gap}, "m")
        wide = int(gap[-1].argmax())
        heading = f"After {cycles:.3g} cycles the largest gap is {factor * gap[-1, wide]:.3g} {unit}"
        more = f", {factor * gap[0, wide]:.3g} {unit} at first; {data.sizes['step']} runs"
        style.heading(drawn, heading, f"in {data['worn'].values[wide]}{more}")
        return style.files("wear", drawn)


def _joint(row: Any, data: xr.Dataset) -> None:
    cycles, name = data["cycles"].values, str(data["worn"].values)
    lines = {"largest gap": data["worn_gap"].values, "mean clearance": data["worn_clearance"].values}
    factor, unit = by_unit(lines, "m")
    for (label, values), color in zip(lines.items(), ("#D55E00", style.INK), strict=True):
        row[0].plot(cycles, factor * values, "o-", ms=2.5, color=color, label=label)
    row[0].set(xlabel="cycles", title=f"{name}: radial clearance ({unit})")
    row[0].legend()
    row[1].plot(cycles, data["peak_force"].values, "o-", ms=2.5, color=style.INK)
    row[1].set(xlabel="cycles", title="largest normal force (N)")
    depths = {side: data[f"depth_{side}"].values[-1].max(axis=0)[: int(data["wear_sectors"])] for side in WHAT}
    factor, unit = by_unit(depths, "m")
    for side, (label, color) in WHAT.items():
        edges = np.linspace(0.0, 360.0, len(depths[side]) + 1)
        row[2].stairs(factor * depths[side], edges, color=color, label=label)
    row[2].set(xlim=(0.0, 360.0), xlabel="angle about z of its frame (°)", xticks=range(0, 361, 90))
    row[2].set_title(f"depth at the end ({unit})")
    row[2].legend()
