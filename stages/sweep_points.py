"""Points of a sweep in a worker, on this machine or another one."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.artifacts.points import Point

if TYPE_CHECKING:
    import xarray as xr

#: runners that a worker keeps
RUNNERS = 8


@dataclass(frozen=True)
class Family:
    """Points that share a scene and its flexible bodies.

    simulate: the scene, as of the simulate stage.  inputs: those of that stage by name.  keep: names of what is
    kept.  members: of each point, 0 for the scene's own start.  error: whether errors are estimated.
    """

    key: str
    simulate: Mapping[str, Any]
    inputs: Mapping[str, xr.Dataset]
    keep: tuple[str, ...]
    members: int
    error: bool


@lru_cache(maxsize=RUNNERS)
def _opened(key: str, packed: bytes) -> tuple[Any, Any]:
    """The scene of a family and what runs its points; kept by a worker, since it holds the compiled functions."""
    import pickle

    from flexclear.pipeline.core.scene.kept import parse_kept
    from flexclear.pipeline.dynamics.record.point import Runner
    from flexclear.stages.s4_simulate import bundles, rebuild

    family: Family = pickle.loads(packed)
    scene = rebuild(family.simulate, family.inputs)
    kept = [parse_kept(name, scene.owners()) for name in family.keep]
    return scene, Runner(bundles(family.inputs), kept, family.members, family.error)


def work(
    key: str,
    packed: bytes,
    points: Sequence[Mapping[str, Any]],
    alone: bool,
    journals: Sequence[Path | None] = (),
    sources: str = "",
) -> tuple[list[Point], float]:
    """Points of a family, and the processor time that they took [s].

    packed: the pickled `Family`.  points: place of the scene -> value.  alone: whether no other worker is busy.
    journals: of each point, where it keeps its unfinished work (`folder/key`), if it does; none by default.
    sources: digest of those of who asks, where that is on another machine; InputError where this one has others, as
    of a worker that has joined since.
    """
    from threadpoolctl import threadpool_limits

    from flexclear.pipeline.core.errors import InputError
    from flexclear.pipeline.core.scene.load import with_numbers
    from flexclear.pipeline.core.workflow import cores, journal

    if sources and sources != source_digest():
        raise InputError("--scheduler", "a worker runs other sources of flexclear", "install the same ones there")
    cores.tell(alone)
    threadpool_limits(1)  # whoever loaded NumPy first, with however many threads
    scene, runner = _opened(key, packed)
    begun, found = time.process_time(), list[Point]()
    for point, place in zip(points, journals or [None] * len(points), strict=True):
        try:
            edited = with_numbers(scene, point)
        except InputError as error:
            found.append(Point({}, {}, {}, 0, str(error)))
            continue
        if place is None:
            found.append(runner.run(edited))
            continue
        with journal.kept(place.parent, place.name) as kept:
            found.append(runner.run(edited))
            kept.remove()
    return found, time.process_time() - begun


@cache
def source_digest() -> str:
    """Digest of the sources that a worker runs, to be compared with those of who asks it."""
    import hashlib

    from flexclear.pipeline.core.workflow.fingerprint import TREE

    digest = hashlib.sha256()
    for folder in ("pipeline", "stages"):
        # by the one import name, under which a checkout and an installed flexclear have the same files
        for path in sorted((TREE / "flexclear" / folder).rglob("*.py")):
            digest.update(path.relative_to(TREE).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()
