"""``flexclear cite``: sources of the methods and data that a scene uses, from the modules that it reaches.

Modules that every run of the scene imports are listed separately from those that functions import where they need them:
another integrator where the scene's own is too slow, singular poses, accuracies, frequencies.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Collection, Iterator
from importlib import import_module

from flexclear.scene.citations import cited
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.registry import module_name, module_of
from flexclear.stages import scenes
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import add_options, open_workplace
from flexclear.workflow.fingerprint import Sources, imported, parents, source_file
from flexclear.workflow.task import in_order

INTEGRATE, COMPILE = "flexclear.dynamics.integrate", "flexclear.dynamics.compile"
RUNS = "flexclear.dynamics.run"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    add_options(parser, "set", "said")


def command(options: argparse.Namespace) -> None:
    """Print the sources of a scene."""
    (graph,) = scenes.graphs([options.scene], options.set)
    print(text(graph, open_workplace().sources), end="")


def text(graph: Graph, sources: Sources) -> str:
    """Return lists of methods, of methods that may be needed (module: source), and of data (part: source)."""
    scene = graph.scene
    used, always = list(methods(graph, sources)), _at_once(graph, sources)
    lines = [f"Methods of {scene.name}"]
    lines += [f"  {module}: {source}" for module, source in used if module in always] or ["  (none)"]
    lines.append("Methods used only when a run or a command needs them")
    lines += [f"  {module}: {source}" for module, source in used if module not in always] or ["  (none)"]
    lines.append(f"Data of {scene.name}")
    lines += [f"  {where}: {source}" for where, source in scene.sources().items()] or ["  (none)"]
    return "\n".join(lines) + "\n"


def methods(graph: Graph, sources: Sources) -> Iterator[tuple[str, str]]:
    """Yield module and source text of each method once, with the modules in alphabetical order."""
    stages, parts = _roots(graph)
    reached = sources.closure(stages | parts)
    for name in sorted(reached.keys() - set(_unused(reached, parts))):
        if name.startswith(f"{COMPILE}."):  # compilation is no method of dynamics
            continue
        path = source_file(sources.root, name)
        assert path is not None  # else it would not be in the closure
        for key in dict.fromkeys(named(path.read_text(encoding="utf-8"))):
            yield name, key


def _roots(graph: Graph, met: tuple[str, ...] | None = None) -> tuple[set[str], set[str]]:
    """Return modules of a scene's stages, and those of its parts and of encounters (`met`; None: all of `Task.met`)."""
    roots = [task.roots(met) for task in in_order(graph.up_to("post"))]
    return {stage for stage, *_ in roots}, {name for _, *names in roots for name in names}


def _at_once(graph: Graph, sources: Sources) -> set[str]:
    """Return the modules that every run of the scene imports, without those that functions import where they need them,
    and without integrators that may take over."""
    own = module_name(graph.scene.solver.integrator)
    others = {f"{INTEGRATE}.{module_name(name)}" for name in INTEGRATORS} - {f"{INTEGRATE}.{own}"}
    single = [task for task in in_order(graph.up_to("post")) if task.met]
    met = {name for task in single for name in {*task.roots()} - {*task.roots(())}}  # other modules may reach them, too
    waiting = [name for names in _roots(graph, ()) for name in names - met]
    visited = set[str]()
    while waiting:
        name = waiting.pop()
        path = source_file(sources.root, name)
        if name in visited or name in others or path is None:
            continue
        visited.add(name)
        waiting += [*imported(path.read_bytes(), name, path.name == "__init__.py", deep=False)[0], *parents(name)]
    return visited


def _unused(reached: Collection[str], parts: Collection[str]) -> Iterator[str]:
    """Yield modules of parts, and of whole families, that the scene does not name.

    They are imported for their types, or by each other, and do nothing for the scene.
    """
    for family in reached:
        inside = {name for name in reached if name.startswith(f"{family}.")}
        listed = getattr(import_module(family), "NAMES", None) if inside else None
        if listed is None:
            continue
        those = {module_of(family, name) for name in listed} & set(reached)
        yield from those - set(parts)
        yield from inside if family != RUNS and not those & set(parts) else ()  # other modules of runs are no parts


def named(source: str) -> Iterator[str]:
    """Yield the texts after ``Source:`` in all docstrings of a module, each on one line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield from cited(ast.get_docstring(node))
