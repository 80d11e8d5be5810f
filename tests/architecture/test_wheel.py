"""What a wheel of this project holds, as setuptools finds it; nothing is built, downloaded or written."""

from __future__ import annotations

import tomllib
from glob import glob
from pathlib import Path
from typing import Any

import pytest

discovery = pytest.importorskip("setuptools.discovery", reason="setuptools builds wheels, and is not needed otherwise")


@pytest.fixture(name="project")
def _project(root: Path) -> dict[str, Any]:
    return tomllib.loads((root / "pyproject.toml").read_text())


@pytest.fixture(name="packages")
def _packages(root: Path, project: dict[str, Any]) -> set[str]:
    found = project["tool"]["setuptools"]["packages"]["find"]
    return set(discovery.PEP420PackageFinder.find(str(root), **found))


def test_a_wheel_owns_one_import_name(root: Path, packages: set[str]) -> None:
    assert {name.partition(".")[0] for name in packages} == {"flexclear"}
    # the folders at the top are reached through their links
    files = {p.relative_to(root) for top in ("pipeline", "stages") for p in (root / top).rglob("*.py")}
    assert {".".join(("flexclear", *p.parent.parts)) for p in files} <= packages


def test_a_wheel_brings_scenes_meshes_and_templates(root: Path, project: dict[str, Any]) -> None:
    brought = set[Path]()
    for package, patterns in project["tool"]["setuptools"]["package-data"].items():
        assert package == "flexclear"
        for pattern in patterns:  # glob follows links, and is what setuptools takes
            found = glob(str(root / package / pattern), recursive=True)
            brought |= {Path(file).relative_to(root / package) for file in found}
    kept = {p for top in ("scenes", "meshes", "stages/templates") for p in (root / top).rglob("*") if p.is_file()}
    wanted = {p.relative_to(root) for p in kept if p.suffix in (".toml", ".csv")}
    assert len(wanted) > 60
    assert wanted | {Path("py.typed")} <= brought


def test_there_is_one_script_and_it_is_the_command(project: dict[str, Any]) -> None:
    assert project["project"]["scripts"] == {"flexclear": "flexclear.stages.__main__:main"}
