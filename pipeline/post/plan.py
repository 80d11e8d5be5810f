"""A plan as a dataset, a table, words and a page: what was decided, why, and what it rests on."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.pipeline.core.decisions import EVIDENCE, NOT_WORTH, Plan
from flexclear.pipeline.post.effect_sizes import written
from flexclear.pipeline.post.plotting.table import Table


def dataset(plan: Plan, title: str, units: Mapping[str, str]) -> xr.Dataset:
    """Influences over (effect, quantity), decisions and evidence over effects, what is wanted over quantities; SI.

    units: of the quantities, by name.  nan where nothing was estimated, infinite where nothing bounds it or the events
    differ.
    """
    names = list(plan.wanted)
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
    found = xr.Dataset(
        {
            "influence": (("effect", "quantity"), estimate),
            "uncertainty": (("effect", "quantity"), doubt),
            "kept": (("effect",), np.array([int(d.kept) for d in plan.decisions], dtype=np.int8)),
            "evidence": (("effect",), np.array([d.evidence for d in plan.decisions], dtype=object)),
            "reason": (("effect",), np.array([d.reason for d in plan.decisions], dtype=object)),
            "wanted": (("quantity",), np.array([plan.wanted[name] for name in names])),
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
        "elements_called_for": "finite elements that the wanted accuracy calls for",
        "mesh_frequency_error": "largest error of a kept frequency due to the mesh, as a share",
        "mesh_compliance_error": "largest error of the frames' compliance due to the mesh, as a share",
        "mesh_error": "estimated error of the quantity due to the body's mesh, at most, in the quantity's unit",
    }
    for name, text in meanings.items():
        found[name].attrs = {"long_name": text}
    return found


def drawn(found: xr.Dataset) -> xr.Dataset:
    """What the chart of influences takes of a plan."""
    return xr.Dataset(
        {"dropped": found["influence"] + found["uncertainty"].fillna(0.0)},
        coords={"effect": found["effect"], "quantity": found["quantity"], "unit": found["unit"]},
    )


def table(found: xr.Dataset) -> Table:
    """Decision, evidence and reason of each effect, and its estimated influence on each quantity."""
    names = [str(name) for name in found["quantity"].values]
    units = [str(unit) for unit in found["unit"].values]
    rows = []
    for i, effect in enumerate(found["words"].values):
        part = found.isel(effect=i)
        cells = [
            written(float(part["influence"][k]), float(np.nan_to_num(part["uncertainty"][k])), unit)
            for k, unit in enumerate(units)
        ]
        decision = "keep" if int(part["kept"]) else "drop"
        rows.append((str(effect), decision, *cells, EVIDENCE[str(part["evidence"].values)], str(part["reason"].values)))
    wanted = [written(float(value), 0.0, unit) for value, unit in zip(found["wanted"].values, units, strict=True)]
    rows.append(("wanted", "", *wanted, "", ""))
    told = json.loads(found.attrs["planned"])
    notes = [words(found)]
    notes += [f"{name} keeps {count} of its modes, which do the same as all." for name, count in told["modes"].items()]
    notes += [_of_mesh(found.sel(body=body), units) for body in found["body"].values]
    if told["apart"]:
        notes.append(f"Not integrated, since nothing couples it to what is asked for: {listed(told['apart'])}.")
    if found.attrs["dearer"]:
        notes.append(f"{found.attrs['dearer']}.")
    notes.append(
        f"The planned run is integrated by {told['integrator']} at a relative tolerance of {told['rtol']:.0e}. "
        f"The plan rests on {found.attrs['runs']} short runs, {found.attrs['evaluations']:,} evaluations."
    )
    return Table(
        "What the wanted accuracy calls for",
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
        return f"{head}; what that does to what is asked for cannot be told."
    told = f"{head}, and so change {listed(errors)}"
    if called > given:
        return f"{told}: the accuracy wanted calls for {called}."
    return f"{told}: enough; {called} would do. Elements cost no time in a run, so the recipe stays as it is."


def words(found: xr.Dataset) -> str:
    """The plan in a sentence or two, for a designer."""
    needed, unseen, gone = _sorted(found)
    asked = " and ".join(str(name) for name in found["quantity"].values)
    if not needed and not unseen:
        return f"For {asked} as wanted nothing but the ideal mechanism is needed: {listed(gone)} may be left out."
    left = f"{listed(gone)} may be left out" if gone else "nothing may be left out" if not unseen else ""
    parts = [f"{listed(needed)} must be kept" if needed else "", left]
    parts += [f"{listed(unseen)} {'is' if len(unseen) == 1 else 'are'} kept without a look" if unseen else ""]
    return f"For {asked} as wanted {'; '.join(filter(None, parts))}."


def listed(names: list[str]) -> str:
    """Names with commas and an `and`."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + f" and {names[-1]}"


