"""Stage 1: recipe -> mesh, as NetCDF for the next stages and as VTU for ParaView."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.scene import provenance
from flexclear.pipeline.core.scene.limits import Limits, check_cells
from flexclear.pipeline.core.scene.load import RECIPE, is_file, read_toml, require_kind
from flexclear.pipeline.core.scene.registry import module_of
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.external_files import companions

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress

KINDS = "flexclear.pipeline.structure.kinds"
#: what kinds of bodies call a recipe, whose file they do not know
PLACE = "mesh recipe"
#: keys of a recipe's shape that name files
FILES = ("file", "stiffness", "mass", "unknowns")


def params(recipe: Path, edits: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The recipe's content; its name and folder do not matter, nor do its sources, which `sources` returns.

    Raises InputError when it cannot be read, or a source is no text.
    edits: values that replace the recipe's; of `elements` a factor, which recipes without them go without.
    """
    table = read_toml(recipe)
    require_kind(table, recipe, RECIPE)
    changes = dict(edits or {})
    factor = changes.pop("elements", None)
    if factor is not None and isinstance(table.get("elements"), int):
        changes["elements"] = factor * table["elements"]
    for path in named(table, recipe.parent):
        if not is_file(path):
            raise InputError(f"{recipe} [shape]", f"there is no file {path}", "paths are relative to the recipe")
    sources(recipe)
    return {"recipe": provenance.without(table | changes)}


def sources(recipe: Path, where: str = "") -> dict[str, str]:
    """Where the values of a recipe come from: path of the part or value -> text; InputError for what is no text."""
    table = read_toml(recipe)
    wrong = provenance.mistaken(table)
    if wrong is not None:
        problem = "expected text, or a table of texts by key"
        raise InputError(f"{recipe} [{wrong}]", problem, 'write source = "Table 2"')
    return provenance.sources(table, where)


def check_size(recipe: Path, limits: Limits, edits: Mapping[str, Any] | None = None) -> None:
    """ResourceError when the mesh would have more cells than it may; files are judged when they are read."""
    table = params(recipe, edits)["recipe"]
    check_cells(table.get("shape"), table.get("elements"), limits, recipe)


def modules(recipe: Path) -> tuple[str, ...]:
    """Module of the kind of body that a recipe describes."""
    return (module_of(KINDS, kind_of(recipe), where=str(recipe)),)


def kind_of(recipe: Path) -> str:
    """Name of the kind of body that a recipe describes."""
    return str(import_module(KINDS).name_of(read_toml(recipe)))


def files(table: Mapping[str, Any], folder: Path) -> dict[str, Path]:
    """The files that a recipe names, and those that their formats read with them, by their paths from the recipe."""
    opened = [file for path in named(table, folder) for file in (path, *companions(path))]
    return {_relative(path, folder): path for path in opened}


def named(table: Mapping[str, Any], folder: Path) -> list[Path]:
    """The files that a recipe names itself."""
    shape = table.get("shape")
    return [folder / str(shape[key]) for key in FILES if key in shape] if isinstance(shape, Mapping) else []


def _relative(path: Path, folder: Path) -> str:
    """A path from a folder; on another drive there is no way from there."""
    try:
        return os.path.relpath(path, folder)
    except ValueError:
        return str(path)


def in_recipe(error: InputError, path: Path) -> InputError:
    """The error of a mesh with the file of its recipe instead of the word for it."""
    return InputError(error.place.replace(PLACE, str(path), 1), error.problem, error.remedy)


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The mesh (schema MESH or SOLID) as ``nc``, and for other programs as ``vtu``.

    params: besides the recipe its file, and its folder, which the files that it names are relative to.
    """
    from flexclear.pipeline.structure.kinds import kind

    folder = Path(params.get("folder", "."))
    try:
        result = kind.build(params["recipe"], folder)
    except InputError as error:
        raise in_recipe(error, Path(params.get("file", PLACE))) from None
    return {"nc": result, "vtu": kind.of_mesh(result).vtu(result)}
