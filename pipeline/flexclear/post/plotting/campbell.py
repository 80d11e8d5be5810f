"""Campbell diagram: frequencies over the speed of a drive, as a table and as a picture."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.post.plotting import style

#: branches in the table: further ones are those of short waves, far above the speeds
MOST = 8
COLORS = {"forward": "#1f6f8b", "backward": "#c05a2b", "": "#6b6b6b"}


def text(data: xr.Dataset) -> str:
    """Format rows per speed, columns per branch, whirls in fixed axes, and critical speeds (schema CAMPBELL)."""
    shown = data.isel(branch=slice(0, MOST))
    frequencies, names = _in_fixed_axes(shown), [str(name) or "no whirl" for name in shown["whirl"].values]
    lines = [
        f"{data.attrs['title']}: drive {data.attrs['drive']}, frequencies in Hz; whirls in fixed axes, "
        "backward negative",
        " ".join([f"{'speed':>10}", *(f"{k:>12}" for k in shown["branch"].values)]),
        " ".join([f"{'rad/s':>10}", *(f"{name:>12}" for name in names)]),
    ]
    for speed, row, growth in zip(shown["speed"].values, frequencies, shown["growth"].values, strict=True):
        says = "  no steady motion" if np.isnan(growth) else f"  unstable: grows at {growth:.3g} 1/s" if growth else ""
        lines.append(" ".join([f"{speed:>10.6g}", *(f"{hertz:>12.6g}" for hertz in row)]) + says)
    for branch, speed in zip(data["branch"].values, data["critical_speed"].values, strict=True):
        if np.isfinite(speed):
            lines.append(f"critical speed of branch {branch}: {speed:.6g} rad/s ({speed * 30.0 / np.pi:.6g} rpm)")
    if data.sizes["branch"] > MOST:
        lines.append(f"{data.sizes['branch'] - MOST} more branches are in the dataset")
    return "\n".join(lines)


def files(name: str, data: xr.Dataset) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``.svg``: magnitudes of whirls in fixed axes, other vibrations, and the speed itself."""
    with style.set_style():
        figure, axes = style.grid(1, 1, (7.0, 4.6))
        panel, speed = axes[0, 0], data["speed"].values
        frequencies, kinds = np.abs(_in_fixed_axes(data)), data["whirl"].values
        top = 4.0 * max(float(np.abs(speed).max()) / (2.0 * np.pi), float(np.nanmin(np.nanmax(frequencies, axis=0))))
        labelled = set[str]()
        for values, kind in zip(frequencies.T, kinds, strict=True):
            label = None if kind in labelled else str(kind) or "no whirl"
            labelled.add(kind)
            panel.plot(speed, values, "o-", ms=2.5, color=COLORS[str(kind)], label=label)
        panel.plot(speed, np.abs(speed) / (2.0 * np.pi), "--", lw=0.9, color=style.SOFT, label="speed")
        for critical in data["critical_speed"].values[np.isfinite(data["critical_speed"].values)]:
            panel.plot(critical, critical / (2.0 * np.pi), "D", ms=5, color=style.INK, zorder=4)
        panel.set(xlabel="speed (rad/s)", ylabel="frequency (Hz)", ylim=(0.0, min(top, 1.05 * np.nanmax(frequencies))))
        panel.legend(fontsize=8.0)
        style.heading(figure, str(data.attrs["title"]), "whirls in fixed axes; diamonds: critical speeds")
        return style.files(name, figure)


def _in_fixed_axes(data: xr.Dataset) -> np.ndarray:
    """Return frequencies [Hz] in fixed axes for whirls, else in the rotating axes; shape (speed, branch)."""
    whirls = data["whirl"].values != ""
    return np.where(whirls[None, :], data["whirl_frequency"].values, data["frequency"].values)
