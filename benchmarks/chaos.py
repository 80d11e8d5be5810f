"""The page docs/chaos.md: whether repeated motions are periodic, quasi-periodic or chaotic."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from flexclear.post.plotting.table import Table, as_csv, pipe_table
from flexclear.stages import scenes
from flexclear.stages.workplace import open_workplace

INTRODUCTION = """# Periodic, quasi-periodic or chaotic

Made from the datasets `results/runs/<scene>/sections.nc` and `verdict.nc` by

    python -m benchmarks.chaos {scenes}

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


def markdown(verdicts: Mapping[str, xr.Dataset], sections: Mapping[str, xr.Dataset], pictures: str) -> str:
    """Return the whole page. verdicts, sections: schemas VERDICT and SECTIONS, by scene; pictures: their folder."""
    first = next(iter(sections.values()))
    text = INTRODUCTION.format(
        scenes=" ".join(verdicts),
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


def write_page(
    verdicts: Mapping[str, xr.Dataset], sections: Mapping[str, xr.Dataset], pictures: Mapping[str, bytes], page: Path
) -> None:
    """Write the verdicts as a page, with figures (PNG) and a table (CSV) in a folder of the same name next to it."""
    files = {f"{name.replace('/', '_')}.png": picture for name, picture in pictures.items()}
    files["verdicts.csv"] = csv_text(verdicts).encode()
    scenes.write_page(page, markdown(verdicts, sections, page.stem), files)


def main(names: list[str]) -> None:
    """Judge scenes and write the page."""
    workplace, graphs = open_workplace(), scenes.graphs(names)
    made = {g.scene.name: one for g, one in zip(graphs, workplace.made(*(g.verdict for g in graphs)), strict=True)}
    sections = dict(zip(made, workplace.datasets(*(g.sections for g in graphs)), strict=True))
    pictures = {name: one.read("sections.png") for name, one in made.items()}
    write_page({name: one.dataset() for name, one in made.items()}, sections, pictures, Path("docs/chaos.md"))


if __name__ == "__main__":
    main(sys.argv[1:])
