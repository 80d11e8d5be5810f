"""Short runs of a scene's variants, each made once, and what they took."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from flexclear.pipeline.core.artifacts.effect_size import Influence, influence, recorded, same_starts
from flexclear.pipeline.core.artifacts.labelled import Labelled
from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.variants import Effect, effects, with_modes, without
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import tabulate
from flexclear.pipeline.dynamics.record.point import Runner
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.run import placed

#: starts of pilots with contacts: enough to see whether the motion parts
MEMBERS = 3
#: rigid pilots without contact are integrated to this tolerance; flexible ones by the method for stiff motions to the
#: second
RTOL, SMOOTH_RTOL, SMOOTH = 1e-7, 1e-5, "radau"
#: tolerance of pilots with contacts: this fraction of the least clearance over the mechanism's size, between two limits
#: (errors of positions are the tolerance times that size, and must stay small next to the clearance)
OF_CLEARANCE, TIGHTEST, LOOSEST = 0.05, 1e-7, 1e-5
#: evaluations times variables that pilots of one variant with contacts may take, all members together: measured, some
#: 0.2 s on one core.  What takes longer is run over a part of the time, at least so much of it
ALLOWED, LEAST_PART, SHORTER = 5e6, 0.0625, 0.25
#: the beginning that is run to know how long the rest takes
BEGINNING = 0.03125
#: where clearance stays, decisions rest on runs over so many times that part: in most scenes over all of the time
WHOLE_TIME = 8
#: a pilot is given up at so many times the evaluations that it is expected to take at most, and is then as one that was
#: refused
GIVEN_UP = 4.0
#: runs at tight tolerances may take so many times more
OF_TIGHT = 2
#: how refusals name that limit
TAKES_LONG = "[solver.evaluations]"
#: what a variant is: the effects that it lacks, and its solver
Key = tuple[frozenset[str], str]


def longest(fraction: float, run: Callable[[float], Point]) -> tuple[float, Point]:
    """The part of the time, from a fraction down, that does not take too long, and the run over it."""
    while TAKES_LONG in (there := run(fraction)).refused and fraction > LEAST_PART:
        fraction = max(LEAST_PART, SHORTER * fraction)
    return fraction, there


@dataclass(frozen=True)
class Extent:
    """What decides how dear a scene's runs are. size: of the mechanism [m].  variables: of its state."""

    size: float
    variables: int

    @property
    def most(self) -> int:
        """Evaluations of one run at which it is given up."""
        return int(GIVEN_UP * WHOLE_TIME * ALLOWED / (MEMBERS * self.variables))


