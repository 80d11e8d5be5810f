"""What each integrator costs and leaves on the mechanism with clearance: the table of docs/integrators.md.

`python -m benchmarks.integrators` prints it; errors are against DOP853 at 1e-13. Largest force, because the paper
prints it; velocity of the platform, in the regular output times.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline import dynamics
from pipeline.core.errors import SolverError
from pipeline.core.integrators import INTEGRATORS
from pipeline.core.progress import silent
from pipeline.core.scene.load import load_scene

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "sps4" / "csj.toml"
#: an impact approaches faster than this [m/s]
IMPACT = 1e-4
ENDS = "at step ends"
RTOLS = (1e-6, 1e-8, 1e-10, 1e-12)
REFERENCE: dict[str, Any] = {"integrator": "dop853", "rtol": 1e-13}


def chosen() -> Iterator[dict[str, Any]]:
    """Solver tables of the rows."""
    for integrator, traits in INTEGRATORS.items():
        for rtol in RTOLS if traits.estimates else ():
            if traits.order > 2 or rtol > min(RTOLS):  # at which order 2 takes millions of steps
                yield {"integrator": integrator, "rtol": rtol}
    for integrator, traits in INTEGRATORS.items():
        for events in ("located", ENDS) if traits.steps else ():
            for step in (1e-5, 1e-6):
                yield {"integrator": integrator, "step": step, "events": events}


def simulate(solver: dict[str, Any]) -> xr.Dataset:
    """One run of the scene; how far its ledger is off is one of the things to see, so that it is not refused."""
    return dynamics.simulate(load_scene(SCENE, {"solver": {**solver, "ledger_tolerance": 1.0}}), {}, silent)


def impact_forces(run: xr.Dataset) -> np.ndarray:
    """Largest force [N] of every impact."""
    hard = (run.event_kind.values == 1) & (run.event_approach_speed.values > IMPACT)
    return run.event_peak_force.values[hard]


def line(solver: dict[str, Any], run: xr.Dataset, known: xr.Dataset) -> str:
    """One row: cost, impacts, errors of forces (share of the largest) and of the platform's velocity [mm/s]."""
    times = np.round(np.arange(0.0, run.time.values[-1], 1e-3), 9)
    velocity = [d.sel(body="platform").sel(time=times, method="nearest").velocity.values for d in (run, known)]
    forces = [impact_forces(d) for d in (run, known)]
    same = len(forces[0]) == len(forces[1])
    force = f"{np.abs(forces[0] - forces[1]).max() / forces[1].max():.1e}" if same else "-"
    speed = f"{1e3 * np.abs(velocity[0] - velocity[1]).max():.1e}"
    return row(solver, str(run.attrs["evaluations"]), f"{len(forces[0])}", force, speed)


def row(solver: dict[str, Any], *cells: str) -> str:
    """A line of the table."""
    steps = f"rtol {solver['rtol']:.0e}" if "rtol" in solver else f"step {solver['step']:.0e} s, {solver['events']}"
    return "| " + " | ".join([solver["integrator"], steps, *cells]) + " |"


def main() -> None:
    """Print the table, a line as soon as it is known."""
    print("| integrator | steps | evaluations | impacts | force error / largest | velocity error mm/s |")
    print("|---|---|---|---|---|---|")
    known = simulate(REFERENCE)
    for solver in chosen():
        try:
            print(line(solver, simulate(solver), known), flush=True)
        except SolverError as error:
            print(row(solver, f"refused: {error}", "", "", ""), flush=True)


if __name__ == "__main__":
    main()
