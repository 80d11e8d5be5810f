"""A plan as a dataset, a table, words and a page: what was decided, why, and what it rests on."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.pipeline.core.decisions import EVIDENCE, Plan
from flexclear.pipeline.post.effect_sizes import written
from flexclear.pipeline.post.plotting.table import Table


def dataset(plan: Plan, title: str, units: Mapping[str, str]) -> xr.Dataset:
    """Influences over (effect, quantity), decisions and evidence over effects, what is requested over quantities; SI.

    units: of the quantities, by name.  nan where nothing was estimated, infinite where nothing bounds it or the events
    differ.
    """
    names = list(plan.requested)
    shape = (len(plan.decisions), len(names))
    estimate, doubt = (np.full(shape, np.nan) for _ in range(2))
    for i, decision in enumerate(plan.decisions):
        for k, name in enumerate(names):
            estimate[i, k] = decision.estimate.get(name, np.nan)
            doubt[i, k] = decision.uncertainty.get(name, 0.0 if name in decision.estimate else np.nan)
    meshes = list(plan.meshes.values())
    planned = {
        "gone": [effect.name for effect in plan.gone],
        "modes": dict(plan.modes),
        "integrator": plan.integrator,
        "rtol": plan.rtol,
        **({"ledger_tolerance": plan.ledger_tolerance} if plan.ledger_tolerance is not None else {}),
        "apart": list(plan.apart),
    }
    plan_dataset = xr.Dataset(
        {
            "influence": (("effect", "quantity"), estimate),
            "uncertainty": (("effect", "quantity"), doubt),
            "kept": (("effect",), np.array([int(d.kept) for d in plan.decisions], dtype=np.int8)),
            "evidence": (("effect",), np.array([d.evidence for d in plan.decisions], dtype=object)),
            "reason": (("effect",), np.array([d.reason for d in plan.decisions], dtype=object)),
            "wanted": (("quantity",), np.array([plan.requested[name] for name in names])),
            "integration": (("quantity",), np.array([plan.integration.get(name, np.nan) for name in names])),
            "elements": (("body",), np.array([m.given for m in meshes], dtype=np.int64)),
            "elements_called_for": (("body",), np.array([m.called_for for m in meshes], dtype=np.int64)),
            "mesh_frequency_error": (("body",), np.array([m.frequency for m in meshes], dtype=float)),
            "mesh_compliance_error": (("body",), np.array([m.compliance for m in meshes], dtype=float)),
            "mesh_error": (
                ("body", "quantity"),
                np.array([[m.error[name] for name in names] for m in meshes], dtype=float).reshape(-1, len(names)),
            ),
        },
        coords={
            "body": np.array(list(plan.meshes), dtype=object),
            "effect": np.array([d.effect.name for d in plan.decisions], dtype=object),
            "words": ("effect", np.array([d.effect.words for d in plan.decisions], dtype=object)),
            "quantity": np.array(names, dtype=object),
            "unit": ("quantity", np.array([units[name] for name in names], dtype=object)),
        },
        attrs={
            "Conventions": "CF-1.11",
            "title": title,
            "planned": json.dumps(planned, sort_keys=True),
            "dearer": plan.dearer,
            "evaluations": plan.evaluations,
            "runs": plan.runs,
        },
    )
    meanings = {
        "influence": "estimated influence of the effect on the quantity, in the quantity's unit",
        "uncertainty": "what the estimate may be wrong by",
        "kept": "1: the planned scene has the effect",
        "evidence": "what the decision rests on",
        "reason": "the decision in words",
        "wanted": "accuracy that the scene asks for",
        "integration": "estimated error of the planned run's integration, and of the modes that it leaves out",
        "elements": "finite elements of the body",
        "elements_called_for": "finite elements that the requested accuracy calls for",
        "mesh_frequency_error": "largest error of a kept frequency due to the mesh, as a fraction",
        "mesh_compliance_error": "largest error of the frames' compliance due to the mesh, as a fraction",
        "mesh_error": "estimated error of the quantity due to the body's mesh, at most, in the quantity's unit",
    }
    for name, text in meanings.items():
        plan_dataset[name].attrs = {"long_name": text}
    return plan_dataset


def drawn(planned: xr.Dataset) -> xr.Dataset:
    """What the chart of influences takes of a plan."""
    return xr.Dataset(
        {"dropped": planned["influence"] + planned["uncertainty"].fillna(0.0)},
        coords={"effect": planned["effect"], "quantity": planned["quantity"], "unit": planned["unit"]},
    )


def table(planned: xr.Dataset) -> Table:
    """Decision, evidence and reason of each effect, and its estimated influence on each quantity."""
    names = [str(name) for name in planned["quantity"].values]
    units = [str(unit) for unit in planned["unit"].values]
    rows = []
    for i, effect in enumerate(planned["words"].values):
        part = planned.isel(effect=i)
        cells = [
            written(float(part["influence"][k]), float(np.nan_to_num(part["uncertainty"][k])), unit)
            for k, unit in enumerate(units)
        ]
        decision = "keep" if int(part["kept"]) else "drop"
        rows.append((str(effect), decision, *cells, EVIDENCE[str(part["evidence"].values)], str(part["reason"].values)))
    requested = [written(float(value), 0.0, unit) for value, unit in zip(planned["wanted"].values, units, strict=True)]
    rows.append(("wanted", "", *requested, "", ""))
    decided = json.loads(planned.attrs["planned"])
    notes = [words(planned)]
    notes += [
        f"{name} keeps {count} of its modes, which do the same as all." for name, count in decided["modes"].items()
    ]
    notes += [_of_mesh(planned.sel(body=body), units) for body in planned["body"].values]
    if decided["apart"]:
        notes.append(f"Not integrated, since nothing couples it to what is asked for: {listed(decided['apart'])}.")
    if planned.attrs["dearer"]:
        notes.append(f"{planned.attrs['dearer']}.")
    notes.append(
        f"The planned run is integrated by {decided['integrator']} at a relative tolerance of {decided['rtol']:.0e}. "
        f"The plan rests on {planned.attrs['runs']} short runs, {planned.attrs['evaluations']:,} evaluations."
    )
    return Table(
        "What the requested accuracy calls for",
        ("effect", "decision", *names, "evidence", "why"),
        tuple(rows),
        tuple(notes),
    )


def _of_mesh(part: xr.Dataset, units: list[str]) -> str:
    """Whether a body's finite elements are enough, in a sentence or two."""
    given, called = int(part["elements"]), int(part["elements_called_for"])
    errors = [
        f"{name} by at most {written(float(value), 0.0, unit)}"
        for name, value, unit in zip(part["quantity"].values, part["mesh_error"].values, units, strict=True)
        if np.isfinite(value)
    ]
    frequency, compliance = (100.0 * float(part[f"mesh_{of}_error"]) for of in ("frequency", "compliance"))
    head = (
        f"{part['body'].item()} has {given} finite elements, which err by {frequency:.2g} % in a frequency and "
        f"{compliance:.2g} % in compliance"
    )
    if not errors:
        return f"{head}; what that does to what is asked for cannot be determined."
    text = f"{head}, and so change {listed(errors)}"
    if called > given:
        return f"{text}: the requested accuracy calls for {called}."
    return f"{text}: enough; {called} would do. Elements cost no time in a run, so the recipe stays as it is."


