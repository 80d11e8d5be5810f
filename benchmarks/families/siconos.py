"""A loose slider against Siconos, whose bodies are rigid and whose impacts are those of Newton, at equal error.

Errors are those of the slider's height from the motion of rigid bodies: theirs go to zero with their step, ours with
one over the contact's stiffness. Siconos is a package of Debian and Ubuntu (`apt-get install python3-siconos`) for
their Python, which `FLEXCLEAR_SICONOS` names where it is not `/usr/bin/python3`; without it there are no records.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import errors
from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import Mechanism
from benchmarks.page import Columns, short, table
from benchmarks.rigid_slider import rigid_heights
from benchmarks.timing import in_turn
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import integrate
from flexclear.scene.load import edited, load_scene
from flexclear.stages.scenes import find_scene
from flexclear.system.progress import silent

SCRIPT = Path(__file__).parents[1] / "siconos_crank.py"
#: steps of Siconos [s]; the last one of rubbing contacts is their reference
STEPS = (1e-4, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6, 5e-7)
#: our stiffnesses [N/m^1.5] and tolerances
STIFFNESSES, TOLERANCES = (1e10, 1e11, 1e12, 1e13), (1e-6, 1e-9)
#: coefficients of friction, and the times at which heights are compared [s]: after one impact, and after two
CASES = {"without friction": (0.0, (4e-3, 6e-3)), "with friction, after one impact": (0.01, (4e-3,))}
ROUNDS = 2


class Outcome(NamedTuple):
    """Processor time of the steps [s], and rows of time [s] and height [m]."""

    s: float
    rows: np.ndarray


def _heights(rows: np.ndarray, times: Sequence[float]) -> np.ndarray:
    """Return heights at times."""
    return np.array([rows[np.abs(rows[:, 0] - t).argmin(), 1] for t in times])


def _theirs(step: float, end: float, friction: float) -> Outcome | None:
    """Return what Siconos gives; None where it is not installed."""
    python = os.environ.get("FLEXCLEAR_SICONOS", "/usr/bin/python3")
    given = [str(SCRIPT.with_suffix(".c")), *map(repr, (step, end, friction))]
    hidden = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}
    try:
        done = subprocess.run([python, str(SCRIPT), *given], capture_output=True, text=True, env=hidden)
    except OSError:
        return None
    if "No module named 'siconos'" in done.stderr:
        return None
    found = json.loads(done.stdout.splitlines()[-1])
    return Outcome(found["s"], np.array(found["rows"])[:, :2])


def _ours(friction: float, end: float, stiffness: float, rtol: float) -> Callable[[], Outcome]:
    """Return a function that makes our run."""
    numbers = {"time.end": end, "output.interval": 1e-4, "solver.rtol": rtol, "joint.guide.normal.stiffness": stiffness}
    changes = numbers | ({} if friction else {"joint.guide.friction": None})
    engine = Mechanism("slider", edited(load_scene(find_scene("gallery/loose_slider")), changes), {}).engine()
    start = consistent_start(engine)

    def run() -> Outcome:
        begun = time.process_time()
        rows = integrate(engine, start, silent).rows
        seconds = time.process_time() - begun
        return Outcome(seconds, np.c_[rows[:, 0], errors.sensed(engine, rows, "slider").position[:, 1]])

    return run


def measure(case: Case) -> list[Record]:
    """Return a record for each run of both programs."""
    friction, times = case.of
    end = max(times)
    if _theirs(STEPS[0], end, friction) is None:
        return []
    tasks: dict[Any, Any] = {step: partial(_theirs, step, end, friction) for step in STEPS}
    tasks |= {(k, rtol): _ours(friction, end, k, rtol) for k in STIFFNESSES for rtol in TOLERANCES}
    found = in_turn(tasks, ROUNDS)
    heights = {key: _heights(runs[-1].rows, times) for key, runs in found.items()}
    exact = heights[STEPS[-1]] if friction else rigid_heights(times, (150.0, -75.0), 1e-3, 0.4, 9.81)
    records = list[Record]()
    for key, runs in found.items():
        stiffness, rtol = key if isinstance(key, tuple) else (None, None)
        which = {"by": "flexclear", "stiffness": stiffness, "rtol": rtol} if rtol else {"by": "siconos", "step": key}
        away = 1e6 * float(np.abs(heights[key] - exact).max())
        if away:  # not the reference itself
            records.append(which | {"s": float(np.median([run.s for run in runs])), "away_um": away})
    return records


def show(records: list[Record]) -> str:
    """Return each run of Siconos next to our fastest one that is no worse."""
    rows = []
    for record in records:
        if record["by"] == "siconos":
            mine = [r for r in records if r["case"] == record["case"] and r["by"] == "flexclear"]
            good = [r for r in mine if r["away_um"] <= record["away_um"]]
            rows.append(record | {"ours": min(good, key=lambda r: r["s"]) if good else None})
    return table(rows, COLUMNS)


def _of_ours(name: str) -> Any:
    return lambda record: short(record["ours"][name]) if record["ours"] else ""


COLUMNS: Columns = {
    "case": lambda record: record["case"],
    "step of Siconos [s]": lambda record: f"{record['step']:g}",
    "error [um]": lambda record: short(record["away_um"]),
    "Siconos [ms]": lambda record: short(1e3 * record["s"]),
    "our stiffness [N/m^1.5]": lambda record: f"{record['ours']['stiffness']:g}" if record["ours"] else "",
    "rtol": lambda record: f"{record['ours']['rtol']:g}" if record["ours"] else "",
    "our error [um]": _of_ours("away_um"),
    "ours [ms]": lambda record: short(1e3 * record["ours"]["s"]) if record["ours"] else "",
    "Siconos / ours": lambda record: short(record["s"] / record["ours"]["s"]) if record["ours"] else "",
}

FAMILY = Family(
    what="a loose slider against Siconos at equal error",
    takes="1 min",
    page="benchmarks.md",
    cases=lambda: [Case(name, of) for name, of in CASES.items()],
    measure=each(measure),
    show=show,
    rows=r"1e-0[56] ",
    children=True,
)
