"""From a scene to its equilibrium."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from pipeline.core.errors import SolverError
from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.linear.bench import Bench, balance, hold, set_drives
from pipeline.dynamics.linear.equilibrium import Equilibrium, find_equilibrium
from pipeline.dynamics.run.engine import Progress
from pipeline.dynamics.run.singular import built_rows

#: speeds of the loops, and change of the forces on the way of the drives, that steady motion may show, relative
STEADY = 1e-9
#: how far the drives are moved to see whether the forces stay the same, in radians or shares of the mechanism's size
PROBE = 0.1


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
    fastest = float(np.max(np.abs(bench.drives[:, 1]) / bench.engine.model.drive_scales, initial=0.0))
    if fastest == 0.0:
        return
    model, before, forces = bench.engine.model, balance(bench, rest.at.q), _forces(bench)
    along = built_rows(model, bench.engine.h) == 0
    loops = float(np.max(np.abs(before.slip) / np.where(along, model.mechanism.length, 1.0), initial=0.0))
    if loops <= STEADY * fastest:
        onward = bench.drives + np.stack([PROBE * bench.drives[:, 1] / fastest, np.zeros(len(bench.drives))], axis=1)
        set_drives(bench, onward)
        after = balance(bench, rest.at.q)
        forces = max(forces, _forces(bench))
        set_drives(bench, bench.drives)
        change = float(np.max(np.abs(after.bias - before.bias) * model.speed_scales, initial=0.0))
        if change <= STEADY * forces:
            return
    raise SolverError(
        f"at t = {bench.time:.6g} s: the drives' motion is not steady: the forces on the free coordinates change "
        "as they go on; hold the drives instead"
    )


def _forces(bench: Bench) -> float:
    """Size of the forces that balance each other in the state evaluated last, as moments [N m].

    Those of inertia, gravity, loads and contacts on each link and what it carries, and those of each load and contact
    alone.  What is left of them along the free coordinates says nothing: in balance that is rounding.
    """
    engine, model = bench.engine, bench.engine.model
    length, sizes = model.mechanism.length, [0.0]
    counts = {m.WRENCH: m.N_LINKS, m.LOAD: m.N_LOADS, m.TOUCH: m.N_CONTACTS}
    for table, count in counts.items():
        rows = engine.table(table, model.arrays.size(count))
        sizes.append(length * float(np.max(np.abs(rows["force"]), initial=0.0)))
    for table in (m.WRENCH, m.LOAD):
        sizes.append(
            float(np.max(np.abs(engine.table(table, model.arrays.size(counts[table]))["moment"]), initial=0.0))
        )
    return max(sizes)
