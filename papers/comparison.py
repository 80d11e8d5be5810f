"""What several papers need: a figure or table from results, verdicts on statements, an axis for differences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

    from flexclear.publishing import Table

#: cell of a table without a value
ABSENT = "–"
#: artifacts by reference, such as ``sps4/csj:run``
Data = dict[str, "xr.Dataset"]


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure or table.

    title: subject.  needs: references of the artifacts that `make` requires, ``<scene>:<artifact>[/<body>]``.  make:
    builds drawing or table from these artifacts; drawings share one style. files: that `make` opens, below the folder
    of the sources.
    """

    title: str
    needs: tuple[str, ...]
    make: Callable[[Data], Drawing | Table]
    files: tuple[str, ...] = ()


def drawn(
    title: str, *needs: str, files: tuple[str, ...] = ()
) -> Callable[[Callable[[Data], Drawing | Table]], Figure]:
    """Return a decorator that turns a drawing function into a `Figure`."""
    return lambda make: Figure(title, needs, make, files)


#: verdicts on a statement
HOLDS, NOT, PARTLY = "holds", "does not hold", "in part"
Outcome = tuple[str, str]  #: verdict, and the numbers behind it


def verdict(*tests: bool) -> str:
    """Return whether a statement holds, of which each test judges a part."""
    return HOLDS if all(tests) else (PARTLY if any(tests) else NOT)


def verdict_table(
    title: str,
    statements: Sequence[tuple[str, ...]],
    tests: Mapping[str, Callable[[Data], Outcome]],
    data: Data,
    notes: tuple[str, ...],
) -> Table:
    """Return a table of statements, each given as the name of its test, its place and its text, with their verdicts."""
    from flexclear.publishing import Table

    judged = tuple((place, text, *tests[name](data)) for name, place, text in statements)
    return Table(title, ("place", "statement", "verdict", "numbers"), judged, notes)


#: largest ratio of the differences' sizes on a linear axis; above it the axis is logarithmic around zero
SEPARATION = 20.0
#: differences below this fraction of the largest are rounding
ROUNDING = 1e-6


def scale_differences(axes: Axes, sizes: Sequence[float]) -> None:
    """Choose a scale on which differences of all sizes are visible."""
    import numpy as np

    from flexclear.publishing import style

    largest = max(sizes, default=0.0)
    smallest = min((size for size in sizes if size > ROUNDING * largest), default=largest)
    if largest <= SEPARATION * smallest:
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))
        return
    linear = 10.0 ** np.floor(np.log10(smallest))
    axes.set_yscale("symlog", linthresh=linear, linscale=0.6)
    top = 10.0 ** np.ceil(np.log10(largest))
    axes.set(ylim=(-top, top), yticks=[-top, 0.0, top])
    axes.minorticks_off()
    text = f"linear within ±{linear:g}, logarithmic beyond"
    axes.text(0.995, 0.03, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=6.8, color=style.INK)
