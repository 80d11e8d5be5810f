"""Stability of a run: checks with value, limit, verdict and remedy, and a figure of the errors over time."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.artifacts.quantities import SEPARATED
from flexclear.post.cost.study import methods
from flexclear.post.overview.curves import size_of
from flexclear.post.plotting import style
from flexclear.post.single_run.series import horizon_sentence
from flexclear.scene import integrators

#: largest error of the energy balance, as a fraction of the largest change of any energy
ENERGY = 1e-3
#: largest opening of loops, as a fraction of the mechanism's extent
LOOPS = 1e-6
#: values below this are rounding
ROUNDING = 1e-15
#: largest disagreement with runs at other tolerances and by other methods, as a fraction of each quantity's size
AGREEMENT = 0.01
#: largest fractions of rejected steps, and of steps limited by stability
REJECTED, STIFF = 0.3, 0.3
#: condition number of the closures above which a singular pose is near
CONDITION = 1e6


@dataclass(frozen=True)
class Check:
    """One check in words.  good: True when the value is within its limit."""

    name: str
    value: str
    limit: str
    good: bool
    remedy: str

    @property
    def verdict(self) -> str:
        """Verdict in words."""
        return "good" if self.good else "note"

    @property
    def advice(self) -> str:
        """The remedy where one is needed."""
        return "–" if self.good else self.remedy


def checks(
    run: xr.Dataset, study: xr.Dataset | None, members: float | None = None, *, by_need: bool = False
) -> list[Check]:
    """Return all checks of a run and of its cost study, or of the run alone for None.

    members: horizon of the scene's ensemble [s], or None.  by_need: True when the program chose the integrator.
    """
    agreement = [] if study is None else _agreement_checks(study, _remedy_for_steps(run))
    result = [_energy_check(run), *_loop_checks(run), *agreement, _rejected_steps(run), _stiffness_check(run, by_need)]
    return [*result, *_condition_checks(run), *_predictability_checks(run, members)]


def lost_energy(run: xr.Dataset) -> np.ndarray:
    """Return the error of the energy balance beyond rounding, as a fraction of the exchanged energy, shape (time,)."""
    missed, rounding = np.abs(run["energy_error"].values), float(run.attrs["energy_rounding"])
    return np.where(missed > rounding, missed / max(float(run.attrs["exchanged_energy"]), rounding), 0.0)


def _drift(run: xr.Dataset) -> np.ndarray | None:
    """Return the opening of loops, as a fraction of the mechanism's extent, shape (time,); None without loops."""
    if "constraint_error" not in run or "condition" not in run:
        return None
    extent = float(np.linalg.norm(np.ptp(run["position"].values.reshape(-1, 3), axis=0))) or 1.0
    return np.asarray(np.abs(run["constraint_error"].values) / extent)


def _energy_check(run: xr.Dataset) -> Check:
    fraction = float(lost_energy(run).max())
    value = f"{fraction:.1e} of the largest energy"
    return Check("energy balance", value, f"{ENERGY:g}", fraction < ENERGY, _remedy_for_steps(run))


def _remedy_for_steps(run: xr.Dataset) -> str:
    """Return what makes the steps of a run more exact, and its key."""
    step = json.loads(run.attrs.get("parameters", "{}")).get("solver", {}).get("step")
    return "a tighter tolerance: [solver] rtol" if step is None else "shorter steps: [solver] step"


def _loop_checks(run: xr.Dataset) -> list[Check]:
    """Check the drift of closed loops; empty without loops."""
    if (drift := _drift(run)) is None:
        return []
    fraction = float(drift.max())
    value = f"{fraction:.1e} of the extent" if fraction > ROUNDING else "rounding"
    return [Check("drift of closed loops", value, f"{LOOPS:g}", fraction < LOOPS, "a tighter tolerance")]


def _agreement_checks(study: xr.Dataset, remedy: str) -> list[Check]:
    """Check agreement with half and a tenth of the tolerance, and with another family of methods, up to the horizon."""
    result = []
    for method, setting, one in methods(study):
        known = one.isel(run=np.isfinite(one["distance"].values).all(axis=1))
        settings = known[setting].values
        if method == study.attrs["own_integrator"]:
            fraction = settings / float(study.attrs[f"own_{setting}"])
            shown = np.flatnonzero((fraction > 0.05) & (fraction < 0.9))
        else:
            shown = np.arange(len(settings))[-1:]  # the tightest one
        for k in shown:
            values = known["distance"].values[k]
            worst = int(np.argmax(values))
            value, unit, which = (float(values[worst]), *(str(study[n].values[worst]) for n in ("unit", "quantity")))
            name = f"agreement with {known['run'].values[k]}"
            text = f"{value:.1e} of the {size_of(unit)} of {which}"
            result.append(Check(name, text, f"{AGREEMENT:g}", value < AGREEMENT, remedy))
    return result


