"""``flexclear sections``: is a repeated motion periodic, quasi-periodic or chaotic, and by what evidence."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.commands.export import as_json
from flexclear.commands.scenes import as_in_its_file, check_target, graphs, scene_arguments
from flexclear.pipeline.core.artifacts.disk import disk_limits, publish
from flexclear.pipeline.core.scene.load import edited
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace, open_workplace

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene

#: options and the keys of `[sections]` that they replace
COUNTS = {"periods": "recorded periods", "transient": "periods before them that are not"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    scene_arguments(parser, "json")
    for name, text in COUNTS.items():
        parser.add_argument(f"--{name}", type=int, metavar="N", help=text)
    parser.add_argument("--period", metavar="TIME", help="period of the laws, e.g. '0.18 s'; else the whole run")
    parser.add_argument("--page", type=Path, metavar="FILE.md", help="write the verdicts as a page, too")


def command(options: argparse.Namespace) -> None:
    """Print the verdict on each scene."""
    asked = {name: getattr(options, name) for name in (*COUNTS, "period") if getattr(options, name) is not None}
    if options.page is not None:
        check_target(options.page, "--page")
    workplace = open_workplace(options)
    scenes = [with_sections(graph.scene, asked) for graph in graphs(options.scenes, options.set)]
    tasks = {scene.name: Graph(scene, shown=not asked) for scene in scenes}
    judged = dict(zip(tasks, workplace.made(*(graph.verdict for graph in tasks.values())), strict=True))
    verdicts = {name: made.dataset() for name, made in judged.items()}
    print(as_json(verdicts) if options.json else "\n\n".join(text(*one) for one in verdicts.items()))
    if options.page is not None:
        sections = dict(zip(tasks, workplace.datasets(*(graph.sections for graph in tasks.values())), strict=True))
        write_page(verdicts, sections, {n: made.read("sections.png") for n, made in judged.items()}, options.page)


def with_sections(scene: Scene, asked: Mapping[str, object]) -> Scene:
    """The scene with some keys of `[sections]` replaced, whether it has that table or not."""
    present = {} if scene.sections is None else scene.sections.model_dump(mode="json", exclude_none=True)
    return edited(scene, {"sections": {**present, **asked}}) if asked else scene


def write_page(
    verdicts: Mapping[str, xr.Dataset], sections: Mapping[str, xr.Dataset], pictures: Mapping[str, bytes], page: Path
) -> None:
    """The verdicts as a page, with the figures (PNG) and a table (CSV) in a folder of its name next to it."""
    from flexclear.pipeline.post.sections.verdict_page import csv_text, markdown

    folder = page.parent / page.stem
    with disk_limits(page.parent):
        folder.mkdir(exist_ok=True)
        for name, picture in pictures.items():
            publish(folder / f"{name.replace('/', '_')}.png", picture)
        publish(folder / "verdicts.csv", csv_text(verdicts).encode())
        publish(page, markdown(verdicts, sections, page.as_posix(), page.stem).encode())


def judge(scene: Scene, workplace: Workplace | None = None) -> tuple[xr.Dataset, xr.Dataset]:
    """Sections (schema SECTIONS) and verdict (schema VERDICT) of a scene, brought up to date as `run` is."""
    workplace = workplace or open_workplace()
    graph = Graph(scene, shown=as_in_its_file(scene))
    made = workplace.datasets(graph.sections, graph.verdict, jobs=1)
    sections, judged = (data.assign_attrs(title=scene.title, scene=scene.name) for data in made)
    return sections, judged


def text(scene: str, verdict: xr.Dataset) -> str:
    """The verdict in words, and the numbers behind it (schema VERDICT)."""
    lines = [f"{scene}: {verdict.attrs['verdict']}"]
    lines += [f"  {reason}" for reason in str(verdict.attrs["reasons"]).split("; ")]
    if "contraction" in verdict:
        lines.append(f"  successive returns come closer by {float(verdict.contraction):.3g} a period")
    return "\n".join(lines)
