"""Files that others made: what is asked before a library reads them, since few libraries ask."""

from __future__ import annotations

import re
from math import prod
from pathlib import Path

from flexclear.pipeline.core import machine
from flexclear.pipeline.core.errors import InputError

#: what a mesh takes in memory while it is read, over its bytes in the file: text of 20 bytes becomes a number of 8, but
#: is there several times
COPIES = 5.0
#: points of a structured grid, which a header of a hundred bytes may promise without end
MOST_POINTS = 2_000_000
_GRID = re.compile(rb"^DATASET\s+(?:STRUCTURED|RECTILINEAR)\w*\s+DIMENSIONS((?:\s+\d{1,12}){3})\s", re.MULTILINE)
#: bytes of the header of a VTK file that are examined
HEADER = 2000


def require_mesh(path: Path, where: str, largest: int | None = None) -> None:
    """InputError for what is no ordinary file, or promises a grid without end; ResourceError for what is too large.

    largest: bytes at most; default: as many as there is memory for.
    """
    require_file(path, where)
    size = path.stat().st_size
    if largest is not None and size > largest:
        raise InputError(where, f"'{path.name}' is larger than {machine.size(largest)}", "write it coarser")
    machine.require_memory(COPIES * size, f"{where}: '{path.name}'", "use a coarser mesh")
    if path.suffix == ".vtk":
        with path.open("rb") as file:
            match = _GRID.search(file.read(HEADER))
        count = prod(int(number) for number in match[1].split()) if match is not None else 0
        if count > MOST_POINTS:
            raise InputError(where, f"'{path.name}' promises a grid of {count:.3g} points, more than {MOST_POINTS}")


def require_file(path: Path, where: str) -> None:
    """InputError unless an ordinary file is there: reading a device may never end, a pipe waits for a writer."""
    try:
        there, ordinary = path.exists(), path.is_file()
    except (OSError, ValueError) as error:
        raise InputError(where, f"'{path}' can be no file: {error}") from None
    if not there:
        raise InputError(where, f"there is no file {path}", "paths are relative to the file that names them")
    if not ordinary:
        raise InputError(where, f"'{path}' is no ordinary file")
