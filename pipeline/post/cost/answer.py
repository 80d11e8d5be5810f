"""What accuracy costs, in a paragraph: the scene's own error and cost, the next digit, and what limits the error."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.post.cost.causes import CAUSES
from flexclear.pipeline.post.cost.price import cheapest


def sentences(study: xr.Dataset) -> str:
    """In words; study: of `stages.cost_study`."""
    return " ".join(filter(None, (_own(study), _digit(study), _looser(study), _cause(study), _undone(study))))


def _worst(study: xr.Dataset) -> tuple[str, float]:
    errors = study["own_error"].values
    k = int(np.argmax(errors))
    return str(study["quantity"].values[k]), float(errors[k])


def _own(study: xr.Dataset) -> str:
    name, error = _worst(study)
    setting = (
        f"rtol {study.attrs['own_rtol']:g}" if "own_rtol" in study.attrs else f"steps of {study.attrs['own_step']:g} s"
    )
    took = (
        f"With {study.attrs['own_integrator']} at {setting} the integration takes {study.attrs['own_seconds']:.2g} s "
        f"of processor time ({study.attrs['own_evaluations']:.0f} evaluations)."
    )
    until = "" if study.attrs["horizon"] == "none" else f" up to the horizon, t = {study.attrs['horizon']:.3g} s,"
    if not np.isfinite(error):
        return f"{took} Its error cannot be said: other runs{until} have another number of impacts ({name})."
    return f"{took} Its largest error{until} is {error:.1e} of a quantity's size ({name})."


def _digit(study: xr.Dataset) -> str:
    """What one more digit costs."""
    _, error = _worst(study)
    better = cheapest(study, 0.1 * error) if np.isfinite(error) else None
    if better is None:
        return "One more digit was not reached within the budget." if np.isfinite(error) else ""
    return f"One more digit costs {better.seconds / study.attrs['own_seconds']:.2g} times as much ({better.name})."


def _looser(study: xr.Dataset) -> str:
    """Whether another setting is as accurate for less."""
    _, error = _worst(study)
    same = cheapest(study, error) if np.isfinite(error) else None
    if same is None or same.seconds > 0.7 * study.attrs["own_seconds"]:
        return ""
    return f"{same.name} is as accurate for {same.seconds / study.attrs['own_seconds']:.2g} times the cost."


def _cause(study: xr.Dataset) -> str:
    """Which cause limits the error, of those that were examined, for the quantity that has the largest one."""
    if "error_by_cause" not in study:
        return ""
    largest = study["error_by_cause"].max("quantity")
    known = {str(c): float(v) for c, v in zip(study["cause"].values, largest.values, strict=True) if not np.isnan(v)}
    if not known:
        return ""
    first = max(known, key=lambda cause: known[cause])
    others = ", ".join(f"{cause} {value:.0e}" for cause, value in known.items() if cause != first)
    size = f"{known[first]:.0e}" if np.isfinite(known[first]) else "other impacts"
    rest = f"; {others}" if others else ""
    missing = [cause for cause in ("mesh", "modal truncation") if cause not in known]
    unseen = f" Not examined: {' and '.join(missing)} (flexclear cost --models)." if missing and len(known) else ""
    return f"The largest cause of error is {first} ({size}{rest}); what helps is {CAUSES[first]}.{unseen}"


def _undone(study: xr.Dataset) -> str:
    return f"Not run within the budget: {study.attrs['undone']}." if study.attrs.get("undone") else ""
