"""Stage 1: recipe -> mesh, as NetCDF for the next stages and as VTU for ParaView."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.scene import provenance
from flexclear.scene.limits import Limits, check_cells
from flexclear.scene.load import RECIPE, is_file, require_kind
from flexclear.scene.toml_files import read_toml
from flexclear.structure.kinds import name_of
from flexclear.system.errors import InputError
from flexclear.system.external_files import companion_files
from flexclear.workflow.fingerprint import library_version

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.system.progress import Progress

#: place in errors of the kinds of bodies, which do not know the recipe's file
PLACE = "mesh recipe"
#: keys of a recipe's shape that name files
FILES = ("file", "stiffness", "mass", "unknowns", "nodes", "basis", "listing")


def params(
    recipe: Path, edits: Mapping[str, Any] | None = None, segment: Sequence[int] | None = None
) -> dict[str, Any]:
    """Return the recipe's content, without its name, its folder, and its sources (see `sources`).

    Raises InputError when the recipe cannot be read, or a source is not text. edits: values that replace the recipe's;
    for `elements` a factor, without effect on recipes that have none. segment: of the rod, if not all of it.
    """
    table = read_toml(recipe)
    require_kind(table, recipe, RECIPE)
    changes = dict(edits or {})
    factor = changes.pop("elements", None)
    if factor is not None and isinstance(table.get("elements"), int):
        changes["elements"] = factor * table["elements"]
    for path in named_files(table, recipe.parent):
        if not is_file(path):
            raise InputError(f"{recipe} [shape]", f"there is no file {path}", "paths are relative to the recipe")
    sources(recipe)
    more: dict[str, Any] = {"segment": list(segment)} if segment else {}
    if isinstance(table.get("shape"), dict) and table["shape"].get("type") == "step":
        more["gmsh"] = library_version("gmsh")
    return {"recipe": provenance.without_sources(table | changes)} | more


def sources(recipe: Path, where: str = "") -> dict[str, str]:
    """Return the provenance of a recipe's values: key path -> text; raise InputError for a source that is not text."""
    table = read_toml(recipe)
    wrong = provenance.path_of_wrong_source(table)
    if wrong is not None:
        problem = "expected text, or a table of texts by key"
        raise InputError(f"{recipe} [{wrong}]", problem, 'write source = "Table 2"')
    return provenance.sources(table, where)


def check_size(recipe: Path, limits: Limits, edits: Mapping[str, Any] | None = None) -> None:
    """Raise ResourceError when a mesh would have too many cells; meshes in files are checked on reading."""
    table = params(recipe, edits)["recipe"]
    check_cells(table.get("shape"), table.get("elements"), limits, recipe)


def kind_of(recipe: Path) -> str:
    """Return the name of the kind of body that a recipe describes."""
    return name_of(read_toml(recipe))


def files(table: Mapping[str, Any], folder: Path) -> dict[str, Path]:
    """Return the files that a recipe names, and those read with them, by their paths relative to the recipe."""
    opened = [file for path in named_files(table, folder) for file in (path, *companion_files(path))]
    return {_relative(path, folder): path for path in opened}


def named_files(table: Mapping[str, Any], folder: Path) -> list[Path]:
    """Return the paths of the files that a recipe itself names."""
    shape = table.get("shape")
    return [folder / str(shape[key]) for key in FILES if key in shape] if isinstance(shape, Mapping) else []


def _relative(path: Path, folder: Path) -> str:
    """Return a path relative to a folder; on another drive, where no relative path exists, the path as it is."""
    try:
        return os.path.relpath(path, folder)
    except ValueError:
        return str(path)


def in_recipe(error: InputError, path: Path) -> InputError:
    """Return the error of a mesh with the recipe's file in place of the words "mesh recipe"."""
    return InputError(error.place.replace(PLACE, str(path), 1), error.problem, error.remedy)


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Build the mesh (schema MESH or SOLID) as ``nc``, and for other programs as ``vtu``.

    params: the recipe; a segment of its rod; its file; its folder, to which the paths of the files in it are relative.
    """
    from flexclear.structure.kinds import kind

    folder = Path(params.get("folder", "."))
    try:
        result = kind.build(params["recipe"], folder, segment=params.get("segment"))
    except InputError as error:
        raise in_recipe(error, Path(params.get("file", PLACE))) from None
    return {"nc": result, "vtu": kind.of_mesh(result).vtu(result)}
