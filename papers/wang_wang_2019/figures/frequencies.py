"""Tables 4 and 5: the paper's frequencies of the rod next to ours and the exact ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from flexclear.papers.wang_wang_2019 import published
from flexclear.papers.wang_wang_2019.figures import Figure
from flexclear.pipeline.post.plotting.table import Table

COLUMNS = (
    "mode",
    "kind",
    "paper, ANSYS (Hz)",
    "paper, normal mode (Hz)",
    "difference of these (%)",
    "ours, square inertia (Hz)",
    "agrees as printed",
    "ours, circle (Hz)",
    "exact Rayleigh beam (Hz)",
    "exact Timoshenko beam (Hz)",
)
ABSENT = "–"
LEAST = 1e-3  # the last digit printed [Hz]
MEANING = "± of ours: how much the frequency changes on a mesh of four times as many elements."


def _table(
    title: str, data: Sequence[xr.Dataset], ansys: Sequence[float], printed: Sequence[float], rigid: int
) -> Table:
    """Rows of one frequency table; `rigid` zero rows come first, as the paper prints them.

    data: modes with the square's inertia and with the circle's, elastic modes only, ascending; then both again on
    a finer mesh.
    """
    square, circle, square_fine, circle_fine = data
    rows = [_rigid_row(i + 1, circle, i) for i in range(rigid)]
    for i, (a, p) in enumerate(zip(ansys, printed, strict=True)):
        ours, right = float(square.frequency[i]), float(circle.frequency[i])
        rows.append(
            (
                str(rigid + i + 1), str(circle.kind.values[i]), f"{a:.1f}", f"{p:.1f}", f"{100 * abs(p - a) / a:.2f}",
                _with_error(ours, square_fine, i), "yes" if f"{ours:.1f}" == f"{p:.1f}" else "no",
                _with_error(right, circle_fine, i),
                _exact(circle, "exact_rayleigh", i), _exact(circle, "exact_timoshenko", i),
            )
        )  # fmt: skip
    agree = [f"{float(square.frequency[i]):.1f}" == f"{p:.1f}" for i, p in enumerate(printed)]
    return Table(
        title,
        COLUMNS,
        tuple(rows),
        (_about_section(agree, square, circle), _about_ansys(), _about_shear(circle), MEANING),
    )


def _with_error(hertz: float, fine: xr.Dataset, i: int) -> str:
    """A frequency, +- what it changes on the finer mesh."""
    return f"{hertz:.3f} ± {max(abs(hertz - float(fine.frequency[i])), LEAST):.3f}"


def euler_bernoulli_ratio() -> float:
    """Third over second frequency of a uniform Euler-Bernoulli beam with both ends alike (clamped or free).

    Roots of cos x cosh x = 1; the frequencies go with the squares of the roots.
    """
    second, third = (
        brentq(lambda x: np.cos(x) - 1.0 / np.cosh(x), c - 0.5, c + 0.5) for c in (2.5 * np.pi, 3.5 * np.pi)
    )
    return float((third / second) ** 2)


def _rigid_row(number: int, modes: xr.Dataset, i: int) -> tuple[str, ...]:
    ours = (
        f"{float(modes.rigid_frequency[i]):.2f}"
        if "rigid_frequency" in modes and i < modes.sizes["rigid_mode"]
        else "0"
    )
    return (str(number), "rigid", "0", "0", "0", "0 (removed)", "yes", f"{ours} (removed)", "0", "0")


def _exact(modes: xr.Dataset, name: str, i: int) -> str:
    return f"{float(modes[name][i]):.3f}" if name in modes and np.isfinite(modes[name][i]) else ABSENT


def _about_section(agree: list[bool], square: xr.Dataset, circle: xr.Dataset) -> str:
    count = len(agree)
    change = np.abs(square.frequency.values[:count] / circle.frequency.values[:count] - 1.0)
    worst = int(np.argmax(change))
    verdict = "all" if all(agree) else f"{sum(agree)} of {count}"
    return (
        "The column 'square inertia' takes the section's second moments in the mass matrix from the square of "
        "equal area and those in "
        f"the stiffness from the circle; so {verdict} of the paper's elastic values come out as printed. The "
        "rod is round: 'circle' is the correct column, "
        f"up to {100 * change[worst]:.1f} % away (mode {worst + 1} of those listed, {circle.kind.values[worst]})."
    )


def _about_ansys() -> str:
    ratio, bound = published.TABLE5_ANSYS[5] / published.TABLE5_ANSYS[2], euler_bernoulli_ratio()
    return (
        "The ANSYS columns belong to no converged uniform rod: its torsional frequency is the same for "
        "clamped and for free ends, yet they give "
        f"{published.TABLE4_ANSYS[4]:.1f} and {published.TABLE5_ANSYS[4]:.1f} Hz; and the third free bending frequency "
        "over the second is "
        f"{ratio:.4f}, above the {bound:.4f} of an Euler-Bernoulli beam, which rotary inertia and shear can only lower."
    )


def _about_shear(circle: xr.Dataset) -> str:
    if "exact_timoshenko" not in circle or "exact_rayleigh" not in circle:
        return "The beam elements have rotary inertia but no shear flexibility."
    bending = np.array([str(kind).startswith("bending") for kind in circle.kind.values])
    drop = 1.0 - circle.exact_timoshenko.values[bending] / circle.exact_rayleigh.values[bending]
    return (
        "Shear flexibility, which these elements leave out, lowers the bending frequencies listed by "
        f"{100 * np.nanmin(drop):.1f} to "
        f"{100 * np.nanmax(drop):.1f} % (exact Timoshenko beam against exact Rayleigh beam)."
    )


def _figure(number: int, reference: str, ansys: Sequence[float], printed: Sequence[float], rigid: int) -> Figure:
    """The table of a reference condition; the other arguments as of `_table`."""
    variants = [f"sps4/frequencies/{reference}_{inertia}" for inertia in ("square", "circle")]
    needs = tuple(f"{scene}:{modes}/rod" for modes in ("modes", "fine-modes") for scene in variants)
    ends = f"{reference}-{reference} reference conditions"
    title = f"Table {number}: frequencies of the rod, {ends}"
    return Figure(
        f"Table {number}: natural frequencies of the rod under {ends}",
        needs,
        lambda data: _table(title, [data[name] for name in needs], ansys, printed, rigid),
    )


TABLE04 = _figure(4, "fixed", published.TABLE4_ANSYS, published.TABLE4_NORMAL_MODE, rigid=0)
TABLE05 = _figure(5, "free", published.TABLE5_ANSYS, published.TABLE5_NORMAL_MODE, rigid=published.RIGID_MODES)
