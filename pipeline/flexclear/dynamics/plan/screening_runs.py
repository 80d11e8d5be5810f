"""Screening runs: short runs of a scene's variants, each made once, with their costs."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from flexclear.artifacts.effect_size import Influence, compared_values, influence, same_starts
from flexclear.artifacts.labelled import Labelled
from flexclear.artifacts.points import Point
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.record.point import Runner
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.run import scene_in_place
from flexclear.scene.integrators import DEFAULT
from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene
from flexclear.scene.variants import Effect, effects, with_modes, without_effects
from flexclear.system.errors import EVALUATIONS as TAKES_LONG
from flexclear.system.errors import SolverError
from flexclear.system.progress import Progress

#: starts of screening runs with contacts: enough to see whether the motion diverges
MEMBERS = 3
#: tolerance of rigid screening runs without contact; tolerance and method of flexible ones, whose motion is stiff
RTOL, SMOOTH_RTOL, SMOOTH = 1e-7, 1e-5, "radau"
#: tolerance of screening runs with contacts: this fraction of the least clearance over the mechanism's size, between
#: two limits (errors of positions are the tolerance times that size, and must be small compared to the clearance)
OF_CLEARANCE, TIGHTEST, LOOSEST = 0.05, 1e-7, 1e-5
#: evaluations times variables of the screening runs of one variant with contacts, all members together: measured, some
#: 0.2 s on one core.  Longer runs cover a part of the time, at least this much, and shorten by this factor
ALLOWED, LEAST_PART, SHORTER = 5e6, 0.0625, 0.25
#: initial part of the time whose run predicts the cost of the rest
BEGINNING = 0.03125
#: with clearance, decisions rest on runs over this multiple of that part: in most scenes over all of the time
WHOLE_TIME = 8
#: a screening run stops at this multiple of its expected evaluations, and then counts as refused
GIVEN_UP = 4.0
#: runs at tight tolerances may take this many times more
OF_TIGHT = 2
#: identity of a variant: the effects that it lacks, and its solver
Key = tuple[frozenset[str], str]


def longest_affordable(fraction: float, run: Callable[[float], Point]) -> tuple[float, Point]:
    """Return the largest part of the time, from a fraction down, whose run is not too long, and that run."""
    while TAKES_LONG in (point := run(fraction)).refused and fraction > LEAST_PART:
        fraction = max(LEAST_PART, SHORTER * fraction)
    return fraction, point


@dataclass(frozen=True)
class Extent:
    """Cost of a scene's runs. size: of the mechanism [m].  variables: of its state."""

    size: float
    variables: int

    @property
    def most(self) -> int:
        """Number of evaluations at which a run stops."""
        return int(GIVEN_UP * WHOLE_TIME * ALLOWED / (MEMBERS * self.variables))


