"""Figures 3 and 4: the first mode shapes with their frequencies."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pipeline.post.plotting import style
from pipeline.post.render import gl
from pipeline.post.rod_shape import centre_line, scale_to

COUNT = 4


def make(name: str, title: str, bundle: xr.Dataset, printed: tuple[float, ...]) -> dict[str, bytes]:
    """Figure `name` with COUNT shapes: rendered where GL works, drawn as lines elsewhere."""
    drawn = gl.works()
    with style.style():
        figure, axes = style.grid(2, 2, (10.6, 6.0 if drawn else 5.2))
        for mode, panel in enumerate(axes.flat):
            (_rendered if drawn else _lines)(panel, bundle, mode)
            frequency = float(bundle.frequency[mode])
            panel.set_title(f"mode {mode + 1}: {frequency:.1f} Hz (paper {printed[mode]:.1f} Hz)")
        how = "colour: their size" if drawn else "drawn as lines, because this machine has no working GL libraries"
        style.heading(figure, title, f"round section; displacements exaggerated; {how}")
        return style.files(name, figure)


def _rendered(axes: Axes, bundle: xr.Dataset, mode: int) -> None:
    from pipeline.post.render.shapes import picture  # pyvista is imported only where it can draw

    axes.imshow(picture(bundle, mode), interpolation="antialiased")
    axes.set_axis_off()


def _lines(axes: Axes, bundle: xr.Dataset, mode: int) -> None:
    """Centre line in an oblique projection, with its undeformed ghost."""
    q = np.zeros(bundle.sizes["mode"])
    q[mode] = 1.0
    points, displacement, _ = centre_line(bundle, q, scale_to(bundle, q, 0.16))
    for offset, color, width in ((0.0, "#b5bdc6", 1.2), (1.0, "#0072B2", 3.0)):
        x, y, z = (points + offset * displacement).T * 1e3
        axes.plot(x - 0.35 * y, z - 0.35 * y, color=color, lw=width)
    axes.set(xlabel="along the rod (mm)", ylabel="oblique view (mm)")
    axes.set_aspect("equal", adjustable="datalim")
