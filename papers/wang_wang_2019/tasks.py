"""Tasks of the paper's report: every figure and table with its inputs, and the page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import flexclear as fc
from flexclear.applications import PUBLISHING, Graph, Outcome, Record, Task, Workplace, check, origins, task_over
from papers import PROJECT
from papers.wang_wang_2019 import DOCUMENTS, figures, timing

#: code that decides figures, tables and the page
CODE = (*PUBLISHING, "papers.comparison", __package__)
#: files with parts that the page shows, below the folder of the sources: pages, their pictures, variants of scenes
PAGES = [pattern for name in DOCUMENTS for pattern in (f"docs/{name}.md", f"docs/{name}/*.png")]
PAGES += ["scenes/sps4/variants/*.toml"]
#: the scene whose film and pictures the page shows: the paper's full model
HEADLINE = "sps4/far_csj_cb"


@dataclass(frozen=True)
class Scenes:
    """Graphs of scenes by name, and timings by family, each built once, so that all figures share their tasks."""

    graphs: dict[str, Graph] = field(default_factory=dict)
    times: dict[str, Task] = field(default_factory=dict)

    def graph(self, name: str) -> Graph:
        """Return the graph of ``scenes/<name>.toml``."""
        if name not in self.graphs:
            self.graphs[name] = Graph(fc.load_scene(PROJECT / "scenes" / f"{name}.toml"))
        return self.graphs[name]

    def artifact(self, reference: str) -> Task:
        """Return the task of ``<scene>:<artifact>[/<body>]`` or ``<folder>:timing``."""
        name, _, artifact = reference.partition(":")
        return self.timing(name) if artifact == "timing" else self.graph(name).artifact(artifact)

    def timing(self, family: str) -> Task:
        """Return the task that times all scenes directly in a folder below scenes/.

        The times are processor seconds, which are measured while other tasks run: run alone they would take a third of
        the whole report's time, with all other cores idle.
        """
        if family in self.times:
            return self.times[family]
        files = sorted((PROJECT / "scenes" / family).glob("*.toml"))
        if not files:
            raise fc.InputError(f"{family}:timing", f"there are no scenes in scenes/{family}")
        graphs = [self.graph(f"{family}/{path.stem}") for path in files]
        shown = {"folder": f"runs/{family}", "names": {"nc": "timing.nc"}}
        run = f"{timing.__name__}:run"
        self.times[family] = task_over(graphs, run, timing.variants, stage="timing", scene=family, **shown)
        return self.times[family]


def bring(workplace: Workplace) -> Outcome:
    """Bring everything in the report, and the page, up to date; the page leaves out what fails."""
    scenes = Scenes()
    drawn = figure_tasks(workplace, scenes)
    # the slowest chains come first: film and timing
    drawn.sort(key=lambda task: all(above.stage != "timing" for above in task.inputs.values()))
    shown = workplace.bring([*scenes.graph(HEADLINE).of("render").values(), *drawn])
    graphs = [graph for graph in scenes.graphs.values() if graph.simulate in shown.records]
    made = workplace.bring([page_task(workplace, shown.records, graphs)])
    check(made)
    return Outcome({**shown.records, **made.records}, shown.failures)


def figure_tasks(workplace: Workplace, scenes: Scenes) -> list[Task]:
    """Return one task for each figure and table."""
    return [
        Task(
            stage="figures",
            scene="report",
            part=name,
            run=f"{figures.__name__}:draw",
            params={"figure": name},
            inputs={reference: scenes.artifact(reference) for reference in entry["needs"]},
            code=CODE,
            files={file: PROJECT / file for file in entry["files"]},
            folder="tables" if name.startswith("table") else "figures",
        )
        for name, entry in figure_index(workplace).items()
    ]


def figure_index(workplace: Workplace) -> Mapping[str, Mapping[str, Any]]:
    """Return the needs of each figure and table, see `papers.wang_wang_2019.figures.index`."""
    names = list(figures.NAMES)
    task = Task(
        stage="figures",
        scene="report",
        part="index",
        run=f"{figures.__name__}:index",
        params={"names": names},
        code=CODE,
    )
    (made,) = workplace.made(task)
    index: dict[str, dict[str, Any]] = json.loads(made.read("index.json"))
    return index


def page_task(workplace: Workplace, records: Mapping[Task, Record], graphs: list[Graph]) -> Task:
    """Return the task of the page; it runs again when anything on the page has changed."""
    return Task(
        stage="report",
        scene="report",
        part="page",
        run="papers.wang_wang_2019.report:run",
        code=CODE,
        params={
            "results": str(workplace.store.root),
            "runs": {graph.scene.name: f"runs/{graph.scene.name}/run.nc" for graph in graphs},
            "origins": {graph.scene.name: origins(graph.scene) for graph in graphs},
            "rendered": HEADLINE,
            "digests": sorted(record.digest for record in records.values()),
        },
        files={
            path.relative_to(PROJECT).as_posix(): path for pattern in PAGES for path in sorted(PROJECT.glob(pattern))
        },
        folder="report",
    )
