"""A plan as a dataset, a table, words and a page: decisions, reasons and evidence."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import Agreement
from flexclear.post.answers.effect_sizes import format_difference, join_names
from flexclear.post.plotting.table import Table
from flexclear.scene.output import Schema
from flexclear.scene.output import table as described
from flexclear.scene.plan_decisions import EVIDENCE, NOT_WORTH, Plan

#: variables of a plan; those of quantities are in the unit of each
PLAN: Schema = described("""
influence | effect quantity | | estimated influence of the effect on the quantity, in the quantity's unit
uncertainty | effect quantity | | uncertainty of the estimate, in the quantity's unit
kept | effect | | 1: the planned scene has the effect
evidence | effect | | evidence of the decision
reason | effect | | the decision in words
requested | quantity | | requested accuracy
integration | quantity | | estimated error of the planned run's integration, and of the modes that it leaves out
""")


def dataset(plan: Plan, title: str, units: Mapping[str, str]) -> xr.Dataset:
    """Return effect sizes over (effect, quantity), decisions and evidence by effect, requests by quantity; in SI units.

    units: of the quantities, by name.  nan where nothing was estimated, infinite where nothing bounds it or the events
    differ.
    """
    names, decisions = list(plan.requested), plan.decisions
    uncertainties = [[d.uncertainty.get(n, 0.0 if n in d.estimate else np.nan) for n in names] for d in decisions]
    planned = {
        "gone": [effect.name for effect in plan.removed_effects],
        "modes": dict(plan.modes),
        **({"integrator": plan.integrator, "rtol": plan.rtol} if plan.integrator else {}),
        **({"ledger_tolerance": plan.ledger_tolerance} if plan.ledger_tolerance is not None else {}),
        "uncoupled": list(plan.uncoupled),
        "constant": list(plan.constant),
    }
    values = {
        "influence": np.reshape([[d.estimate.get(n, np.nan) for n in names] for d in decisions], (-1, len(names))),
        "uncertainty": np.reshape(uncertainties, (-1, len(names))),
        "kept": np.array([d.kept for d in decisions], dtype=np.int8),
        "evidence": _texts(d.evidence for d in decisions),
        "reason": _texts(d.reason for d in decisions),
        "requested": np.array(list(plan.requested.values())),
        "integration": np.array([plan.integration.get(name, np.nan) for name in names]),
    }
    return xr.Dataset(
        {name: (PLAN[name].dims, value, {"long_name": PLAN[name].long_name}) for name, value in values.items()},
        coords={
            "effect": _texts(d.effect.name for d in decisions),
            "words": ("effect", _texts(d.effect.words for d in decisions)),
            "quantity": _texts(names),
            "unit": ("quantity", _texts(units[name] for name in names)),
        },
        attrs={
            "Conventions": "CF-1.11",
            "title": title,
            "planned": json.dumps(planned, sort_keys=True),
            "evaluations": plan.evaluations,
            "runs": plan.runs,
        },
    )


def _texts(words: Iterable[str]) -> np.ndarray:
    return np.array(list(words), dtype=object)


def upper_bounds(planned: xr.Dataset) -> xr.Dataset:
    """Return the upper bounds of a plan's effect sizes, as the chart takes them."""
    most = planned["influence"] + planned["uncertainty"].fillna(0.0)
    return xr.Dataset({"dropped": most, "dropped_uncertainty": 0.0 * most}, {"unit": planned["unit"]})


def table(planned: xr.Dataset) -> Table:
    """Tabulate decision, evidence and reason of each effect, and its estimated size in each quantity."""
    names = [str(name) for name in planned["quantity"].values]
    units = [str(unit) for unit in planned["unit"].values]
    rows = []
    for i, effect in enumerate(planned["words"].values):
        part = planned.isel(effect=i)
        cells = [
            format_difference(float(part["influence"][k]), float(np.nan_to_num(part["uncertainty"][k])), unit)
            for k, unit in enumerate(units)
        ]
        decision = "keep" if int(part["kept"]) else "drop"
        rows.append((str(effect), decision, *cells, EVIDENCE[str(part["evidence"].values)], str(part["reason"].values)))
    requested = [
        format_difference(float(value), 0.0, unit)
        for value, unit in zip(planned["requested"].values, units, strict=True)
    ]
    rows.append(("requested", "", *requested, "", ""))
    decided = json.loads(planned.attrs["planned"])
    notes = [plan_in_words(planned)]
    notes += [f"{name} retains {count} of its modes, which suffice." for name, count in decided["modes"].items()]
    if decided["uncoupled"]:
        notes.append(
            f"Not integrated, since the requested quantities do not depend on it: {join_names(decided['uncoupled'])}."
        )
    notes += _unplanned_quantities(decided)
    notes.append(
        f"{_integration_sentence(decided)} The plan is based on {planned.attrs['runs']} short runs, "
        f"{planned.attrs['evaluations']:,} evaluations."
    )
    return Table(
        "Effects that the requested accuracy requires",
        ("effect", "decision", *names, "evidence", "why"),
        tuple(rows),
        tuple(notes),
    )


