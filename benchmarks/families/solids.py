"""Cost of a large solid from its recipe to its Craig-Bampton bundle on the disk, by parts of the work.

The work uses one thread, so that processor seconds measure it.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.family import Case, Family, Record, each
from flexclear.artifacts.store import write_dataset
from flexclear.post.plotting.table import pipe_table
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from flexclear.system.platforms import peak_memory

MATERIAL = {"density": 2740.0, "youngs_modulus": 7.17e10, "poisson": 0.33}
FRAMES = {name: {"on": {"region": region}, "tie": "mean"} for name, region in (("bottom", "start"), ("top", "end"))}
#: the paper's rod with 100 083 displacements, and a compact block with 295 704 and the largest factors
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
#: parts of the work in their order, and the text with which the stages report the beginning of each
PARTS = {
    "mesh and assembly": "mesh",
    "static shapes": "static shapes",
    "factorisation": "factorising",
    "normal modes": "normal modes",
    "counting them, by another factorisation": "checking that no mode was missed",
    "compliances, free body to compare with, error bounds": "compliance of the full model",
    "inertia integrals and writing": "inertia integrals",
}


class Parts:
    """Processor seconds by part of the work; earlier work that a part repeats counts for that part."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(PARTS, 0.0)
        self._now, self._since = 0, time.process_time()

    def __call__(self, fraction: float | None, text: str) -> None:
        """Receive the progress of the stages."""
        now = time.process_time()
        self.seconds[list(PARTS)[self._now]] += now - self._since
        self._since = now
        self._now = max([self._now, *(k for k, words in enumerate(PARTS.values()) if words in text)])


def _body(case: Case) -> list[Record]:
    """Return the seconds by part, and the peak memory so far."""
    shape, parts, begun = case.of, Parts(), time.process_time()
    recipe = {"interfaces": list(FRAMES), "shape": shape, "material": MATERIAL, "frames": FRAMES}
    mesh = kind.build(recipe, Path())
    modes = solve(mesh, "craig-bampton", COUNT, progress=parts)
    parts(None, "inertia integrals")
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(Path(folder) / "bundle.nc", bundle.build(mesh, modes))
    parts(None, "done")
    sizes = {"cells": f"{shape['element'].removeprefix('hex')}-node cells", "displacements": 3 * mesh.sizes["node"]}
    whole = {"together": time.process_time() - begun, "gibibytes": peak_memory() / 2**30}
    return [{**sizes, "seconds": parts.seconds, **whole}]


def show(records: list[Record]) -> str:
    """Return a table with one column for each body."""
    rows = [["displacements", *(f"{r['displacements']:,}".replace(",", " ") for r in records)]]
    rows += [[part, *(f"{r['seconds'][part]:.0f}" for r in records)] for part in PARTS]
    rows.append(["together", *(f"{r['together']:.0f}" for r in records)])
    rows.append(["most memory", *(f"{r['gibibytes']:.1f} GiB" for r in records)])
    return pipe_table(("", *(f"{r['case']}, {r['cells']}" for r in records)), rows)


FAMILY = Family(
    what="large solids from the recipe to the bundle, by parts of the work",
    takes="11 min, 7 GiB of memory",
    page="structure.md",
    cases=lambda: [Case(name, shape) for name, shape in SHAPES.items()],
    measure=each(_body),
    show=show,
    rows="displacements|normal modes|counting|together|memory",
)
