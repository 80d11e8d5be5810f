"""What became of a case: verdict, how well ledger, loops and friction hold, what it cost, what was said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.artifacts.event_kinds import CLOSING

if TYPE_CHECKING:
    import xarray as xr

#: verdicts
FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"
#: a finished run is wrong when its energy is off by more than this share of the energy that passed through it,
LEDGER = 1e-4
#: when a loop is open by more than this [m],
CLOSURE = 1e-9
#: or when its platform's speed is off by more than this share of the largest, from that of a run at tighter tolerance,
#: before its own horizon, which ends where runs from starts a tolerance apart differ by a tenth of that
DEVIATION = 1e-2


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    reason: of a refusal or a fault, in words.  method: the integrator that made the run; switched: why it took the
    place of the one asked for.  ledger: largest energy error, as a share of the largest energy in the ledger.
    closure: largest opening of a loop [m].  deviation: of the platform's velocity from that of a tighter run, up to
    the horizon, as a share of its largest; not a number where that was not looked for.  horizon_share: how much of the
    run can be believed point by point.  seconds: of processor time.
    """

    verdict: str
    reason: str = ""
    method: str = ""
    switched: str = ""
    ledger: float = float("nan")
    closure: float = float("nan")
    deviation: float = float("nan")
    horizon_share: float = float("nan")
    impacts: int = 0
    peak_force: float = float("nan")
    evaluations: int = 0
    seconds: float = 0.0


def judge(run: xr.Dataset, deviation: float, seconds: float) -> Outcome:
    """The outcome of a finished run."""
    energies = ("kinetic", "potential", "elastic", "dissipated", "drive_work")
    largest = max(float(np.abs(run[name]).max()) for name in energies)
    ledger = float(np.abs(run["energy_error"]).max()) / largest
    closure = float(run["constraint_error"].max())
    start, end = float(run["time"][0]), float(run["time"][-1])
    reason = fault(run, ledger, closure, deviation)
    closings = run["event_kind"].values == CLOSING
    return Outcome(
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
