"""The horizon that one perturbed run gives against that of an ensemble, in random mechanisms with a loose joint."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.artifacts.quantities import PERTURBATION
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.post.single_run.series import horizon
from tests.properties.mechanisms import Table
from tests.properties.movable import Setting, scene
from tests.properties.movable_planar import LOOPS, loop, planar

#: a clearance that lets mechanisms of 0.2 m have ten to a hundred impacts in two seconds [m]
CLEARANCE, END, MEMBERS = 6e-4, 2.0, 8
CLOSED = ("four-bar", "five-bar", "Watt's six-bar")


def falling(seed: int) -> Table:
    """A mechanism that swings under gravity: an open chain for every third seed, else a closed loop."""
    random = np.random.default_rng([11, seed])
    if seed % 3 == 0:
        links = int(random.integers(2, 5))
        points = np.cumsum(np.vstack([np.zeros(2), random.uniform(-1.0, 1.0, (links - 1, 2))]), axis=0)
        pairs = [(k, k + 1) for k in range(links)]
        made = planar(random, "chain", links + 1, pairs, points, loose=[int(random.integers(links))])
    else:
        name = CLOSED[seed % 9 // 3]
        made = loop(random, name, loose=[int(random.integers(len(LOOPS[name][1])))])
    written = scene(
        made,
        random,
        Setting(size=0.2, density=200.0),
        load={"gravity": {"type": "gravity", "acceleration": [0, -9.81, 0]}},
        solver={"integrator": "dop853", "rtol": 1e-8},
        output={"interval": 2e-3},
        time={"end": END},
    )
    for joint in written["joint"].values():
        if "clearance" in joint:
            joint["clearance"] = CLEARANCE
    return written


def horizons(seeds: Iterable[int]) -> np.ndarray:
    """Horizons [s] of each mechanism: by its perturbed run and by members as far away from the start."""
    made = []
    for seed in seeds:
        table = falling(seed)
        alone = dynamics.simulate(Scene.model_validate(table), {}, silent)
        requested = {"members": MEMBERS, "perturbation": PERTURBATION * CLEARANCE}
        members = dynamics.ensemble(Scene.model_validate(table | {"ensemble": requested}), {}, silent)
        made.append((float(alone.horizon), horizon(members.time.values, members.velocity.values)))
    return np.array(made)


def agreeing(seeds: Iterable[int]) -> tuple[int, int]:
    """Numbers of mechanisms whose horizons are within a factor of two of each other, and of diverging ensembles."""
    alone, members = horizons(seeds).T
    return int(np.sum(np.abs(np.log2(alone / members)) <= 1.0)), int(np.sum(members < END))


# one perturbed run is one draw, an ensemble's spread the largest of eight: they differ in a few mechanisms
def test_the_perturbed_run_diverges_when_the_ensemble_does() -> None:
    agree, diverged = agreeing(range(9, 21))
    assert diverged >= 3
    assert agree >= 10  # of 12


@pytest.mark.slow
def test_so_it_is_in_sixty_mechanisms() -> None:
    agree, diverged = agreeing(range(60))
    assert diverged >= 20  # 28 here
    assert agree >= 54  # 57 here
