"""The decisions of a plan: the error that is wanted is a budget, and what is dropped spends it.

Order of the evidence: bounds and first-order responses along the ideal motion (`dynamics.linear.play`), which cost one
run of the ideal mechanism; then runs of variants, rigid ones with clearance and flexible ones without, which are cheap;
then, where clearance stays, a loose run of the whole scene to see whether flexible bodies change what it does.
What is not shown to be small is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.decisions import BOUND, NONE, PILOT, RESPONSE, Decision, Plan
from flexclear.pipeline.core.influence import Influence
from flexclear.pipeline.core.progress import Progress, silent
from flexclear.pipeline.core.scene.coupling import lessened, uncoupled
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.variants import CLEARANCE, FLEXIBILITY, Effect, effects
from flexclear.pipeline.core.scene.wanted import KINDS, parse
from flexclear.pipeline.dynamics.linear.play import OF_POSE, Bounds, bounds
from flexclear.pipeline.dynamics.plan.pilots import BEGINNING, MEMBERS, RTOL, Pilots
from flexclear.pipeline.dynamics.plan.tolerance import chosen_solver
from flexclear.pipeline.dynamics.plan.wanted import wanted_in
from flexclear.pipeline.dynamics.run.run import integrate

#: share of what is wanted that dropped effects may use up together; the rest is for what is not estimated
BUDGET = 0.75
#: what bounds of clearances, which hold whatever happens, may use up of it
BY_BOUND = 0.9
#: a bent body vibrates about its quasi-static deflection, by as much again after a sudden load; and half of that more
#: for what the response leaves out: turning, and loads that follow the vibration
VIBRATION = 3.0
#: what flexible bodies may change of what impacts of rigid ones do to rates and forces, as a share of that
OF_IMPACTS = 0.5
#: what an influence measured with pilots' tolerance may be wrong by, as a share of it
OF_PILOT = 0.15
#: what the rest of the time may add to what a run over a part of it shows, as a share
WHOLE = 1.0
#: where members part, static modes are only trusted that were seen over this part of the time
LEAST_SEEN = 0.5
#: effects that cost nothing to keep are dropped below this share of what is wanted
NEGLIGIBLE = 0.02
#: why parts go that the motion asked for never feels
UNCOUPLED = "nothing couples it to what is asked for"


@dataclass
class Search:
    """The state of the decisions. used: of the budget, by quantity, as shares of what is wanted.  modes: of bodies that
    need fewer beside impacts."""

    pilots: Pilots
    wanted: dict[str, float]
    used: dict[str, float] = field(default_factory=dict)
    decisions: dict[str, Decision] = field(default_factory=dict)
    modes: dict[str, int] = field(default_factory=dict)

    @property
    def gone(self) -> list[Effect]:
        """What has been dropped."""
        return [d.effect for d in self.decisions.values() if not d.kept]

    def fits(self, most: Mapping[str, float], budget: float = BUDGET) -> bool:
        """Whether influences of at most this much fit into what is left of the budget, for all quantities."""
        return all(
            self.used.get(name, 0.0) + most.get(name, np.inf) / self.wanted[name] <= budget for name in self.wanted
        )

    def spend(self, most: Mapping[str, float]) -> None:
        """Take influences out of the budget."""
        for name in self.wanted:
            self.used[name] = self.used.get(name, 0.0) + most[name] / self.wanted[name]

    def decide(
        self,
        effect: Effect,
        kept: bool,
        evidence: str,
        reason: str,
        estimate: Mapping[str, float] | None = None,
        uncertainty: Mapping[str, float] | None = None,
    ) -> None:
        """Write down what becomes of an effect."""
        self.decisions[effect.name] = Decision(effect, kept, evidence, reason, estimate or {}, uncertainty or {})

    def judge(
        self, effect: Effect, small: bool, why: str, most: Mapping[str, float], apart: Mapping[str, Influence]
    ) -> None:
        """Write down what short runs say. why: it may go, if it is small.  most, apart: what it does there."""
        difference = {name: influence.difference for name, influence in apart.items()}
        uncertainty = {name: influence.uncertainty for name, influence in apart.items()}
        self.decide(effect, not small, PILOT, why if small else _too_much(most, self.wanted), difference, uncertainty)


def plan(
    scene: Scene,
    bundles: Mapping[str, xr.Dataset],
    fewer: Mapping[str, xr.Dataset],
    filled: Callable[[Scene], Scene],
    progress: Progress,
) -> Plan:
    """The decisions for a scene with `[accuracy]`.

    bundles: reduced flexible bodies.  fewer: the same of fewer modes, of those that have a choice.  filled: a variant
    with the rigid bodies that recipes describe filled in.
    Raises InputError where nothing is wanted, or the motion itself is below it; SolverError where the scene, or what is
    left of it, cannot be run.
    """
    assert scene.accuracy is not None
    quantities = [parse(name, scene.owners()) for name in scene.accuracy.quantities]
    apart = uncoupled(scene, {q.owner.partition(".")[0] for q in quantities})
    bare = lessened(_plain(scene), apart)
    mine, less = ({n: b for n, b in given.items() if n in bare.flexible()} for given in (bundles, fewer))
    pilots = Pilots(bare, mine, less, filled, quantities, progress)
    _ = pilots.extent  # a scene that cannot be built is refused before anything is run
    pilots.must_run((), BEGINNING, 0)
    every = effects(bare)
    loose = [effect for effect in every if effect.kind == CLEARANCE]
    soft = [effect for effect in every if effect.kind == FLEXIBILITY]
    inner = [effect for effect in every if effect.within]
    within_bodies = [e for e in inner if e.within.startswith("body.")]
    ideal = pilots.point([*loose, *soft, *inner], rtol=RTOL)
    search = Search(pilots, wanted_in(scene, quantities, ideal, lambda: pilots.point([*soft, *within_bodies])))
    found = _bounds(search, [*loose, *soft, *inner]) if loose or soft else Bounds({}, {}, {})
    _clearances(search, loose, [*soft, *inner], found, ideal)
    _interactions(search, soft, inner)
    _flexibilities(search, soft, loose, inner, found)
    _confirm(search, soft, inner)
    _others(search, [e for e in every if e.kind not in (CLEARANCE, FLEXIBILITY)], every)
    return _finished(search, effects(scene), apart)


def _plain(scene: Scene) -> Scene:
    from flexclear.pipeline.core.scene.load import edited

    return edited(scene, dict.fromkeys(("accuracy", "ensemble", "sections", "view")))


def _bounds(search: Search, gone: Sequence[Effect]) -> Bounds:
    scene = search.pilots.variant(gone)
    if not any(q.kind in OF_POSE for q in search.pilots.chosen):
        return Bounds({}, {}, {})
    run = integrate(scene, {}, silent)
    search.pilots.evaluations += int(run.trajectory.counters["evaluations"])
    return bounds(search.pilots.scene, run, search.pilots.bundles, search.pilots.chosen)


def _clearances(search: Search, loose: Sequence[Effect], soft: Sequence[Effect], found: Bounds, ideal: Point) -> None:
    """Which joints stay loose: by bounds where only the pose is asked for, else by runs of rigid bodies."""
    asked = {q.owner for q in search.pilots.chosen if KINDS[q.kind].owner == "contact"}
    for effect in loose:
        if effect.owner in asked:
            search.decide(effect, True, NONE, "a quantity of this contact is asked for")
    free = [effect for effect in loose if effect.owner not in asked]
    if not free:
        return
    reach = {effect.name: found.clearance.get(effect.owner, {}) for effect in free}
    total = _sum(reach.values(), search.wanted)
    if search.fits(total, BY_BOUND):
        search.spend(total)
        for effect in free:
            search.decide(effect, False, BOUND, "its play cannot move what is asked for by more", reach[effect.name])
        return
    there = search.pilots.point([e for e in soft if e.kind == FLEXIBILITY or e.within.startswith("body.")])
    dropped: list[Effect] = []
    for effect in sorted(free, key=lambda e: max(reach[e.name].values(), default=np.inf)):
        trial = [*dropped, effect]
        variant = _rigid_without(search, trial, soft)
        apart = _with_doubt(search, search.pilots.between(variant, there), bool(soft))
        most = {name: i.most for name, i in apart.items()}
        for name, bound in _sum((reach[e.name] for e in trial), search.wanted).items():
            most[name] = min(most[name], bound)
        small = search.fits(most)
        search.judge(effect, small, "its impacts change what is asked for by less", most, apart)
        if small:
            dropped = trial
            left = most
    if dropped:
        search.spend(left)


def _interactions(search: Search, soft: Sequence[Effect], inner: Sequence[Effect]) -> None:
    """Clearances that rigid bodies may do without stay where flexible ones, shaken by impacts, may not.

    Rates and forces only: vibrations that impacts excite are small in places and large in these.
    """
    pilots = search.pilots
    dropped = [e for e in search.gone if e.kind == CLEARANCE and search.decisions[e.name].evidence == PILOT]
    if not soft or not dropped or all(q.kind in OF_POSE for q in pilots.chosen):
        return
    share = pilots.part(())
    names = {effect.name for effect in dropped}
    lacking = pilots.point([*dropped, *(e for e in inner if e.within in names)], share=share)
    apart = _with_doubt(
        search, pilots.between(lacking, pilots.point((), share=share)), False, 0.0 if share == 1.0 else WHOLE
    )
    most = {name: i.most for name, i in apart.items()}
    if all(most[name] <= BUDGET * wanted for name, wanted in search.wanted.items()):
        return
    search.used = {}
    for effect in dropped:
        search.judge(effect, False, "", most, apart)


def _rigid_without(search: Search, trial: Sequence[Effect], soft: Sequence[Effect]) -> Point:
    names = {effect.name for effect in trial}
    inner = [e for e in soft if e.within in names or e.kind == FLEXIBILITY or e.within.startswith("body.")]
    return search.pilots.point([*trial, *inner])


def _with_doubt(search: Search, apart: Mapping[str, Influence], soft: bool, more: float = 0.0) -> dict[str, Influence]:
    """With what pilots may be wrong by, what flexible bodies may change of the impacts, and a share `more`."""
    kinds = {q.name: q.kind for q in search.pilots.chosen}
    found = {}
    for name, i in apart.items():
        share = more + OF_PILOT + (OF_IMPACTS if soft and kinds[name] not in OF_POSE else 0.0)
        found[name] = Influence(i.difference, i.uncertainty + share * i.difference)
    return found


def _sum(parts: object, wanted: Mapping[str, float]) -> dict[str, float]:
    return {name: sum(part.get(name, np.inf) for part in list(parts)) for name in wanted}  # type: ignore[call-overload]


def _too_much(most: Mapping[str, float], wanted: Mapping[str, float]) -> str:
    name = max(wanted, key=lambda n: most[n] / wanted[n])
    if not np.isfinite(most[name]):
        return f"without it {name} cannot be told, or has other events"
    return f"it may change {name} by {most[name]:.2g}, {most[name] / wanted[name]:.2g} times what is wanted"


def _flexibilities(
    search: Search, soft: Sequence[Effect], loose: Sequence[Effect], inner: Sequence[Effect], found: Bounds
) -> None:
    """Which bodies stay flexible."""
    if not soft:
        return
    kept_loose = [e for e in loose if e.name in search.decisions and search.decisions[e.name].kept]
    bent = {e.name: {n: VIBRATION * v for n, v in found.bending.get(e.owner, {}).items()} for e in soft}
    if kept_loose:
        _beside_impacts(search, soft, loose, kept_loose)
        return
    total = _sum(bent.values(), search.wanted)
    if search.fits(total):
        search.spend(total)
        for effect in soft:
            search.decide(
                effect, False, RESPONSE, "it bends too little to matter, vibration included", bent[effect.name]
            )
        return
    gone = [*search.gone, *(e for e in inner if e.within.startswith("joint."))]
    there = search.pilots.point(gone)
    dropped: list[Effect] = []
    for effect in sorted(soft, key=lambda e: max(bent[e.name].values(), default=np.inf)):
        trial = [*dropped, effect]
        names = {e.name for e in trial}
        variant = search.pilots.point([*gone, *trial, *(e for e in inner if e.within in names)])
        apart = _with_doubt(search, search.pilots.between(variant, there), False)
        most = {name: i.most for name, i in apart.items()}
        small = search.fits(most)
        search.judge(effect, small, "its deformation changes what is asked for by less", most, apart)
        if small:
            dropped, left = trial, most
    if dropped:
        search.spend(left)


def _confirm(search: Search, soft: Sequence[Effect], inner: Sequence[Effect]) -> None:
    """Clearances that go beside bodies that stay flexible: one run of all tells whether they do as was estimated.

    Bounds hold along the motion of rigid bodies, and flexible ones may go elsewhere.
    """
    pilots = search.pilots
    dropped = [effect for effect in search.gone if effect.kind == CLEARANCE]
    if not dropped or all(effect in search.gone for effect in soft):
        return
    share = min(1.0, MEMBERS * pilots.part(()))
    names = {effect.name for effect in search.gone}
    lacking = pilots.point([*search.gone, *(e for e in inner if e.within in names)], share=share)
    apart = pilots.between(lacking, pilots.must_run((), share, 0))
    most = {name: (1.0 if share == 1.0 else 1.0 + WHOLE) * i.difference for name, i in apart.items()}
    if all(most[name] <= wanted for name, wanted in search.wanted.items()):
        return
    for effect in dropped:
        search.judge(effect, False, "", most, apart)


def _beside_impacts(
    search: Search, soft: Sequence[Effect], loose: Sequence[Effect], kept_loose: Sequence[Effect]
) -> None:
    """Flexible bodies in a mechanism that stays loose: what they bend changes the impacts, and these everything.

    Runs of the whole mechanism at a loose tolerance, over as much of the time as they may take, tell what rigid bodies
    and what static modes alone would do.
    """
    pilots, gone = search.pilots, search.gone
    every = effects(pilots.scene)
    inner = [e for e in every if e.within in {g.name for g in gone}]
    gone = [*gone, *inner]
    share = pilots.part(gone)
    more = 0.0 if share == 1.0 else WHOLE
    whole = pilots.must_run(gone, share)
    rigid = [*soft, *(e for e in every if e.within in {s.name for s in soft})]
    # what takes longer than all modes do is no way to save time
    longest = {"evaluations": whole.evaluations // MEMBERS} if not whole.refused else {}
    apart = _with_doubt(search, pilots.between(pilots.point([*gone, *rigid], share=share), whole), False, more)
    most = {name: i.most for name, i in apart.items()}
    small = search.fits(most)
    if small:
        search.spend(most)
    for effect in soft:
        search.judge(effect, small, "with or without bending the loose joints do the same", most, apart)
    if small or not pilots.fewer:
        return
    if share < LEAST_SEEN:
        own = pilots.point([*gone, *rigid])
        if any(i.uncertainty > search.wanted[name] for name, i in pilots.between(own, own).items()):
            return  # members of rigid bodies part later, and the beginning does not tell what modes do then
    # the bodies go on to bend, so that chance, which members tell, does not count against leaving out what shakes them
    apart = pilots.between(pilots.point(gone, fewer=True, share=share, **longest), whole)
    most = {name: (1.0 + more) * i.difference for name, i in apart.items()}
    if not search.fits(most):
        return
    search.spend(most)
    search.modes = {name: int(bundle.sizes["mode"]) for name, bundle in pilots.fewer.items()}
    beyond = [name for name, i in apart.items() if i.uncertainty > search.wanted[name]]
    for effect in soft:
        if effect.owner in search.modes:
            told = search.decisions[effect.name]
            search.decisions[effect.name] = replace(told, reason=f"{told.reason}; {_static(beyond, kept_loose)}")


def _static(beyond: Sequence[str], kept_loose: Sequence[Effect]) -> str:
    """Why the modes with the ends held may go."""
    if not beyond:
        return "its static stiffness alone does the same"
    return (
        f"{' and '.join(beyond)} parts by more than is wanted when {kept_loose[0].owner} starts a hair elsewhere, and "
        "with static stiffness alone it differs by no more than that"
    )


def _others(search: Search, others: Sequence[Effect], every: Sequence[Effect]) -> None:
    """Gravity, friction, damping, stiffening, stops: kept unless a cheap run shows that they do next to nothing."""
    kept = {d.effect.name for d in search.decisions.values() if d.kept}
    gone = list(search.gone)
    dear = any(d.kept and d.effect.kind == FLEXIBILITY for d in search.decisions.values()) and any(
        d.kept and d.effect.kind == CLEARANCE for d in search.decisions.values()
    )
    for effect in others:
        if effect.within and effect.within not in kept:
            owner = next(e for e in every if e.name == effect.within)
            search.decide(effect, False, search.decisions[owner.name].evidence, f"goes with the {owner.words}")
            gone.append(effect)
    for effect in others:
        if effect.name in search.decisions:
            continue
        if dear:
            search.decide(effect, True, NONE, "to leave it out would save no time worth the look")
            continue
        there, lost = search.pilots.point(gone), search.pilots.point([*gone, effect])
        apart = search.pilots.between(lost, there)
        most = {name: i.most for name, i in apart.items()}
        small = search.fits(most, NEGLIGIBLE + max(search.used.values(), default=0.0)) and search.fits(most)
        if small:
            search.spend(most)
            gone.append(effect)
        search.judge(effect, small, "it does next to nothing", most, apart)


def _modes(search: Search) -> dict[str, int]:
    """Bodies that stay flexible and need fewer modes, and how many, all of them together."""
    pilots, gone = search.pilots, search.gone
    kept = [n for n in pilots.fewer if not any(e.owner == n and e.kind == FLEXIBILITY for e in gone)]
    if not kept:
        return {}
    if search.modes or pilots.variant(gone).contacts() or pilots.scene.stop:
        return search.modes  # beside impacts it has been decided
    apart = _with_doubt(search, pilots.between(pilots.point(gone, fewer=True), pilots.point(gone)), False)
    most = {name: i.most for name, i in apart.items()}
    if not search.fits(most):
        return {}
    search.spend(most)
    return {name: int(pilots.fewer[name].sizes["mode"]) for name in kept}


def _finished(search: Search, every: Sequence[Effect], apart: tuple[str, ...]) -> Plan:
    order = {effect.name: k for k, effect in enumerate(every)}
    modes = _modes(search)
    integrator, rtol, error = chosen_solver(search.pilots, search.gone, search.wanted, fewer=bool(modes))
    for effect in every:
        if ".".join(effect.name.split(".")[:2]) in apart:
            search.decide(effect, False, BOUND, UNCOUPLED, dict.fromkeys(search.wanted, 0.0))
    decisions = sorted(search.decisions.values(), key=lambda d: order[d.effect.name])
    pilots = search.pilots
    return Plan(
        tuple(decisions),
        dict(search.wanted),
        integrator,
        rtol,
        error,
        modes,
        pilots.evaluations,
        len(pilots.points),
        apart,
    )