def words(planned: xr.Dataset) -> str:
    """The plan in a sentence or two, for a designer."""
    remaining = [str(w) for w, k in zip(planned["words"].values, planned["kept"].values, strict=True) if k]
    gone = [str(w) for w, k in zip(planned["words"].values, planned["kept"].values, strict=True) if not k]
    asked = " and ".join(str(name) for name in planned["quantity"].values)
    if not remaining:
        return f"For {asked} as requested nothing but the ideal mechanism is needed: {listed(gone)} may be left out."
    if not gone:
        return f"For {asked} as requested all effects are needed: {listed(remaining)}."
    return f"For {asked} as requested {listed(remaining)} must be kept; {listed(gone)} may be left out."


def listed(names: list[str]) -> str:
    """Names with commas and an `and`."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + f" and {names[-1]}"


def verified(planned: xr.Dataset) -> Table:
    """The true distance of the planned run from the full one, next to what is requested."""
    rows = []
    for k, name in enumerate(planned["quantity"].values):
        unit = str(planned["unit"].values[k])
        error, chance = float(planned["error"][k]), float(planned["chance"][k])
        requested = float(planned["wanted"][k])
        fraction = error / requested
        verdict = "met" if fraction <= 1.0 else f"missed, {fraction:.2g} times"
        rows.append((str(name), written(requested, 0.0, unit), written(error, chance, unit), verdict))
    notes = [
        f"Evaluations of the equations of motion: {int(planned.attrs['full_evaluations']):,} in full, "
        f"{int(planned.attrs['planned_evaluations']):,} as planned, of all members together.",
        *_no_gain(int(planned.attrs["full_evaluations"]), int(planned.attrs["planned_evaluations"])),
        "Behind ±: what may be chance, by Student's t of the members' means of runs with contacts.",
    ]
    return Table(
        "The plan next to the full scene", ("quantity", "wanted", "true error", "verdict"), tuple(rows), tuple(notes)
    )


def _no_gain(full: int, planned: int) -> list[str]:
    """That a plan takes more evaluations than the scene as it is, where it does."""
    return [f"The plan is {planned / full:.2g} times as dear as the scene as it is."] if planned > full else []
