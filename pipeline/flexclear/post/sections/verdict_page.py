"""The figure of sections and their verdict, and the page with the verdicts on several scenes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flexclear.post.plotting import style
from flexclear.post.plotting.table import Table, as_csv, pipe_table

INTRODUCTION = """# Periodic, quasi-periodic or chaotic

Made from the datasets `results/runs/<scene>/sections.nc` and `verdict.nc` by

    flexclear sections {scenes} \\
        --page {page}

Nothing on this page is typed in. Each scene's laws are repeated, period after period; {transient} periods are left to
settle, and {periods} are examined, once each at the same phase. For {followed} of them a neighbour is followed that
starts {distance:.0e} away, in units of the mechanism's size, and is brought back to that distance again and again: the
mean rate at which it parts is the largest Lyapunov exponent, with the confidence interval of its batch means.

- *periodic*: the states come back, and the exponent is not positive;
- *chaotic*: all of the exponent's interval is above what {followed} periods cannot distinguish from zero, and the 0-1
test
  says so (K above 0.8);
- *quasi-periodic*: the exponent may be zero, the 0-1 test says regular (K below 0.2), few lines hold the spectrum;
- *undecided* otherwise.

A freedom on which nothing depends, such as the spin of a leg with balls at both ends, has an exponent of zero. So the
largest exponent of a periodic motion is zero there, and the contraction shows how fast the rest settles.
"""
COLUMNS = ("scene", "verdict", "periods", "exponent", "exponent_low", "exponent_high")
HEAD = ("scene", "verdict", "exponent, 1/s", "95 %", "K", "returns after", "to", "contraction", "in 16 lines")


def markdown(verdicts: Mapping[str, xr.Dataset], sections: Mapping[str, xr.Dataset], page: str, pictures: str) -> str:
    """Return the whole page. verdicts, sections: schemas VERDICT and SECTIONS, by scene; pictures: their folder."""
    first = next(iter(sections.values()))
    text = INTRODUCTION.format(
        scenes=" ".join(verdicts),
        page=page,
        transient=first.attrs["transient"],
        periods=first.sizes["section"],
        followed=first.sizes["followed"],
        distance=first.attrs["neighbour_distance"],
    )
    table = pipe_table(HEAD, [row(name, verdict) for name, verdict in verdicts.items()])
    shown = [f"## {name}\n\n![Sections of {name}]({pictures}/{name.replace('/', '_')}.png)\n" for name in verdicts]
    return "\n".join([text, table, "", *shown])


def csv_text(verdicts: Mapping[str, xr.Dataset]) -> str:
    """Return the verdicts and their exponents [1/s] for programs: columns `COLUMNS`, a line for each scene."""
    rows = [
        (
            name,
            verdict.attrs["verdict"],
            str(verdict.sizes["section"]),
            *(f"{float(verdict[c]):.3g}" for c in COLUMNS[3:]),
        )
        for name, verdict in verdicts.items()
    ]
    return as_csv(Table("Verdicts", COLUMNS, tuple(rows)))


def row(name: str, verdict: xr.Dataset) -> tuple[str, ...]:
    """Return a line of the table."""
    after = int(verdict.returns_after)
    return (
        f"`{name}`",
        str(verdict.attrs["verdict"]),
        f"{float(verdict.exponent):.3g}",
        f"{float(verdict.exponent_low):.3g} to {float(verdict.exponent_high):.3g}",
        f"{float(verdict.zero_one):.2f}" if "zero_one" in verdict else "",
        str(after) if after else "not",
        f"{float(verdict.return_distance):.1e}",
        f"{float(verdict.contraction):.2f}" if "contraction" in verdict and after else "",
        f"{100 * float(verdict.few_lines):.0f} %" if "few_lines" in verdict and not after else "",
    )


COLOR, LIGHT = "#1f6f8b", "#b9b9b9"
POINT = {"s": 9, "lw": 0, "color": COLOR, "alpha": 0.8}


def make(sections: xr.Dataset, verdict: xr.Dataset) -> dict[str, bytes]:
    """Draw sections.png and sections.svg."""
    with style.set_style():
        figure, axes = style.grid(1, 4, (13.2, 3.9))
        section, returns, power, growth = axes[0]
        _draw_section(section, verdict)
        _draw_returns(returns, verdict)
        _draw_power(power, verdict)
        _draw_growth(growth, sections, verdict)
        style.heading(
            figure,
            f"A {verdict.attrs['verdict']} motion" if verdict.attrs["verdict"] != "undecided" else "Undecided",
            verdict.attrs["reasons"],
        )
        return style.files("sections", figure)


def _draw_section(axes: Axes, verdict: xr.Dataset) -> None:
    shown = verdict.principal.values
    other = shown[:, 1] if shown.shape[1] > 1 else np.zeros(len(shown))
    axes.scatter(shown[:, 0], other, **POINT)  # type: ignore[arg-type]
    axes.set(title="section", xlabel="along the largest variance", ylabel="along the second largest")


def _draw_returns(axes: Axes, verdict: xr.Dataset) -> None:
    first = verdict.principal.values[:, 0]
    low, high = float(first.min()), float(first.max())
    axes.plot([low, high], [low, high], color=LIGHT, lw=1.0, zorder=1)
    axes.scatter(first[:-1], first[1:], **POINT)  # type: ignore[arg-type]
    axes.set(title="return map", xlabel="this period", ylabel="next period")


def _draw_power(axes: Axes, verdict: xr.Dataset) -> None:
    axes.set(title="spectrum", xlabel="cycles per period", ylabel="fraction of the variance")
    if not verdict.power.values.any():
        axes.text(0.5, 0.5, "the states are constant", transform=axes.transAxes, ha="center", color=style.SOFT)
        return
    for component in range(verdict.sizes["component"])[::-1]:
        power = np.maximum(verdict.power.values[1:, component], 1e-16)
        axes.semilogy(verdict.frequency.values[1:], power, lw=0.9, color=COLOR if component == 0 else LIGHT)
    axes.set_ylim(bottom=max(1e-16, axes.get_ylim()[0]))


def _draw_growth(axes: Axes, sections: xr.Dataset, verdict: xr.Dataset) -> None:
    grown = np.cumsum(sections.growth.values)
    number = np.arange(1, len(grown) + 1)
    axes.plot(number, grown, color=COLOR)
    period = float(sections.attrs["period"])
    axes.fill_between(
        number,
        float(verdict.exponent_low) * period * number,
        float(verdict.exponent_high) * period * number,
        color=COLOR,
        alpha=0.18,
        lw=0,
    )
    axes.set(title="separation of a neighbour", xlabel="period", ylabel="logarithm of its distance's growth factor")
