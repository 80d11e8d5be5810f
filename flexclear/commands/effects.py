"""``flexclear effects``: what each part of a scene does to each quantity, taken away and put in, alone and in pairs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flexclear.commands import as_json
from flexclear.commands.scenes import graphs, print_files, scene_arguments
from flexclear.pipeline.core.artifacts.store import Record, publish
from flexclear.pipeline.core.scene import variants
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.workflow.task import Task
from flexclear.stages import effect_study, watched_quantities
from flexclear.stages.workplace import Workplace, check, open_workplace

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    scene_arguments(parser, "json")
    parser.add_argument(
        "--members",
        type=int,
        default=watched_quantities.MEMBERS,
        metavar="N",
        help=f"number of starts of each variant that has contacts (default {watched_quantities.MEMBERS}); "
        "more of them resolve smaller differences",
    )


def command(options: argparse.Namespace) -> None:
    """Bring the tables up to date, print them and say where they are."""
    workplace = open_workplace(options)
    tables: dict[str, xr.Dataset] = {}
    for graph in graphs(options.scenes, options.set):
        done, record = bring(graph.scene, workplace, options.members)
        if options.json:
            tables[graph.scene.name] = workplace.store.load(record)
            continue
        folder = workplace.store.root / done.folder
        print(workplace.store.path(done.stage, record.key, "effects.md").read_text(encoding="utf-8"))
        print_files(folder, {"index.html": "the page", "effects.nc": "all influences", "effects.png": "the chart"})
    if options.json:
        print(as_json.as_json(tables))


def bring(scene: Scene, workplace: Workplace, members: int = watched_quantities.MEMBERS) -> tuple[Task, Record]:
    """All variants, and their differences.  InputError for a scene without effects, or that watches nothing."""
    if members < 2:
        raise InputError(
            "--members", f"must be at least 2 (got {members})", "the scatter cannot be estimated from one start"
        )
    there, chosen = variants.effects(scene), scene.watched()
    if not there:
        raise InputError(
            str(scene.path or scene.name),
            "has no effect that could be taken away: no clearance, flexible body, friction, gravity or stop",
            "compare it with another scene: flexclear compare A B",
        )
    if not chosen:
        raise InputError(str(scene.path or scene.name), "nothing in it is watched", "name quantities in [view] watch")
    by_name = {effect.name: effect for effect in there}
    requested = effect_study.variants_of(there)
    scenes = {gone: variants.without(scene, [by_name[name] for name in gone]) for gone in requested}
    tasks = {gone: watched_quantities.task(variant, chosen, members) for gone, variant in scenes.items()}
    done = effect_study.task(scene, there, chosen, tasks, members)
    outcome = workplace.bring([done])
    check(outcome)
    record = outcome.records[id(done)]
    picture = workplace.store.path(done.stage, record.key, "effects.png").read_bytes()
    words = workplace.store.path(done.stage, record.key, "effects.md").read_text(encoding="utf-8")
    publish(workplace.store.root / done.folder / "index.html", effect_study.page(scene, words, picture))
    return done, record


def dataset(scene: Scene, workplace: Workplace) -> xr.Dataset:
    """The influences, over (effect, other, quantity)."""
    _, record = bring(scene, workplace)
    return workplace.store.load(record)