def _rejected_steps(run: xr.Dataset) -> Check:
    steps, rejected = float(run.attrs.get("steps", 0)), float(run.attrs.get("rejected_steps", 0))
    fraction = rejected / max(steps + rejected, 1.0)
    remedy = "another integrator, or a tighter tolerance"
    return Check("rejected steps", f"{100.0 * fraction:.2g} %", f"{100.0 * REJECTED:g} %", fraction < REJECTED, remedy)


def _stiffness_check(run: xr.Dataset, by_need: bool) -> Check:
    fraction, chosen = float(run.attrs.get("stiff_share", 0.0)), by_need or "method_reason" in run.attrs
    limit = "none: the integrator was chosen by its cost" if chosen else f"{100.0 * STIFF:g} %"
    remedy = f'an implicit integrator: [solver] integrator = "{integrators.STIFF}"'
    name = "steps limited by stability"
    return Check(name, f"{100.0 * fraction:.2g} %", limit, chosen or fraction < STIFF, remedy)


def _condition_checks(run: xr.Dataset) -> list[Check]:
    if "condition" not in run:
        return []
    worst = int(np.argmax(run["condition"].values))
    value, time = float(run["condition"][worst]), float(run["time"][worst])
    text = f"condition number {value:.2g} at t = {time:.4g} s"
    return [
        Check("distance from singular poses", text, f"{CONDITION:.0e}", value < CONDITION, "pass the pose at speed")
    ]


def _predictability_checks(run: xr.Dataset, members: float | None) -> list[Check]:
    if "horizon" not in run:
        return []
    end = float(run["time"][-1])
    horizon = min(float(run["horizon"]), end if members is None else members)
    return [
        Check(
            "predictability",
            f"up to t = {horizon:.4g} s",
            f"{end:.4g} s, the end",
            horizon >= end,
            "beyond it, means over members: [ensemble]",
        )
    ]


def answer(run: xr.Dataset, result: list[Check], members: float | None = None) -> str:
    """Return the result of all checks in words.  members: as in `checks`."""
    bad = [check for check in result if not check.good and check.name != "predictability"]
    disagreeing = [check for check in bad if check.name.startswith("agreement")]
    bad = [check for check in bad if check not in disagreeing[1:]]  # one is enough in words, the table has the others
    text = (
        f"Yes: all {len(result)} checks hold."
        if all(check.good for check in result)
        else "The integration is stable: all its checks hold."
        if not bad
        else "Not in all checks: " + "; ".join(f"{c.name} ({c.value}, limit {c.limit}): {c.remedy}" for c in bad) + "."
    )
    if "horizon" in run:
        text += " " + horizon_sentence(float(run["horizon"]), float(run["time"][-1]), members)
    return text


def figure(run: xr.Dataset) -> dict[str, bytes]:
    """Draw ``stability.png`` and ``.svg``: errors of energy and loops over time, with limits, and the separation."""
    panels = [("energy error", "fraction of the largest energy", run["time"].values, lost_energy(run), ENERGY)]
    drift = _drift(run)
    if drift is not None and drift.max(initial=0.0) > ROUNDING:
        panels.append(("drift of closed loops", "fraction of the extent", run["time"].values, drift, LOOPS))
    if "separation" in run:
        times, values = run["separation_time"].values, run["separation"].values
        panels.append(("distance of a perturbed run", "fraction of each motion", times, values, SEPARATED))
    with style.set_style():
        figure, axes = style.grid(1, len(panels), (3.6 * len(panels), 2.9))
        for axis, (title, label, time, values, limit) in zip(axes.ravel(), panels, strict=True):
            shown = np.where(values > 0.0, values, np.nan)
            axis.plot(1e3 * time, shown, color="#0072B2", lw=1.0)
            axis.axhline(limit, color="#D55E00", lw=1.2, label="limit")
            axis.set(yscale="log", title=title, xlabel="time (ms)", ylabel=label)
            low = float(np.nanmin(shown)) if np.isfinite(shown).any() else limit * 1e-3
            axis.set_ylim(max(low, 1e-18) * 0.5, None)
        axes.ravel()[0].legend(fontsize=8)
        return style.files("stability", figure)
