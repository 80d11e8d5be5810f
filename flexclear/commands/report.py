"""``flexclear report``: every figure and table of the paper, and the page that shows them
(`papers.wang_wang_2019.tasks`).

With scenes it is the report of these (`flexclear.commands.scene_report`). What brings either up to date is imported
when something may have changed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.commands import as_json
from flexclear.pipeline.post.render import gl
from flexclear.stages.workplace import Workplace, add_options, check, open_workplace, relative


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="the report of these scenes; without any, that of the paper"
    )
    parser.add_argument(
        "--folder", action="store_true", help="a folder with the page and its pictures as files, not one file with all"
    )
    parser.add_argument(
        "--answers", choices=("all", "none"), default="all", help="none leaves the three answers out (default all)"
    )
    add_options(parser, "usual", "budget", "json")


def command(options: argparse.Namespace) -> None:
    """Bring it up to date and say where it is."""
    workplace = open_workplace(options)
    pages: dict[str, str] = {}

    def made(name: str, page: Path) -> None:
        pages[name] = str(page)
        if not options.json:
            print(relative(page))

    if not options.scenes:
        made("paper", make(workplace, folder=options.folder))
    else:
        from flexclear.commands import scene_report, scenes
        from flexclear.stages import limit

        seconds = None if options.budget is None else limit.seconds(options.budget, "--budget")
        for graph in scenes.graphs(options.scenes, options.set):
            answers = options.answers != "none"
            page = scene_report.make(graph, workplace, folder=options.folder, seconds=seconds, answers=answers)
            made(graph.scene.name, page)
    if options.json:
        print(as_json.as_json(pages))


def make(workplace: Workplace, *, folder: bool = False) -> Path:
    """Bring everything that the report shows up to date; returns the page; with `folder` one with files next to it.

    What fails is left out of the page and raised (FailedTasksError) after the page is written.
    """
    from flexclear.papers.wang_wang_2019 import tasks

    outcome = tasks.bring(workplace)
    if gl.state().endswith("none"):
        workplace.monitor.say(f"shapes are drawn as lines and there is no film: {gl.remedy()}")
    check(outcome)
    target = workplace.store.root / "report" / "index.html"
    if not folder:
        return target
    from flexclear.commands.scene_report import publish_page

    return publish_page(target.parent, "folder", target.read_bytes(), folder=True)
