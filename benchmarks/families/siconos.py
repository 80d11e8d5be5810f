"""A loose slider and a four-bar with three loose pins against Siconos, at equal error.

Its bodies are rigid, and its impacts those of Newton and Coulomb. Errors are those of a body's height from the motion
of rigid bodies (`benchmarks.rigid_impacts`): theirs go to zero with their step, ours with one over the contact's
stiffness. Siconos is a package of Debian and Ubuntu (`apt-get install python3-siconos`) for their Python, which
`FLEXCLEAR_SICONOS` names where it is not `/usr/bin/python3`; without it there are no records.
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
from benchmarks.rigid_impacts import rigid_four_bar, rigid_heights
from benchmarks.timing import in_turn
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import integrate
from flexclear.scene.load import edited, load_scene
from flexclear.stages.scenes import find_scene
from flexclear.system.progress import silent

SCRIPT = Path(__file__).parents[1] / "siconos_model.py"
#: steps of Siconos [s]
STEPS = (1e-4, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6, 5e-7)
#: our stiffnesses [N/m^1.5] and tolerances
STIFFNESSES, TOLERANCES = (1e11, 1e12, 1e13, 1e14, 1e15), (1e-6, 1e-9)
ROUNDS = 2


class Compared(NamedTuple):
    """A mechanism: its name and friction in Siconos; here its scene, what is changed, and the body.

    times: at which heights are compared [s].  exact: heights by the laws of rigid bodies, at times.
    """

    name: str
    friction: float
    scene: str
    changes: Callable[[float], dict[str, Any]]
    body: str
    times: tuple[float, ...]
    exact: Callable[[Sequence[float]], np.ndarray]

    def source(self) -> str:
        """Return the path of the C functions of the mechanism."""
        return str(SCRIPT.with_name(f"siconos_{self.name}.c"))


def slider(friction: float, *times: float) -> Compared:
    """Return the slider-crank of Flores, Leine & Glocker (2010)."""

    def changes(stiffness: float) -> dict[str, Any]:
        return {"joint.guide.normal.stiffness": stiffness} | ({} if friction else {"joint.guide.friction": None})

    def exact(times: Sequence[float]) -> np.ndarray:
        return rigid_heights(times, (150.0, -75.0), 1e-3, 0.4, 9.81, friction)

    return Compared("crank", friction, "gallery/loose_slider", changes, "slider", times, exact)


def four_bar(*times: float) -> Compared:
    """Return a four-bar that falls, with loose pins B, C and D."""

    def changes(stiffness: float) -> dict[str, Any]:
        pin = load_scene(find_scene("checks/clearance_four_bar")).joint["C"].model_dump(mode="json", exclude_none=True)
        normal = {"law": "flores", "delivered_restitution": 0.8, "stiffness": stiffness}
        ends = {"B": ["crank.B", "coupler.B"], "C": ["coupler.C", "rocker.C"], "D": ["ground.D", "rocker.D"]}
        loose = pin | {"normal": normal, "friction": None}
        return {f"joint.{name}": loose | {"between": between} for name, between in ends.items()}

    exact = partial(rigid_four_bar, restitution=0.8)
    return Compared("four_bar", 0.0, "checks/clearance_four_bar", changes, "rocker", times, exact)


CASES = {
    "slider without friction, two impacts": slider(0.0, 4e-3, 6e-3),
    "slider with friction, one impact": slider(0.01, 4e-3),
    "four-bar with three loose pins": four_bar(8e-3, 10e-3, 12e-3, 14e-3, 16e-3),
}


class Outcome(NamedTuple):
    """Processor time of the steps [s], and rows of time [s] and height [m]."""

    s: float
    rows: np.ndarray


def _heights(rows: np.ndarray, times: Sequence[float]) -> np.ndarray:
    """Return heights at times."""
    return np.array([rows[np.abs(rows[:, 0] - t).argmin(), 1] for t in times])


def _theirs(of: Compared, step: float) -> Outcome | None:
    """Return what Siconos gives; None where it is not installed."""
    python = os.environ.get("FLEXCLEAR_SICONOS", "/usr/bin/python3")
    given = [of.name, of.source(), *map(repr, (step, of.times[-1], of.friction))]
    hidden = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}
    try:
        done = subprocess.run([python, str(SCRIPT), *given], capture_output=True, text=True, env=hidden)
    except OSError:
        return None
    if "No module named 'siconos'" in done.stderr:
        return None
    found = json.loads(done.stdout.splitlines()[-1])
    return Outcome(found["s"], np.array(found["rows"])[:, :2])


def _ours(of: Compared, stiffness: float, rtol: float) -> Callable[[], Outcome]:
    """Return a function that makes our run."""
    numbers = {"time.end": of.times[-1], "output.interval": 1e-4, "solver.rtol": rtol}
    scene = edited(load_scene(find_scene(of.scene)), numbers | of.changes(stiffness))
    engine = Mechanism(of.name, scene, {}).engine()
    start = consistent_start(engine)

    def run() -> Outcome:
        begun = time.process_time()
        rows = integrate(engine, start, silent).rows
        seconds = time.process_time() - begun
        return Outcome(seconds, np.c_[rows[:, 0], errors.sensed(engine, rows, of.body).position[:, 1]])

    return run


def measure(case: Case) -> list[Record]:
    """Return a record for each run of both programs."""
    of = CASES[case.name]
    if _theirs(of, STEPS[0]) is None:
        return []
    tasks: dict[Any, Any] = {step: partial(_theirs, of, step) for step in STEPS}
    tasks |= {(k, rtol): _ours(of, k, rtol) for k in STIFFNESSES for rtol in TOLERANCES}
    found, exact = in_turn(tasks, ROUNDS), of.exact(of.times)
    records = list[Record]()
    for key, runs in found.items():
        stiffness, rtol = key if isinstance(key, tuple) else (None, None)
        which = {"by": "flexclear", "stiffness": stiffness, "rtol": rtol} if rtol else {"by": "siconos", "step": key}
        away = 1e6 * float(np.abs(_heights(runs[-1].rows, of.times) - exact).max())
        records.append(which | {"s": float(np.median([run.s for run in runs])), "away_um": away})
    return records


def show(records: list[Record]) -> str:
    """Return each run of Siconos next to our fastest one that is no worse, and our errors over the stiffness."""
    rows, away = [], dict[float, Record]()
    for record in records:
        if record["by"] == "siconos":
            mine = [r for r in records if r["case"] == record["case"] and r["by"] == "flexclear"]
            good = [r for r in mine if r["away_um"] <= record["away_um"]]
            rows.append(record | {"ours": min(good, key=lambda r: r["s"]) if good else None})
        elif record["rtol"] == min(TOLERANCES):
            away.setdefault(record["stiffness"], {})[record["case"]] = record["away_um"]
    columns: dict[str, Callable[[Record], str]] = {"our stiffness [N/m^1.5]": lambda row: f"{row['stiffness']:g}"}
    columns |= {f"error [um], {case}": partial(_of_case, case) for case in CASES}
    return "\n\n".join([table(rows, COLUMNS), table([{"stiffness": k} | row for k, row in away.items()], columns)])


def _of_case(case: str, row: Record) -> str:
    return short(row[case]) if case in row else ""


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
    what="a loose slider and a four-bar with three loose pins against Siconos at equal error",
    takes="2 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in CASES],
    measure=each(measure),
    show=show,
    rows=r"(pins|impacts?) +\| +(0\.0001|1e-0[56]) ",
    children=True,
)
