"""``flexclear report``: the page of scenes.

It shows the answer, then film, figures, comparison with its ideal mechanism, assumptions, warnings.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.artifacts.disk import publish
from flexclear.post.pages import Part, downloads, figures_of, in_folder, page, prose
from flexclear.scene.output import rows
from flexclear.scene.provenance import assumed_values
from flexclear.scene.variants import idealised_effects
from flexclear.stages import derived_series
from flexclear.stages.notebook import COST
from flexclear.stages.scenes import errors_in_file, pictures
from flexclear.stages.workplace import Made, Workplace, check, relative
from flexclear.study import compare
from flexclear.study.answers import Answers, shown_answer
from flexclear.system.errors import FlexclearError, ResourceError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene
    from flexclear.stages.graph import Graph

#: pictures of the motion in a report, by the names of `Graph.render`
SHOWN_MOTION = ("motion mp4", "motion html", "modes html")
#: general figures, in this order: caption, and text for a reader who does not see them
FIGURES = {
    name: (caption, alt)
    for name, caption, alt in rows("""
motion.png | Motion | Displacement, velocity and rotation of the bodies over time
reactions.png | Reactions and drives | Magnitude of the force in each joint, and forces of drives, over time
contacts.png | Joints with clearance | Path of the ball or pin in its socket, the gap, and the normal force over time
wear.png | Wear of contacts | Load times sliding distance over time, and wear depth of the surfaces over the angle
joint_friction.png | Friction of ideal joints | Normal force in the bearings and energy lost, over time
watched.png | Watched quantities | Quantities that the scene watches, over time
energy.png | Energy | Energies over time, and the error of their balance
""")
}
PROVENANCE = {
    "scene": "scene",
    "source": "program",
    "versions": "versions of the libraries",
    "Conventions": "conventions of the datasets",
}


def write_report(
    graph: Graph, workplace: Workplace, *, folder: bool = False, budget: float | None = None, answers: bool = True
) -> Path:
    """Bring everything in the report of a scene up to date; return the page.

    One file with all inside; or with `folder` a folder with the page and its pictures as files.  Without GL libraries
    the page has no film.  budget: of the three answers (`flexclear.study.answers`) [s].  answers: False leaves out
    those that take further runs. Raises as `workplace.check` when the run itself fails, and, after the page is written,
    ResourceError where a limit of time, of the machine or of `[limits]` left parts out.
    """
    scene = graph.scene
    compared, answering = None, Answers(scene, workplace, budget, questions=2 if answers else 0)
    if idealised_effects(scene):
        with errors_in_file(scene.path):
            compared = compare.compare_scenes([scene], workplace, "both")
    drawn = [task for what, task in graph.render.items() if what in SHOWN_MOTION]
    members = [graph.ensemble, graph.post] if graph.ensemble else []
    outcome = workplace.bring([*drawn, graph.overview, *members])  # the film takes longest, so it begins first
    if any(failure.task not in [*drawn, *members] for failure in outcome.failures):
        check(outcome)
    left_out = {failure.task.label: failure.exit_code for failure in outcome.failures}
    for failure in outcome.failures:
        workplace.monitor.say(f"not in the report: {failure.message}")
    made = workplace.artifacts(outcome)
    run = made[graph.simulate].dataset() if graph.simulate in made else None
    result, failed = _answers(answering, workplace) if run is not None else ({}, {})
    text = _page(graph, made, compared, run, result)
    target = publish_page(workplace.store.root / f"runs/{scene.name}", "report", text, folder=folder)
    limited = [name for name, code in (left_out | failed).items() if code == ResourceError.exit_code]
    if limited:
        raise ResourceError(f"{relative(target)} is written without {', '.join(limited)}")
    return target


def publish_page(where: Path, name: str, page: bytes, *, folder: bool) -> Path:
    """Write a page as ``<name>.html``, or as ``<name>/index.html`` with its files next to it."""
    if not folder:
        publish(where / f"{name}.html", page)
        return where / f"{name}.html"
    for file, content in in_folder(page).items():
        (where / name / file).parent.mkdir(parents=True, exist_ok=True)
        publish(where / name / file, content)
    return where / name / "index.html"


def _answers(answers: Answers, workplace: Workplace) -> tuple[dict[str, Made], dict[str, int]]:
    """Return the answers that succeed, and the exit codes of the others, whose errors it reports; by name."""
    result, failed = dict[str, Made](), dict[str, int]()
    for name in ("accuracy", "stability", "effects") if answers.questions else ("stability",):
        try:
            result[name] = getattr(answers, name)
        except FlexclearError as error:
            workplace.monitor.say(f"not in the report: {name}: {error}")
            failed[name] = error.exit_code
    return result, failed


def _answered(scene: Scene, result: Mapping[str, Made]) -> list[Part]:
    """Return the sections of the answers: each with a sentence, a picture and a table."""
    parts = []
    for name, answer in result.items():
        words = shown_answer(name, answer, scene)
        shown = pictures(answer, {words.picture: (words.caption,)})
        parts.append(Part(name, words.heading, f"<p>{html.escape(words.text)}</p>\n{shown}{words.table}"))
    return parts


def _page(
    graph: Graph,
    made: Mapping[Task, Made],
    compared: Made | None,
    run: xr.Dataset | None,
    answers: Mapping[str, Made],
) -> bytes:
    from flexclear.post.answers.effect_answer import ideal_sentences
    from flexclear.post.answers.summary import answer, effects
    from flexclear.post.single_run.series import parameters

    scene = graph.scene
    attributes: Mapping[Any, Any] = {} if run is None else run.attrs
    warnings = [text for text in str(attributes.get("warnings", "")).split("\n") if text]
    assumptions = assumed_values(derived_series.sources(scene))
    parts: list[Any] = [
        Part("film", "The mechanism in motion", _moving(graph, made)),
        Part("run", "The run", pictures(made.get(graph.overview), FIGURES)),
        *_answered(scene, answers),
        *(compare.parts(compared) if compared is not None else []),
        Part("doubts", "Warnings", prose(("no.", "warning"), [(f"{k + 1}", text) for k, text in enumerate(warnings)])),
        Part(
            "assumptions",
            "Assumptions",
            prose(("value", "assumption"), assumptions.items()),
        ),
        Part(
            "present",
            "Effects present and absent",
            prose(("effect", "in the scene"), effects(parameters(run)).items()) if run is not None else "",
        ),
        Part("cost", "How it was computed", prose(("quantity", "value"), _rows(attributes, COST).items())),
        Part("provenance", "Provenance", prose(("item", "value"), _provenance(graph, made).items())),
        Part("downloads", "Downloads", downloads(_files(graph))),
    ]
    dataset = None if compared is None else compared.dataset()
    lead = " ".join(scene.description.split()) or scene.name
    changes = ideal_sentences(answers["effects"].dataset()) if "effects" in answers else []
    return page(scene.title, lead, parts, answer(dataset, run, warnings, changes))


def _rows(attributes: Mapping[Any, Any], names: Mapping[str, str]) -> dict[str, str]:
    """Return attributes by label; whole numbers in groups of three, fractions in per cent."""
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


def _provenance(graph: Graph, made: Mapping[Task, Made]) -> dict[str, str]:
    rows = {"command": f"`flexclear report {graph.scene.path.name if graph.scene.path else graph.scene.name}`"}
    run = made.get(graph.simulate)
    if run is not None:
        rows |= _rows(run.dataset().attrs, PROVENANCE) | {"digest of the run": run.record.digest}
    return rows | {"sources of methods and data": f"`flexclear cite {graph.scene.name}`"}


def _files(graph: Graph) -> dict[str, bytes]:
    """Return the scene's file and its recipes, by name; small enough for any page."""
    files = {}
    if graph.scene.path is not None:
        files[graph.scene.path.name] = graph.scene.path.read_bytes()
    for recipe in graph.scene.recipes().values():
        files[Path(recipe).name] = Path(recipe).read_bytes()
    return files


def _moving(graph: Graph, made: Mapping[Task, Made]) -> str:
    """Return the film and the interactive views as HTML."""
    text = ""
    for what, one in ((what, made[task]) for what, task in graph.render.items() if task in made):
        if what.endswith("html"):
            text += "".join(figures_of(one.text(name)) for name in sorted(one.record.files))
        elif what == "motion mp4":
            film = ("The mechanism in motion", f"Film of {graph.scene.title}")
            text = pictures(one, dict.fromkeys(one.record.files, film)) + text
    return text
