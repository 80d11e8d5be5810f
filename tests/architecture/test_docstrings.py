"""Docstrings: examples do what they show, and first sentences say what a function does."""

import ast
import doctest
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: first words of fragments that only a reader of the code understands: "Whether it is.", "Of each row, by name."
FRAGMENTS = set(
    [
        "As",
        "By",
        "From",
        "How",
        "In",
        "Its",
        "Itself",
        "Meanwhile",
        "Of",
        "That",
        "Those",
        "What",
        "When",
        "Where",
        "Whether",
        "Which",
        "Why",
        "With",
    ]
)
MODULES = [
    "flexclear." + ".".join(path.relative_to(ROOT / "flexclear").with_suffix("").parts)
    for folder in ("", "commands", "papers", "pipeline", "stages")
    for path in sorted((ROOT / "flexclear" / folder).glob("**/*.py" if folder else "*.py"))
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


def _functions(path: Path) -> Iterator[tuple[str, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and (text := ast.get_docstring(node)):
            yield f"{path.relative_to(ROOT)}: {node.name}", text


def test_docstrings_of_functions_begin_with_a_sentence() -> None:
    folders = [ROOT / folder for folder in ("pipeline", "stages", "papers", "flexclear/commands")]
    functions = [one for folder in folders for path in sorted(folder.rglob("*.py")) for one in _functions(path)]
    assert len(functions) > 1000
    assert [name for name, text in functions if text.split()[0].strip(",.:;") in FRAGMENTS] == []
