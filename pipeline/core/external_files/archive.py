"""Arrays in npz files, unpacked in the child process."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from flexclear.pipeline.core import machine
from flexclear.pipeline.core.external_files import isolated


def read(path: Path, where: str, copies: float, remedy: str) -> dict[str, np.ndarray]:
    """All arrays of a file by name; objects of Python, which would be code, are not read.

    copies: how often what is unpacked will be in memory.  remedy: what helps where that is too much.
    Raises ResourceError for that, `isolated.UnreadableError`, and as `isolated.read` does.
    """
    arrays: dict[str, np.ndarray] = isolated.read(unpacked, path, where, copies, remedy, isolated.allowed())
    return arrays


def unpacked(path: Path, where: str, copies: float, remedy: str, allowed: float) -> dict[str, np.ndarray]:
    """What `read` says, in the child. allowed: bytes of memory."""
    with zipfile.ZipFile(path) as packed:
        need = sum(entry.file_size for entry in packed.infolist())
    machine.require_memory(copies * need, f"{where}: '{path.name}' unpacked", remedy, allowed)
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
