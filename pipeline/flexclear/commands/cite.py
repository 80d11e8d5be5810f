"""``flexclear cite``: sources of the methods and data of a scene, from the docstrings of the modules that it uses.

Modules that every run of the scene uses are listed separately from those that only some need: another integrator where
the scene's own is too slow, singular poses, accuracies, frequencies.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from flexclear.artifacts.paths import PACKAGE
from flexclear.dynamics.effects.citations import Uses, sources
from flexclear.scene.events import with_switched
from flexclear.scene.schema import Scene
from flexclear.stages import scenes
from flexclear.stages.meshing import kind_of
from flexclear.stages.workplace import add_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    add_options(parser, "set", "said")


def run_command(options: argparse.Namespace) -> None:
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
    uses = Uses(with_switched(scene) if scene.event else scene)
    for path in sorted(PACKAGE.rglob("*.py")):
        tower, *inside = path.relative_to(PACKAGE).with_suffix("").parts
        always = uses.always(".".join(inside)) if tower == "dynamics" else _bodies_need(scene, tower, inside) or None
        if always is not None:
            for source in dict.fromkeys(sources(path)):
                yield ".".join(("flexclear", tower, *inside)), source, always


def _bodies_need(scene: Scene, tower: str, inside: list[str]) -> bool:
    """Return True for a module that the flexible bodies of a scene use."""
    kinds = {kind_of(Path(body.mesh)) for body in scene.flexible().values()}
    stressed = "stress" not in inside or bool(scene.output.stress)
    return tower == "structure" and bool(kinds) and stressed and not ({"beam", "solid"} - kinds) & set(inside)
