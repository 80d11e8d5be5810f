"""Mesh recipes: what a file under meshes/ may say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from pipeline.core.errors import InputError, InputErrors
from pipeline.core.registry import suggestion
from pipeline.core.scene.fields import Density, Length, Number, Part, Pressure, Source
from pipeline.core.scene.load import read_toml

Positive = Field(gt=0.0)


class StraightBeam(Part):
    """A beam along x of the mesh frame, from x = 0 to `length`, cut into equal elements."""

    type: Literal["straight-beam"]
    length: Annotated[Length, Positive]


class Isotropic(Part):
    """A linear elastic, isotropic material."""

    density: Annotated[Density, Positive]
    youngs_modulus: Annotated[Pressure, Positive]
    poisson: Annotated[Number, Field(gt=-1.0, lt=0.5)]

    @property
    def shear_modulus(self) -> float:
        """E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))


class CircleSection(Part):
    """Full circle."""

    type: Literal["circle"]
    radius: Annotated[Length, Positive]


class EqualAreaSquare(Part):
    """The square with the area of the stiffness section; lends its second moments to the mass only."""

    type: Literal["equal-area-square"]


class NodeFrame(Part):
    """A named frame at a node: z along the beam (x of the mesh frame), x = mesh y, y = mesh z."""

    x: Length


class Recipe(Part):
    """A beam to be meshed.

    section: gives area and stiffness.  inertia_section: gives the second moments of the mass; default: `section`.
    interfaces: frames at which the body is joined to others; the first carries the body frame of a Craig-Bampton basis.
    """

    title: str = ""
    elements: Annotated[int, Field(ge=1, le=100_000)]
    shape: StraightBeam
    material: Isotropic
    section: CircleSection
    inertia_section: Annotated[CircleSection | EqualAreaSquare, Field(discriminator="type")] | None = None
    frames: Annotated[dict[str, NodeFrame], Field(min_length=1)]
    interfaces: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _interfaces_are_frames(self) -> Recipe:
        for name in self.interfaces:
            if name not in self.frames:
                raise ValueError(f"interface '{name}' is no frame of the recipe; {suggestion(name, self.frames)}")
        if len(set(self.interfaces)) < len(self.interfaces):
            raise ValueError(f"interfaces {list(self.interfaces)} name a frame twice")
        return self


def read_recipe(path: str | Path) -> dict[str, Any]:
    """The recipe in a TOML file as a plain table in SI units; InputError names every mistake in it."""
    return parse(read_toml(Path(path)), str(path)).model_dump(mode="json", exclude_none=True)


def parse(table: Mapping[str, Any], place: str) -> Recipe:
    """The recipe that a table holds; `place` opens every message of an InputError."""
    try:
        return Recipe.model_validate(dict(table))
    except ValidationError as error:
        raise InputErrors([_input_error(place, e) for e in error.errors()]) from None


def _input_error(place: str, error: Any) -> InputError:
    # pydantic names the chosen member of a union in the path; the file does not
    key = ".".join(str(k) for k in error["loc"] if k not in ("circle", "equal-area-square"))
    known = {"extra_forbidden": "unknown key", "missing": "is missing"}
    message = known.get(error["type"], error["msg"].removeprefix("Value error, "))
    value = error.get("input")
    shown = f" (got {value!r})" if isinstance(value, (str, int, float)) and error["type"] != "missing" else ""
    return InputError(f"{place} [{key}]" if key else place, message + shown)


def sources(recipe: Recipe) -> str:
    """All `source` entries on one line, ``part: text; part.key: text``."""
    found = dict(_flat("recipe", recipe.source))
    parts: dict[str, Part | None] = {"shape": recipe.shape, "material": recipe.material, "section": recipe.section}
    parts["inertia_section"] = recipe.inertia_section
    parts |= {f"frames.{name}": frame for name, frame in recipe.frames.items()}
    for name, part in parts.items():
        if part is not None:
            found |= _flat(name, part.source)
    return "; ".join(f"{name}: {text}" for name, text in found.items())


def _flat(name: str, source: Source | None) -> dict[str, str]:
    if source is None:
        return {}
    return {name: source} if isinstance(source, str) else {f"{name}.{key}": text for key, text in source.items()}
