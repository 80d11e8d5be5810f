"""Stage 1: recipe -> mesh, as NetCDF for the next stages and as VTU for ParaView."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.core.errors import InputError
from pipeline.core.registry import module_of
from pipeline.core.scene.load import read_toml

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.progress import Progress

KINDS = "pipeline.structure.kinds"
#: keys of a recipe's shape that name files
FILES = ("file", "stiffness", "mass")


def params(recipe: Path, edits: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The recipe's content; where it lies does not matter. Raises InputError when it cannot be read.

    edits: values that take the place of the recipe's; of `elements` a factor.
    """
    table = read_toml(recipe)
    changes = dict(edits or {})
    if "elements" in changes:
        changes["elements"] = changes["elements"] * table["elements"]
    return {"recipe": table | changes} | _files(table, recipe.parent)


def modules(recipe: Path) -> tuple[str, ...]:
    """Module of the kind of body that a recipe describes."""
    return (module_of(KINDS, kind_of(recipe), where=str(recipe)),)


def kind_of(recipe: Path) -> str:
    """Name of the kind of body that a recipe describes."""
    shape = read_toml(recipe).get("shape")
    kinds = import_module(KINDS).SHAPES
    return str(kinds.get(str(shape.get("type")), "beam")) if isinstance(shape, Mapping) else "beam"


def _files(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Where the files lie that a recipe names, and what is in them; nothing for a recipe without files."""
    shape = table.get("shape")
    named = shape if isinstance(shape, Mapping) else {}
    found = {str(named[key]): folder / str(named[key]) for key in FILES if key in named}
    missing = [path for path in found.values() if not path.is_file()]
    if missing:
        raise InputError(f"{folder} [shape]", f"there is no file {missing[0]}", "paths are relative to the recipe")
    if not found:
        return {}
    digests = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in found.items()}
    return {"folder": str(folder.resolve()), "sha256": digests}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The mesh (schema MESH or SOLID) as ``nc``, and for other programs as ``vtu``."""
    from pipeline.structure.kinds import kind

    part = kind.of_recipe(params["recipe"])
    result = part.build(params["recipe"], Path(params.get("folder", ".")))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        part.write_vtu(result, path)
        return {"nc": result, "vtu": path.read_bytes()}
