"""Short runs of a scene's variants, each made once, and what they took."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.influence import Influence, influence, kept, members_apart
from flexclear.pipeline.core.progress import Progress
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.variants import Effect, with_modes, without
from flexclear.pipeline.core.scene.wanted import Quantity
from flexclear.pipeline.dynamics.record.point import Runner

#: starts of pilots with contacts: enough to see whether the motion parts
MEMBERS = 3
#: pilots are integrated to this tolerance; of motions without contact by the method for stiff ones to the second
RTOL, SMOOTH_RTOL, SMOOTH = 1e-7, 1e-5, "radau"
#: what a variant is: the effects that it lacks, and its solver
Key = tuple[frozenset[str], str]


@dataclass
class Pilots:
    """Variants of a scene that have been run.

    bundles: reduced flexible bodies.  fewer: the same of fewer modes, where there are such.  filled: fills in what
    recipes tell of rigid bodies.  points: by what was run.
    """

    scene: Scene
    bundles: Mapping[str, xr.Dataset]
    fewer: Mapping[str, xr.Dataset]
    filled: Callable[[Scene], Scene]
    chosen: Sequence[Quantity]
    progress: Progress
    points: dict[Key, Point] = field(default_factory=dict)
    evaluations: int = 0

    def variant(self, gone: Collection[Effect], **solver: object) -> Scene:
        """The scene without some effects, integrated as `solver` says, else as pilots are."""
        bare = without(self.scene, gone)
        contacts = bool(bare.contacts() or bare.stop)
        smooth = bool(bare.flexible()) and not contacts
        usual: dict[str, object] = {"integrator": SMOOTH, "rtol": SMOOTH_RTOL} if smooth else {"rtol": RTOL}
        return self.filled(edited(bare, {"solver": usual | solver}))

    def point(self, gone: Collection[Effect], *, fewer: bool = False, share: float = 1.0, **solver: object) -> Point:
        """What is watched of a variant over a share of its time; a refusal of the solver is in the point.

        fewer: with fewer modes of those bodies that have a choice.
        """
        scene = self.variant(gone, **solver)
        mine = {name: bundle for name, bundle in self.bundles.items() if name in scene.flexible()}
        if fewer:
            mine |= {name: bundle for name, bundle in self.fewer.items() if name in mine}
            scene = with_modes(scene, {name: mine[name].sizes["mode"] for name in self.fewer if name in mine})
        if share < 1.0:
            scene = edited(scene, {"time.end": scene.time.start + share * (scene.time.end - scene.time.start)})
        names = frozenset(effect.name for effect in gone)
        key = (names, json.dumps([scene.solver.model_dump(mode="json"), fewer, share]))
        if key not in self.points:
            self.progress(None, f"run {len(self.points) + 1}: {scene.summary()}")
            members = MEMBERS if scene.contacts() or scene.stop else 0
            found = Runner(mine, kept(scene.owners(), self.chosen), members).run(members_apart(scene))
            self.points[key] = found
            self.evaluations += found.evaluations
        return self.points[key]

    def between(self, a: Point, b: Point) -> dict[str, Influence]:
        """How far two of them are apart in each quantity; infinitely where one of them was refused."""
        if a.refused or b.refused:
            return {q.name: Influence(np.inf) for q in self.chosen}
        return {q.name: influence(a, b, q, MEMBERS) for q in self.chosen}
