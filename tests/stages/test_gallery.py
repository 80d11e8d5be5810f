"""Every mechanism of the gallery runs, and answers what docs/gallery.md says; the site of docs/ builds."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.families.gallery import ENTRIES, scene_of, solved
from flexclear.stages.run import bundles

#: kinds of mechanisms that whoever looks for a beginning expects to find
EXPECTED = {"four_bar", "clearance_slider_crank", "scott_russell", "stewart", "robot_arm", "universal_shaft"}
EXPECTED |= {"heavy_top", "governor", "overhung_rotor", "bracket"}
#: answers have two to four digits; where one is at the edge of rounding, another processor may round the other way
LAST_DIGIT = 0.06


def numbers(text: str) -> list[float]:
    return [float(found) for found in re.findall(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


def test_the_gallery_has_fifteen_mechanisms_and_those_that_are_looked_for() -> None:
    assert len(ENTRIES) >= 15
    assert set(ENTRIES) >= EXPECTED


@pytest.mark.parametrize("name", ENTRIES)
def test_a_mechanism_answers_what_its_page_says(name: str, root: Path) -> None:
    entry = ENTRIES[name]
    page = (root / "docs" / "gallery.md").read_text()
    told = re.search(rf"^\*{re.escape(entry.question)}\* (.+)$", page, re.MULTILINE)
    assert told is not None
    scene = scene_of(entry)
    answer = entry.answer(solved(entry, scene, bundles(scene)), scene)
    assert re.sub(r"[\d.e+-]+", "#", answer) == re.sub(r"[\d.e+-]+", "#", told[1])
    assert numbers(answer) == pytest.approx(numbers(told[1]), rel=LAST_DIGIT)
    assert (root / "docs" / "gallery" / f"{name}.png").is_file()


@pytest.mark.skipif(find_spec("mkdocs") is None, reason="the extra 'docs' is not installed; `make docs` brings it")
def test_the_site_builds_without_a_warning_and_asks_nothing_of_the_network(root: Path, tmp_path: Path) -> None:
    config = root / "benchmarks" / "site" / "mkdocs.yml"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", str(config), "--site-dir"]
    made = subprocess.run([*command, str(tmp_path / "site")], capture_output=True, text=True, cwd=root, check=False)
    assert made.returncode == 0, made.stderr
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    loaded = re.compile(r"<(?:script|img|iframe)[^>]* src=\"(?:https?:)?//|<link[^>]* rel=\"stylesheet\"[^>]*//")
    assert [page.name for page in pages if loaded.search(page.read_text())] == []
