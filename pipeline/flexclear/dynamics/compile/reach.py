"""Modules that the generated files of a mechanism reach: for digests of code and keys of runs."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from flexclear.dynamics.compile import sources
from flexclear.dynamics.effects import (
    DEEP,
    METHOD,
    POSES,
    RUNS,
    SINGULAR,
    Parts,
    most_parts,
    named,
    schemes,
    ways,
)
from flexclear.scene.events import with_switched
from flexclear.scene.registry import module_of
from flexclear.workflow.fingerprint import TREE, source_file, sources_of

if TYPE_CHECKING:
    from flexclear.dynamics.effects import Scheme
    from flexclear.scene.schema import Scene

SOURCES = sources_of(TREE)
#: packages of the kernels' code and of the numbers it uses
CODE = ("flexclear.dynamics", "flexclear.scene.event_kinds")


def modules(scene: Scene, *, alone: bool = False) -> tuple[str, ...]:
    """Return the modules that a run of the scene reaches by names: of its parts, its effects and its generated files.

    alone: True for a run without concurrent ones and without derivatives, whose conditional modules `met` lists.
    Raises InputError when a name is not listed in its family.
    """
    scene = _switched(scene)
    found = named(scene).union(*(effect.modules for effect in most_parts(scene).present))
    found |= {module_of(RUNS, way) for way in ways(scene) if way not in POSES}
    found |= set().union(*(_composed(most_parts(scene), scheme, alone) for scheme in schemes(scene)[: _needed(scene)]))
    return tuple(sorted(found if alone else found.union(*met(scene, alone=False).values())))


def met(scene: Scene, *, alone: bool = True) -> dict[str, tuple[str, ...]]:
    """Return the modules that a run reaches only under a condition, by the condition's name in `encounters`."""
    scene = _switched(scene)
    parts, known = most_parts(scene), schemes(scene)
    deep = [_composed(replace(parts, articulated=True), scheme, alone) for scheme in known]
    found = {DEEP: frozenset().union(*deep)}
    found |= {METHOD.format(s.integrator): _composed(parts, s, alone) for s in known[_needed(scene) :]}
    poses = frozenset(module_of(RUNS, way) for way in ways(scene) if way in POSES)
    found |= {SINGULAR: poses} if poses else {}
    return {name: tuple(sorted(of_it)) for name, of_it in found.items()}


def _switched(scene: Scene) -> Scene:
    return with_switched(scene) if scene.event else scene


def _needed(scene: Scene) -> int:
    """Return the number of `schemes` that count unconditionally: all of them where the run chooses one."""
    return len(schemes(scene)) if scene.by_need() else 1


@cache
def _composed(parts: Parts, scheme: Scheme, alone: bool) -> frozenset[str]:
    """Return the modules that the generated files of parts import; cached, since many scenes share them."""
    texts = [*sources.sources(parts, scheme).values(), *sources.kernels(parts).values(), sources.specialised(parts, ())]
    texts += [] if alone else [sources.batched(parts, (), lanes=2), sources.tangent(parts, ())]
    return frozenset().union(*map(_reached, texts))


@cache
def _reached(source: str) -> frozenset[str]:
    """Return the modules that a generated file imports; cached, since steps depend on few of the parts."""
    return frozenset(name for name in imported(source) if source_file(TREE, name))  # other names are attributes


def imported(source: str) -> set[str]:
    """Return the modules and names that a generated file imports, as `fingerprint.imported` does for other sources."""
    lines = re.findall(r"^from (\S+) import (\S+)", source, re.MULTILINE)
    return {name for module, part in lines for name in (module, f"{module}.{part}")}


def reached(source: str) -> dict[str, str]:
    """Return the digests of the modules with `CODE` that a generated source imports, directly or not.

    Packages on the way do not count: their ``__init__`` modules hold no kernel, but reach everything.
    """
    source_texts: dict[str, str] = {}
    waiting = sorted(imported(source))
    while waiting:
        name = waiting.pop()
        module = SOURCES.module(name) if name.startswith(CODE) and name not in source_texts else None
        if module is not None and not module.package:
            source_texts[name] = module.digest
            waiting.extend(module.own)
    return source_texts
