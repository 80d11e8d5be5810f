"""Examples in docstrings do what they show."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
