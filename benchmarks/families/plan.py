"""Plans for random scenes: does the planned run meet the accuracy, what does it save, what does planning cost?

The full scene, the planned scene and the planning are timed alike: processor time of setting up, integrating and
observing, with compiled code and reduced bodies at hand. The true error is the difference of the planned run from the
full one over slightly perturbed members; the part that the members' spread explains is given next to it.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Family, Measured, Record
from benchmarks.page import Columns, short, table
from benchmarks.plan_scenes import Drawn, drawn
from flexclear.artifacts import effect_size
from flexclear.artifacts.effect_size import Agreement
from flexclear.artifacts.points import Point
from flexclear.post.answers.plan import MET, MET_TO_HORIZON, MISSED, UNDECIDED, dataset, verdict
from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity, parse
from flexclear.scene.schema import Scene
from flexclear.stages import effect_plan, simulation, variant_runs
from flexclear.stages.workplace import check, open_workplace
from flexclear.study import plan
from flexclear.study.members import MEMBERS
from flexclear.system.errors import FlexclearError
from flexclear.system.progress import silent

#: first of consecutive seeds that were never looked at before, number of seeds, and scenes of each
SEED, SEEDS, SCENES = 5301, 3, 8
#: processor time of the ensemble runs that decide whether a plan meets the requested accuracy [s]
DECIDING = 240.0
#: a miss by more than this factor is wrong; planning may take this fraction of the full run, or this many seconds
WORST, FRACTION, SECOND = 3.0, 0.2, 1.0
#: `solver` in the record of a plan that is the unchanged scene
AS_IT_IS = "as the scene"
#: duration of the warm-up as a fraction of the run
WARM = 0.002
#: limits of the classes of full runs by processor time [s] in the table of savings
SIZES = (0.0, 0.3, 1.0, 3.0, np.inf)


def cases(seed: int = SEED, seeds: int = SEEDS, scenes: int = SCENES) -> list[Case]:
    """Return scenes of consecutive seeds as cases, ordered by the number of the scene."""
    return [Case(f"seed {s} scene {k}", (s, k)) for k in range(scenes) for s in range(seed, seed + seeds)]


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Measure one scene after the other, since their times are the subject."""
    with tempfile.TemporaryDirectory() as folder:
        for case in cases:
            seed, number = case.of
            yield case, [_measured(seed, number, Path(folder))]


def _measured(seed: int, number: int, folder: Path) -> Record:
    made = drawn(seed, number, folder / "recipes")
    scene, drawing = made.scene, dict(made.record)
    place = open_workplace()
    try:
        task = effect_plan.task(scene)
        done = place.bring(list(task.inputs.values()), 1)
        check(done)
        inputs = {name: place.store.load(done.records[below]) for name, below in task.inputs.items()}
        params = {**task.params, **task.context}
        decided, planning = _planned(params, inputs)
        if planning > SECOND:  # the first call may have loaded compiled code
            decided, planning = _planned(params, inputs)
    except FlexclearError as error:
        return {**drawing, "verdict": REFUSED, "reason": str(error)}
    planned = plan.planned_scene(
        scene, dataset(decided, scene.title, {q.name: q.unit for q in scene.requested_quantities()})
    )
    full = edited(scene, {"accuracy": None})
    chosen = [parse(name, scene.owners()) for name in made.record["wanted"]]
    spent = [time.process_time()]
    fewer, loose = _reduced(inputs, decided.modes), bool(full.contacts() or full.stop)
    few = MEMBERS[0] if loose else 1
    one, full_cpu = _run(full, inputs, chosen, few)
    two, planned_cpu = _run(planned, fewer, chosen, few)
    if one.refused or two.refused:
        return {**drawing, "verdict": WRONG if two.refused else REFUSED, "reason": one.refused or two.refused}

    def compared(members: int) -> list[Agreement]:
        a, b = (one, two) if members == few else (_run(s, i, chosen, members)[0] for s, i in pair)
        return [effect_size.agreement(b, a, q, members, _requested(made, a, q)) for q in chosen]

    def affordable(members: int) -> bool:
        return time.process_time() - spent[0] + members * (full_cpu + planned_cpu) <= DECIDING

    pair = ((full, inputs), (planned, fewer))
    found, members = compared(few), few
    for more in MEMBERS[1:] if loose else ():
        if all(verdict(one) != UNDECIDED for one in found) or not affordable(more):
            break
        found, members = compared(more), more
    worst = max(found, key=lambda one: (one.is_missed, (one.error + one.chance) / one.allowed))
    outcome = verdict(worst)
    if outcome == MET and any(verdict(one) == MET_TO_HORIZON for one in found):
        outcome = MET_TO_HORIZON
    return {
        **drawing,
        "share": worst.error / worst.allowed,
        "chance": worst.chance / worst.allowed,
        "judged": outcome,
        "members": members,
        "horizon": min(one.horizon for one in found),
        "kept": [d.effect.name for d in decided.decisions if d.kept],
        "gone": [d.effect.name for d in decided.decisions if not d.kept],
        "modes": dict(decided.modes),
        "solver": f"{decided.integrator} {decided.rtol:.0e}" if decided.integrator else AS_IT_IS,
        "full_s": full_cpu,
        "planned_s": planned_cpu,
        "plan_s": planning,
        "saving": full_cpu / planned_cpu,
        "verdict": WRONG if outcome == MISSED and worst.error > WORST * worst.allowed else FINISHED,
        **({} if outcome != MISSED else {"reason": f"error is {worst.error / worst.allowed:.2g} times the accuracy"}),
    }


