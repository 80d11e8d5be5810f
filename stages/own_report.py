"""The report of one scene: film, figures, comparison with its ideal twin, assumptions, doubts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.artifacts.store import Record, publish
from flexclear.pipeline.core.scene.ideal import loose
from flexclear.pipeline.core.workflow.task import Task
from flexclear.stages import compare
from flexclear.stages.graph import Graph
from flexclear.stages.run import Workplace, check, in_file

if TYPE_CHECKING:
    import xarray as xr

#: general figures, in this order, and their captions
FIGURES = {
    "motion.png": "Motion",
    "reactions.png": "Reactions and drives",
    "contacts.png": "Joints with clearance",
    "wear.png": "Wear of contacts",
    "joint_friction.png": "Friction of ideal joints",
    "energy.png": "Energy",
}
#: of a run's attributes, those that tell how it was made
FACTS = ("method", "evaluations", "steps", "rejected_steps", "switched", "redundant_closure_rows", "versions")


def make(graph: Graph, place: Workplace) -> Path:
    """Bring everything that the report of a scene shows up to date; returns the page, one file with all inside.

    Without GL libraries it has no film.  Raises FailedTasksError when the run itself cannot be made.
    """
    scene = graph.scene
    compared = None
    if loose(scene) or scene.flexible():
        with in_file(scene.path):
            compared = compare.bring([scene], place, "both")
    outcome = place.bring([graph.overview, graph.render])
    if any(failure.task is not graph.render for failure in outcome.failures):
        check(outcome)
    for failure in outcome.failures:
        place.monitor.say(f"no film: {failure.message}")
    run = place.store.load(outcome.records[id(graph.simulate)]) if id(graph.simulate) in outcome.records else None
    target = place.store.root / f"runs/{scene.name}" / "report.html"
    publish(target, _page(graph, place, outcome.records, compared, run))
    return target


def _page(
    graph: Graph,
    place: Workplace,
    records: Mapping[int, Record],
    compared: compare.Comparison | None,
    run: xr.Dataset | None,
) -> bytes:
    from flexclear.pipeline.post.overview.page import Part, listed, page

    scene = graph.scene
    attributes: Mapping[Any, Any] = {} if run is None else run.attrs
    doubts = [text for text in str(attributes.get("warnings", "")).split("\n") if text]
    facts = {name.replace("_", " "): str(attributes[name]) for name in FACTS if attributes.get(name) not in (None, "")}
    assumed = json.loads(attributes.get("assumptions", "{}"))
    parts: list[Any] = [
        Part("film", "The mechanism moving", _media(place, graph.render, records, _films(graph.render, records))),
        Part("run", "The run", _media(place, graph.overview, records, FIGURES)),
    ]
    parts += compare.parts(compared) if compared is not None else []
    parts += [
        Part("doubts", "To be doubted", listed({f"{k + 1}": text for k, text in enumerate(doubts)}, ("", "warning"))),
        Part("assumptions", "Assumptions", listed(assumed, ("value", "assumption"))),
        Part("facts", "How it was computed", listed(facts, ("", ""))),
    ]
    return page(scene.title, " ".join(scene.description.split()) or scene.name, parts)


def _films(render: Task, records: Mapping[int, Record]) -> dict[str, str]:
    files = records[id(render)].files if id(render) in records else {}
    film = next((name for name in files if name.startswith("film.")), None)
    return {film: "Film"} if film else {"mechanism.png": "The mechanism"} if "mechanism.png" in files else {}


def _media(place: Workplace, task: Task, records: Mapping[int, Record], captions: Mapping[str, str]) -> str:
    from flexclear.pipeline.post.overview.page import media

    record = records.get(id(task))
    if record is None:
        return ""
    return "".join(
        media(name, place.store.path(task.stage, record.key, name).read_bytes(), text)
        for name, text in captions.items()
        if name in record.files
    )
