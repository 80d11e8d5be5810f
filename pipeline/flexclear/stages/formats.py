"""Models and results in the forms of other programs.

To add a format: its entry in `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from flexclear.artifacts.disk import disk_limits
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.stages import export, fmu, scenes
from flexclear.stages.workplace import Workplace
from flexclear.system.errors import InputError


class Format(NamedTuple):
    """A format: function that writes it and says what, endings of its files, the first by default, and its options."""

    write: Callable[[Scene, Path, Mapping[str, Any], Workplace], str]
    endings: tuple[str, ...]
    options: tuple[str, ...]


FORMATS = {"fmu": Format(fmu.write, (".fmu",), ("fmi",))}


def write(scene: Scene, name: str, target: Path | None, asked: Mapping[str, Any], workplace: Workplace) -> str:
    """Write a scene in a format, by default to a file named like the scene in the current folder; return what it says.

    asked: the options given.  Raises InputError for an unknown format or ending.
    """
    if name not in FORMATS:
        raise InputError(f"--format {name}", "unknown format", suggestion(name, FORMATS))
    made = FORMATS[name]
    target = target or Path(f"{Path(scene.name).name}{made.endings[0]}")
    export.check_format(target, made.endings)
    scenes.check_target(target)
    with disk_limits(target.parent):
        return made.write(scene, target, asked, workplace)
