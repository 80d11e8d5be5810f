"""The report of one scene: the answer, then film, figures, comparison with its ideal mechanism, assumptions, doubts."""

from __future__ import annotations

import html
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.commands import compare
from flexclear.commands.answers import Answer, Answers, said
from flexclear.commands.scenes import in_file
from flexclear.pipeline.core.artifacts.store import Record, publish
from flexclear.pipeline.core.scene.provenance import assumed
from flexclear.pipeline.core.scene.variants import loose
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.core.workflow.task import Task
from flexclear.pipeline.post.single_run.series import sentence
from flexclear.stages import derived_series
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import FailedTasksError, Workplace, check

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.post.pages import Part

#: what a report shows of the motion, by the names of `Graph.render`
SHOWN = ("motion mp4", "motion html", "modes html")
#: general figures, in this order: caption, and what a reader who does not see them reads
FIGURES = {
    "motion.png": ("Motion", "Displacement, velocity and rotation of the bodies over time"),
    "reactions.png": (
        "Reactions and drives",
        "Magnitude of the force in each joint, and what drives supply, over time",
    ),
    "contacts.png": (
        "Joints with clearance",
        "Path of the ball or pin in its socket, the gap, and the normal force over time",
    ),
    "wear.png": ("Wear of contacts", "Load times sliding way over time, and how deep the surfaces wear over the angle"),
    "joint_friction.png": ("Friction of ideal joints", "Normal force in the bearings and energy lost, over time"),
    "watched.png": ("Watched quantities", "What the scene watches, over time"),
    "energy.png": ("Energy", "Energies over time, and the error of their balance"),
}
#: of a run's attributes, those that tell how it was made, and what they are called
COST = {
    "method": "integrator",
    "method_reason": "why this one",
    "evaluations": "evaluations of the equations of motion",
    "steps": "steps",
    "rejected_steps": "steps made again, shorter, since their error was too large",
    "jacobians": "Jacobians of the equations",
    "projections": "times the closed loops were put together again",
}
STABILITY = {
    "switched": "another integrator continued",
    "stiff_share": "fraction of the steps that stability made shorter than accuracy would have",
    "redundant_closure_rows": "conditions of closed loops that follow from the others",
    "accuracy_verdict": "accuracy asked for",
}
PROVENANCE = {
    "scene": "scene",
    "source": "made by",
    "versions": "versions of the libraries",
    "Conventions": "conventions of the datasets",
}


def make(
    graph: Graph, workplace: Workplace, *, folder: bool = False, seconds: float | None = None, answers: bool = True
) -> Path:
    """Bring everything that the report of a scene shows up to date; returns the page.

    One file with all inside; or with `folder` a folder with the page and its pictures as files.  Without GL libraries
    it has no film.  seconds, answers: budget of the three answers (`flexclear.commands.answers`), and whether they are
    there. Raises FailedTasksError when the run itself cannot be made.
    """
    scene = graph.scene
    compared, answering = None, Answers(scene, workplace, seconds)
    if loose(scene) or scene.flexible():
        with in_file(scene.path):
            compared = compare.bring([scene], workplace, "both", answering.kernels() if answers else ())
    drawn = [task for what, task in graph.render.items() if what in SHOWN]
    members = [graph.ensemble, graph.post] if graph.ensemble else []
    outcome = workplace.bring([*drawn, graph.overview, *members])  # the film takes longest, so it begins first
    if any(failure.task not in [*drawn, *members] for failure in outcome.failures):
        check(outcome)
    for failure in outcome.failures:
        workplace.monitor.say(f"not in the report: {failure.message}")
    run = workplace.store.load(outcome.records[id(graph.simulate)]) if id(graph.simulate) in outcome.records else None
    result = _answers(answering, workplace) if answers and run is not None else {}
    text = _page(graph, workplace, outcome.records, compared, run, result)
    return publish_page(workplace.store.root / f"runs/{scene.name}", "report", text, folder=folder)


def publish_page(where: Path, name: str, page: bytes, *, folder: bool) -> Path:
    """Write a page as ``<name>.html``, or as ``<name>/index.html`` with its files next to it."""
    if not folder:
        publish(where / f"{name}.html", page)
        return where / f"{name}.html"
    from flexclear.pipeline.post.pages import in_folder

    (where / name).mkdir(parents=True, exist_ok=True)
    for file, content in in_folder(page).items():
        publish(where / name / file, content)
    return where / name / "index.html"


def _answers(answers: Answers, workplace: Workplace) -> dict[str, Answer]:
    """Those of the three answers that can be given, by name; why one cannot is said."""
    result = {}
    for name in ("accuracy", "stability", "matters"):
        try:
            answer = getattr(answers, name)
        except (InputError, SolverError, FailedTasksError) as error:
            workplace.monitor.say(f"not in the report: {name}: {error}")
            continue
        if answer is not None:
            result[name] = answer
    return result


def _answered(scene: Scene, result: Mapping[str, Answer]) -> list[Part]:
    """The three sections: each with a sentence that answers, a picture and a table."""
    from flexclear.pipeline.post.pages import Part, media

    parts = []
    for name, answer in result.items():
        words = said(name, answer, scene)
        picture = answer.file(words.picture)
        shown = "" if picture is None else media(words.picture, picture.read_bytes(), words.caption)
        parts.append(Part(name, words.heading, f"<p>{html.escape(words.text)}</p>\n{shown}{words.table}"))
    return parts


