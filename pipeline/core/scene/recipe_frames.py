"""Names of the frames of bodies that mesh recipes describe."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from flexclear.pipeline.core.system.errors import InputError


def recipe_frames(mesh: str) -> list[str] | None:
    """Return the names of the frames in a mesh recipe; None when it cannot be read, which is reported elsewhere."""
    try:
        status = Path(mesh).stat()
        return _frames(mesh, status.st_mtime_ns, status.st_size)
    except (OSError, ValueError, InputError):
        return None


@lru_cache
def _frames(mesh: str, changed: int, size: int) -> list[str] | None:
    from flexclear.pipeline.core.scene.load import read_toml  # scenes ask for frames while they are read

    frames = read_toml(Path(mesh)).get("frames")
    return list(frames) if isinstance(frames, dict) else None
