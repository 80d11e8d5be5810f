"""The benchmarks as families: one entry, one log, pages that follow from the log alone."""

import csv
import io
import json
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from benchmarks import command_parts, families, log, page, plan_scenes
from benchmarks.__main__ import main
from benchmarks.families import solids
from benchmarks.family import Case, Family
from benchmarks.log import Session
from flexclear.system.errors import InputError

FAMILIES = {name: page.named(name) for name in families.NAMES}
#: constants of families that make a measurement longer and better
SHORT = {"ROUNDS": 2, "TURNS": 2, "EVALUATIONS": 100, "REFERENCE": {"integrator": "dop853", "rtol": 1e-8}}
PAGES = sorted({family.page for family in FAMILIES.values()})


def test_every_family_is_listed_with_what_it_measures_and_how_long_that_takes(capsys: pytest.CaptureFixture):
    assert main(["--list"]) == 0
    listed = [[cell.strip() for cell in line.strip("|").split("|")] for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in listed[2:]] == list(FAMILIES)
    for row, family in zip(listed[2:], FAMILIES.values(), strict=True):
        cases = family.cases(**family.settings)
        assert row[1:5] == [family.what, str(len(cases)), family.takes, f"docs/{family.page}"]
        assert len({case.name for case in cases}) == len(cases) > 0
        assert not family.quick or family.quick in [case.name for case in cases]


def test_every_module_of_the_families_is_one(root: Path):
    """Adding a benchmark is a module and a line; neither is there without the other."""
    there = {path.stem for path in (root / "benchmarks" / "families").glob("*.py")} - {"__init__"}
    assert there == {module.partition(":")[0] for module in families.NAMES.values()}
    assert {f"{name}.jsonl" for name in FAMILIES} == {path.name for path in log.FOLDER.iterdir()}


def test_make_bench_measures_all_families_of_the_page_of_benchmarks(root: Path):
    recipe = (root / "Makefile").read_text().partition("\nbench:")[2].partition("\n\n")[0]
    named = recipe.partition("-m benchmarks ")[2].split()
    assert sorted(named) == sorted(name for name, family in FAMILIES.items() if family.page == "benchmarks.md")


@pytest.mark.parametrize("number", range(len(plan_scenes.ORDER)))
def test_scenes_of_the_family_of_plans_can_be_drawn(number: int, tmp_path: Path):
    """They name scenes and recipes that are files of the program."""
    drawn = plan_scenes.drawn(3, number, tmp_path)
    assert drawn.record["mechanism"] == plan_scenes.ORDER[number]
    assert all(Path(body.mesh).is_file() for body in drawn.scene.flexible().values())


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_that_of_the_log_to_the_byte(root: Path, name: str):
    assert page.text(name).encode() == (root / "docs" / name).read_bytes()


@pytest.mark.parametrize("name", PAGES)
def test_a_page_says_when_and_where_once(root: Path, name: str):
    text = (root / "docs" / name).read_text()
    sessions = [s for family in page.of_page(name) for s in log.latest(log.FOLDER / f"{family}.jsonl")]
    assert text.count("\nMeasured") == 1
    reported = {page.session_words(s) for s in sessions}
    lines = [line.removesuffix(".") for line in text.splitlines()]
    assert all(sum(line.endswith(words) for line in lines) == 1 for words in reported)
    assert text.count("<!-- begin measured -->") == 1
    for said in {s.cpu for s in sessions if s.cpu}:
        assert text.count(said) == sum(said in words for words in reported)


def test_long_tables_are_short_on_their_page_and_complete_as_csv(root: Path):
    """No row is lost, every file is linked from its page, and none is left from a former page."""
    found = dict[str, str]()
    for name, family in FAMILIES.items():
        records = page.records(log.latest(log.FOLDER / f"{name}.jsonl"))
        for path, content in page.shown(name, family, records)[1].items():
            found[path] = (root / "docs" / family.page).read_text()
            assert (root / "docs" / path).read_bytes() == content
            assert f"[All {len(list(csv.reader(io.StringIO(content.decode())))) - 1} rows]({path})" in found[path]
    assert {f"tables/{path.name}" for path in (root / "docs/tables").iterdir()} == found.keys()


