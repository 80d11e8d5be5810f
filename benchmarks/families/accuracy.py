"""Cost of accuracy: the studies of `flexclear cost` of five scenes, with Exudyn's logged runs next to ours.

The store holds the studies, point by point. The log holds the texts of the page and the digests of the pictures, which
are drawn from the studies and not from the log.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks import log
from benchmarks.families import exudyn
from benchmarks.family import Case, Family, Measured, Record
from flexclear.artifacts.paths import results_root
from flexclear.post.cost import work_precision
from flexclear.post.cost.study import sentences
from flexclear.post.plotting.table import Table, as_markdown, from_markdown
from flexclear.scene.load import load_scene
from flexclear.stages.scenes import find_scene, open_workplace
from flexclear.study import cost

#: processor time of a study [s]
STUDY = 3600.0
#: models of the paper's mechanism
SCENES = ("sps4/ideal", "sps4/csj", "sps4/far_cb", "sps4/variants/far_csj_cb_damped", "sps4/far_csj_cb")


@dataclass(frozen=True, slots=True)
class Studied:
    """Section of the page on a scene: `advice`, tables (Markdown), pictures by title."""

    scene: str
    advice: str
    tables: tuple[str, ...]
    pictures: Mapping[str, str]


def _sections(scenes: tuple[Studied, ...]) -> str:
    """Return the advice on each scene, and then each scene's pictures and tables."""
    parts = ["## What to choose\n", *(f"- **{s.scene}**: {s.advice}\n" for s in scenes)]
    for s in scenes:
        parts.append(f"\n## {s.scene}\n")
        parts += [f"![{title} of {s.scene}]({path})\n" for title, path in s.pictures.items()]
        parts += [table.rstrip() + "\n" for table in s.tables]
    return "\n".join(parts)


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield for each scene one record with the advice, one for each picture and one for each table."""
    place = open_workplace()
    peers = exudyn.points([r for s in log.latest(log.FOLDER / "exudyn.jsonl") for r in s.records])
    for case in cases:
        scene = load_scene(find_scene(case.name))
        study = cost.measure_costs(scene, place, budget=STUDY)
        data, file = study.dataset(), f"{cost.FIGURE}.png"
        others = curves_of(data, peers.get(case.name, ()))
        drawn = work_precision.make(cost.FIGURE, data, f"Error against cost: {scene.title}", others)[file]
        _picture(case.name).parent.mkdir(parents=True, exist_ok=True)
        _picture(case.name).write_bytes(drawn)
        picture = {"file": file, "sha256": hashlib.sha256(drawn).hexdigest()}
        picture |= {"picture": "Error against cost", "path": f"accuracy/{case.name.replace('/', '_')}_{file}"}
        table = asdict(from_markdown(study.text(cost.TABLE)))
        yield case, [{"advice": sentences(data)}, picture, {"table": table}]


def _picture(scene: str) -> Path:
    """Return the path of the picture of a scene, with other programs' runs, among the results."""
    return results_root() / "benchmarks" / scene / f"{cost.FIGURE}.png"


def curves_of(study: xr.Dataset, tracks: Sequence[Mapping[str, Any]]) -> list[work_precision.Curve]:
    """Return curves of another program's runs. tracks: name, seconds [s] and errors [SI] by quantity."""
    lines = []
    for track in tracks:
        seconds = np.array(track["seconds"], dtype=float)
        error = np.full((len(seconds), study.sizes["quantity"]), np.nan)
        for k, name in enumerate(study["quantity"].values):
            if str(name) in track["error"]:
                error[:, k] = np.array(track["error"][str(name)], dtype=float) / float(study["scale"][k])
        lines.append(work_precision.Curve(track["name"], seconds, error, np.isfinite(error)))
    return lines


def show(records: list[Record]) -> str:
    """Return the advice for each scene, with its pictures and tables."""
    found = []
    measured = {r["case"] for r in records}
    for scene in (name for name in SCENES if name in measured):
        mine = [r for r in records if r["case"] == scene]
        tables = tuple(as_markdown(_table(r["table"])) for r in mine if "table" in r and _shown(r["table"]))
        # the log of former studies has pictures of causes and means as well, which are tables now
        pictures = {r["picture"]: r["path"] for r in mine if r.get("file") == "work_precision.png"}
        # what to refine was part of former studies
        advice, _, _ = next(r["advice"] for r in mine if "advice" in r).partition(" To refine")
        found.append(Studied(scene, advice, tables, pictures))
    return _sections(tuple(found))


def _shown(stored: Mapping[str, list]) -> bool:
    """Return True for a price list: the log of former studies has other tables as well."""
    return str(stored["title"]).startswith("What accuracy costs")


def _table(stored: Mapping[str, list]) -> Table:
    """Return a table of the log; its refused runs, and what the page says once of all tables, stay there."""
    rows = tuple(tuple(row) for row in stored["rows"])
    notes = tuple(note for note in stored["notes"] if note.startswith(("Reference", "Pointwise")))
    return Table(str(stored["title"]), tuple(stored["columns"]), rows, notes)


def files(records: list[Record]) -> dict[str, bytes]:
    """Return the pictures that still exist among the results; those of other studies have other digests."""
    found = {}
    for r in records:
        file = _picture(r["case"])
        if "picture" in r and file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() == r["sha256"]:
            found[r["path"]] = file.read_bytes()
    return found


FAMILY = Family(
    what="error against cost of five scenes",
    takes="40 min",
    page="accuracy.md",
    cases=lambda: [Case(scene) for scene in SCENES],
    measure=measure,
    show=show,
    files=files,
    times=False,
)
