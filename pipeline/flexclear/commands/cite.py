"""``flexclear cite``: sources of the methods and data of a scene, from the docstrings of the modules that it uses.

Modules that every run of the scene uses are listed separately from those that only some need: another integrator where
the scene's own is too slow, singular poses, accuracies, frequencies.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterable, Iterator
from pathlib import Path

from flexclear.artifacts.paths import TREE
from flexclear.dynamics.effects import most_parts, schemes
from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.scene.citations import cited
from flexclear.scene.events import with_switched
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.registry import module_name
from flexclear.scene.schema import Scene
from flexclear.stages import scenes
from flexclear.stages.meshing import kind_of
from flexclear.stages.workplace import add_options
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.task import flatten

#: folders of `dynamics` with a module for each part that a scene may name
PARTS = ("contact.form", "contact.friction", "contact.normal", "contact.surfaces", "drives", "joints", "loads")
#: of `dynamics`: what only some runs of a scene need, and what belongs to other commands and to the compiler
SOMETIMES, NEVER = ("equations.articulated", "linear", "run"), ("compile", "plan", "sensitivity", "specialise")
#: modules of `integrate` that steps of every method use
STEPS = ("adaptive", "norms", "runge_kutta", "stiffness", "within_step")
#: keys of a scene that name parts
NAMING = {"type", "law", "integrator"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    add_options(parser, "set", "said")


def command(options: argparse.Namespace) -> None:
    """Print the sources of a scene."""
    (graph,) = scenes.graphs([options.scene], options.set)
    print(text(graph.scene), end="")


def text(scene: Scene) -> str:
    """Return lists of methods, of methods that may be needed (module: source), and of data (part: source)."""
    used = list(methods(scene))
    lines = [f"Methods of {scene.name}"]
    lines += [f"  {module}: {source}" for module, source, always in used if always] or ["  (none)"]
    lines.append("Methods used only when a run or a command needs them")
    lines += [f"  {module}: {source}" for module, source, always in used if not always] or ["  (none)"]
    lines.append(f"Data of {scene.name}")
    lines += [f"  {where}: {source}" for where, source in scene.sources().items()] or ["  (none)"]
    return "\n".join(lines) + "\n"


def methods(scene: Scene) -> Iterator[tuple[str, str, bool]]:
    """Yield module, source text, and whether every run uses it, of each method once, with the modules in order."""
    uses = _Uses(with_switched(scene) if scene.event else scene)
    packages = ("dynamics", "structure") if scene.flexible() else ("dynamics",)
    for path in [path for package in packages for path in Sources(TREE).files(f"flexclear.{package}")]:
        module = path.removesuffix(".py").replace("/", ".")
        always = uses.always(module.removeprefix("flexclear."))
        if always is not None:
            for source in dict.fromkeys(named((TREE / path).read_text(encoding="utf-8"))):
                yield module, source, always


class _Uses:
    """Modules that the runs of a scene use."""

    def __init__(self, scene: Scene) -> None:
        parts, table = most_parts(scene), scene.model_dump(mode="json", exclude_none=True)
        values = {text.strip('"') for key, text in flatten(table) if key.rpartition(".")[2] in NAMING}
        self.parts = {module_name(name) for name in (*values, *parts.forms)}
        self.own, *self.others = (INTEGRATORS[scheme.integrator].module for scheme in schemes(scene))
        kinds = {kind_of(Path(body.mesh)) for body in scene.flexible().values()}
        stress = bool(scene.output.stress)
        needed = {"dynamics.bodies": parts.flexible, "dynamics.contact": bool(parts.forms)}
        needed |= {"dynamics.events": bool(scene.event), "dynamics.integrate.guards": bool(parts.frictions)}
        needed |= {f"dynamics.integrate.{name}": parts.flexible for name in ("modal_basis", "phi_functions")}
        needed |= {"dynamics.record.stress": stress, "structure.stress": stress}
        needed |= {f"structure.{folder}": "solid" in kinds for folder in ("fe.solid", "stress.solid")}
        needed |= {f"dynamics.effects.{effect.name}": effect in parts.present for effect in EFFECTS}
        self.absent = [*(f"dynamics.{name}" for name in NEVER), *(name for name, there in needed.items() if not there)]

    def always(self, module: str) -> bool | None:
        """Return whether every run uses a module; None where no run does."""
        folder, _, name = module.removeprefix("dynamics.").rpartition(".")
        known = name in self.parts if folder in PARTS else True
        if folder == "integrate":
            known = name not in {traits.module for traits in INTEGRATORS.values()} or name in {self.own, *self.others}
        if not known or _below(module, self.absent):
            return None
        return (
            name in (self.own, *STEPS)
            if folder == "integrate"
            else not _below(module, [f"dynamics.{n}" for n in SOMETIMES])
        )


def _below(module: str, packages: Iterable[str]) -> bool:
    """Return True for one of the packages or a module in them."""
    return any(f"{module}.".startswith(f"{package}.") for package in packages)


def named(source: str) -> Iterator[str]:
    """Yield the texts after ``Source:`` in all docstrings of a module, each on one line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield from cited(ast.get_docstring(node))
