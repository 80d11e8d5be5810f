"""From a scene to its equilibrium."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from pipeline.core.errors import SolverError
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.linear.bench import Bench, balance, hold, set_drives
from pipeline.dynamics.linear.equilibrium import Equilibrium, find_equilibrium
from pipeline.dynamics.linear.tangent import scales
from pipeline.dynamics.run.engine import Progress

#: speeds of the loops, and change of the forces on the way of the drives, that steady motion may show, relative
STEADY = 1e-9
#: how far the drives are moved to see whether the forces stay the same [m or rad]
PROBE = 1e-3


def equilibrium(
    scene: Scene,
    bundles: Mapping[str, xr.Dataset],
    progress: Progress,
    time: float | None,
    drives: Mapping[str, float] | None,
    moving: bool,
) -> tuple[Bench, Equilibrium]:
    """The bench of a scene and its equilibrium; see `pipeline.dynamics.equilibrium`."""
    bench, q = hold(scene, bundles, progress, time, drives, moving)
    progress(None, "looking for the equilibrium")
    rest = find_equilibrium(bench, q)
    if moving:
        _require_steady(bench, rest)
    return bench, rest


def _require_steady(bench: Bench, rest: Equilibrium) -> None:
    """SolverError unless the pose stays in balance, and the loops closed, while the drives move on."""
    fastest = float(np.max(np.abs(bench.drives[:, 1]), initial=0.0))
    if fastest == 0.0:
        return
    before = balance(bench, rest.at.q)
    onward = bench.drives + np.stack([PROBE * bench.drives[:, 1] / fastest, np.zeros(len(bench.drives))], axis=1)
    set_drives(bench, onward)
    after = balance(bench, rest.at.q)
    set_drives(bench, bench.drives)
    size = scales(bench)
    change = float(np.max(np.abs(after.bias - before.bias) * size, initial=0.0))
    largest = float(np.max(np.abs(before.bias) * size, initial=0.0))
    loops = float(np.max(np.abs(before.slip), initial=0.0))
    if change > STEADY * largest or loops > STEADY * fastest:
        raise SolverError(
            f"at t = {bench.time:.6g} s: the drives' motion is not steady: the forces on the free coordinates change "
            "as they go on; hold the drives instead"
        )
