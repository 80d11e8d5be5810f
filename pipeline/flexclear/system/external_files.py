"""Files from other programs: checks before and after a library reads them, since few libraries check.

The files are read in this process. Every failure of a reader is reported as an error in words.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.system import machine
from flexclear.system.errors import FlexclearError, InputError, ResourceError, terminal_text

if TYPE_CHECKING:
    import meshio

#: memory of a mesh while it is read, over the size of its file: text of 20 bytes becomes a number of 8 bytes, but in
#: several copies
COPIES = 5.0
#: largest number of points of a structured grid: a header of a hundred bytes can announce any number
MOST_POINTS = 2_000_000
#: what a reader quotes of a file
_QUOTED = re.compile(r"(['\"]).*?\1")
_GRID = re.compile(rb"^DATASET\s+(?:STRUCTURED|RECTILINEAR)\w*\s+DIMENSIONS((?:\s+\d{1,12}){3})\s", re.MULTILINE)
#: largest number of files that an Abaqus file may include, counted as often as they are read
MOST_INCLUDES = 1000
#: characters forbidden in names of DOLFIN files: meshio searches for their parts by a pattern that contains the name
PATTERN = set("\\^$*+?{}[]|()")
#: entry that meshio puts among the cell sets of a Gmsh 4 file, although it holds numbers of curves and points
NO_CELLS = "gmsh:bounding_entities"

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
HDF5 = "MED and other formats in HDF5 need h5py: pip install 'flexclear[med]'"


def require_file(path: Path, where: str) -> None:
    """Raise InputError unless a file to be read is an ordinary one.

    Reading a device may never end; a pipe waits for a writer.
    """
    try:
        exists, ordinary = path.exists(), path.is_file()
    except (OSError, ValueError) as error:
        raise InputError(where, f"'{path}' cannot be a file: {error}") from None
    if not exists:
        raise InputError(where, f"there is no file {path}", "paths are relative to the file that names them")
    if not ordinary:
        raise InputError(where, f"'{path}' is not an ordinary file")


@contextlib.contextmanager
def convert_reader_errors(path: Path, where: str, problem: str, remedy: str | None = None) -> Any:
    """Convert any error of a reader of this file to an InputError with `problem` and the reader's reason.

    Damaged files make readers fail in many ways. Too little memory becomes a ResourceError.
    """
    try:
        with warnings.catch_warnings():  # of NumPy about what is refused next
            warnings.simplefilter("ignore", UserWarning)
            yield
    except FlexclearError:
        raise
    except ImportError as error:  # a library that only few formats need, such as h5py
        raise InputError(where, f"{problem}: {error}", HDF5 if error.name == "h5py" else remedy) from None
    except MemoryError:
        raise ResourceError(f"{where}: '{path.name}' is damaged, or needs more memory than available") from None
    except Exception as error:
        reason = _QUOTED.sub("...", str(error)) or type(error).__name__  # the file may be private
        raise InputError(where, f"{problem}: {terminal_text(reason)}", remedy) from None


def read_mesh(path: Path, where: str, problem: str, remedy: str, largest: int | None = None) -> meshio.Mesh:
    """Return the mesh in a file as meshio reads it: points of 1 to 3 columns, cell sets and integer cell data only.

    problem, remedy: of the InputError for unreadable files. largest: size limit [bytes]; default: the available memory.
    Raises ResourceError for larger files.
    """
    _require_mesh(path, where, largest)
    with convert_reader_errors(path, where, problem, remedy):
        opened = [path, *companion_files(path)]
        for file in opened:
            require_file(file, where)
            require_whole(file, where)
        return _read_by_meshio(path)


def _require_mesh(path: Path, where: str, largest: int | None) -> None:
    """Raise InputError for no ordinary file or an oversized grid, ResourceError where memory does not suffice."""
    require_file(path, where)
    size = path.stat().st_size
    if largest is not None and size > largest:
        raise InputError(where, f"'{path.name}' is larger than {machine.size_text(largest)}", "export it coarser")
    machine.require_memory(COPIES * size, f"{where}: '{path.name}'", "use a coarser mesh")
    if path.suffix == ".vtk":
        with path.open("rb") as file:
            # 2000: bytes of the header of a VTK file that are examined
            match = _GRID.search(file.read(2000))
        count = prod(int(number) for number in match[1].split()) if match is not None else 0
        if count > MOST_POINTS:
            raise InputError(where, f"'{path.name}' declares a grid of {count:.3g} points, more than {MOST_POINTS}")


def require_whole(path: Path, where: str) -> None:
    """Raise InputError for an HDF5 file with parts in other files, whose edits would go unnoticed."""
    if not _is_hdf5(path):
        return
    import h5py

    outside: list[str] = []

    def look_at_link(name: str, link: object) -> None:
        if isinstance(link, h5py.ExternalLink):
            outside.append(name)

    def look_at_data(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset) and (node.external or node.is_virtual):
            outside.append(name)

    with h5py.File(path, "r") as file:
        file.visititems_links(look_at_link)
        file.visititems(look_at_data)
    if outside:
        problem = f"'{path.name}' has parts in other files, such as '{outside[0]}'"
        raise InputError(where, problem, "write it again as one file")


def _is_hdf5(path: Path) -> bool:
    """Return True when the HDF5 signature is at the start, or after a user block of 512, 1024, 2048, ... bytes."""
    with path.open("rb") as file:
        for start in (0, *(512 << k for k in range(path.stat().st_size.bit_length()))):
            file.seek(start)
            if file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                return True
    return False


def _read_by_meshio(path: Path) -> meshio.Mesh:
    """Read a mesh for `read_mesh`; raise any error, in words or not, for unreadable content."""
    import meshio  # slow to import, and only meshes from files need it
    import numpy as np

    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed), np.errstate(over="ignore"):
            # to detect binary files, meshio interprets text as the length of one, which may overflow
            mesh = meshio.read(path)
    except SystemExit:
        # meshio prints its reason and ends the process where the content does not fit the suffix
        raise ValueError(" ".join(printed.getvalue().split()) or "meshio does not know its format") from None
    points = np.asarray(mesh.points)
    mesh.points = points if points.size else np.empty((0, 3))
    if mesh.points.ndim != 2 or not 1 <= mesh.points.shape[1] <= 3 or points.dtype.kind not in "iuf":
        raise ValueError(f"its points are an array of {points.dtype}, {points.shape}")
    mesh.cell_sets = {
        name: [np.asarray([] if part is None else part, dtype=np.int64).ravel() for part in parts]
        for name, parts in mesh.cell_sets.items()
        if name != NO_CELLS
    }
    mesh.point_sets = {name: np.asarray(nodes, dtype=np.int64).ravel() for name, nodes in mesh.point_sets.items()}
    mesh.cell_data = _integers(mesh.cell_data)
    return mesh


def _integers(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data with one integer per cell."""
    import numpy as np

    arrays = {name: [np.asarray(part) for part in parts] for name, parts in data.items()}
    return {
        name: parts
        for name, parts in arrays.items()
        if all(part.dtype.kind in "iu" and part.ndim == 1 for part in parts)
    }


