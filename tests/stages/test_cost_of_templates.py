"""What accuracy costs, for each template: how soon there is an answer, and whether its errors are right."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.commands import cost
from flexclear.commands.new import KINDS, write
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.stages import simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace, open_workplace

#: of two processors in 30 s and in two minutes [s]; compiling is included
FIRST, ALL = 60.0, 240.0
#: a tolerance tighter by so much makes the reference of the other method converged next to the scene's own run
TIGHTER, TIGHTEST = 1e-3, 1e-13
#: what the study's errors may be wrong by: they are maxima over a few hundred outputs, which both runs share
FACTOR = 2.0
#: smaller errors are rounding, which the closures of the mechanisms magnify
ROUNDING = 1e-11


def _spent() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    return sum(os.times()[:4])


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS))
def test_the_first_answer_comes_soon_and_its_errors_are_those_of_a_converged_run_of_another_method(
    kind: str, tmp_path: Path, fresh: Path
):
    scene, workplace = load_scene(write(kind, tmp_path)[0]), open_workplace()
    workplace = Workplace(workplace.store, workplace.sources, jobs=1)
    begun, first = _spent(), list[float]()
    study = cost.bring(scene, workplace, answered=lambda made: first.append(_spent() - begun)).dataset()
    print(f"{kind}: first answer after {first[0]:.1f} s of processor time, done after {_spent() - begun:.1f} s")
    assert first[0] <= FIRST
    assert _spent() - begun <= ALL

    own, rtol = str(study.attrs["own_integrator"]), float(study.attrs["own_rtol"])
    other = {"integrator": "dop853" if own != "dop853" else "dopri5", "rtol": max(TIGHTER * rtol, TIGHTEST)}
    mine, reference = (_run(scene, workplace, solver) for solver in ({"integrator": own, "rtol": rtol}, other))
    until = study.attrs["horizon"] if study.attrs["horizon"] != "none" else np.inf
    chosen = scene.requested() if scene.accuracy is not None else scene.watched()
    for q in chosen:
        if not q.over_time:
            continue
        reported = float(study["own_error"].sel(quantity=q.name))
        true = quantities.error(mine, reference, q, until) / (quantities.scale(reference, q) or 1.0)
        print(f"{kind} {q.name}: error {reported:.2e}, by {other['integrator']} {true:.2e}")
        assert reported <= FACTOR * true + ROUNDING
        assert true <= FACTOR * reported + ROUNDING


def _run(scene: Scene, workplace: Workplace, solver: dict[str, Any]) -> xr.Dataset:
    """The scene's run by a method, without a horizon of its own."""
    variant = edited(scene, {"solver": solver, "accuracy": None, "ensemble": None})
    bodies = Graph(variant, shown=False).bodies()
    outcome = workplace.bring(list(bodies.values()))
    inputs = {name: workplace.store.load(outcome.records[task]) for name, task in bodies.items()}
    filled = simulation.rebuild(simulation.params(variant), inputs)
    return dynamics.simulate(filled, simulation.bundles(inputs), silent)
