"""The list of cases: one parameter at a time over its range, and random points of all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.stability.mechanism import Parameters

#: seed of the random points; other seeds give other cases of the same kind
SEED = 20190310
RANDOM = 200
#: Craig-Bampton counts that cut no pair of equal frequencies: 6 static modes and pairs, torsion, axial
MODES = (0, 6, 8, 10, 11, 13, 15, 30)
#: ranges over which single parameters are varied; logarithmic ones by decades
RANGES: dict[str, tuple[float, ...]] = {
    "clearance": tuple(np.geomspace(1e-6, 2e-3, 14).tolist()),
    "stiffness": tuple(np.geomspace(1e-2, 1e4, 13).tolist()),
    "restitution": tuple(np.linspace(0.0, 1.0, 11).tolist()),
    "friction": tuple(np.linspace(0.0, 0.5, 11).tolist()),
    "speed": tuple(np.geomspace(0.1, 20.0, 10).tolist()),
    "mass": tuple(np.geomspace(1e-3, 1e3, 13).tolist()),
    "modes": MODES,
    "damping": (0.0, 0.001, 0.005, 0.01, 0.02, 0.05),
    "nearness": (0.0, *(1.0 - np.geomspace(1e-1, 1e-6, 6)).tolist()),
    "joints": (1, 2, 3, 4, 5),
    "strokes": (1, 10, 100),
}
#: the parameter that another one needs to mean anything
ALONG: dict[str, dict[str, Any]] = {"damping": {"modes": 13}}


@dataclass(frozen=True)
class Case:
    """A point of the atlas: which sweep it belongs to, and its parameters."""

    sweep: str
    parameters: Parameters


def cases(seed: int = SEED, count: int = RANDOM) -> list[Case]:
    """All single sweeps and `count` random points."""
    return [*_sweeps(), *_random(seed, count)]


def _sweeps() -> Iterator[Case]:
    for name, values in RANGES.items():
        base = replace(Parameters(), **ALONG.get(name, {}))
        for value in values:
            change: dict[str, Any] = {name: value}
            yield Case(name, replace(base, **change))


def _random(seed: int, count: int) -> Iterator[Case]:
    """Every parameter uniform over its range (logarithmic where it spans decades); flexible rods in one of four."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        flexible = random.random() < 0.25
        yield Case(
            "random",
            Parameters(
                clearance=float(np.exp(random.uniform(np.log(1e-6), np.log(2e-3)))),
                stiffness=float(np.exp(random.uniform(np.log(1e-2), np.log(1e4)))),
                restitution=float(random.uniform(0.0, 1.0)),
                friction=float(random.choice([0.0, random.uniform(0.0, 0.5)])),
                speed=float(np.exp(random.uniform(np.log(0.1), np.log(20.0)))),
                mass=float(np.exp(random.uniform(np.log(1e-3), np.log(1e3)))),
                modes=int(random.choice(MODES[1:6])) if flexible else 0,
                damping=float(random.uniform(0.0, 0.05)) if flexible else 0.0,
                nearness=float(1.0 - 10.0 ** random.uniform(-6.0, 0.0)),
                joints=int(random.integers(1, 6)),
            ),
        )