def _requested(made: Drawn, full: Point, q: Quantity) -> float:
    """Return the requested accuracy of a quantity [SI]; a relative one refers to its size in the full scene."""
    request = made.record["wanted"][q.name]
    return float(
        request["absolute"] if "absolute" in request else request["relative"] * effect_size.reference_size(full, q)
    )


def _planned(params: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, float]:
    """Return a plan, and the processor time of planning [s]."""
    begun = time.process_time()
    found = effect_plan.decide_plan(params, inputs, silent)
    return found, time.process_time() - begun


def _reduced(inputs: dict[str, Any], modes: Any) -> dict[str, Any]:
    """Return the inputs with the bundles of fewer modes where the plan chooses these."""
    by_count = [level for level in effect_plan.fewer_modes(inputs) if modes and all(body in level for body in modes)]
    chosen = next((n for n in by_count if all(n[body].sizes["mode"] == count for body, count in modes.items())), {})
    return inputs | {f"bundle/{body}": chosen[body] for body in modes}


def _run(scene: Scene, inputs: dict[str, Any], chosen: list[Any], members: int) -> tuple[Any, float]:
    """Return the watched quantities of a scene, and the processor time of one run [s]."""
    plain = variant_runs.plain(scene)
    rigid = {name: data for name, data in inputs.items() if name.removeprefix("rigid/") in plain.meshed_bodies()}
    filled = simulation.rebuild(simulation.params(plain), rigid)
    bundles = {name: data for name, data in simulation.bundles(inputs).items() if name in filled.flexible()}
    end = filled.time.start + WARM * (filled.time.end - filled.time.start)
    variant_runs.watch(edited(filled, {"time.end": end}), bundles, chosen, 0)
    begun = time.process_time()
    found = variant_runs.watch(filled, bundles, chosen, members)
    spent = time.process_time() - begun
    loose = bool(filled.contacts() or filled.stop)
    return found, spent / (members if loose else 1)