def verified(found: xr.Dataset) -> Table:
    """The true distance of the planned run from the full one, beside what is wanted."""
    rows = []
    for k, name in enumerate(found["quantity"].values):
        unit = str(found["unit"].values[k])
        error, chance = float(found["error"][k]), float(found["chance"][k])
        wanted = float(found["wanted"][k])
        rows.append(
            (str(name), written(wanted, 0.0, unit), written(error, chance, unit), _verdict(found.isel(quantity=k)))
        )
    notes = [
        f"Evaluations of the equations of motion: {int(found.attrs['full_evaluations']):,} in full, "
        f"{int(found.attrs['planned_evaluations']):,} as planned, of all members together.",
        *_no_gain(int(found.attrs["full_evaluations"]), int(found.attrs["planned_evaluations"])),
        "Behind ±: what may be chance, by Student's t of the members' means of runs with contacts.",
    ]
    return Table(
        "The plan beside the full scene", ("quantity", "wanted", "true error", "verdict"), tuple(rows), tuple(notes)
    )


MET, MISSED, UNDECIDED = "met", "missed", "not decided"


def verdict(error: float, chance: float, wanted: float) -> str:
    """Met where error and chance together are below what is wanted, missed where both are above, else not decided."""
    if error + chance <= wanted:
        return MET
    return MISSED if error - chance > wanted else UNDECIDED


def _verdict(one: xr.Dataset) -> str:
    """The verdict on one quantity, with what it would take where it is not decided."""
    error, chance, wanted = (float(one[name]) for name in ("error", "chance", "wanted"))
    said = verdict(error, chance, wanted)
    if said == MISSED:
        return f"missed, {error / wanted:.2g} times"
    if said == UNDECIDED and error < wanted:
        members = int(one.attrs["members"])
        return f"not decided: {int(np.ceil(members * (chance / (wanted - error)) ** 2))} members would"
    return said


def levels(plans: Mapping[str, xr.Dataset | str]) -> Table:
    """What each accuracy calls for, by the accuracy in words; why there is no plan, where there is none."""
    rows = list[tuple[str, ...]]()
    for level, found in plans.items():
        if isinstance(found, str):
            rows.append((level, "–", "–", "–", "–", found.splitlines()[0]))
            continue
        told = json.loads(found.attrs["planned"])
        needed, unseen, gone = _sorted(found)
        modes = ", ".join(f"{count} of {body}" for body, count in told["modes"].items()) or "all"
        method = f"{told['integrator']}, rtol {told['rtol']:.0e}"
        rows.append((level, *(listed(names or ["none"]) for names in (needed, unseen, gone)), modes, method))
    return Table(
        "What accuracy calls for",
        ("of each size", "needed", "kept without a look", "may be left out", "modes", "integrated by"),
        tuple(rows),
        (
            "Each accuracy is that of all watched quantities; name one in [accuracy] to get its planned scene. "
            "Kept without a look: leaving the effect out would save no time worth the runs that tell its size.",
        ),
    )


def _sorted(found: xr.Dataset) -> tuple[list[str], list[str], list[str]]:
    """Effects in words: those that are needed, those that are kept without evidence, and those that may be left out."""
    rows = list(zip(found["words"].values, found["kept"].values, found["reason"].values, strict=True))
    return (
        [str(w) for w, kept, reason in rows if kept and reason != NOT_WORTH],
        [str(w) for w, kept, reason in rows if kept and reason == NOT_WORTH],
        [str(w) for w, kept, _ in rows if not kept],
    )


def _no_gain(full: int, planned: int) -> list[str]:
    """That a plan takes more evaluations than the scene as it is, where it does."""
    return [f"The plan is {planned / full:.2g} times as dear as the scene as it is."] if planned > full else []