@dataclass
class Pilots:
    """Variants of a scene that have been run.

    bundles: reduced flexible bodies.  fewer: the same of fewer modes, where there are such, levels with the fewest
    first.  filled: fills in what recipes describe rigid bodies.  points: by what was run.  evaluations: of all.
    work: these times the variables of each.  refused_loose: whether the loose tolerance was refused.
    """

    scene: Scene
    bundles: Mapping[str, Labelled]
    fewer: Sequence[Mapping[str, Labelled]]
    filled: Callable[[Scene], Scene]
    chosen: Sequence[Quantity]
    progress: Progress
    points: dict[Key, Point] = field(default_factory=dict)
    evaluations: int = 0
    work: float = 0.0
    refused_loose: bool = False
    _variants: dict[tuple[frozenset[str], bool], Scene] = field(default_factory=dict)
    _engines: dict[tuple[frozenset[str], int | None, str], Engine | None] = field(default_factory=dict)

    @cached_property
    def every(self) -> tuple[Effect, ...]:
        """All effects of the scene."""
        return effects(self.scene)

    def _names(self, gone: Collection[Effect]) -> frozenset[str]:
        """Of effects, and of those within them, which go with them."""
        names = {effect.name for effect in gone}
        return frozenset(names | {effect.name for effect in self.every if effect.within in names})

    def variant(self, gone: Collection[Effect]) -> Scene:
        """The scene without some effects and what lies within them, integrated as pilots are."""
        names = self._names(gone)
        if (names, self.refused_loose) not in self._variants:
            bare = without(self.scene, [effect for effect in self.every if effect.name in names])
            self._variants[names, self.refused_loose] = self._made(bare)
        return self._variants[names, self.refused_loose]

    def _made(self, bare: Scene) -> Scene:
        contacts = bool(bare.contacts() or bare.stop)
        smooth = bool(bare.flexible()) and not contacts
        usual: dict[str, object] = {"integrator": SMOOTH, "rtol": SMOOTH_RTOL} if smooth else {"rtol": RTOL}
        if contacts:
            usual = {"rtol": self.loose(bare), "evaluations": self.extent.most}
        return self.filled(edited(bare, {"solver": usual}))

    def loose(self, variant: Scene) -> float:
        """The tolerance of a variant with contacts."""
        clearances = [joint.clearance for joint in variant.contacts().values()]
        if self.refused_loose:
            return RTOL
        if not clearances:
            return LOOSEST
        return float(np.clip(OF_CLEARANCE * min(clearances) / self.extent.size, TIGHTEST, LOOSEST))

    @cached_property
    def extent(self) -> Extent:
        """Of the full scene."""
        model = tabulate(build(placed(self.scene), self.bundles))
        return Extent(model.mechanism.length, model.nq + model.nv)

    def part(self, gone: Collection[Effect]) -> float:
        """The part of the time over which a variant is compared with others, so that it does not take too long.

        Its beginning is run from one start to know, and less where the part then takes too long all the same.
        """
        begun = self.must_run(gone, BEGINNING, 0)
        fraction = BEGINNING * ALLOWED / (MEMBERS * max(begun.evaluations, 1) * self.extent.variables)
        fraction = LEAST_PART if begun.refused else float(np.clip(fraction, LEAST_PART, 1.0))
        return longest(fraction, lambda part: self.must_run(gone, part))[0]

    def whole(self, gone: Collection[Effect]) -> float:
        """The part of the time over which a variant that stays loose is examined: all of it where that can be had."""
        return min(1.0, WHOLE_TIME * self.part(gone))

    def point(
        self,
        gone: Collection[Effect],
        *,
        level: int | None = None,
        fraction: float = 1.0,
        members: int = MEMBERS,
        **solver: object,
    ) -> Point:
        """What is watched of a variant over a fraction of its time; a refusal of the solver is in the point.

        level: with so few modes of those bodies that have a choice; None: with all.  members: starts, where there are
            contacts.
        """
        scene, names = self.variant(gone), self._names(gone)
        key = (names, json.dumps([scene.solver.model_dump(mode="json") | solver, level, fraction, members]))
        if key not in self.points:
            mine = {name: bundle for name, bundle in self.bundles.items() if name in scene.flexible()}
            if level is not None:
                mine |= {name: bundle for name, bundle in self.fewer[level].items() if name in mine}
                scene = with_modes(scene, self.modes(level, mine))
            end = scene.time.start + fraction * (scene.time.end - scene.time.start)
            scene = edited(scene, {f"solver.{k}": v for k, v in solver.items()} | {"time.end": end})
            self.progress(None, f"run {len(self.points) + 1}: {scene.summary()}")
            starts = members if scene.contacts() or scene.stop else 0
            place = names, level, scene.solver.integrator
            runner = Runner(mine, recorded(scene.owners(), self.chosen), starts, engine=self._engines.get(place))
            measured = self.points[key] = runner.run(scene)
            self._engines[place] = runner.engine
            self.evaluations += measured.evaluations
            self.work += measured.evaluations * self._variables(mine)
        return self.points[key]

    def modes(self, level: int, bodies: Collection[str]) -> dict[str, int]:
        """Numbers of modes of a level, of those bodies that have a choice."""
        return {name: int(bundle.sizes["mode"]) for name, bundle in self.fewer[level].items() if name in bodies}

    def saved(self, level: int) -> float:
        """Variables of the full scene for each one that is left with so few modes."""
        return self.extent.variables / self._variables({**self.bundles, **self.fewer[level]})

    def _variables(self, bundles: Mapping[str, Labelled]) -> int:
        """Of the full scene with these flexible bodies."""
        left_out = sum(b.sizes["mode"] for b in self.bundles.values()) - sum(b.sizes["mode"] for b in bundles.values())
        return max(self.extent.variables - 2 * int(left_out), 1)

    def must_run(self, gone: Collection[Effect], fraction: float, members: int = MEMBERS) -> Point:
        """What is watched of a variant that the decisions need, at a tight tolerance where the loose one is refused.

        Raises SolverError where it is refused then, too, for another reason than that it takes long.
        """
        point = self.point(gone, fraction=fraction, members=members)
        if point.refused and TAKES_LONG not in point.refused:
            self.refused_loose = True
            point = self.point(gone, fraction=fraction, members=members, rtol=RTOL)
        if point.refused and TAKES_LONG not in point.refused:
            raise SolverError(f"{self.scene.name}: the scene cannot be run as it is: {point.refused}")
        return point

    def between(self, a: Point, b: Point) -> dict[str, Influence]:
        """Difference of two of them in each quantity; infinitely where one of them was refused."""
        if a.refused or b.refused:
            return {q.name: Influence(np.inf) for q in self.chosen}
        return {q.name: influence(a, b, q, MEMBERS) for q in self.chosen}

    def same_starts(self, a: Point, b: Point, requested: Mapping[str, float]) -> dict[str, Influence]:
        """Difference of two ways to integrate one variant, in each quantity; infinite where one was refused."""
        if a.refused or b.refused:
            return dict.fromkeys(requested, Influence(np.inf))
        return {q.name: same_starts(a, b, q, requested[q.name]) for q in self.chosen}