def show(records: list[Record]) -> dict[str, str]:
    """Return the summary, and the table of missed and undecided cases."""
    done = [r for r in records if "judged" in r]
    if not done:
        return {"summary": "Not measured.", "misses": ""}
    counts = {kind: sum(r["judged"] == kind for r in done) for kind in (MET, MET_TO_HORIZON, MISSED, UNDECIDED)}
    within, decided = counts[MET] + counts[MET_TO_HORIZON], len(done) - counts[UNDECIDED]
    saved = [r["saving"] for r in done]
    same = sum(r["solver"] == AS_IT_IS for r in done)
    dearer = sum(r["saving"] < 1.0 and r["solver"] != AS_IT_IS for r in done)
    cheap = [r for r in done if r["plan_s"] <= max(SECOND, FRACTION * r["full_s"])]
    text = (
        f"{len(done)} scenes: {counts[MET]} met, {counts[MET_TO_HORIZON]} met to the horizon, {counts[MISSED]} missed, "
        f"{counts[UNDECIDED]} not decided. Of the {decided} decided ones {within} ({within / max(decided, 1):.0%}) are "
        f"within what is requested{_worst(done)}. Median saving {np.median(saved):.3g} times "
        f"({np.percentile(saved, 25):.3g} to {np.percentile(saved, 75):.3g} for the middle half). Plans that keep "
        f"the scene: {same}; of the others {dearer} take longer than their scene. Planning within a fifth of the "
        f"full run or one second in {len(cheap)}, median {np.median([r['plan_s'] for r in done]):.2g} s."
    )
    by_mechanism: Columns = {
        "mechanism": lambda r: r["mechanism"],
        "scenes": lambda r: str(r["scenes"]),
        "within": lambda r: str(r["within"]),
        "missed": lambda r: str(r["missed"]),
        "not decided": lambda r: str(r["undecided"]),
        "median saving": lambda r: short(r["saving"]),
        "all dropped": lambda r: str(r["bare"]),
        "clearance kept": lambda r: str(r["loose"]),
        "flexibility kept": lambda r: str(r["soft"]),
        "of these fewer modes": lambda r: str(r["fewer"]),
        "median planning [s]": lambda r: short(r["planning"]),
    }
    rows = [
        _together(name, [r for r in done if r["mechanism"] == name])
        for name in dict.fromkeys(str(r["mechanism"]) for r in done)
    ]
    sizes = [
        _together(f"{short(low)} to {short(high)} s" if np.isfinite(high) else f"above {short(low)} s", mine)
        for low, high in pairwise(SIZES)
        if (mine := [r for r in done if low <= r["full_s"] < high])
    ]
    by_size: Columns = {"full run" if name == "mechanism" else name: column for name, column in by_mechanism.items()}
    missed: Columns = {
        "case": lambda r: r["case"],
        "mechanism": lambda r: r["mechanism"],
        "clearance [um]": lambda r: short(1e6 * r["clearance"]),
        "speed": lambda r: short(r["speed"]),
        "rod": lambda r: r["rod"],
        "requested": lambda r: ", ".join(f"{n} {_asked(of)}" for n, of in r["wanted"].items()),
        "kept": lambda r: ", ".join(r["kept"]) or "nothing",
        "verdict": lambda r: r["judged"],
        "members": lambda r: str(r["members"]),
        "error / allowed": lambda r: "refused" if r["share"] is None else f"{short(r['share'])} ± {short(r['chance'])}",
    }
    misses = [r for r in done if r["judged"] in (MISSED, UNDECIDED)]
    other = [f"{r['case']}: {r['reason']}" for r in records if "judged" not in r]
    listed = table(misses, missed) if misses else "None."
    return {
        "summary": f"{text}\n\n{table(rows, by_mechanism)}\n\nBy the processor time of the full run:\n\n"
        f"{table(sizes, by_size)}",
        "misses": "\n\n".join([listed, *(["Not run: " + "; ".join(other)] if other else [])]),
    }


def _worst(done: list[Record]) -> str:
    """Return the worst miss in words; empty without a miss."""
    missed = [r["share"] for r in done if r["judged"] == MISSED]
    if None in missed:  # the log stores infinity as null
        return "; the worst miss is a planned run whose energy balance, for one of its members, is refused"
    return f"; the worst miss is {max(missed):.2g} times what is allowed" if missed else ""


def _asked(of: dict[str, float]) -> str:
    """Return an accuracy as a scene gives it, absolute ones in SI units."""
    return f"{of['absolute']:.2g}" if "absolute" in of else f"{100 * of['relative']:.2g} %"


def _together(name: str, mine: list[Record]) -> Record:
    """Return one row that summarises the scenes of one mechanism, or of one size."""
    kept = [" ".join(r["kept"]) for r in mine]
    return {
        "mechanism": name,
        "scenes": len(mine),
        "within": sum(r["judged"] in (MET, MET_TO_HORIZON) for r in mine),
        "missed": sum(r["judged"] == MISSED for r in mine),
        "undecided": sum(r["judged"] == UNDECIDED for r in mine),
        "saving": float(np.median([r["saving"] for r in mine])),
        "bare": sum(".clearance" not in k and ".modes" not in k for k in kept),
        "loose": sum(".clearance" in k for k in kept),
        "soft": sum(".modes" in k for k in kept),
        "fewer": sum(bool(r["modes"]) for r in mine),
        "planning": float(np.median([r["plan_s"] for r in mine])),
    }


FAMILY = Family(
    what="plans: are planned runs within the requested accuracy, and what do they save",
    takes="20 min",
    page="plan.md",
    cases=cases,
    measure=measure,
    show=show,
    settings={"seed": SEED, "seeds": SEEDS, "scenes": SCENES},
)
