"""One case of the atlas, from its parameters to what became of it."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import processes
from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Measured, Record
from benchmarks.stability.scenes import Parameters, scene, sweep
from flexclear.commands.scenes import Workplace, bundles, open_workplace
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.quantity import parse
from flexclear.pipeline.core.system.errors import FlexclearError, SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.core.workflow.progress import Monitor
from flexclear.pipeline.core.workflow.task import in_order
from flexclear.pipeline.dynamics.run.run import engine_of
from flexclear.stages.graph import Graph

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene

#: processor time of a case after which it counts as hanging [s]; the dearest takes a fifth of it
LIMIT = 600
#: how much tighter the run is that a finished one is compared with, and runs so dear are not made twice
TIGHTER, TWICE = 1e-2, 300_000
TIGHTEST = 1e-14
#: a finished run is wrong when its energy is off by more than this share of the energy that passed through it,
LEDGER = 1e-4
#: when a loop is open by more than this [m],
CLOSURE = 1e-9
#: or when its platform's speed is off by more than this share of the largest, from that of a run at tighter tolerance,
#: before its own horizon, which ends where a run and its perturbed run separate by a tenth of that
DEVIATION = 1e-2


def modules(case: Case) -> set[str]:
    """What decides about a case: its scene, the dynamics, the stages before them, and the parts that it names."""
    tasks = in_order([Graph(scene(case.of), shown=False).simulate])
    named = {name for task in tasks for name in (*task.modules, task.run.partition(":")[0])}
    return {scene.__module__, "flexclear.pipeline.dynamics", *named}


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each case; one that hangs or dies is an outcome, too."""
    for case, found in processes.outcomes(list(cases), jobs, run_case, LIMIT):
        yield case, [{"sweep": sweep(case.name), "parameters": asdict(case.of), **found}]


def run_case(parameters: Parameters, compiled: Callable[[], None] = lambda: None) -> Record:
    """What becomes of a case.

    Refusals are outcomes; anything else that goes wrong is a fault of the program and listed as such.
    compiled: called when the kernels are there, so that a limit of time may begin.
    """
    begun = time.process_time()
    try:
        described = scene(parameters)
        reduced = bundles(described, _place())
        engine_of(described, reduced, silent)
        compiled()
        begun = time.process_time()
        run = dynamics.simulate(described, reduced, silent)
        seconds = time.process_time() - begun
        return judge(run, _deviation(parameters, described, run), seconds)
    except SolverError as error:
        return {"verdict": REFUSED, "reason": str(error), "seconds": time.process_time() - begun}
    except Exception as error:  # the atlas reports faults, it does not stop at them
        reason = f"{type(error).__name__}: {error}"
        return {"verdict": WRONG, "reason": reason, "seconds": time.process_time() - begun}


@cache
def _place() -> Workplace:
    """The usual one, for as long as this process lives; nobody watches it."""
    return replace(open_workplace(), monitor=Monitor(io.StringIO()))


def _deviation(parameters: Parameters, described: Scene, run: xr.Dataset) -> float:
    """Largest difference of the platform's velocity from that of a tighter run, up to the horizon, over its largest.

    Not a number where the run is too dear to be made twice, or the tighter one cannot be had.
    """
    if int(run.attrs["evaluations"]) > TWICE:
        return float("nan")
    tight_scene = scene(parameters, max(TIGHTEST, described.solver.rtol * TIGHTER))
    try:
        tight = dynamics.simulate(tight_scene, bundles(tight_scene, _place()), silent)
    except FlexclearError:
        return float("nan")
    velocity = parse("platform.velocity", described.owners())
    until = min(float(run["horizon"]), float(tight["horizon"]))
    return quantities.error(run, tight, velocity, until) / quantities.scale(run, velocity)


def judge(run: xr.Dataset, deviation: float, seconds: float) -> Record:
    """The outcome of a finished run.

    method: the integrator that made the run; switched: why it took the place of the one asked for.  ledger: largest
    energy error, as a share of the largest energy in the ledger.  closure: largest opening of a loop [m].  deviation:
    of the platform's velocity from that of a tighter run, up to the horizon, as a share of its largest; not a number
    where that was not looked for.  horizon_share: how much of the run can be believed point by point.  seconds: of
    processor time.
    """
    energies = ("kinetic", "potential", "elastic", "dissipated", "drive_work")
    largest = max(float(np.abs(run[name]).max()) for name in energies)
    ledger = float(np.abs(run["energy_error"]).max()) / largest
    closure = float(run["constraint_error"].max())
    start, end = float(run["time"][0]), float(run["time"][-1])
    reason = fault(run, ledger, closure, deviation)
    closings = run["event_kind"].values == "closing"
    return dict(
        verdict=WRONG if reason else FINISHED,
        reason=reason,
        method=str(run.attrs["method"]),
        switched=str(run.attrs.get("switched", "")),
        ledger=ledger,
        closure=closure,
        deviation=deviation,
        horizon_share=(float(run["horizon"]) - start) / (end - start),
        impacts=int(closings.sum()),
        peak_force=float(run["event_peak_force"].values[closings].max(initial=0.0)),
        evaluations=int(run.attrs["evaluations"]),
        seconds=seconds,
    )


def fault(run: xr.Dataset, ledger: float, closure: float, deviation: float) -> str:
    """What is wrong with a finished run, in words; empty when nothing is."""
    # an event that is no closing has no peak, so that its columns have gaps on purpose
    series = [name for name in run.data_vars if not str(name).startswith("event_")]
    if not all(np.isfinite(run[name]).all() for name in series):
        return "values that are not finite"
    if not ledger <= LEDGER:
        return f"energy off by {ledger:.1e} of the largest energy"
    if not closure <= CLOSURE:
        return f"a loop open by {closure:.1e} m"
    if "contact_friction_power" in run and float(run["contact_friction_power"].max()) > 0.0:
        return "friction feeds energy in"
    if deviation > DEVIATION:
        return f"velocity off by {deviation:.1e} of the largest before the horizon"
    return ""
