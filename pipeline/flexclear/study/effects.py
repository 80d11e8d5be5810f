"""``flexclear effects`` and the answer on effects: effect size of each part of a scene on each quantity, by removal.

Each effect is removed, with more members until its change is decided, within a budget. On request each is added, too,
and pairs are removed and added.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from typing import TYPE_CHECKING

from flexclear.scene import variants
from flexclear.scene.variants import EFFECTS, Effect
from flexclear.stages.workplace import Made, Workplace
from flexclear.study.cost_design import Setting
from flexclear.study.members import MEMBERS, Budget, Members, comparing_task, error_runs, setting_of, with_setting
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.points import Point
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene

Names = frozenset[str]


def examine_effects(
    scene: Scene,
    workplace: Workplace,
    levels: Sequence[int] = MEMBERS[:1],
    of: Sequence[str] = (),
    *,
    pairs: bool = False,
    own: tuple[Setting, float] | None = None,
    budget: Budget | None = None,
) -> Made:
    """Run the scene without each effect; return effect sizes and which effects matter (`stages.studies`).

    levels: numbers of members that are tried until a change beyond the horizon is decided.  of: names of effects or
    parts, as of `variants.effects_of`.  pairs: also add each effect to the bare scene, and remove and add pairs. own:
    setting and processor time [s] of the scene's own run, where known.  Raises InputError for a scene without effects
    or watched quantities.
    """
    from flexclear.post.answers.effect_sizes import IDEAL, Pair, undecided_quantities
    from flexclear.post.answers.effect_sizes import variants as combined

    if min(levels) < 2:
        text = f"must be at least 2 (got {min(levels)})"
        raise InputError("--members", text, "the scatter cannot be estimated from one start")
    effects, chosen = _effects_and_quantities(scene, of)
    removed, (setting, seconds) = removals(scene, effects, IDEAL), own or (setting_of(scene, workplace), 0.0)
    levels = levels if scene.contacts() or scene.stops() else (0,)
    full, tight = frozenset[str](), set[Hashable]()
    runs, sets = Members(workplace, chosen, budget or Budget(), seconds), (full, *removed.values())

    def variant(gone: Names) -> Scene:
        return _without(scene, effects, gone, setting, tight=gone in tight)

    def more(members: int, points: Mapping[Names, Point]) -> Collection[Names]:
        compared = {gone: Pair(points[full], point, members) for gone, point in points.items() if gone}
        return [gone for gone, pair in compared.items() if undecided_quantities(pair, chosen)]

    while True:
        reached = runs.until_decided({gone: variant(gone) for gone in sets}, levels, more)
        if runs.refused <= tight:
            break
        tight |= runs.refused  # what a tighter tolerance does not mend either is refused
    ran = {gone: variant(gone) for gone in (full, *reached)}
    if pairs:
        ran |= {gone: variant(gone) for gone in combined(effects)}
        runs.points(ran, levels[-1])
        if again := runs.refused - tight:
            tight |= again
            repeated = {gone: variant(gone) for gone in ran if gone in again}
            runs.points(repeated, levels[-1])
            ran |= repeated
    members = {name: reached[gone] for name, gone in removed.items() if gone in reached}
    words = {effect.name: effect.words for effect in effects} | {IDEAL: IDEAL}
    if removed.get(IDEAL) in [gone for name, gone in removed.items() if name != IDEAL]:
        words[IDEAL] = ""  # is listed as that effect
    errors, types = error_runs(scene, setting), {name: joint.type for name, joint in scene.joint.items()}
    params = {
        "title": scene.title,
        "looser": errors.looser,
        "quantities": [q.to_json() for q in chosen],
        "units": [q.unit for q in chosen],
        "outputs": [scene.time.start, scene.output.interval],
        "variants": [sorted(names) for names in ran],
        "owners": [{kind: list(names) for kind, names in one.owners().items()} for one in ran.values()],
        "staying": [name for name in variants.contacts_that_stay(types) if f"joint.{name}" not in full.union(*ran)],
        "removed": {name: sorted(removed[name]) for name in members},
        "members": members,
        "words": words,
        "undone": ", ".join(words[name] for name in removed if name not in members and words[name]),
        "added": [[e.name, e.kind, e.within, e.joint] for e in effects] if pairs else [],
    }
    inputs = {f"variant{k}/{n}": one for k, gone in enumerate(ran) for n, one in enumerate(runs.tasks[gone])}
    task = comparing_task("effects", scene.name, params, {**inputs, **errors.runs})
    return workplace.made(task)[0]


def _effects_and_quantities(scene: Scene, of: Sequence[str]) -> tuple[tuple[Effect, ...], list[Quantity]]:
    """Return the effects that can be removed and the watched quantities; InputError without one of them."""
    effects, chosen, where = (
        variants.effects_of(scene, of, f"{scene.name} --of"),
        scene.watched_quantities(),
        scene.path,
    )
    if not effects:
        raise InputError(
            str(where or scene.name),
            "has no effect that can be removed: no clearance, flexible body, friction, gravity or stop",
            "name parts, as --of load.spring, or compare it with another scene: flexclear compare A B",
        )
    if not chosen:
        raise InputError(str(where or scene.name), "no quantity is watched", "name quantities in [view] watch")
    return effects, chosen


def removals(scene: Scene, effects: Sequence[Effect], ideal: str) -> dict[str, Names]:
    """Return the effects that go with each one: first, as `ideal`, all clearances and flexible bodies."""
    idealised = frozenset(effect.name for effect in variants.idealised_effects(scene))
    both = {ideal: idealised} if idealised and idealised <= {e.name for e in effects} else {}
    order = sorted(effects, key=lambda effect: effect.kind not in EFFECTS)
    alone = both | {effect.name: frozenset({effect.name}) for effect in order}
    return {name: gone | {e.name for e in effects if e.within in gone} for name, gone in alone.items()}


def _without(scene: Scene, effects: Sequence[Effect], gone: Names, setting: Setting, *, tight: bool = False) -> Scene:
    """Return the scene without effects, by the method of its own run; tight: as of `with_setting`."""
    return with_setting(variants.without_effects(scene, [e for e in effects if e.name in gone]), setting, tight=tight)
