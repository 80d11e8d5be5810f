"""The pages are true of the sources: the drawing of the dynamics tower, and every file and module that they name."""

from __future__ import annotations

import ast
import doctest
import re
from collections import defaultdict
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import grimp
import pytest

DYNAMICS = "flexclear.dynamics"
Arrows = set[tuple[str, str]]


def section(root: Path) -> str:
    page = (root / "docs" / "architecture.md").read_text()
    return page[page.index("## The engine") :]


def drawn(root: Path) -> Arrows:
    """(who imports, who is imported), as docs/architecture.md draws it."""
    chart = re.search(r"^```mermaid\n(.*?)^```$", section(root), re.DOTALL | re.MULTILINE)
    assert chart is not None
    return set(re.findall(r"^ +(\w+) --> (\w+)$", chart[1], re.MULTILINE))


def imports() -> Arrows:
    """The same, between folders and single modules of the tower, as it is."""
    graph = grimp.build_graph("flexclear", cache_dir=None, exclude_type_checking_imports=True)
    found = set()
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            if module.startswith(f"{DYNAMICS}.") and other.startswith(f"{DYNAMICS}."):
                found.add((module.split(".")[2], other.split(".")[2]))
    # a run may start with another run, and a point of a sweep may have phases, which record runs
    return {(a, b) for a, b in found if a != b} - {("run", "starts"), ("record", "events")}


def below(arrows: Arrows, start: str) -> set[str]:
    """Everything that arrows lead to."""
    leads = defaultdict(set)
    for a, b in arrows:
        leads[a].add(b)
    found, waiting = set(), [start]
    while waiting:
        for b in leads[waiting.pop()] - found:
            found.add(b)
            waiting.append(b)
    return found


def tabled(root: Path) -> list[str]:
    """Folders and modules of the table above the drawing, in its order."""
    return re.findall(r"^\| `([\w/.]+)` \|", section(root).partition("```mermaid")[0], re.MULTILINE)


def bare(name: str) -> str:
    return name.removesuffix("/").removesuffix(".py")


def parts(root: Path) -> set[str]:
    tower = root / "pipeline" / "flexclear" / "dynamics"
    folders = {path.parent.name + "/" for path in tower.glob("*/__init__.py")}
    return folders | {path.name for path in tower.glob("*.py") if path.name != "__init__.py"}


def test_the_drawing_shows_every_part_of_the_tower(root: Path) -> None:
    assert sorted(tabled(root)) == sorted(parts(root))
    assert {end for arrow in drawn(root) for end in arrow} == {bare(name) for name in tabled(root)}


def test_every_arrow_of_the_drawing_is_an_import(root: Path) -> None:
    assert drawn(root) - imports() == set()


def test_every_import_follows_the_arrows_of_the_drawing(root: Path) -> None:
    arrows = drawn(root)
    assert {(a, b) for a, b in imports() if b not in below(arrows, a)} == set()
    assert [a for a in {a for a, _ in arrows} if a in below(arrows, a)] == []


def test_the_table_has_the_order_of_the_arrays(root: Path) -> None:
    rows = [bare(name) for name in tabled(root)]
    assert [(a, b) for a, b in drawn(root) if rows.index(a) > rows.index(b)] == []


def test_the_way_of_the_data_leads_through_modules_that_exist(root: Path) -> None:
    way = re.search(r"^```text\n(.*?)^```$", section(root), re.DOTALL | re.MULTILINE)
    assert way is not None
    names = re.findall(r"\w+(?:/\w+)+(?:\.py)?", way[1])
    assert len(names) > 10
    assert [name for name in names if not exists(root, name)] == []


# Names -------------------------------------------------------------------------------------------------------------

#: what stands in backticks and looks like a file or module of the project, but for names in angles and asterisks
FILE = re.compile(r"[\w.*<>-]+(/[\w.*<>-]+)+/?|[\w*<>]+\.(py|md|toml|json|jsonl)")
MODULE = re.compile(
    r"(flexclear|stages|structure|dynamics|post|scene|artifacts|workflow|papers|tests|benchmarks)(\.\w+)+"
)
#: folders that names below begin in: `model/tree` is `pipeline/flexclear/dynamics/model/tree.py`
FROM = (
    "",
    "pipeline",
    "pipeline/flexclear",
    "pipeline/flexclear/dynamics",
    "pipeline/flexclear/structure",
    "pipeline/flexclear/post",
    "docs",
    "scenes",
)
#: first parts of names that are no sources: written by runs, quantities, units, symbols
ELSEWHERE = {".venv", "results", "mesh", "modes", "bundle", "figures", "tables", "report"}
#: files that runs or users make
MADE = {"slider_crank.toml", "rod.toml", "run.nc", "post.nc", "cost.json", "timing.nc"}


