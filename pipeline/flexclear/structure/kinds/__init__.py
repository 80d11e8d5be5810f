"""Kinds of flexible bodies, by their recipe; each turns recipes into meshes and meshes into models.

To add one: a module here with ``KIND: Kind``, a line in `kind.KINDS`, and its shapes below.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: kinds whose stresses are known (`structure.stress`)
STRESSED = {"beam": True, "solid": True}
#: kind of body by `shape.type` of its recipe; every other type is a beam
SHAPES = {
    "cylinder": "solid",
    "block": "solid",
    "mesh-file": "solid",
    "step": "solid",
    "matrices": "matrices",
}


def name_of(recipe: Mapping[str, Any]) -> str:
    """Return the name of the kind of body that a recipe's table describes."""
    shape = recipe.get("shape")
    return SHAPES.get(str(shape.get("type")), "beam") if isinstance(shape, Mapping) else "beam"