def test_a_long_table_keeps_the_rows_of_its_pattern_or_its_ends():
    head, rows = "| n | x |\n|---|--:|\n", [f"| row {k} | {k} |\n" for k in range(page.LONG_TABLE + 1)]
    tables: dict[str, bytes] = {}
    few = page.shortened(f"before\n\n{head}{''.join(rows)}\nafter", "t", "", tables)
    link = f"\n[All {len(rows)} rows](tables/t.csv).\n"
    assert few == f"before\n\n{head}{rows[0]}{rows[1]}{rows[-1]}{link}\nafter"
    assert page.shortened(head + "".join(rows), "t", "row [13]", tables).count("| row") == 2
    assert list(tables) == ["tables/t.csv", "tables/t-2.csv"]
    assert tables["tables/t.csv"].decode().splitlines() == ["n,x", *(f"row {k},{k}" for k in range(len(rows)))]
    short = head + "".join(rows[1:])
    assert page.shortened(short, "t", "", {}) == short


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "stability" else []) for name in FAMILIES]
)
def test_files_of_a_page_are_those_of_the_log(root: Path, name: str):
    """Text to the byte; pictures but for how versions of matplotlib round at the edges of lines."""
    family = FAMILIES[name]
    for path, content in family.files(page.records(log.latest(log.FOLDER / f"{name}.jsonl"))).items():
        if path.endswith(".png"):
            there, made = imread(root / "docs" / path), imread(io.BytesIO(content))
            assert there.shape == made.shape
            # 0 with the pinned versions; one line of text elsewhere is 2e-3
            assert np.abs(there - made).mean() < 2e-4
            assert f"]({path})" in (root / "docs" / family.page).read_text()
        else:
            assert (root / "docs" / path).read_bytes() == content


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if family.quick])
def test_the_smallest_case_runs_from_end_to_end(root: Path, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    family = FAMILIES[name]
    module, _, _ = families.NAMES[name].partition(":")
    for constant, value in SHORT.items():
        monkeypatch.setattr(f"benchmarks.families.{module}.{constant}", value, raising=False)
    assert main([name, "--only", family.quick, "--into", str(tmp_path)]) == 0
    (session,) = log.read(tmp_path / "log" / f"{name}.jsonl")
    assert session.cpu == log.today().cpu
    assert {record["case"] for record in session.records} == {family.quick}
    written = (tmp_path / family.page).read_text()
    shown = family.show(session.records)
    assert all(part.strip() in written for part in ([shown] if isinstance(shown, str) else shown.values()))
    assert f"Measured {session.measured} on {session.cpu}, python" in written
    # what was measured elsewhere is not on a page that says it was measured here
    places = (root / "docs" / family.page).read_text().count("<!-- begin ") - 1
    assert written.count(page.NOTHING) == places - (1 if isinstance(shown, str) else len(shown))


def test_the_parts_of_a_solid_s_work_add_up():
    shape = {"type": "block", "size": [0.2, 0.1, 0.1], "element": "hex8", "cells": [6, 3, 3]}
    ((_, [record]),) = solids.FAMILY.measure([Case("small", shape)], 1)
    # what is outside of the parts is reading the clock
    assert sum(record["seconds"].values()) == pytest.approx(record["together"], abs=0.05)
    # so small a body has no sparse eigensolver, and hence nothing to count
    idle = {part for part, seconds in record["seconds"].items() if seconds == 0.0}
    assert idle == {"normal modes", "counting them, by another factorisation"}
    assert record["displacements"] == 3 * 7 * 4 * 4
    assert "336" in str(solids.FAMILY.show([{"case": "small", **record}]))


def test_parts_of_a_command_are_timed_separately_in_each_thread(monkeypatch: pytest.MonkeyPatch):
    """A part inside of another one in one thread, while a second thread is in a third part."""
    monkeypatch.setattr(command_parts, "_spent", {})
    clock = threading.local()
    monkeypatch.setattr(command_parts.time, "thread_time", lambda: getattr(clock, "now", 0.0))
    both = threading.Barrier(2, timeout=60.0)

    def spend(seconds: float) -> None:
        clock.now = getattr(clock, "now", 0.0) + seconds
        both.wait()

    inner = command_parts.timed("inner", spend)
    outer = command_parts.timed("outer", lambda: (spend(1.0), inner(2.0)))
    beside = threading.Thread(target=command_parts.timed("beside", lambda: (spend(4.0), spend(8.0))))
    beside.start()
    outer()
    beside.join()
    assert command_parts._spent == {"outer": 1.0, "inner": 2.0, "beside": 12.0}


def test_a_name_that_is_no_family_is_refused_with_those_there_are(capsys: pytest.CaptureFixture):
    assert main(["zoology"]) == 2
    assert "evaluation, exudyn, faults, gallery, geometry, growth" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options, words",
    [
        (["growth", "--only", "6 loops"], "no case of growth has such a name"),
        (["growth", "--set", "members=3"], "is no setting of growth"),
        (["stability", "--set", "seed=7"], "say --into FOLDER"),
    ],
)
def test_options_that_ask_for_nothing_are_refused(options: list[str], words: str, capsys: pytest.CaptureFixture):
    assert main(options) == 2
    assert words in capsys.readouterr().err


