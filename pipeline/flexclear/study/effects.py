"""``flexclear effects``: effect size of each part of a scene on each quantity, by removal, alone and in pairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexclear.artifacts.store import publish
from flexclear.post.pages import Part, page
from flexclear.scene import variants
from flexclear.stages import effect_study, watched_quantities
from flexclear.stages.scenes import pictures, tables
from flexclear.stages.workplace import Made, Workplace
from flexclear.study.members import Members, integrated, setting_of, with_setting
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene


def bring(
    scene: Scene, workplace: Workplace, members: int = watched_quantities.MEMBERS, of: Sequence[str] = ()
) -> Made:
    """Run all variants; return effect sizes over (effect, other, quantity), and their page.

    of: names of effects or parts, as of `variants.effects_of`.  Raises InputError for a scene without effects or
    watched quantities.
    """
    from flexclear.post.answers.effect_sizes import variants as requested

    if members < 2:
        raise InputError(
            "--members", f"must be at least 2 (got {members})", "the scatter cannot be estimated from one start"
        )
    present, chosen = variants.effects_of(scene, of, f"{scene.name} --of"), scene.watched()
    if not present:
        raise InputError(
            str(scene.path or scene.name),
            "has no effect that can be removed: no clearance, flexible body, friction, gravity or stop",
            "name parts, as --of load.spring, or compare it with another scene: flexclear compare A B",
        )
    if not chosen:
        raise InputError(str(scene.path or scene.name), "no quantity is watched", "name quantities in [view] watch")
    by_name = {effect.name: effect for effect in present}
    scenes = {gone: variants.without(scene, [by_name[name] for name in gone]) for gone in requested(present)}
    setting, runs = setting_of(scene, workplace), Members(workplace, chosen)
    runs.points({gone: with_setting(variant, setting) for gone, variant in scenes.items()}, members)
    (made,) = workplace.made(
        effect_study.task(scene, present, chosen, scenes, runs.tasks, members, integrated(scene, setting))
    )
    parts = [
        Part("chart", "Chart", pictures(made, {"effects.png": ("Each effect alone",)})),
        Part("table", "Table", tables(made, "effects.md")),
    ]
    which = "Every effect of the scene" if not of else f"Effects of {', '.join(of)}"
    lead = f"{which}, removed and added, alone and in pairs."
    publish(made.folder / "index.html", page(f"Effects: {scene.title}", lead, parts))
    return made
