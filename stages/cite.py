"""``flexclear cite``: sources of the methods and data that a scene uses, from the modules that it reaches."""

from __future__ import annotations

import argparse
import ast
from collections.abc import Collection, Iterator
from importlib import import_module

from flexclear.pipeline.core.citations import cited
from flexclear.pipeline.core.workflow.fingerprint import Sources, source_file
from flexclear.pipeline.core.workflow.task import in_order
from flexclear.stages import run
from flexclear.stages.graph import Graph


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scene", metavar="SCENE")


def command(options: argparse.Namespace) -> None:
    """Print them."""
    (graph,) = run.graphs([options.scene])
    print(text(graph, run.workplace().sources), end="")


def text(graph: Graph, sources: Sources) -> str:
    """Two lists: methods (module: source) and data (part of the scene: source)."""
    scene = graph.scene
    lines = [f"Methods of {scene.name}"]
    lines += [f"  {module}: {source}" for module, source in methods(graph, sources)] or ["  (none is named)"]
    lines.append(f"Data of {scene.name}")
    lines += [f"  {place}: {source}" for place, source in scene.sources().items()] or ["  (none is named)"]
    return "\n".join(lines) + "\n"


def methods(graph: Graph, sources: Sources) -> Iterator[tuple[str, str]]:
    """Module and source text, modules in alphabetical order, each pair once."""
    tasks = in_order(graph.up_to("post"))
    roots = {task.run.partition(":")[0] for task in tasks} | {name for task in tasks for name in task.modules}
    reached = sources.closure(roots)
    parts = {name for task in tasks for name in task.modules}
    for name in sorted(reached.keys() - set(_unused(reached, parts))):
        path = source_file(sources.root, name)
        assert path is not None  # else it would not be in the closure
        for found in dict.fromkeys(named(path.read_text(encoding="utf-8"))):
            yield name, found


def _unused(reached: Collection[str], parts: Collection[str]) -> Iterator[str]:
    """Modules of families that the scene names no part of, and of parts that it does not name.

    They are imported for their types, or by each other, and do nothing for the scene.
    """
    for family in reached:
        listed = getattr(import_module(family), "NAMES", None) if _is_package(family, reached) else None
        if listed is None:
            continue
        inside = {name for name in reached if name.startswith(f"{family}.")}
        those = {f"{family}.{place.partition(':')[0]}" for place in listed.values()}
        yield from (inside & those) - set(parts) if inside & set(parts) else inside


def _is_package(name: str, reached: Collection[str]) -> bool:
    return any(other.startswith(f"{name}.") for other in reached)


def named(source: str) -> Iterator[str]:
    """Texts after ``Source:`` in all docstrings of a module, each on one line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield from cited(ast.get_docstring(node))
