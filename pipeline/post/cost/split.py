"""The error of a scene as it is, separated by cause: each from a pair of runs that differ in that cause only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.post.cost.statistics import relative_error
from flexclear.pipeline.post.cost.study import Point, believed, relative

#: half the width of a normal distribution's 95 % interval, in standard deviations
NORMAL_95 = 1.96


def causes_of(
    quantity: Quantity,
    points: Sequence[Point],
    runs: Mapping[str, xr.Dataset],
    located: float,
    ensemble: xr.Dataset | None = None,
) -> dict[str, float]:
    """Relative error by cause (names of `causes.CAUSES`); NaN where the scene has no such cause.

    located: fraction of the clearance to which contact events are located.  ensemble: at the tightest tolerance, of a
    scene that has one; its spread is that of the whole run, all other errors are those up to the horizon.
    """
    there = [p for p in points if "refused" not in runs[p.key].attrs]
    asis = next((runs[p.key] for p in there if p.group == "sampling" and p.key == "as it is"), None)
    reference = next(runs[p.key] for p in there if p.group == "reference")
    growth = 0.0 if asis is None else float(asis.attrs.get("growth", 0.0))
    until = believed(there, runs)
    size = quantities.scale(reference, quantity)

    def between(a: xr.Dataset | None, b: xr.Dataset | None) -> float:
        if a is None or b is None:
            return np.nan
        return relative(quantities.error(a, b, quantity, until), size)

    model = [p for p in there if p.group == "model"]
    base = _model(model, runs, _own)
    return {
        "mesh": between(base, _model(model, runs, _finest_mesh)),
        "beam theory": between(base, _model(model, runs, _other_theory)),
        "modal truncation": between(base, _model(model, runs, _most_modes)),
        "time integration": between(asis, reference),
        "event location": _location(quantity, reference, located, size, growth),
        "sampling of the output": _sampling(quantity, asis, there, runs, size),
        "ensemble spread": _spread(quantity, ensemble, size),
    }


Choice = Callable[[Sequence[Point]], Point | None]


def _model(points: Sequence[Point], runs: Mapping[str, xr.Dataset], choice: Choice) -> xr.Dataset | None:
    chosen = choice(points) if points else None
    return None if chosen is None else runs[chosen.key]


def _own(points: Sequence[Point]) -> Point | None:
    """The scene's own mode set, modes, mesh and theory."""
    return next((p for p in points if p.factors.get("own")), None)


def _most_modes(points: Sequence[Point]) -> Point | None:
    """The most modes of a statically complete set, on the scene's own mesh and with its theory."""
    own = _own(points)
    if own is None:
        return None
    same = [p for p in points if all(p.factors[f] == own.factors[f] for f in ("theory", "elements"))]
    complete = [p for p in same if p.factors["mode_set"] == "craig-bampton"] or same
    return max(complete, key=lambda p: p.factors["modes"])


def _finest_mesh(points: Sequence[Point]) -> Point | None:
    own = _own(points)
    finer = [p for p in points if own is not None and p.factors["elements"] > own.factors["elements"]]
    return max(finer, key=lambda p: p.factors["elements"], default=None)


def _other_theory(points: Sequence[Point]) -> Point | None:
    """Shear-flexible beams, the theory with the fewest assumptions."""
    own = _own(points)
    if own is None or own.factors["theory"] == "timoshenko":
        return None
    return next((p for p in points if p.factors["theory"] == "timoshenko"), None)


def _location(quantity: Quantity, reference: xr.Dataset, located: float, size: float, growth: float) -> float:
    """Bound from the root finder's tolerance: a displacement of that size, grown as the perturbed run's does."""
    if "clearance" not in reference.attrs:
        return np.nan
    displacement = located * float(reference.attrs["clearance"])
    if quantity.kind == "velocity":
        return growth * located
    if quantity.kind == "impact_times":
        speed = reference["event_approach_speed"].values[reference["event_kind"].values == "closing"]
        hard = speed[speed > quantities.IMPACT]
        return relative(displacement / float(hard.min()), size) if len(hard) else np.nan
    return np.nan


def _sampling(
    quantity: Quantity, asis: xr.Dataset | None, points: Sequence[Point], runs: Mapping[str, xr.Dataset], size: float
) -> float:
    """What the largest value changes when the output is denser; events are located, not sampled."""
    denser = next((runs[p.key] for p in points if p.key == "denser output"), None)
    if asis is None or denser is None or not quantity.over_time:
        return np.nan
    return relative(abs(quantities.scale(denser, quantity) - quantities.scale(asis, quantity)), size)


def _spread(quantity: Quantity, ensemble: xr.Dataset | None, size: float) -> float:
    """Half the 95 % interval of the members' mean: by bootstrap of peaks, 1.96 standard errors of series."""
    if ensemble is None:
        return np.nan
    if quantity.kind == "peak_force":
        return relative_error(ensemble["peak_force"].sel(contact=quantity.owner).values.astype(float))
    if quantity.name in ensemble["quantity"].values:
        return relative(NORMAL_95 * float(ensemble["standard_error"].sel(quantity=quantity.name)), size)
    return np.nan
