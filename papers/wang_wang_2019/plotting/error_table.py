"""What tables 7-9 share: rows of largest deviations, ours next to the paper's, and how far apart they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexclear.papers.wang_wang_2019.deviations import Deviation
from flexclear.papers.wang_wang_2019.published import MaximumError

#: row heads, attribute of Deviation, factor to the unit, attribute of MaximumError (None: not in the paper)
ROWS: tuple[tuple[str, str, float, str | None], ...] = (
    ("angle about y0 (rad)", "angle", 1.0, "angle"),
    ("total rotation (rad), added", "rotation", 1.0, None),
    ("displacement z0 (mm)", "displacement", 1e3, "displacement"),
    ("velocity z0 (mm/s)", "velocity", 1e3, "velocity"),
)
ABSENT = "–"
#: deviations below this fraction of the printed ones are called zero: the paper prints four digits
NOTHING = 1e-4
#: values below this are rounding of the runs and differ between machines (positions of 0.1 m to 16 digits, in mm)
NOISE = 1e-10


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its head, and one value or (mean, standard deviation) per row; None where there is none."""

    head: str
    cells: tuple[str, ...]


def paper(head: str, values: MaximumError) -> Column:
    """The paper's column."""
    return Column(head, tuple(ABSENT if name is None else number(getattr(values, name)) for *_, name in ROWS))


def single(head: str, deviation: Deviation, tighter: Deviation) -> Column:
    """The column of one run, +- what it changes when the run is made at a tighter tolerance."""
    cells = []
    for _, name, factor, _ in ROWS:
        value, other = factor * getattr(deviation, name), factor * getattr(tighter, name)
        cells.append(f"{number(value)} ± {max(abs(value - other), NOISE):.0e}")
    return Column(head, tuple(cells))


def several(head: str, deviations: Sequence[Deviation]) -> Column:
    """Mean +- standard deviation over an ensemble's members."""
    cells = []
    for _, name, factor, _ in ROWS:
        values = factor * np.array([getattr(deviation, name) for deviation in deviations])
        cells.append(f"{number(values.mean())} ± {values.std(ddof=1):.1e}")
    return Column(head, tuple(cells))


def rows(columns: Sequence[Column]) -> tuple[tuple[str, ...], ...]:
    """Rows of the table: head and one cell per column."""
    return tuple((head, *(column.cells[i] for column in columns)) for i, (head, *_) in enumerate(ROWS))


def heads(columns: Sequence[Column]) -> tuple[str, ...]:
    """Column heads, the first for the quantity."""
    return ("largest error", *(column.head for column in columns))


def ratios(deviation: Deviation, printed: MaximumError) -> dict[str, float]:
    """Ours over the paper's per quantity that the paper prints."""
    return {
        name: factor * getattr(deviation, ours) / getattr(printed, name)
        for _, ours, factor, name in ROWS
        if name is not None
    }


#: what the +- of `single` means, for the notes of a table
MEANING = (
    "± of a single run: how much the value changes at a hundred times tighter tolerance, the error of its time "
    "integration; the model's own errors (assumed geometry, mode set) and what lies between two outputs are not in it."
)


def comparison(who: str, deviation: Deviation, printed: MaximumError) -> str:
    """A sentence with the ratios; says zero where there is nothing to divide."""
    percentages = ratios(deviation, printed)
    if max(percentages.values()) < NOTHING:
        return f"{who}: ours are zero, up to rounding."
    text = ", ".join(f"{name} {ratio:.2g}" for name, ratio in percentages.items())
    return f"{who}: ours over the paper's: {text}."


def number(value: float) -> str:
    """Four significant digits, in the paper's style for small values; rounding noise is not printed."""
    if abs(value) < NOISE:
        return f"< {NOISE:.0e}"
    return f"{value:.3f}" if 0.1 <= abs(value) < 1e4 else f"{value:.3e}"
