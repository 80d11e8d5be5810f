"""Cost and errors of each integrator on the mechanism with clearance, against DOP853 at a tolerance of 1e-13.

Errors are those of the largest force of every impact, which the paper prints, and of the platform's velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.family import REFUSED, Case, Family, Measured, Record
from benchmarks.page import Columns, table
from flexclear import dynamics
from flexclear.artifacts.quantities import IMPACT
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.load import load_scene
from flexclear.stages.scenes import find_scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent

SCENE = "sps4/csj"
RTOLS = (1e-6, 1e-8, 1e-10, 1e-12)
REFERENCE: dict[str, Any] = {"integrator": "dop853", "rtol": 1e-13}
#: velocities are compared at multiples of this time [s]
GRID = 1e-3


def cases() -> list[Case]:
    """Return solver tables as cases: adaptive steps of every integrator that has them, then fixed steps."""
    found: list[dict[str, Any]] = []
    for integrator, traits in INTEGRATORS.items():
        # at the tightest tolerance a method of order 2 takes millions of steps
        rtols = RTOLS[: None if traits.order > 2 else -1] if traits.estimates else ()
        found += [{"integrator": integrator, "rtol": rtol} for rtol in rtols]
    for integrator, traits in INTEGRATORS.items():
        for events in ("located", "at step ends") if traits.steps else ():
            found += [{"integrator": integrator, "step": step, "events": events} for step in (1e-5, 1e-6)]
    return [Case(f"{solver['integrator']}, {steps(solver)}", solver) for solver in found]


def steps(solver: dict[str, Any]) -> str:
    """Return in words how the steps of a solver table are chosen."""
    return f"rtol {solver['rtol']:.0e}" if "rtol" in solver else f"step {solver['step']:.0e} s, {solver['events']}"


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each solver table: cost, impacts, errors."""
    known = _run(REFERENCE)
    for case in cases:
        try:
            found = _errors(_run(case.of), known)
        except SolverError as error:
            found = {"verdict": REFUSED, "reason": str(error)}
        yield case, [{**case.of, **found}]


def _run(solver: dict[str, Any]) -> xr.Dataset:
    """Return one run; the loose ledger tolerance keeps inaccurate runs from being refused."""
    scene = load_scene(find_scene(SCENE), {"solver": {**solver, "ledger_tolerance": 1.0}})
    return dynamics.simulate(scene, {}, silent)


def _errors(run: xr.Dataset, known: xr.Dataset) -> Record:
    """Return cost and errors of a run; the force error is a fraction of the largest, None for other impacts."""
    times = np.round(np.arange(0.0, run.time.values[-1], GRID), 9)
    velocity = [d.sel(body="platform").sel(time=times, method="nearest").velocity.values for d in (run, known)]
    forces = [_forces(d) for d in (run, known)]
    same = len(forces[0]) == len(forces[1])
    return {
        "evaluations": int(run.attrs["evaluations"]),
        "impacts": len(forces[0]),
        "force_error": float(np.abs(forces[0] - forces[1]).max() / forces[1].max()) if same else None,
        "velocity_mm_s": float(1e3 * np.abs(velocity[0] - velocity[1]).max()),
    }


def _forces(run: xr.Dataset) -> np.ndarray:
    """Return the largest force [N] of every impact."""
    hard = (run.event_kind.values == "closing") & (run.event_approach_speed.values > IMPACT)
    return run.event_peak_force.values[hard]


#: a dash where forces cannot be compared
COLUMNS: Columns = {
    "integrator": lambda r: r["integrator"],
    "steps": steps,
    "evaluations": lambda r: str(r.get("evaluations", f"refused: {r.get('reason')}")),
    "impacts": lambda r: str(r.get("impacts", "")),
    "force error / largest": lambda r: f"{r['force_error']:.1e}" if r.get("force_error") is not None else "-",
    "velocity error mm/s": lambda r: f"{r['velocity_mm_s']:.1e}" if "velocity_mm_s" in r else "",
}


FAMILY = Family(
    what="cost and errors of every integrator with clearance",
    takes="2 min",
    page="integrators.md",
    cases=cases,
    measure=measure,
    show=lambda records: table(records, COLUMNS),
    rows="rtol 1e-10|1e-05 s, at step ends",
    quick="dopri5, rtol 1e-06",
    times=False,
)
