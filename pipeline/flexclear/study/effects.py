"""``flexclear effects``: effect size of each part of a scene on each quantity, by removal, alone and in pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.artifacts.store import publish
from flexclear.post.pages import Part, page
from flexclear.scene import variants
from flexclear.stages import effect_study, watched_quantities
from flexclear.stages.scenes import pictures, tables
from flexclear.stages.workplace import Made, Workplace
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene


def bring(scene: Scene, workplace: Workplace, members: int = watched_quantities.MEMBERS) -> Made:
    """Run all variants; return effect sizes over (effect, other, quantity), and their page.

    Raises InputError for a scene without effects or watched quantities.
    """
    from flexclear.post.answers.effect_sizes import variants as requested

    if members < 2:
        raise InputError(
            "--members", f"must be at least 2 (got {members})", "the scatter cannot be estimated from one start"
        )
    present, chosen = variants.effects(scene), scene.watched()
    if not present:
        raise InputError(
            str(scene.path or scene.name),
            "has no effect that can be removed: no clearance, flexible body, friction, gravity or stop",
            "compare it with another scene: flexclear compare A B",
        )
    if not chosen:
        raise InputError(str(scene.path or scene.name), "no quantity is watched", "name quantities in [view] watch")
    by_name = {effect.name: effect for effect in present}
    scenes = {gone: variants.without(scene, [by_name[name] for name in gone]) for gone in requested(present)}
    tasks = {gone: watched_quantities.task(variant, chosen, members) for gone, variant in scenes.items()}
    (made,) = workplace.made(effect_study.task(scene, present, chosen, scenes, tasks, members))
    parts = [
        Part("chart", "Chart", pictures(made, {"effects.png": ("Each effect alone",)})),
        Part("table", "Table", tables(made, "effects.md")),
    ]
    lead = "Every effect of the scene removed and added, alone and in pairs."
    publish(made.folder / "index.html", page(f"Effects: {scene.title}", lead, parts))
    return made