def test_a_system_without_times_of_children_is_refused_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    """As on Windows; families that need none run there."""
    monkeypatch.setitem(sys.modules, "resource", None)
    assert main(["commands", "cold", "faults"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in said] == ["commands", "cold", "faults"]
    assert all("which this system does not have" in line for line in said)


def test_without_the_peer_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    assert main(["exudyn"]) == 0
    said = capsys.readouterr().out
    assert said.count("\n") == 1
    assert "pip install" in said


def session(day: int, *cases: str) -> Session:
    return Session(
        f"2026-01-0{day}", f"processor {day}", {"python": "3"}, records=[{"case": c, "s": day} for c in cases]
    )


def test_the_log_has_machine_and_date_once_and_the_last_of_each_case_counts(tmp_path: Path):
    path = tmp_path / "family.jsonl"
    log.append(path, session(1, "a", "b", "c"), history=True)
    log.append(path, session(2, "b"), history=True)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line for line in lines if "measured" not in line] == [
        {"case": c, "s": s} for c, s in zip("abcb", (1, 1, 1, 2), strict=True)
    ]
    assert [set(line) for line in lines if "measured" in line] == [{"measured", "cpu", "versions"}] * 2
    assert [(s.measured, s.records) for s in log.latest(path)] == [
        ("2026-01-01", [{"case": "a", "s": 1}, {"case": "c", "s": 1}]),
        ("2026-01-02", [{"case": "b", "s": 2}]),
    ]
    log.append(path, session(3, "a", "c"), history=False)
    assert [s.measured for s in log.read(path)] == ["2026-01-02", "2026-01-03"]


def test_a_page_of_several_sessions_says_which_case_is_whose():
    reported = page.where({"growth": [session(1, "a", "c"), session(2, "b")], "runs": [session(2, "d")]})
    assert reported.startswith("Measured:\n")
    assert "- growth (a, c): 2026-01-01 on processor 1, python 3" in reported
    assert "- growth (b), runs: 2026-01-02 on processor 2, python 3" in reported
    assert page.where({"growth": [session(1, "a")], "runs": [session(1, "d")]}).count("processor 1") == 1


def test_a_part_without_a_place_on_its_page_is_refused():
    with pytest.raises(InputError, match=r"docs/x\.md: has no place for 'growth'"):
        page.filled("<!-- begin runs -->\n<!-- end runs -->\n", {"growth": "table"}, "docs/x.md")


def test_floats_of_the_log_have_the_digits_that_mean_something():
    assert log.plain({"a": [1.23456789, 3, True, "x"], "b": float("nan")}, 4) == {"a": [1.235, 3, True, "x"], "b": None}
    assert log.plain(1.23456789, None) == 1.23456789


def counted(calls: list[str], fails: list[str], **more: Any) -> Family:
    """A family that notes what it measures, and fails at some cases."""

    def measure(cases, jobs):
        for case in cases:
            if case.name in fails:
                raise KeyboardInterrupt
            calls.append(case.name)
            yield case, [{"s": len(calls)}]

    measure.__module__ = "benchmarks.timing"
    spec: dict[str, Any] = {
        "what": "",
        "takes": "no time",
        "page": "benchmarks.md",
        "cases": lambda: [Case(n) for n in "abc"],
    }
    return Family(**spec, measure=measure, show=lambda records: str(records), **more)


def test_what_was_interrupted_goes_on_where_it_stopped_and_times_are_then_measured_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: Path
):
    calls: list[str] = []
    fails = ["b"]
    monkeypatch.setattr(page, "named", lambda name: counted(calls, fails))
    monkeypatch.setattr(page, "write", lambda *places: tmp_path)
    command = ["growth", "--into", str(tmp_path)]
    assert main(command) == 130
    fails.clear()
    assert main(command) == 0
    assert calls == ["a", "b", "c"]
    assert [r["s"] for r in log.read(tmp_path / "log" / "growth.jsonl")[0].records] == [1, 2, 3]
    assert main(command) == 0
    assert calls == ["a", "b", "c"] * 2


def test_a_case_that_went_wrong_makes_the_command_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def measure(cases, jobs):
        yield from ((case, [{"verdict": "wrong"}]) for case in cases)

    measure.__module__ = "benchmarks.timing"
    wrong = Family("", "", "benchmarks.md", lambda: [Case("a")], measure, lambda records: "")
    monkeypatch.setattr(page, "named", lambda name: wrong)
    assert main(["growth", "--dry"]) == 1
