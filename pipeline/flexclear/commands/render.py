"""``flexclear render``: pictures, films and pages of scenes, their modes, joints and vibrations."""

from __future__ import annotations

import argparse

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.graph import Graph
from flexclear.stages.rendering import FORMATS
from flexclear.stages.workplace import check, open_workplace, relative
from flexclear.system.errors import InputError
from flexclear.workflow.task import Task


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument(
        "--what",
        choices=FORMATS,
        help="the motion, its stress, modes of flexible bodies, joints with clearance, or vibrations; "
        "default: motion and modes",
    )
    known = list(dict.fromkeys(kind for kinds in FORMATS.values() for kind in kinds))
    parser.add_argument(
        "--format",
        choices=known,
        help="picture (png), film (gif, mp4), page to turn (html), or for other programs: gltf, pvd (ParaView); "
        "default: what suits",
    )
    parser.add_argument(
        "--at", metavar="TIME", help="for vibrations: hold the drives at their positions at this time, such as '90 ms'"
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring the pictures up to date and print where they are."""
    requested = _subject_and_format(options.what, options.format)
    if options.at is not None and options.what != "vibrations":
        raise InputError("--at", "belongs to --what vibrations")
    time = scenes.moment(options.at)
    graphs, workplace = scenes.graphs(options.scenes, options.set), open_workplace(options)
    made = list[Task]()
    for graph in graphs:
        with scenes.errors_in_file(graph.scene.path):
            made += graph.render.values() if requested is None else [graph.picture(*requested, time)]
    if len(graphs) > 1 and requested == ("modes", "html"):
        made.append(_mode_sets(graphs))
    outcome = workplace.bring(made)
    artifacts, files = workplace.artifacts(outcome), dict[str, list[str]]()
    for one in (artifacts[task] for task in made if task in artifacts):
        files.setdefault(one.task.scene, []).extend(str(one.folder / name) for name in one.record.files)
        if not options.json:
            shown = [name for name in sorted(one.record.files) if not name.endswith(".vtp")]
            rest = len(one.record.files) - len(shown)
            print(f"{relative(one.folder)}: {', '.join(shown)}{f' and {rest} more files' if rest else ''}")
    if options.json:
        print(as_json(files))
    check(outcome)


def _subject_and_format(what: str | None, kind: str | None) -> tuple[str, str] | None:
    """Return subject and format, None for the default ones.  Raises InputError for a format that the subject lacks."""
    if what is None and kind is None:
        return None
    what = what or "motion"
    kind = kind or next(k for k in ("mp4", "html", "png") if k in FORMATS[what])
    if kind not in FORMATS[what]:
        raise InputError(
            f"--what {what} --format {kind}", f"{what} has no such format", f"as {', '.join(FORMATS[what])}"
        )
    return what, kind


def _mode_sets(graphs: list[Graph]) -> Task:
    """Return the task that shows the mode sets of several scenes on one page."""
    bundles = {f"bundle/{graph.scene.name}: {body}": task for graph in graphs for body, task in graph.bundle.items()}
    return Task(
        stage="render",
        scene=graphs[-1].scene.name,
        part="modes of all",
        run="flexclear.stages.rendering:run",
        params={"what": "modes", "format": "html", "title": "Mode sets side by side"},
        inputs=bundles,
        code=("flexclear.stages.simulation", "flexclear.post"),
        folder=f"compare/{scenes.joint_folder_name([graph.scene.name for graph in graphs])}",
    )
