"""Table 9: largest errors of the FAR-CSJ model against the ideal model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.deviations import Deviation, ensemble_deviations, max_deviation
from flexclear.papers.wang_wang_2019.models import (
    CSJ,
    FAR_CSJ,
    FAR_CSJ_CB,
    FAR_CSJ_FIXED,
    FAR_CSJ_FREE,
    IDEAL,
    JOINT,
    PLATFORM,
    Model,
    believed_until,
    references,
)
from flexclear.papers.wang_wang_2019.plotting.error_table import MEANING, Column, heads, paper, rows, several, single
from flexclear.papers.wang_wang_2019.published import TABLE9
from flexclear.pipeline.post.plotting.table import Table, files

NEEDS = (
    *references((IDEAL, *FAR_CSJ), "run", "tight"),
    *references((CSJ, *FAR_CSJ), "post"),
    *references(FAR_CSJ, "ensemble"),
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table09.csv and table09.md: within the horizon one run, over the whole stroke the ensemble."""
    columns: list[Column] = []
    for model, name in ((FAR_CSJ_FREE, "free-free"), (FAR_CSJ_FIXED, "fixed-fixed")):
        columns += [paper(f"paper, {name}", TABLE9[name]), *_ours(name, model, data)]
    columns += _ours("Craig-Bampton (added)", FAR_CSJ_CB, data)
    notes = (
        "A single run means something point by point only up to its horizon (the time in the column's head): "
        "there the members of an ensemble, "
        "which differ by a tiny offset of the ball at the start, begin to differ visibly. Over the whole "
        "stroke the table gives mean ± "
        "standard deviation, over the members, of each member's largest error.",
        _against_paper(data),
        _peaks(data),
        _accelerations(data),
        MEANING,
    )
    return files(
        "table09", Table("Table 9: largest errors, ideal model and FAR-CSJ model", heads(columns), rows(columns), notes)
    )


def _ours(name: str, model: Model, data: dict[str, xr.Dataset]) -> list[Column]:
    horizon = believed_until(data[f"{model.scene}:post"])
    inside, tighter = (
        max_deviation(data[f"{model.scene}:{run}"], data[f"{IDEAL.scene}:{run}"], PLATFORM, horizon)
        for run in ("run", "tight")
    )
    head = f"ours, {name}, to {1e3 * inside.until:.1f} ms"
    return [single(head, inside, tighter), several(f"ours, {name}, whole stroke", _members(model, data))]


def _members(model: Model, data: dict[str, xr.Dataset]) -> list[Deviation]:
    return ensemble_deviations(data[f"{model.scene}:ensemble"], data[f"{IDEAL.scene}:run"], PLATFORM)


def _against_paper(data: dict[str, xr.Dataset]) -> str:
    """In how many standard deviations the paper's single values lie from the ensembles' means."""
    texts = []
    for model, name in ((FAR_CSJ_FREE, "free-free"), (FAR_CSJ_FIXED, "fixed-fixed")):
        velocity = 1e3 * np.array([member.velocity for member in _members(model, data)])
        texts.append(f"{name} {velocity.mean() / TABLE9[name].velocity:.2f}")
    return (
        f"Mean largest velocity error over the paper's: {', '.join(texts)}; as in Table 8 it is a prediction. The "
        "paper's values are one run each, at a fixed step, of a motion that does not repeat under tiny changes; "
        "agreement of more than the magnitude would be chance. Angle and displacement are the clearance times "
        "sensitivities that are fitted to Table 8."
    )


def _peaks(data: dict[str, xr.Dataset]) -> str:
    """Largest contact forces: the ensembles' and the rigid CSJ run's."""
    texts = [f"CSJ {float(data[f'{CSJ.scene}:post'].peak_force.sel(contact=JOINT)):.0f} N"]
    for model in FAR_CSJ:
        peak = data[f"{model.scene}:ensemble"].peak_force.sel(contact=JOINT).values
        texts.append(f"{model.label.removeprefix('FAR-CSJ, ')} {peak.mean():.0f} ± {peak.std(ddof=1):.0f} N")
    return (
        f"Largest contact forces: {'; '.join(texts)}. What softens an impact is how far the mode set lets the rod be "
        "compressed between its joints; the three sets differ in just that."
    )


def _accelerations(data: dict[str, xr.Dataset]) -> str:
    """Largest vertical accelerations of the platform: the ensembles' and the rigid CSJ run's."""
    rigid = float(data[f"{CSJ.scene}:post"].peak_acceleration.sel(body=PLATFORM, axis="z"))
    texts = [f"CSJ {rigid:.0f} m/s²"]
    for model in FAR_CSJ:
        peak = data[f"{model.scene}:ensemble"].peak_acceleration.sel(body=PLATFORM, axis="z").values
        texts.append(f"{model.label.removeprefix('FAR-CSJ, ')} {peak.mean():.0f} ± {peak.std(ddof=1):.0f} m/s²")
    return (
        f"Largest vertical accelerations of the platform: {'; '.join(texts)}. They lie inside impacts, where the "
        "motion "
        "is recorded at the largest force and penetration of each contact besides the regular outputs."
    )
