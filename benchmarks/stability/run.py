"""Every case once: did it finish, how well do ledger and closures hold, what did it cost, what was said."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stability.cases import Case

#: how much tighter the run is that a finished one is compared with, and cases so dear are not run twice
TIGHTER, TWICE = 1e-2, 600_000
#: verdicts
FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"
#: a finished run is wrong when its energy is off by more than this share of the energy that passed through it,
#: a loop is open by more than this [m], or friction feeds energy in
LEDGER, CLOSURE = 1e-4, 1e-9


@dataclass(frozen=True)
class Result:
    """What became of a case.

    deviation: of the platform's position from that of a tighter run, up to the horizon, over the clearance.
    """

    sweep: str
    verdict: str
    reason: str
    method: str
    ledger: float
    closure: float
    deviation: float
    horizon_share: float
    impacts: int
    evaluations: int
    seconds: float

    @classmethod
    def none(cls, sweep: str, verdict: str, reason: str, seconds: float) -> Result:
        """A case without a run."""
        nothing = float("nan")
        return cls(sweep, verdict, reason, "", nothing, nothing, nothing, nothing, 0, 0, seconds)


def run_all(cases: list[Case], jobs: int) -> Iterator[tuple[Case, Result]]:
    """Results as they come, in the order of the cases, over `jobs` processes."""
    with ProcessPoolExecutor(jobs) as pool:
        yield from zip(cases, pool.map(run_case, cases), strict=True)


def run_case(case: Case) -> Result:
    """One case; refusals are results, anything else that goes wrong is a fault of the program and is told as such."""
    from benchmarks.stability.mechanism import scene
    from pipeline.core.errors import SolverError

    begun = time.perf_counter()
    try:
        run = _simulate(scene(case.parameters))
    except SolverError as error:
        return Result.none(case.sweep, REFUSED, str(error), time.perf_counter() - begun)
    except Exception as error:  # the atlas reports faults, it does not stop at them
        return Result.none(case.sweep, WRONG, f"{type(error).__name__}: {error}", time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    return _result(case, run, seconds)


def _simulate(scene: Any) -> Any:
    from pipeline import dynamics

    return dynamics.simulate(scene, _bundles(scene), lambda share, text: None)


def _bundles(scene: Any) -> dict[str, Any]:
    from pipeline.core.scene.load import read_toml
    from pipeline.structure.fe import mesh
    from pipeline.structure.modes import bundle, solve

    found = {}
    for name, body in scene.flexible().items():
        grid = mesh.build(read_toml(Path(body.mesh)))
        found[name] = bundle.build(grid, solve(grid, body.modes.reference, body.modes.count, body.modes.interfaces))
    return found


def _result(case: Case, run: Any, seconds: float) -> Result:
    energy = max(
        float(np.abs(run[name]).max()) for name in ("kinetic", "potential", "elastic", "dissipated", "drive_work")
    )
    ledger = float(np.abs(run["energy_error"]).max()) / energy
    closure = float(run["constraint_error"].max())
    end, horizon = float(run["time"][-1]), float(run["horizon"])
    deviation = _deviation(case, run)
    return Result(
        sweep=case.sweep,
        verdict=WRONG if (reason := _fault(run, ledger, closure)) else FINISHED,
        reason=reason,
        method=str(run.attrs.get("method", "dop853")),
        ledger=ledger,
        closure=closure,
        deviation=deviation,
        horizon_share=horizon / end,
        impacts=int((run["event_kind"] == 1).sum()),
        evaluations=int(run.attrs["evaluations"]),
        seconds=seconds,
    )


def _fault(run: Any, ledger: float, closure: float) -> str:
    """What is wrong with a finished run, in words; empty when nothing is."""
    if not all(np.isfinite(run[name]).all() for name in run.data_vars if not str(name).startswith("event_")):
        return "values that are not finite"
    if not ledger <= LEDGER:
        return f"energy off by {ledger:.1e} of the largest energy"
    if not closure <= CLOSURE:
        return f"a loop open by {closure:.1e} m"
    if "contact_friction_power" in run and float(run["contact_friction_power"].max()) > 0.0:
        return "friction feeds energy in"
    return ""


def _deviation(case: Case, run: Any) -> float:
    """Distance of the platform from that of a run at tighter tolerance, up to the horizon, over the clearance."""
    from benchmarks.stability.mechanism import scene
    from pipeline.core import quantities
    from pipeline.core.errors import FlexclearError

    if int(run.attrs["evaluations"]) > TWICE:
        return float("nan")
    given = scene(case.parameters)
    try:
        tight = _simulate(scene(case.parameters, given.solver.rtol * TIGHTER))
    except FlexclearError:
        return float("nan")
    position = quantities.parse("platform.position", given.owners())
    until = min(float(run["horizon"]), float(tight["horizon"]))
    return quantities.error(run, tight, position, until) / case.parameters.clearance


def row(case: Case, result: Result) -> dict[str, Any]:
    """Parameters and result in one flat table row."""
    return {"sweep": case.sweep, **asdict(case.parameters), **{k: v for k, v in asdict(result).items() if k != "sweep"}}
