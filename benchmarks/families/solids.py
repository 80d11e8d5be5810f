"""``python -m benchmarks.large_solid [rod|block]``: a large solid to its Craig-Bampton bundle, by stages of the work.

One thread, so that processor seconds are those of the work; docs/structure.md has the numbers.
"""

from __future__ import annotations

# first of all: it pins BLAS to one thread, which NumPy reads when it is imported
import pipeline  # noqa: F401  isort: skip

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from pipeline.core.artifacts.store import write_dataset
from pipeline.structure.kinds.kind import of_recipe
from pipeline.structure.modes import bundle, solve

MATERIAL = {"density": 2740.0, "youngs_modulus": 7.17e10, "poisson": 0.33}
FRAMES = {name: {"on": {"region": region}, "tie": "mean"} for name, region in (("bottom", "start"), ("top", "end"))}
#: the paper's rod with 100 083 displacements, and a compact block, whose factors are the largest for its 295 704
SHAPES: dict[str, dict[str, Any]] = {
    "rod": {
        "type": "cylinder",
        "radius": 0.01,
        "length": 0.24,
        "element": "hex27",
        "cells": {"along": 36, "across": 6, "rings": 3},
    },
    "block": {"type": "block", "size": [0.2, 0.1, 0.1], "element": "hex8", "cells": [71, 36, 36]},
}
COUNT = 13


class Stages:
    """Prints what is done as it begins: seconds of the processor and of the clock so far, largest memory so far."""

    def __init__(self) -> None:
        self._begun = time.process_time(), time.perf_counter()
        self._last = ""

    def __call__(self, share: float | None, text: str) -> None:
        """Progress callback of the stages."""
        if text == self._last:
            return
        self._last = text
        processor, clock = time.process_time() - self._begun[0], time.perf_counter() - self._begun[1]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"{processor:8.1f} s {clock:8.1f} s {memory:6.2f} GiB  {text}", flush=True)


def measure(shape: dict[str, Any]) -> None:
    """Recipe to bundle on the disk."""
    stages = Stages()
    stages(None, "mesh")
    recipe = {"interfaces": list(FRAMES), "shape": shape, "material": MATERIAL, "frames": FRAMES}
    mesh = of_recipe(recipe).build(recipe, Path())
    modes = solve(mesh, "craig-bampton", COUNT, progress=stages)
    stages(None, "inertia integrals")
    reduced = bundle.build(mesh, modes)
    stages(None, "writing")
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(Path(folder) / "bundle.nc", reduced)
    stages(None, f"done: {3 * mesh.sizes['node']} displacements, {reduced.sizes['mode']} coordinates")


def main() -> int:
    """Measure one body or both."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large_solid", description=__doc__)
    parser.add_argument("bodies", nargs="*", help=f"some of {', '.join(SHAPES)}; default: all")
    options = parser.parse_args()
    for name in options.bodies or SHAPES:
        if name not in SHAPES:
            parser.error(f"no body is called {name}")
        print(f"{name}: processor, clock, memory")
        measure(SHAPES[name])
    return 0


if __name__ == "__main__":
    sys.exit(main())
