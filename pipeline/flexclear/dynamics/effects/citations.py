"""Sources of methods, from the docstrings of the modules that the runs of a scene use."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from flexclear.artifacts.paths import PACKAGE
from flexclear.dynamics.effects import most_parts, schemes
from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.scene.films import films_of
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.provenance import cited_sources
from flexclear.scene.schema import Scene
from flexclear.workflow.task import flatten

#: folders of `dynamics` with a module for each part that a scene may name
PARTS = (
    "contact.conforming",
    "contact.form",
    "contact.friction",
    "contact.normal",
    "contact.surfaces",
    "drives",
    "joints",
    "loads",
)
#: of `dynamics`: what only some runs of a scene need, and what belongs to other commands and to the compiler
SOMETIMES = ("linear", "run")
NEVER = ("compile", "plan", "sensitivity", "specialise")
#: modules of `integrate` that steps of every method use
STEPS = ("adaptive", "norms", "runge_kutta", "stiffness", "within_step")
#: keys of a scene that name parts
NAMING = {"type", "law", "form", "integrator"}


def references(scene: Scene) -> str:
    """Return the publications of the methods that the scene's parts represent, one a line."""
    own, parts = schemes(scene)[0].integrator, _named(scene)
    modules = [f"integrate.{INTEGRATORS[own].module}"]
    modules += [f"{folder}.{name}" for folder in PARTS for name in sorted(parts)]
    paths = [PACKAGE / "dynamics" / f"{name.replace('.', '/')}.py" for name in modules]
    return "\n".join(dict.fromkeys(source for path in paths if path.is_file() for source in sources(path)))


@cache
def sources(path: Path) -> tuple[str, ...]:
    """Return the texts after ``Source:`` in all docstrings of a module, each on one line."""
    nodes = ast.walk(ast.parse(path.read_bytes()))
    documented = [node for node in nodes if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))]
    return tuple(source for node in documented for source in cited_sources(ast.get_docstring(node)))


def _named(scene: Scene) -> set[str]:
    """Return the names of the modules of the parts that a scene names."""
    values = flatten(scene.model_dump(mode="json", exclude_none=True))
    films = {film.type for film in films_of(scene).values()}
    return films | {text.strip('"').replace("-", "_") for key, text in values if key.rpartition(".")[2] in NAMING}


class Uses:
    """Modules of `dynamics` that the runs of a scene use."""

    def __init__(self, scene: Scene) -> None:
        parts = most_parts(scene)
        self.parts = {*_named(scene), *parts.forms}
        self.own, *self.others = (INTEGRATORS[scheme.integrator].module for scheme in schemes(scene))
        needed = {"bodies": parts.flexible, "contact": bool(parts.forms), "events": bool(scene.event)}
        needed |= {f"integrate.{name}": parts.flexible for name in ("modal_basis", "phi_functions")}
        needed |= {"integrate.guards": bool(parts.frictions), "record.stress": bool(scene.output.stress)}
        needed |= {f"mechanics.{name}": bool(parts.forms) for name in ("contacts", "surfaces")}
        # all loads are in one module, whose only source is of controllers
        controlled = any(effect.name == "controllers" for effect in parts.present)
        needed |= {"mechanics.flexible": parts.flexible, "mechanics.loads": controlled}
        for effect in EFFECTS:
            folders = ("bodies", "contact", "equations", "mechanics", "model", "record", "run")
            needed |= {f"{folder}.{effect.name}": effect in parts.present for folder in folders}
        self.absent = [*NEVER, *(name for name, there in needed.items() if not there)]

    def always(self, module: str) -> bool | None:
        """Return whether every run uses a module, by its name in `dynamics`; None where no run does."""
        folder, _, name = module.rpartition(".")
        methods = {traits.module for traits in INTEGRATORS.values()} - {self.own, *self.others}
        unnamed = name not in self.parts if folder in PARTS else folder == "integrate" and name in methods
        if unnamed or _below(module, self.absent):
            return None
        return name in (self.own, *STEPS) if folder == "integrate" else not _below(module, SOMETIMES)


def _below(module: str, packages: Iterable[str]) -> bool:
    """Return True for one of the packages or a module in them."""
    return any(f"{module}.".startswith(f"{package}.") for package in packages)
