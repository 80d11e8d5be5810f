"""``flexclear effects`` and the answer on effects: effect size of each part of a scene on each quantity, by removal.

Either all effects are removed and added, alone and in pairs, with one number of members; or each is removed alone, with
more members until its change is decided, within a budget.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from flexclear.scene import variants
from flexclear.scene.variants import EFFECTS, Effect
from flexclear.stages import effect_study
from flexclear.stages.workplace import Made, Workplace
from flexclear.study.cost_design import Setting
from flexclear.study.members import MEMBERS, Budget, Members, integrated, setting_of, with_setting
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.points import Point
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene

Names = effect_study.Names


def bring(scene: Scene, workplace: Workplace, members: int = MEMBERS[0], of: Sequence[str] = ()) -> Made:
    """Run all variants; return effect sizes over (effect, other, quantity).

    of: names of effects or parts, as of `variants.effects_of`.  Raises InputError for a scene without effects or
    watched quantities.
    """
    from flexclear.post.answers.effect_sizes import variants as requested

    if members < 2:
        raise InputError(
            "--members", f"must be at least 2 (got {members})", "the scatter cannot be estimated from one start"
        )
    effects, chosen = _examined(scene, of)
    setting, runs = setting_of(scene, workplace), Members(workplace, chosen)
    made = {gone: _without(scene, effects, gone, setting) for gone in requested(effects)}
    runs.points(made, members)
    params = {"effects": [[e.name, e.kind, e.within, e.joint] for e in effects], "members": members}
    errors = integrated(scene, setting)
    return workplace.made(effect_study.task("effects", scene, chosen, made, runs.tasks, errors, **params))[0]


def rank(
    scene: Scene,
    workplace: Workplace,
    own: tuple[Setting, float],
    budget: Budget,
    levels: Sequence[int] = MEMBERS,
    of: Sequence[str] = (),
) -> Made:
    """Run the scene without each effect; return which effects matter (`stages.effect_study`).

    own: setting and processor time [s] of the scene's own run.  levels: numbers of members that are tried until a
    change beyond the horizon is decided.  of: as of `bring`, with the same errors.
    """
    from flexclear.post.answers.effect_ranking import IDEAL, Pair, undecided_quantities

    effects, chosen = _examined(scene, of)
    removed, (setting, seconds) = _removed(scene, effects, IDEAL), own
    levels = levels if scene.contacts() or scene.stops() else (0,)
    full, tight = frozenset[str](), False
    while True:
        runs, sets = Members(workplace, chosen, budget, seconds), (full, *removed.values())
        made = {gone: _without(scene, effects, gone, setting, tight=tight) for gone in sets}

        def more(members: int, points: Mapping[Names, Point]) -> Collection[Names]:
            pairs = {gone: Pair(points[full], point, members) for gone, point in points.items() if gone}
            return [gone for gone, pair in pairs.items() if undecided_quantities(pair, chosen)]

        reached = runs.until_decided(made, levels, more)
        if tight or not runs.refused:
            break
        tight = True  # members run at the scene's own tolerance, since the looser one for means was refused
    pairs = {name: reached[gone] for name, gone in removed.items() if gone in reached}
    words = {effect.name: effect.words for effect in effects} | {IDEAL: IDEAL}
    if removed.get(IDEAL) in [gone for name, gone in removed.items() if name != IDEAL]:
        words[IDEAL] = ""  # is listed as that effect
    left = ", ".join(words[name] for name in removed if name not in pairs and words[name])
    ran, errors = {gone: made[gone] for gone in (full, *reached)}, integrated(scene, setting, tight=tight)
    params = {"removed": {name: sorted(removed[name]) for name in pairs}, "pairs": pairs, "words": words}
    task = effect_study.task("effect_ranking", scene, chosen, ran, runs.tasks, errors, undone=left, **params)
    return workplace.made(task)[0]


def _examined(scene: Scene, of: Sequence[str]) -> tuple[tuple[Effect, ...], list[Quantity]]:
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


def _removed(scene: Scene, effects: Sequence[Effect], ideal: str) -> dict[str, Names]:
    """Return the effects that go with each one: first, as `ideal`, all clearances and flexible bodies."""
    idealised = frozenset(e.name for e in variants.effects(scene) if e.kind in EFFECTS)
    both = {ideal: idealised} if idealised and idealised <= {e.name for e in effects} else {}
    order = sorted(effects, key=lambda effect: effect.kind not in EFFECTS)
    alone = both | {effect.name: frozenset({effect.name}) for effect in order}
    return {name: gone | {e.name for e in effects if e.within in gone} for name, gone in alone.items()}


def _without(scene: Scene, effects: Sequence[Effect], gone: Names, setting: Setting, *, tight: bool = False) -> Scene:
    """Return the scene without effects, by the method of its own run; tight: as of `with_setting`."""
    return with_setting(variants.without_effects(scene, [e for e in effects if e.name in gone]), setting, tight=tight)
