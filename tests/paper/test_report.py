"""The report shows what there is, links to what exists, and lists every assumption and discrepancy."""

from __future__ import annotations

import base64
import json
import re
from itertools import pairwise
from pathlib import Path

import pytest

from flexclear.post.pages import in_folder
from flexclear.system.progress import silent
from papers.wang_wang_2019 import figures, report
from papers.wang_wang_2019.published import DISCREPANCIES
from tests.paper.material import everything

RENDERED = "sps4/far_csj_cb"
REASON = "assumed: not printed in the paper"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A results folder with two figures, two tables and a film that is none."""
    root = tmp_path_factory.mktemp("results")
    for name in ("fig08", "table08", "table10"):
        folder = root / ("tables" if name.startswith("table") else "figures")
        folder.mkdir(exist_ok=True)
        for file, content in figures.draw({"figure": name}, everything(), silent).items():
            (folder / file).write_bytes(content)
    headline = root / "runs" / RENDERED
    headline.mkdir(parents=True)
    for file in ("film.mp4", "mechanism.png", "mode_rod1.html", "modes_rod1.vtu"):
        (headline / file).write_bytes(b"stand-in")
    (root / "report").mkdir()
    return root


@pytest.fixture(scope="module")
def content(results):
    """What the report finds there."""
    attributes = {name: everything()[f"{name}:run"].attrs for name in ("sps4/ideal", "sps4/csj")}
    return report.collect(results, attributes, RENDERED)


def test_everything_that_the_page_shows_is_in_it(content):
    """Its scripts are its own, and its images and films are written out."""
    page = report.html_page(content)
    links = [link[:40] for link in re.findall(r"(?:src|href)='([^'#][^']*)'", page)]
    assert links
    assert [link for link in links if not link.startswith("data:")] == []
    assert "http" not in page
    inside = re.findall(r"href='#([^']+)'", page)
    assert [key for key in inside if f"id='{key}'" not in page] == []


def test_the_same_page_as_a_folder_has_its_pictures_as_files(content):
    found = in_folder(report.html_page(content).encode())
    named = re.findall(rb"src='(files/[^']+)'", found["index.html"])
    assert {name.decode() for name in named} == set(found) - {"index.html"}
    assert b"data:image/png" not in found["index.html"]


def test_page_shows_figures_tables_film_assumptions_and_discrepancies(content):
    page = report.html_page(content)
    assert page.count("<video") == 1
    for text in ("Figure 8", "Table 8", "Table 10", "not printed in the paper", DISCREPANCIES[0][0]):
        assert text in page


def test_an_empty_results_folder_gives_a_page_without_figures(tmp_path):
    page = report.html_page(report.collect(tmp_path, {}, RENDERED))
    assert "<img" not in page
    assert "Discrepancies" in page


def test_equal_assumptions_of_scenes_are_listed_once_and_different_ones_all():
    said = {"a": {"x": REASON, "y": REASON, "z": "assumed: 1"}, "b": {"x": REASON, "z": "assumed: 2"}}
    reported = {scene: {"assumptions": json.dumps(texts)} for scene, texts in said.items()}
    assert report.merged_assumptions(reported) == [
        ("x", REASON, ("a", "b")),
        ("y", REASON, ("a",)),
        ("z", "assumed: 1", ("a",)),
        ("z", "assumed: 2", ("b",)),
    ]


def test_paper_page_names_its_tables_and_every_figure_with_its_scenes(content):
    listed = report.paper_lists(content)["figures"].rows
    for name, (title, scenes) in zip(figures.NAMES, listed, strict=True):
        assert title == figures.figure(name).title
        assert all(f"`{scene}`" in scenes for scene in report.scenes_of(name) if "/" in scene)
    text = report.paper_markdown(content)
    assert all(f"](paper/{name}.csv)" in text for name in ("figures", "notes", "assumptions", "table08", "table10"))


def test_every_note_on_the_paper_s_tables_is_listed_once(content):
    listed = [note for _, note in report.paper_lists(content)["notes"].rows]
    every = {note for name in ("table08", "table10") for note in content.tables[name].notes}
    assert set(listed) == {note for note in every if not note.startswith("What could not be")}
    assert len(listed) == len(set(listed)) > report.NOTES


def test_tables_of_the_paper_page_are_whole(content):
    """Every row of every pipe table has as many cells as its head."""
    lines = report.paper_markdown(content).splitlines()
    for above, line in pairwise(lines):
        if above.startswith("|") and line.startswith("|"):
            assert line.count("|") == above.count("|"), line


def test_a_link_to_a_whole_table_holds_the_table(tmp_path: Path) -> None:
    """A page that is one file has no folder of tables beside it; links to other pages stay text."""
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "far.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text(
        "# Page\n\n[All 1 rows](tables/far.csv), [gone](tables/gone.csv), [more](other.md).\n", encoding="utf-8"
    )
    shown = report.section(page)
    (data,) = re.findall(r"<a download='far.csv' href='data:text/csv;base64,([^']+)'>All 1 rows</a>", shown)
    assert base64.b64decode(data) == b"a,b\n1,2\n"
    assert "<i>gone</i>, <i>more</i>" in shown
