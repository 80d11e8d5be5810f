"""Effect sizes in the paper's mechanism, cost of an open contact, and savings by static modes.

The effect sizes answer the paper's questions: does the flexible rod alone matter for the pose, does clearance dominate,
are both needed together for forces?
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.family import Case, Family, Record, each
from benchmarks.page import Columns, table
from benchmarks.timing import interleaved, once
from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engines, follow
from flexclear.post.answers.effect_sizes import format_difference
from flexclear.scene.load import edited, load_scene
from flexclear.stages import scenes
from flexclear.stages.workplace import open_workplace
from flexclear.study import effects
from flexclear.system.progress import silent

SCENE, RIGID = "sps4/far_csj_cb", "sps4/csj"
#: watched quantities
WATCHED = (
    "platform.position",
    "platform.orientation",
    "platform.velocity",
    "A2.force",
    "A1.peak_force",
)
ROD, PLAY = "body.rod1.modes", "joint.A1.clearance"
ROUNDS, EVALUATIONS = 8, 20000
#: relative difference between repeated measurements of a least time
NOISE = 0.02
#: an effect dominates another one from this ratio on
DOMINATES = 10.0
#: tolerance at which numbers of modes are compared, as of planned runs; number of static modes
RTOL, STATIC = 1e-6, 6


def cases() -> list[Case]:
    """Return the cases: influences, cost of an open contact in two scenes, cost of modes."""
    return [
        Case("influences", None),
        Case("open contact, rigid", RIGID),
        Case("open contact, flexible", SCENE),
        Case("static modes", SCENE),
    ]


def _measured(case: Case) -> list[Record]:
    if case.of is None:
        return _influences()
    return [(_open if case.name.startswith("open") else _modes)(case.of)]


def _influences() -> list[Record]:
    scene = edited(load_scene(scenes.find_scene(SCENE)), {"view": {"watch": list(WATCHED)}})
    found = effects.examine_effects(scene, open_workplace(), pairs=True).dataset()
    records = []
    for quantity in WATCHED:
        part = found.sel(quantity=quantity)
        record: Record = {"quantity": quantity, "unit": str(part["unit"].values)}
        for name, effect, other in (("rod", ROD, PLAY), ("play", PLAY, ROD)):
            for kind, second in (("dropped", {}), ("added", {}), ("interaction", {"other": other})):
                for part_of in ("", "_uncertainty"):
                    value = float(part[f"{kind}{part_of}"].sel({"effect": effect, **second}))
                    # infinite where the events differ; JSON has no infinity
                    record[f"{name}_{kind}{part_of}"] = value if np.isfinite(value) else None
        records.append(record)
    return records


def _started(name: str, **changes: Any) -> tuple[Any, Any, np.ndarray]:
    scene = edited(load_scene(scenes.find_scene(name)), {"ensemble": None, **changes})
    reduced = scenes.bundles(scene) if scene.flexible() else {}
    engine, other = engines(scene, reduced, silent)
    return engine, other, consistent_start(engine)


def _open(name: str) -> Record:
    """Return the processor time of an evaluation with the contact open, and the fraction of checking its gap."""
    engine, _, start = _started(name)
    surfaces_of_scene = int(engine.h[m.N_SURFACES])

    def evaluation(surfaces: int) -> float:
        engine.h[m.N_SURFACES] = surfaces
        return once(lambda: closure_rows.evaluate(engine, start, engine.start, EVALUATIONS)) / EVALUATIONS

    tasks = {"with_it": partial(evaluation, surfaces_of_scene), "without": partial(evaluation, 0)}
    with_it, without = (min(times.seconds) for times in interleaved(tasks, ROUNDS).values())
    engine.h[m.N_SURFACES] = surfaces_of_scene
    return {"scene": name, "evaluation_us": 1e6 * with_it, "share": (with_it - without) / with_it}


def _modes(name: str) -> Record:
    """Return the processor time of a run with all modes, and with the static modes only [s]."""
    found: Record = {"scene": name}
    for key, change in (("all", {}), ("static", {"body.rod1.modes.count": STATIC})):
        engine, other, start = _started(name, **change, **{"solver.rtol": RTOL})
        found[f"{key}_s"] = min(once(lambda: follow(engine, start, silent, other)) for _ in range(3))  # noqa: B023
    return found


def show(records: list[Record]) -> dict[str, str]:
    """Return the table of influences with the answers, and the costs of open contacts and of modes."""
    influences = {r["quantity"]: r for r in records if "quantity" in r}
    columns: Columns = {
        "quantity": lambda r: r["quantity"],
        "rod alone": lambda r: _cell(r, "rod_added"),
        "clearance alone": lambda r: _cell(r, "play_added"),
        "rod taken from both": lambda r: _cell(r, "rod_dropped"),
        "clearance taken from both": lambda r: _cell(r, "play_dropped"),
        "beyond the sum": lambda r: _cell(r, "rod_interaction"),
    }
    parts = {"influences": table(list(influences.values()), columns), "demand": ""}
    if influences:
        parts["influences"] += "\n\n" + _answers(influences)
    lines = [
        f"- {r['scene']}: an evaluation takes {r['evaluation_us']:.3g} us while the contact is open; checking its "
        f"gap takes {_share(r['share'])} of that."
        for r in records
        if "evaluation_us" in r
    ]
    lines += [
        f"- {r['scene']} at a tolerance of {RTOL:g}: {r['all_s']:.2g} s with all modes, {r['static_s']:.2g} s with the "
        f"{STATIC} static ones."
        for r in records
        if "all_s" in r
    ]
    return parts | {"demand": "\n".join(lines) or "Not measured."}


def _cell(record: Record, name: str) -> str:
    value, chance = record[name], record[f"{name}_uncertainty"]
    return "–" if value is None else format_difference(value, chance or 0.0, record["unit"])


def _answers(found: dict[str, Record]) -> str:
    place, force, peak = (found[name] for name in ("platform.position", "A2.force", "A1.peak_force"))
    ratio = place["play_added"] / place["rod_added"]
    beyond, chance = force["rod_interaction"], force["rod_interaction_uncertainty"] or 0.0
    together = beyond > max(chance, force["rod_added"], 0.1 * force["play_added"])
    alone, dropped = _cell(place, "rod_added"), _cell(place, "rod_dropped")
    dropped += _given(place, "rod_dropped") + _matters(place)
    dominates = force["play_added"] > DOMINATES * force["rod_added"]
    lines = [
        f'- "The flexible rod alone does not matter for the pose": it moves the platform by {alone}, the clearance by '
        f"{ratio:.0f} times that. {_so(ratio > DOMINATES)} Next to the clearance, "
        f"where it is taken from both, the mean position changes by {dropped}.",
        f'- "Clearance dominates": alone it moves the platform by {_cell(place, "play_added")} and changes the force '
        f"at A2 by {_cell(force, 'play_added')}, the rod alone by {_cell(force, 'rod_added')}. {_so(dominates)}",
        f'- "Both together are needed for forces": without the rod\'s flexibility the largest force at A1 changes by '
        f"{_cell(peak, 'rod_dropped')}{_given(peak, 'rod_dropped')}; at A2 both do {_cell(force, 'rod_interaction')} "
        f"beyond the sum of each{_given(force, 'rod_interaction')}. "
        f"{_so(together)}",
    ]
    return "\n".join(lines)


def _matters(place: Record) -> str:
    """Return a clause when the rod changes the pose more with clearance than alone, beyond chance."""
    known = place["rod_dropped"] > max(place["rod_dropped_uncertainty"] or 0.0, place["rod_added"])
    return ": with clearance the rod does matter, since it changes the impacts" if known else ""


def _given(record: Record, name: str) -> str:
    """Return a remark when chance may explain a difference of means."""
    return "" if record[name] > (record[f"{name}_uncertainty"] or 0.0) else ", which chance may explain"


def _share(value: float) -> str:
    """Return a percentage, or an upper bound where it is below the noise of repeated measurements."""
    return f"{100 * value:.0f} %" if value > NOISE else f"less than {100 * NOISE:.0f} %, the noise of this measurement,"


def _so(holds: bool) -> str:
    return "That holds." if holds else "That does not hold."


FAMILY = Family(
    what="what each effect does in the paper's mechanism, and what could be left out on demand",
    takes="3 min",
    page="plan.md",
    cases=cases,
    measure=each(_measured),
    show=show,
)
