"""``flexclear sections``: verdict whether a repeated motion is periodic, quasi-periodic or chaotic, with evidence."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import open_workplace

if TYPE_CHECKING:
    import xarray as xr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument("--page", type=Path, metavar="FILE.md", help="also write the verdicts as a page")


def run_command(options: argparse.Namespace) -> None:
    """Print the verdict on each scene."""
    if options.page is not None:
        scenes.check_target(options.page, "--page")
    workplace = open_workplace(options)
    tasks = {graph.scene.name: graph for graph in scenes.graphs(options.scenes, options.set)}
    judged = dict(zip(tasks, workplace.made(*(graph.verdict for graph in tasks.values())), strict=True))
    verdicts = {name: made.dataset() for name, made in judged.items()}
    print(as_json(verdicts) if options.json else "\n\n".join(text(*one) for one in verdicts.items()))
    if options.page is not None:
        sections = dict(zip(tasks, workplace.datasets(*(graph.sections for graph in tasks.values())), strict=True))
        write_page(verdicts, sections, {n: made.read("sections.png") for n, made in judged.items()}, options.page)


def write_page(
    verdicts: Mapping[str, xr.Dataset], sections: Mapping[str, xr.Dataset], pictures: Mapping[str, bytes], page: Path
) -> None:
    """Write the verdicts as a page, with figures (PNG) and a table (CSV) in a folder of the same name next to it."""
    from flexclear.post.sections.verdict_page import csv_text, markdown

    files = {f"{name.replace('/', '_')}.png": picture for name, picture in pictures.items()}
    files["verdicts.csv"] = csv_text(verdicts).encode()
    scenes.write_page(page, markdown(verdicts, sections, page.as_posix(), page.stem), files)


def text(scene: str, verdict: xr.Dataset) -> str:
    """Return the verdict in words, and its numbers (schema VERDICT)."""
    lines = [f"{scene}: {verdict.attrs['verdict']}"]
    lines += [f"  {reason}" for reason in str(verdict.attrs["reasons"]).split("; ")]
    if "contraction" in verdict:
        lines.append(f"  the distance of successive returns shrinks by {float(verdict.contraction):.3g} per period")
    return "\n".join(lines)