@dataclass
class ScreeningRuns:
    """Variants of a scene that have been run.

    bundles: reduced flexible bodies.  fewer: those with fewer modes, where available, levels with the fewest
    first.  filled: fills in rigid bodies that recipes describe.  points: results by variant.  evaluations: of all runs.
    work: evaluations times variables, sum_by_quantity.  refused_loose: True when the loose tolerance was refused.
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
    def all_effects(self) -> tuple[Effect, ...]:
        """All effects of the scene."""
        return effects(self.scene)

    def _names(self, dropped: Collection[Effect]) -> frozenset[str]:
        """Return the names of effects, and of the effects within them, which are dropped with them."""
        names = {effect.name for effect in dropped}
        return frozenset(names | {effect.name for effect in self.all_effects if effect.within in names})

    def variant(self, dropped: Collection[Effect]) -> Scene:
        """Return the scene without some effects and those within them, with the integration of screening runs."""
        names = self._names(dropped)
        if (names, self.refused_loose) not in self._variants:
            bare = without_effects(self.scene, [effect for effect in self.all_effects if effect.name in names])
            self._variants[names, self.refused_loose] = self._with_solver(bare)
        return self._variants[names, self.refused_loose]

    def _with_solver(self, bare: Scene) -> Scene:
        contacts = bool(bare.contacts() or bare.stops())
        smooth = bool(bare.flexible()) and not contacts
        usual: dict[str, object] = (
            {"integrator": SMOOTH, "rtol": SMOOTH_RTOL} if smooth else {"integrator": DEFAULT, "rtol": RTOL}
        )
        if contacts:
            usual = {"integrator": DEFAULT, "rtol": self.loose_tolerance(bare), "evaluations": self.extent.most}
        return self.filled(edited(bare, {"solver": usual}))

    def loose_tolerance(self, variant: Scene) -> float:
        """Return the tolerance of a variant with contacts."""
        clearances = [joint.clearance for joint in variant.contacts().values()]
        if self.refused_loose:
            return RTOL
        if not clearances:
            return LOOSEST
        return float(np.clip(OF_CLEARANCE * min(clearances) / self.extent.size, TIGHTEST, LOOSEST))

    @cached_property
    def extent(self) -> Extent:
        """Cost parameters of the full scene."""
        model = tabulate(build(scene_in_place(self.scene), self.bundles))
        return Extent(model.mechanism.length, model.nq + model.nv)

    def affordable_part(self, dropped: Collection[Effect]) -> float:
        """Return the part of the time over which a variant is compared with others, so that it does not take too long.

        A run of the beginning from one start predicts that part; it shrinks where the part still takes too long.
        """
        beginning = self.must_run(dropped, BEGINNING, 0)
        fraction = BEGINNING * ALLOWED / (MEMBERS * max(beginning.evaluations, 1) * self.extent.variables)
        fraction = LEAST_PART if beginning.refused else float(np.clip(fraction, LEAST_PART, 1.0))
        return longest_affordable(fraction, lambda part: self.must_run(dropped, part))[0]

    def examined_part(self, dropped: Collection[Effect]) -> float:
        """Return the part of the time over which a variant with clearance is examined: all of it where affordable."""
        return min(1.0, WHOLE_TIME * self.affordable_part(dropped))

    def point(
        self,
        dropped: Collection[Effect],
        *,
        level: int | None = None,
        fraction: float = 1.0,
        members: int = MEMBERS,
        **solver: object,
    ) -> Point:
        """Return the watched quantities of a variant over a fraction of its time; the point holds a solver's refusal.

        level: of modes, for bodies with several levels; None: all modes.  members: number of starts, with
            contacts only.
        """
        scene, names = self.variant(dropped), self._names(dropped)
        key = (names, json.dumps([scene.solver.model_dump(mode="json") | solver, level, fraction, members]))
        if key not in self.points:
            own = {name: bundle for name, bundle in self.bundles.items() if name in scene.flexible()}
            if level is not None:
                own |= {name: bundle for name, bundle in self.fewer[level].items() if name in own}
                scene = with_modes(scene, self.modes(level, own))
            end = scene.time.start + fraction * (scene.time.end - scene.time.start)
            scene = edited(scene, {f"solver.{k}": v for k, v in solver.items()} | {"time.end": end})
            self.progress(None, f"run {len(self.points) + 1}: {scene.summary()}")
            starts = members if scene.contacts() or scene.stops() else 0
            place = names, level, scene.solver.integrator
            runner = Runner(own, compared_values(scene.owners(), self.chosen), starts, engine=self._engines.get(place))
            measured = self.points[key] = runner.run(scene)
            self._engines[place] = runner.engine
            self.evaluations += measured.evaluations
            self.work += measured.evaluations * self._variables(own)
        return self.points[key]

    def modes(self, level: int, bodies: Collection[str]) -> dict[str, int]:
        """Return the numbers of modes of a level, for those bodies that have a choice."""
        return {name: int(bundle.sizes["mode"]) for name, bundle in self.fewer[level].items() if name in bodies}

    def saved_work(self, level: int) -> float:
        """Return the ratio of the full scene's number of variables to that with this level of modes."""
        return self.extent.variables / self._variables({**self.bundles, **self.fewer[level]})

    def _variables(self, bundles: Mapping[str, Labelled]) -> int:
        """Return the number of variables of the full scene with these flexible bodies."""
        left_out = sum(b.sizes["mode"] for b in self.bundles.values()) - sum(b.sizes["mode"] for b in bundles.values())
        return max(self.extent.variables - 2 * int(left_out), 1)

    def must_run(self, dropped: Collection[Effect], fraction: float, members: int = MEMBERS) -> Point:
        """Return the point of a variant that the decisions need, at a tight tolerance where the loose one is refused.

        Raises SolverError where the tight one is refused too, for another reason than its cost.
        """
        point = self.point(dropped, fraction=fraction, members=members)
        if point.refused and TAKES_LONG not in point.refused:
            self.refused_loose = True
            point = self.point(dropped, fraction=fraction, members=members, rtol=RTOL)
        if point.refused and TAKES_LONG not in point.refused:
            raise SolverError(f"{self.scene.name}: the scene cannot be run as it is: {point.refused}")
        return point

    def differences(self, a: Point, b: Point) -> dict[str, Influence]:
        """Return the difference of two points in each quantity; infinite where one of them was refused."""
        if a.refused or b.refused:
            return {q.name: Influence(np.inf) for q in self.chosen}
        return {q.name: influence(a, b, q, MEMBERS) for q in self.chosen}

    def paired_differences(self, a: Point, b: Point, requested: Mapping[str, float]) -> dict[str, Influence]:
        """Return the difference of two integrations of a variant, in each quantity; infinite if one was refused."""
        if a.refused or b.refused:
            return dict.fromkeys(requested, Influence(np.inf))
        return {q.name: same_starts(a, b, q, requested[q.name]) for q in self.chosen}
