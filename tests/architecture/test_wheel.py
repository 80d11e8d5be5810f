"""What a wheel of this project holds, as setuptools finds it; nothing is built, downloaded or written."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

#: folders at the top that are packages below `flexclear`
TOPS = ("pipeline", "stages", "papers", "scenes", "meshes")


@pytest.fixture(name="project")
def _project(root: Path) -> dict[str, Any]:
    return tomllib.loads((root / "pyproject.toml").read_text())


def test_a_wheel_holds_every_package_and_no_other(root: Path, project: dict[str, Any]) -> None:
    modules = {p.relative_to(root) for top in ("papers", "pipeline", "stages") for p in (root / top).rglob("*.py")}
    packages = {".".join(("flexclear", *p.parent.parts)) for p in modules} | {"flexclear.commands"}
    assert set(project["tool"]["setuptools"]["packages"]) == packages | {
        "flexclear",
        "flexclear.scenes",
        "flexclear.meshes",
    }


def test_folders_of_packages_do_not_depend_on_links(root: Path, project: dict[str, Any]) -> None:
    folders = project["tool"]["setuptools"]["package-dir"]
    assert folders == {"flexclear": "flexclear"} | {f"flexclear.{top}": top for top in TOPS}
    assert not any((root / folder).is_symlink() for folder in folders.values())


def test_a_wheel_brings_scenes_meshes_and_templates(root: Path, project: dict[str, Any]) -> None:
    setuptools = project["tool"]["setuptools"]
    brought = {
        file
        for package, patterns in setuptools["package-data"].items()
        for pattern in patterns
        for file in (root / package.removeprefix("flexclear.").replace(".", "/")).glob(pattern)
    }
    data = {p for top in ("scenes", "meshes", "stages/templates") for p in (root / top).rglob("*") if p.is_file()}
    assert len(data) > 60
    assert data <= brought
    assert root / "flexclear" / "py.typed" in brought


def test_there_is_one_script_and_it_is_the_command(project: dict[str, Any]) -> None:
    assert project["project"]["scripts"] == {"flexclear": "flexclear.commands.__main__:main"}