def _page(
    graph: Graph,
    workplace: Workplace,
    records: Mapping[int, Record],
    compared: compare.Comparison | None,
    run: xr.Dataset | None,
    answers: Mapping[str, Answer],
) -> bytes:
    from flexclear.pipeline.post.answers.matters import ideal_sentences
    from flexclear.pipeline.post.answers.summary import answer, by_weight, effects
    from flexclear.pipeline.post.pages import Part, downloads, listed, page
    from flexclear.pipeline.post.single_run.series import parameters

    scene = graph.scene
    attributes: Mapping[Any, Any] = {} if run is None else run.attrs
    doubts = [text for text in str(attributes.get("warnings", "")).split("\n") if text]
    assumptions = by_weight(assumed(derived_series.sources(scene)), run)
    members = _members(graph, workplace, records)
    parts: list[Any] = [
        Part("film", "The mechanism moving", _moving(graph, workplace, records)),
        Part("run", "The run", _media(workplace, graph.overview, records, FIGURES)),
        *_answered(scene, answers),
        *(compare.parts(compared) if compared is not None else []),
        Part("doubts", "Warnings", listed({f"{k + 1}": text for k, text in enumerate(doubts)}, ("no.", "warning"))),
        Part("assumptions", "Assumptions, the most influential first", listed(assumptions, ("value", "assumption"))),
        Part(
            "effects",
            "Effects present and absent",
            listed(effects(parameters(run)), ("effect", "in the scene")) if run is not None else "",
        ),
        Part("cost", "Computing cost", listed(_rows(attributes, COST), ("figure", "value"))),
        Part(
            "stability",
            "Stability and constraints",
            "" if "stability" in answers else listed(_stability(run, members), ("figure", "value")),
        ),
        Part("provenance", "Provenance", listed(_provenance(graph, workplace, records), ("item", "value"))),
        Part("downloads", "Downloads", downloads(_files(graph, compared))),
    ]
    dataset = None if compared is None else compared.dataset()
    lead = " ".join(scene.description.split()) or scene.name
    changes = ideal_sentences(answers["matters"].dataset()) if "matters" in answers else []
    return page(scene.title, lead, parts, answer(dataset, run, doubts, changes, members))


def _rows(attributes: Mapping[Any, Any], names: Mapping[str, str]) -> dict[str, str]:
    """Attributes by what they are called; whole numbers in groups of three, shares in per cent."""
    rows = {}
    for name, label in names.items():
        value = attributes.get(name)
        if value not in (None, ""):
            whole = isinstance(value, int) or (getattr(value, "dtype", None) is not None and value.dtype.kind in "iu")
            if name.endswith("_share"):
                rows[label] = f"{100.0 * float(value):.3g} %"
            elif whole:
                rows[label] = f"{int(value):,}"
            else:
                rows[label] = f"{value:.4g}" if isinstance(value, float) else str(value)
    return rows


def _members(graph: Graph, workplace: Workplace, records: Mapping[int, Record]) -> float | None:
    """Horizon of the scene's ensemble [s]; None where there is none, or where it cannot be made."""
    if graph.ensemble is None or id(graph.post) not in records:
        return None
    return float(workplace.store.load(records[id(graph.post)])["ensemble_horizon"])


def _stability(run: xr.Dataset | None, members: float | None) -> dict[str, str]:
    if run is None:
        return {}
    rows = _rows(run.attrs, STABILITY)
    if "horizon" in run:
        rows["predictability"] = sentence(float(run["horizon"]), float(run["time"].values[-1]), members)
    for name, label, unit in (
        ("energy_error", "largest error of the energy balance", "J"),
        ("constraint_error", "largest error of a closed loop", "m"),
    ):
        if name in run:
            rows[label] = f"{float(abs(run[name]).max()):.2e} {unit}"
    return rows


def _provenance(graph: Graph, workplace: Workplace, records: Mapping[int, Record]) -> dict[str, str]:
    rows = {"command": f"`flexclear report {graph.scene.path.name if graph.scene.path else graph.scene.name}`"}
    record = records.get(id(graph.simulate))
    if record is not None:
        rows |= _rows(workplace.store.load(record).attrs, PROVENANCE)
        rows["digest of the run"] = record.digest
    rows["sources of methods and data"] = f"`flexclear cite {graph.scene.name}`"
    return rows


def _files(graph: Graph, compared: compare.Comparison | None) -> dict[str, bytes]:
    """The scene as it was written, with what it extends, its recipes, and the tables; small enough for any page."""
    files = {}
    if graph.scene.path is not None:
        files[graph.scene.path.name] = graph.scene.path.read_bytes()
    for recipe in graph.scene.recipes().values():
        files[Path(recipe).name] = Path(recipe).read_bytes()
    if compared is not None:
        for name in ("differences.csv", "costs.csv"):
            if name in compared.record.files:
                files[name] = compared.file(name).read_bytes()
    return files


def _moving(graph: Graph, workplace: Workplace, records: Mapping[int, Record]) -> str:
    """The film, and the views that can be turned."""
    from flexclear.pipeline.post.pages import figures_of

    text = ""
    for what, task in graph.render.items():
        record = records.get(id(task))
        if record is None:
            continue
        if what.endswith("html"):
            for name in sorted(record.files):
                text += figures_of(workplace.store.path(task.stage, record.key, name).read_text(encoding="utf-8"))
        elif what == "motion mp4":
            names = {name: ("The mechanism moving", f"Film of {graph.scene.title}") for name in record.files}
            text = _media(workplace, task, records, names) + text
    return text


def _media(
    workplace: Workplace, task: Task, records: Mapping[int, Record], captions: Mapping[str, tuple[str, str]]
) -> str:
    from flexclear.pipeline.post.pages import media

    record = records.get(id(task))
    if record is None:
        return ""
    return "".join(
        media(name, workplace.store.path(task.stage, record.key, name).read_bytes(), text, alt)
        for name, (text, alt) in captions.items()
        if name in record.files
    )
