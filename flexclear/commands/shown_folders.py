"""Which scene file a folder of shown results belongs to: two files of one name must not replace each other."""

from __future__ import annotations

from pathlib import Path

from flexclear.pipeline.core.artifacts.disk import checked, disk_limits, publish, read_checked
from flexclear.pipeline.core.artifacts.store import Store
from flexclear.pipeline.core.scene.load import is_file
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system import file_names
from flexclear.pipeline.core.system.errors import InputError


def refuse_namesakes(scenes: list[Scene]) -> None:
    """InputError when two files given together have one name."""
    folders: dict[str, Path] = {}
    for scene in scenes:
        path, name = _file(scene), file_names.folded(scene.name)  # as Windows and macOS name folders
        if path is not None and folders.setdefault(name, path) != path:
            raise InputError(
                str(path),
                f"is called '{scene.name}', as {folders[name]} is, and their results would replace each other",
                "rename one, or call the command from a folder above both, which names them by their paths",
            )


def claim(scene: Scene, store: Store) -> str | None:
    """Note that results/runs/<name> is of this file; a sentence when it was of another one that is still there."""
    path = _file(scene)
    if path is None:
        return None
    note = store.root / "runs" / scene.name / ".facts" / "scene.owner"
    before = (read_checked(note) or {}).get("file")
    if before == str(path):
        return None
    with disk_limits(note.parent):
        note.parent.mkdir(parents=True, exist_ok=True)
        publish(note, checked({"file": str(path)}))
    if not isinstance(before, str) or not is_file(Path(before)):
        return None
    return f"results/runs/{scene.name} showed {before}, and from now on shows {path}, which has the same name"


def _file(scene: Scene) -> Path | None:
    return None if scene.path is None else scene.path.resolve()
