"""What accuracy costs, in a paragraph: the scene's own error and cost, the next digit, and what limits the error."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.post.cost.causes import CAUSES
from flexclear.pipeline.post.cost.price import Choice, cheapest, choices

#: a setting that is as accurate as the scene's own is named where it costs less than this fraction
CHEAPER = 0.7


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
    horizon = study.attrs["horizon"]
    whole = horizon == "none" or horizon >= study.attrs["end"]
    until = "" if whole else f" up to the horizon, t = {horizon:.3g} s,"
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
    if same is None or same.evaluations > CHEAPER * study.attrs["own_evaluations"]:
        return ""
    if same.seconds > CHEAPER * study.attrs["own_seconds"]:
        return ""
    return f"{same.name} is as accurate for {same.seconds / study.attrs['own_seconds']:.2g} times the cost."


def _cause(study: xr.Dataset) -> str:
    """Which cause limits the error, of those that were looked at, for the quantity that has the largest one."""
    if "error_by_cause" not in study:
        return ""
    largest = study["error_by_cause"].max("quantity")
    known = {str(c): float(v) for c, v in zip(study["cause"].values, largest.values, strict=True) if not np.isnan(v)}
    if not known:
        return ""
    first = max(known, key=lambda cause: known[cause])
    others = ", ".join(f"{cause} {value:.0e}" for cause, value in known.items() if cause != first and value > 0.0)
    size = f"{known[first]:.0e}" if np.isfinite(known[first]) else "other impacts"
    rest = f"; {others}" if others else ""
    missing = [cause for cause in ("mesh", "modal truncation") if cause not in known and study.attrs["flexible"]]
    unseen = f" Not looked at: {' and '.join(missing)} (flexclear cost --models)." if missing and len(known) else ""
    helps = ", which the root finder bounds" if first == "event location" else f"; what helps is {CAUSES[first]}"
    return f"The largest cause of error is {first} ({size}{rest}){helps}.{unseen}"


def _undone(study: xr.Dataset) -> str:
    return f"Not run within the budget: {study.attrs['undone']}." if study.attrs.get("undone") else ""


def figure(name: str, study: xr.Dataset, title: str) -> dict[str, bytes]:
    """``<name>.png`` and ``.svg``: the largest error of any quantity against processor time, this scene as a star."""
    from flexclear.pipeline.post.cost.work_precision import LOOKS
    from flexclear.pipeline.post.plotting import style

    by_method: dict[str, list[Choice]] = {}
    for choice in choices(study):
        by_method.setdefault(choice.name.partition(",")[0], []).append(choice)
    with style.style():
        made, axes = style.grid(1, 1, (6.4, 3.6))
        panel = axes[0, 0]
        for method, result in by_method.items():
            shown = sorted((c.seconds, c.error) for c in result if np.isfinite(c.error) and c.error > 0.0)
            color, mark = LOOKS.get(method, ("#6b6b6b", "x"))
            panel.plot(*np.array(shown).reshape(-1, 2).T, mark, color=color, ls="-", lw=1.0, ms=5, label=method)
        _, error = _worst(study)
        if np.isfinite(error):
            panel.plot(study.attrs["own_seconds"], error, "*", color="#222222", ms=13, label="this scene", zorder=5)
        unsure = float(study["reference_uncertainty"].max())
        if np.isfinite(unsure) and unsure > 0.0:
            panel.axhline(unsure, color="#6b6b6b", lw=0.9, ls=":", label="uncertainty of the tightest run")
        panel.set(xscale="log", yscale=style.scale_of(panel), xlabel="processor time of the integration (s)")
        panel.set_ylabel("largest relative error")
        style.plain(panel.xaxis)
        panel.legend(fontsize=8)
        style.heading(made, title)
        return style.files(name, made)
