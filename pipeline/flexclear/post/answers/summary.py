"""Sentences at the top of a report: effects of clearance and flexibility, in numbers."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.artifacts.effect_size import Influence
from flexclear.post.answers.effect_answer import change_in_words
from flexclear.post.answers.effect_sizes import staying_contacts_sentence
from flexclear.post.overview.curves import impacts_text, in_unit
from flexclear.post.single_run.series import parameters
from flexclear.scene.loose_joints import SURFACES
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import contacts_that_stay

NEITHER = "The scene has neither clearance nor flexible bodies"


def answer(
    compared: xr.Dataset | None,
    run: xr.Dataset | None,
    warnings: Sequence[str],
    changes: Sequence[str] = (),
) -> str:
    """Return a list of sentences, as HTML.

    compared: of `overview.comparison`, the ideal counterpart first and the scene last; or None. run: schema RUN of the
    scene.  warnings: of the run.  changes: sentences of `post.answers.effect_answer` on the differences from the ideal
    mechanism; they replace those from two runs alone.
    """
    sentences = [] if compared is None else [*changes] or _effects(compared)
    if compared is None and run is not None:
        lacks = "Balls on planes and stops have no ideal counterpart" if "contact" in run.coords else NEITHER
        sentences.append(f"{lacks}, so there is no idealised run to compare it with.")
    if run is not None:
        sentences += _impacts(run)
    if warnings:
        many = "one warning" if len(warnings) == 1 else f"{len(warnings)} warnings"
        sentences.append(f"The run gave <span class='bad'>{many}</span>, see <a href='#doubts'>below</a>.")
    head = "Compared with the same mechanism with ideal joints and rigid bodies"
    keeps = (
        [] if run is None else contacts_that_stay({n: j["type"] for n, j in parameters(run).get("joint", {}).items()})
    )
    head += "; after ±, what may be due to chance or to time steps" if any("±" in text for text in sentences) else ""
    head += f" ({html.escape(staying_contacts_sentence(keeps)).rstrip('.')}):" if keeps else ":"
    return f"{'' if compared is None else f'<p>{head}</p>'}<ul>{''.join(f'<li>{text}</li>' for text in sentences)}</ul>"


def _effects(compared: xr.Dataset) -> list[str]:
    """Return a sentence for each quantity: its difference from the ideal mechanism, and the errors of both runs."""
    first, last, sentences = compared.isel(run=0), compared.isel(run=-1), []
    for j, name in enumerate(str(q) for q in compared["quantity"].values):
        difference, error = float(last["difference"][j]), float(first["error"][j]) + float(last["error"][j])
        if np.isfinite(difference):
            unit = str(compared["unit"].values[j])
            text = f"differs by <b class='n'>{in_unit(difference, unit)}</b>; its error is unknown"
            if np.isfinite(error):
                size = float(first["largest"][j])
                text = change_in_words(Influence(difference, error), size, unit)
            sentences.append(f"<b>{html.escape(name)}</b>: {text}.")
    return sentences


def _impacts(run: xr.Dataset) -> list[str]:
    """Return a sentence for each contact of the scene, ends of stops included."""
    sentences = []
    for name in (str(c) for c in run["contact"].values) if "contact" in run.coords else ():
        unit = quantities.unit(run, Quantity(name, "peak_force"))
        count, peak = (quantities.contact_values(run, Quantity(name, kind)) for kind in ("impact_times", "peak_force"))
        closed = float(np.mean(run["contact_gap"].sel(contact=name).values < 0.0))
        sentences.append(
            f"<b>{html.escape(name)}</b>: {impacts_text(len(count), closed)}; the contact "
            f"{'force' if unit == 'N' else 'torque'} reaches <b class='n'>{in_unit(float(peak[0]), unit)}</b>."
        )
    return sentences


def effects(scene: Mapping[str, Any]) -> dict[str, str]:
    """Return a scene's effects by name, in words, from its parameters; absent ones are named as absent."""
    body, joint = scene.get("body", {}), scene.get("joint", {})
    load = scene.get("load", {})
    flexible = [n for n, b in body.items() if b["type"] == "flexible"]
    loose = [n for n, j in joint.items() if j["type"] in SURFACES]
    present = {
        "clearance": loose,
        "contact friction": [f"{n} ({joint[n]['friction']['law']})" for n in loose if joint[n].get("friction")],
        "wear": [n for n in loose if joint[n].get("wear")],
        "films of oil": [n for n in loose if joint[n].get("film")],
        "flexible bodies": [f"{n} ({body[n]['modes']['reference']})" for n in flexible],
        "damping of flexible bodies": [n for n in flexible if body[n].get("damping") is not None],
        "geometric stiffening": [n for n in flexible if body[n].get("stiffening") is not None],
        "gravity": [n for n, part in load.items() if part["type"] == "gravity"],
        "springs, dampers, bushings": [
            n for n, p in load.items() if p["type"] in ("spring-damper", "joint-spring", "bushing")
        ],
        "joint friction": [n for n, part in load.items() if part["type"] == "joint-friction"]
        + [n for n, part in joint.items() if n not in loose and part.get("friction")],
        "controllers": [n for n, part in load.items() if "pid" in part["type"]],
        "other forces": [n for n, p in load.items() if p["type"] in ("point-force", "point-torque", "joint-force")],
        "stops": list(scene.get("stop", {})),
        "gears": list(scene.get("gear", {})),
    }
    return {name: ", ".join(listed) if listed else "not in the scene" for name, listed in present.items()}
