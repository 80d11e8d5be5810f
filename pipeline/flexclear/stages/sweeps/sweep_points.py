"""Points of a sweep in a worker, on this or another machine."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from flexclear.artifacts.paths import PACKAGE
from flexclear.artifacts.points import Point
from flexclear.scene.load import with_numbers
from flexclear.scene.quantity import parse_recorded
from flexclear.stages.simulation import bundles, rebuild
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress, silent
from flexclear.workflow import cores
from flexclear.workflow.cores import side_by_side

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.dynamics.record.point import Runner
    from flexclear.dynamics.run.evaluation.batched_evaluation import Place
    from flexclear.scene.schema import Scene

#: runners that a worker holds in memory
RUNNERS = 8


@dataclass(frozen=True)
class Work:
    """Points that share a scene and its flexible bodies.

    simulate: the scene, as parameters of the simulate stage. inputs: those of that stage by name. keep: names of the
    recorded quantities. members: per point, 0 for the scene's own start. error: whether errors are estimated.
    """

    key: str
    simulate: Mapping[str, Any]
    inputs: Mapping[str, xr.Dataset]
    keep: tuple[str, ...]
    members: int
    error: bool


@lru_cache(maxsize=RUNNERS)
def _open_family(key: str, packed: bytes) -> tuple[Scene, Runner]:
    """Return scene and runner of a family; cached, since the runner holds the compiled functions."""
    from flexclear.dynamics.record.point import Runner

    family: Work = pickle.loads(packed)
    scene = rebuild(family.simulate, family.inputs)
    recorded = [parse_recorded(name, scene.owners()) for name in family.keep]
    return scene, Runner(bundles(family.inputs), recorded, family.members, family.error, scaled=False)


def work(
    key: str,
    packed: bytes,
    points: Sequence[Mapping[str, Any]],
    others_idle: bool,
    together: bool = False,
    sources: str = "",
) -> tuple[list[Point], float]:
    """Run points of a family; return them and the processor time that they took [s].

    packed: the pickled `Work`. points: key path in the scene -> value. others_idle: whether no other worker is busy.
    together: whether points are evaluated together; no result depends on it. sources: digest of the caller's sources
    when the caller is on another machine; InputError when this worker's differ, as those of a worker that joined later
    may.
    """
    if sources and sources != source_digest():
        raise InputError("--scheduler", "a worker runs different sources of flexclear", "install the same version")
    cores.set_idle(others_idle)
    threadpool_limits(1)  # NumPy may have been loaded with more threads
    scene, runner = _open_family(key, packed)
    begun = time.process_time()
    results = _run_together(runner, scene, points) if together else [_point(runner, scene, point) for point in points]
    return results, time.process_time() - begun


def _run_together(runner: Runner, scene: Scene, points: Sequence[Mapping[str, Any]]) -> list[Point]:
    """Run points concurrently, each in a thread, where batched evaluation is possible."""
    places = runner.places(scene, len(points))

    def one(k: int, alive: Progress) -> Point:
        with places.place() if places else nullcontext() as where:
            return _point(runner, scene, points[k], where, alive)

    return side_by_side(one, len(points), lambda _: None, places.seats if places else 1)


def _point(
    runner: Runner, scene: Scene, point: Mapping[str, Any], where: Place | None = None, alive: Progress = silent
) -> Point:
    try:
        edited = with_numbers(scene, point)
    except InputError as error:
        return Point({}, {}, {}, 0, str(error))
    return runner.run(edited, where, alive)


@cache
def source_digest() -> str:
    """Return the digest of the sources that a worker runs, to be compared with the caller's."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(PACKAGE).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()