def _unplanned_quantities(decided: Mapping[str, Any]) -> list[str]:
    """Return a sentence that lists the watched quantities for which nothing is planned; else nothing."""
    names = decided["constant"]
    if not names:
        return []
    verb = "never changes" if len(names) == 1 else "never change"
    return [
        f"Left out: {join_names(names)}, which {verb} in the ideal mechanism; [accuracy] takes an absolute accuracy."
    ]


def _integration_sentence(decided: Mapping[str, Any]) -> str:
    """Return a sentence on integrator and tolerance of the planned run."""
    if "integrator" not in decided:
        return "No other integrator or tolerance is cheaper and as accurate as requested: the scene's own is used."
    return f"The planned run is integrated by {decided['integrator']} at a relative tolerance of {decided['rtol']:.0e}."


def plan_in_words(planned: xr.Dataset) -> str:
    """Return the plan in a sentence or two, for a designer."""
    needed, unseen, gone = _effects_by_decision(planned)
    keeps = f" {planned.attrs['staying']}" if planned.attrs.get("staying") else ""
    asked = " and ".join(str(name) for name in planned["quantity"].values)
    if not needed and not unseen:
        without = join_names(gone)
        return f"For the requested accuracy of {asked} the ideal mechanism suffices: {without} may be omitted.{keeps}"
    left = f"{join_names(gone)} may be omitted" if gone else "nothing may be omitted" if not unseen else ""
    parts = [f"{join_names(needed)} must be modelled" if needed else "", left]
    parts += [f"{join_names(unseen)} {'is' if len(unseen) == 1 else 'are'} modelled unexamined" if unseen else ""]
    return f"For the requested accuracy of {asked}: {'; '.join(filter(None, parts))}.{keeps}"


MET, MET_TO_HORIZON, MISSED, UNDECIDED = "met", "met to the horizon", "missed", "not decided"


def verdict(one: Agreement) -> str:
    """Return met where error plus chance is below the allowed error, missed where certainly above, else not decided."""
    if one.is_met:
        return MET if one.horizon == 1.0 else MET_TO_HORIZON
    return MISSED if one.is_missed else UNDECIDED


def verification_table(planned: xr.Dataset) -> Table:
    """Tabulate the true distance of the planned run from the full one, next to the requested one."""
    rows = []
    for k, name in enumerate(planned["quantity"].values):
        unit, one = str(planned["unit"].values[k]), agreement_of(planned, k)
        requested = format_difference(float(planned["requested"][k]), 0.0, unit)
        rows.append((str(name), requested, format_difference(one.error, one.chance, unit), _verdict(planned, k)))
    notes = [
        f"Evaluations of the equations of motion: {int(planned.attrs['full_evaluations']):,} in full, "
        f"{int(planned.attrs['planned_evaluations']):,} as planned"
        + (f", of {planned.attrs['members']} members each." if planned.attrs["members"] else "."),
        "For runs with contacts, the number after ± may be due to chance (Student's t of the members' means).",
    ]
    return Table(
        "The plan against the full scene", ("quantity", "requested", "true error", "verdict"), tuple(rows), tuple(notes)
    )


def agreement_of(planned: xr.Dataset, k: int) -> Agreement:
    """Return the agreement in the k-th quantity of a verified plan."""
    return Agreement(*(float(planned[name][k]) for name in ("error", "chance", "allowed", "horizon")))


def _verdict(planned: xr.Dataset, k: int) -> str:
    """Return the verdict on one quantity; beyond the horizon the scatter of single runs; members that decide it."""
    one, unit = agreement_of(planned, k), str(planned["unit"].values[k])
    result, reasons = verdict(one), list[str]()
    if result == MISSED:
        return f"missed, {one.error / one.allowed:.2g} times the allowed error" if one.allowed else result
    if one.horizon < 1.0:
        reasons.append(
            f"after {one.horizon:.0%} of the time runs of the full scene from slightly different starts differ by "
            f"{format_difference(float(planned['scatter'][k]), 0.0, unit)}"
            + (", and the means differ by less" if result == MET_TO_HORIZON else "")
        )
    enough = one.deciding_members(planned.attrs["members"])
    if result == UNDECIDED and np.isfinite(enough):
        reasons.append(f"{int(np.ceil(enough))} members would decide")
    return f"{result}: {'; '.join(reasons)}" if reasons else result


def _effects_by_decision(result: xr.Dataset) -> tuple[list[str], list[str], list[str]]:
    """Return effects in words: those needed, those that stay without evidence, and those that may be left out."""
    rows = list(zip(result["words"].values, result["kept"].values, result["reason"].values, strict=True))
    return (
        [str(w) for w, recorded, reason in rows if recorded and reason != NOT_WORTH],
        [str(w) for w, recorded, reason in rows if recorded and reason == NOT_WORTH],
        [str(w) for w, recorded, _ in rows if not recorded],
    )
