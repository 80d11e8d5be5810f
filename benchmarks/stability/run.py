"""One case, from its parameters to its outcome."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.stability.mechanism import Parameters, scene
from benchmarks.stability.outcome import REFUSED, WRONG, Outcome, judge
from pipeline import dynamics
from pipeline.core import quantities
from pipeline.core.errors import FlexclearError, SolverError
from pipeline.core.progress import silent
from pipeline.core.scene.wanted import parse
from pipeline.dynamics.run.run import engine_of
from stages import s1_mesh, s2_modes, s3_bundle

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene

#: how much tighter the run is that a finished one is compared with, and runs so dear are not made twice
TIGHTER, TWICE = 1e-2, 300_000
TIGHTEST = 1e-14


def run_case(parameters: Parameters, compiled: Callable[[], None] = lambda: None) -> Outcome:
    """What becomes of a case.

    Refusals are outcomes; anything else that goes wrong is a fault of the program and told as such.
    compiled: called when the kernels are there, so that a limit of time may begin.
    """
    begun = time.process_time()
    try:
        described = scene(parameters)
        reduced = bundles(described)
        engine_of(described, reduced, silent)
        compiled()
        begun = time.process_time()
        run = dynamics.simulate(described, reduced, silent)
        seconds = time.process_time() - begun
        return judge(run, _deviation(parameters, described, run), seconds)
    except SolverError as error:
        return Outcome(REFUSED, str(error), seconds=time.process_time() - begun)
    except Exception as error:  # the atlas reports faults, it does not stop at them
        return Outcome(WRONG, f"{type(error).__name__}: {error}", seconds=time.process_time() - begun)


def bundles(described: Scene) -> dict[str, xr.Dataset]:
    """The reduced flexible bodies of a scene, through stages 1 to 3."""
    return {name: _bundle(body.mesh, *_asked(described, name)) for name, body in described.flexible().items()}


def _asked(described: Scene, body: str) -> tuple[str, str]:
    """What stages 2 and 3 are told of a body, as text that a cache can compare."""
    return json.dumps(s2_modes.params(described.flexible()[body])), json.dumps(s3_bundle.params(described, body))


@cache
def _bundle(recipe: str, modes: str, bundle: str) -> xr.Dataset:
    mesh = s1_mesh.run(s1_mesh.params(Path(recipe)), {}, silent)["nc"]
    found = {"mesh": mesh, "modes": s2_modes.run(json.loads(modes), {"mesh": mesh}, silent)["nc"]}
    made: Any = s3_bundle.run(json.loads(bundle), found, silent)["nc"]
    return made


def _deviation(parameters: Parameters, described: Scene, run: xr.Dataset) -> float:
    """Largest difference of the platform's velocity from that of a tighter run, up to the horizon, over its largest.

    Not a number where the run is too dear to be made twice, or the tighter one cannot be had.
    """
    if int(run.attrs["evaluations"]) > TWICE:
        return float("nan")
    tight_scene = scene(parameters, max(TIGHTEST, described.solver.rtol * TIGHTER))
    try:
        tight = dynamics.simulate(tight_scene, bundles(tight_scene), silent)
    except FlexclearError:
        return float("nan")
    velocity = parse("platform.velocity", described.owners())
    until = min(float(run["horizon"]), float(tight["horizon"]))
    return quantities.error(run, tight, velocity, until) / quantities.scale(run, velocity)