def companion_files(path: Path) -> Iterator[Path]:
    """Yield the files that meshio reads with this one: of TetGen, DOLFIN and XDMF, and nested includes of Abaqus.

    Callers that depend on a mesh file depend on these, too: their content decides the result as well. A file that
    cannot be examined has none, since its reader refuses it. Raises InputError, after the existing files, where no
    reader ends: for circular or too many includes; and for a name that DOLFIN's reader takes for a pattern.
    """
    includes = path.suffix.lower() == ".inp"
    waiting: list[tuple[Path, tuple[str, ...]]] = [(path, ())]
    for file, above in waiting:  # grows by the includes of each file, as often as it is read
        within = (*above, os.path.realpath(file))
        with contextlib.suppress(OSError, ValueError, SyntaxError):
            if not file.is_file():  # a device has no end
                continue
            for other in _included_by(file) if includes else _named_by(file):
                circle = includes and os.path.realpath(other) in within
                if circle or len(waiting) > MOST_INCLUDES:
                    problem = "in a circle" if circle else f"after {MOST_INCLUDES} others, and more are not read"
                    raise InputError(str(path), f"includes '{other}' {problem}", "remove that include")
                yield other
                if includes:
                    waiting.append((other, within))


def _included_by(path: Path) -> Iterator[Path]:
    """Yield the includes of an Abaqus file by meshio's own rule; only lines with a U can be includes."""
    with path.open(encoding=io.text_encoding(None)) as file:  # as meshio does
        for line in file:
            if not ("U" in line or "u" in line) or line.startswith("**"):
                continue
            if line.partition(",")[0].strip().replace("*", "").upper() == "INCLUDE":
                name = Path(line.split("=")[-1].strip())
                yield name if name.exists() else path.parent / name


def _named_by(path: Path) -> Iterator[Path]:
    """Yield the files that meshio opens when it reads this one, at the paths where it searches for them."""
    suffix = path.suffix.lower()
    if path.suffix in (".ele", ".node"):
        yield path.with_suffix(".node" if path.suffix == ".ele" else ".ele")
    elif suffix == ".xml":
        if PATTERN & set(path.stem):
            problem = f"its name has one of {' '.join(sorted(PATTERN))}, which its reader interprets as a pattern"
            raise InputError(str(path), problem, "rename it")
        part = re.compile(f"{path.stem}_([^.]+)\\.xml")
        yield from sorted(file for file in path.resolve().parent.iterdir() if part.match(file.name))
    elif suffix in (".xdmf", ".xmf"):
        yield from dict.fromkeys(_numbers_of_xdmf(path))


def _numbers_of_xdmf(path: Path) -> Iterator[Path]:
    """Yield the data files of an XDMF file: HDF5 next to it, binary data relative to the current folder."""
    from xml.etree import ElementTree  # 5 ms, and only few meshes need it

    folder = path.resolve().parent
    for _, node in ElementTree.iterparse(path):
        name = (node.text or "").strip() if node.tag == "DataItem" else ""
        if node.get("Format") == "HDF":
            yield folder / name.partition(":")[0]
        elif node.get("Format") == "Binary":
            yield Path(name)
        node.clear()  # frees numbers inside the file, which may be many