def named(page: str) -> list[str]:
    text = re.sub(r"^```.*?^```$", "", page, flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"`([^`\n]+)`", text)


def exists(root: Path, name: str) -> bool:
    """Whether a file, a folder or a module has this name; angles and asterisks stand for any text."""
    pattern = re.sub(r"<[^>]*>", "*", name).rstrip("/")
    if (root / "docs/examples/extending" / Path(name).name).is_file():
        return True  # a module that the reader is to write
    return any(
        next(root.joinpath(folder).glob(pattern + ending), None) is not None
        for folder in FROM
        for ending in ("", ".py", ".toml")
    )


def object_exists(root: Path, name: str) -> bool:
    """Whether a dotted name is a module, or something that a module holds."""
    if exists(root, name.replace(".", "/")):
        return True
    module, _, attribute = name.rpartition(".")
    bases = [root / folder / module.replace(".", "/") for folder in FROM]
    files = [path for base in bases for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()]
    return any(re.search(rf"\b{attribute}\b", path.read_text()) for path in files)


def pages(root: Path) -> list[Path]:
    return [*sorted((root / "docs").glob("*.md")), root / "README.md", root / "CONTRIBUTING.md"]


def missing(root: Path, page: str) -> list[str]:
    found = []
    for name in named(page):
        if name in MADE:
            continue
        if MODULE.fullmatch(name):
            found += [] if object_exists(root, name) else [name]
        elif FILE.fullmatch(name) and name.split("/")[0] not in ELSEWHERE:
            found += [] if exists(root, name) else [name]
    return found


def test_every_file_and_module_that_a_page_names_exists(root: Path) -> None:
    gone = {path.name: names for path in pages(root) if (names := missing(root, path.read_text()))}
    assert gone == {}


@pytest.mark.parametrize("name", ["assembly/tree", "dynamics.assembly", "model/trees.py", "tables.py"])
def test_a_name_that_is_gone_is_noticed(root: Path, name: str) -> None:
    assert missing(root, f"See `{name}`.") == [name]


def equations(text: str) -> set[int]:
    """Numbers of the equations in brackets: (3), or (3)-(5)."""
    ranges = re.findall(r"\((\d+)\)(?:-\((\d+)\))?", text)
    return {k for first, last in ranges for k in range(int(first), int(last or first) + 1)}


def test_equations_and_the_functions_that_theory_names_name_each_other(root: Path) -> None:
    """Functions of the dynamics, each before the path of its module."""
    page, found = (root / "docs" / "theory.md").read_text(encoding="utf-8"), 0
    for numbers, where in re.findall(
        r"^\| ([(\d][^|]*) \|[^|]*\| ([^|]*pipeline/flexclear/dynamics[^|]*) \|$", page, re.MULTILINE
    ):
        for names, path in re.findall(r"((?:`\w+`, )+)`(pipeline/flexclear/dynamics/[\w/]+\.py)`", where):
            functions = {
                node.name: ast.get_docstring(node) or ""
                for node in ast.walk(ast.parse((root / path).read_text(encoding="utf-8")))
                if isinstance(node, ast.FunctionDef)
            }
            for name in re.findall(r"\w+", names):
                found += 1
                assert equations(numbers) <= equations(functions[name]), f"{path}: {name}"
    assert found == 11


# Examples in docstrings do what they show -----------------------------------------------------------------------------


ROOT = Path(__file__).parents[2]
MODULES = [
    ".".join(path.relative_to(folder).with_suffix("").parts)
    for folder in (ROOT / "pipeline", ROOT / "papers")
    for path in sorted(folder.rglob("*.py"))
    if ">>> " in path.read_text()
]


def test_what_is_called_from_python_has_examples() -> None:
    assert "flexclear.public" in MODULES


@pytest.mark.parametrize("name", MODULES)
def test_examples_show_what_happens(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    module = import_module(name)
    failed, tried = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert tried > 0
    assert failed == 0


# First sentences of docstrings ----------------------------------------------------------------------------------------

#: first words of fragments that only a reader of the code understands: "Whether it is.", "Of each row, by name."
FRAGMENTS = {"Of", "By", "As", "In", "From", "With", "Its", "Those", "That", "Meanwhile"}
FRAGMENTS |= {"What", "Whether", "Which", "Where", "When", "Why", "How", "Itself"}


def _functions(path: Path) -> Iterator[tuple[str, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and (text := ast.get_docstring(node)):
            yield f"{path.relative_to(ROOT)}: {node.name}", text


def test_docstrings_of_functions_begin_with_a_sentence() -> None:
    folders = [ROOT / folder for folder in ("pipeline", "stages", "papers")]
    functions = [one for folder in folders for path in sorted(folder.rglob("*.py")) for one in _functions(path)]
    assert len(functions) > 1000
    assert [name for name, text in functions if text.split()[0].strip(",.:;") in FRAGMENTS] == []
