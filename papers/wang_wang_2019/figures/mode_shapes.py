"""Figures 3 and 4: the first mode shapes with their frequencies."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as Drawing

from flexclear.papers.wang_wang_2019.figures import Figure
from flexclear.papers.wang_wang_2019.published import TABLE4_NORMAL_MODE, TABLE5_NORMAL_MODE
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.plotting.drawing import View, shell, triad, view
from flexclear.pipeline.post.shapes.rod_shape import rod_scale_to as scale_to
from flexclear.pipeline.post.shapes.rod_shape import rod_surface as surface

#: drawn size of the largest displacement, as a fraction of the body's length
FRACTION = 0.16
#: of the pictures [m]
MARGIN = 0.008
#: the rod lies across the picture, seen from above and in front; both planes of bending are seen
TOWARDS, UP = np.array([-0.35, -1.0, 0.9]), np.array([0.0, 0.0, 1.0])


def _sheet(heading: str, bundle: xr.Dataset, printed: tuple[float, ...]) -> Drawing:
    """The first four shapes; printed: the paper's frequencies [Hz]."""
    seen = view(TOWARDS, UP)
    figure, axes = style.grid(2, 2, (10.6, 6.3))
    corners = []
    for mode, panel in enumerate(axes.flat):
        factor, reach = _shape(panel, seen, bundle, mode)
        corners.append(reach)
        frequency = float(bundle.frequency[mode])
        panel.set_title(
            f"({'abcd'[mode]}) mode {mode + 1}: {frequency:.1f} Hz (paper {printed[mode]:.1f} Hz), "
            f"drawn × {factor:.2g} √kg m",
            fontsize=8.0,
        )
    low, high = np.min(corners, axis=(0, 1)) - MARGIN, np.max(corners, axis=(0, 1)) + MARGIN
    for panel in axes.flat:  # one scale for all of them
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, 1.0), "viridis"), ax=axes, shrink=0.7, pad=0.01, aspect=30)
    bar.set_label("displacement, largest = 1")
    below = (
        "mass-normalised shapes of the round section (in kg$^{-1/2}$) times the factor next to each; grey: undeformed"
    )
    style.heading(figure, heading, below)
    return figure


def _shape(axes: Axes, seen: View, bundle: xr.Dataset, mode: int) -> tuple[float, np.ndarray]:
    """One shape over its undeformed ghost.

    Returns the factor of the drawn displacements [kg^0.5 m], and lower left and upper right corner of the picture [m].
    """
    q = np.zeros(bundle.sizes["mode"])
    ghost, _ = surface(bundle, q)
    q[mode] = 1.0
    factor = scale_to(bundle, q, FRACTION)
    rings, size = surface(bundle, q, factor)
    shell(axes, seen, ghost, None, alpha=0.22, antialiased=False, zorder=1)
    shell(axes, seen, rings, size / max(float(size.max()), 1e-300), zorder=2)
    corner = ghost.reshape(-1, 3).min(axis=0) + np.array([0.0, 0.0, -0.055])
    triad(axes, seen, corner, 0.03, ("x", "y", "z"))
    places = seen.project(np.concatenate([ghost.reshape(-1, 3), rings.reshape(-1, 3), corner[None] - 0.008]))
    axes.set_aspect("equal")
    axes.set_axis_off()
    return factor, np.array([places.min(axis=0), places.max(axis=0)])


def _figure(title: str, heading: str, condition: str, printed: tuple[float, ...]) -> Figure:
    """The figure of a reference condition of the rod with a round section."""
    needed = f"sps4/frequencies/{condition}_circle:bundle/rod"
    return Figure(title, (needed,), lambda data: _sheet(heading, data[needed], printed))


FIG03 = _figure(
    "Figure 3: first four mode shapes of the rod under fixed-fixed reference conditions",
    "Figure 3: fixed-fixed modes leave both ends of the rod at rest",
    "fixed",
    TABLE4_NORMAL_MODE,
)
FIG04 = _figure(
    "Figure 4: first four elastic mode shapes of the rod under free-free reference conditions",
    "Figure 4: free-free modes leave the rod's ends free, which move most",
    "free",
    TABLE5_NORMAL_MODE,
)
