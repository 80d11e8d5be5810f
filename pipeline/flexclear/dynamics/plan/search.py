"""Decisions of a plan: the requested error is a budget, and each dropped effect spends a part of it.

Order of the evidence: bounds and first-order responses along the ideal motion (`dynamics.linear.clearance_response`),
which cost one run of the ideal mechanism; then cheap runs of variants, rigid ones with clearance and flexible ones
without;
then, where clearance stays, a loose run of the whole scene, which shows whether flexible bodies change its motion.
Effects stay unless a result shows that they are small.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from flexclear.artifacts import effect_size
from flexclear.artifacts.labelled import Labelled
from flexclear.artifacts.points import Point
from flexclear.dynamics.linear.clearance_response import OF_POSE, bound_effects
from flexclear.dynamics.linear.response import Response, response
from flexclear.dynamics.plan.budget import BUDGET, UNCHANGED, Integration, Search, possible_increase, upper_bounds
from flexclear.dynamics.plan.impacts import choose_with_contacts, decide_bending
from flexclear.dynamics.plan.screening_runs import BEGINNING, MEMBERS, RTOL, ScreeningRuns
from flexclear.dynamics.plan.tolerance import cheaper_method, choose_without_contacts, scene_is_cheaper
from flexclear.dynamics.run.run import Run, integrate
from flexclear.scene.load import edited
from flexclear.scene.plan_decisions import BOUND, NO_CHEAPER, NONE, NOT_WORTH, PILOT, RESPONSE, Plan
from flexclear.scene.quantity import KINDS, OF_CLEARANCE, Quantity, parse
from flexclear.scene.schema import Scene
from flexclear.scene.variants import CLEARANCE, FLEXIBILITY, Effect, effects, uncoupled_paths, without_parts
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress, silent

#: fraction of the budget that bounds of clearances may use up; bounds hold under all circumstances
BY_BOUND = 0.9
#: factor on the response of flexible bodies, which neglects that the pose turns during a vibration and that
#: loads follow the vibration; compared with runs the response is 0.94 times the true effect or more
OF_RESPONSE = 2.0
#: peaks of forces between flexible bodies are at least this fraction of those between rigid ones
SOFTER = 0.5
#: effects that cost nothing to keep are dropped below this fraction of the requested accuracy
FREE, NEGLIGIBLE = ("gravity", "damping", "stiffening"), 0.02
#: reason to drop parts that do not affect the requested motion
UNCOUPLED = "the requested quantities do not depend on it"


def plan(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    fewer: Sequence[Mapping[str, xr.Dataset]],
    filled: Callable[[Scene], Scene],
    progress: Progress,
    watched: bool = False,
) -> Plan:
    """Return the decisions for a scene with `[accuracy]`.

    bundles: reduced flexible bodies.  fewer: those with fewer modes, for bodies with a choice, levels with the
    fewest first.  filled: fills a variant
    with the rigid bodies that recipes describe.  watched: the quantities are those that the scene watches, not named
    for their accuracy: those that never change are left out.
    Raises InputError where nothing is requested, or the motion is smaller than the request; SolverError where the
    scene, or its planned variant, cannot be run.
    """
    assert scene.accuracy is not None
    quantities = [parse(name, scene.owners()) for name in scene.accuracy.quantities]
    uncoupled_parts = uncoupled_paths(scene, {term.owner.partition(".")[0] for q in quantities for term in q.terms()})
    plain = edited(scene, dict.fromkeys(("accuracy", "ensemble", "sections", "view")))
    bare = without_parts(plain, uncoupled_parts)
    own, *less = ({n: b for n, b in given.items() if n in bare.flexible()} for given in (bundles, *fewer))
    runs = ScreeningRuns(bare, own, less, filled, quantities, progress)
    _ = runs.extent  # refuses a scene that cannot be built, before anything is run
    runs.must_run((), BEGINNING, 0)
    loose, soft = ([effect for effect in runs.all_effects if effect.kind == kind] for kind in (CLEARANCE, FLEXIBILITY))
    ideal = runs.point([*loose, *soft], rtol=RTOL)
    simpler = (lambda: ideal, lambda: runs.point(soft), lambda: runs.point(loose), lambda: runs.point(()))
    search = Search(runs, _requested_accuracies(scene, quantities, simpler, watched))
    runs.chosen = [q for q in quantities if q.name in search.requested]
    rigid = _run_ideal(search, [*loose, *soft]) if loose or soft else None
    _decide_clearances(search, loose, soft, rigid)
    _decide_interactions(search, soft)
    _decide_flexibility(search, soft, loose, rigid)
    _confirm_clearances(search, soft)
    _decide_others(search)
    constant = tuple(q.name for q in quantities if q.name not in search.requested)
    return replace(_complete_plan(search, effects(scene), uncoupled_parts), constant=constant)


def _requested_accuracies(
    scene: Scene, quantities: Sequence[Quantity], simpler: Sequence[Callable[[], Point]], watched: bool
) -> dict[str, float]:
    """Return the requested accuracy by quantity [SI]; relative ones refer to the size in the ideal mechanism. For
    quantities of contacts the size is that with rigid bodies, half of it where bodies are flexible.

    simpler: run the ideal mechanism, that with clearance, that with flexible bodies, and the full one: the first that
    has a quantity says its size.  watched: quantities that never change are left out.
    Raises InputError where a quantity never changes (with `watched`: where none changes), or all requested errors
    exceed the quantities' sizes; SolverError where the mechanism with rigid bodies cannot be run.
    """
    accuracies, sizes, constant = dict[str, float](), dict[str, float](), list[str]()
    where = f"{scene.path or scene.name} [accuracy]"
    assert scene.accuracy is not None
    for q in quantities:
        of_contact = any(KINDS[term.kind].owner in OF_CLEARANCE for term in q.terms())
        for run in simpler[of_contact:]:
            point = run()
            if point.refused:
                raise SolverError(f"{scene.name}: a simpler mechanism cannot be run: {point.refused}")
            if _has_quantity(point, q):
                break
        sizes[q.name] = effect_size.reference_size(point, q) * (SOFTER if of_contact and scene.flexible() else 1.0)
        want = scene.accuracy.quantities[q.name]
        if want.absolute is None and sizes[q.name] <= effect_size.rounding_threshold(point, q):
            constant.append(q.name)
        else:
            accuracies[q.name] = want.absolute if want.absolute is not None else (want.relative or 0.0) * sizes[q.name]
    if constant and not (watched and accuracies):
        raise InputError(
            f"{where} {constant[0]}",
            "is a relative accuracy, but the quantity is constant in the ideal mechanism",
            "give an absolute one, with a unit",
        )
    quantities = [q for q in quantities if q.name in accuracies]
    sizes = {name: sizes[name] for name in accuracies}
    if all(accuracies[name] >= size for name, size in sizes.items()):
        # forces and rates may come from impacts alone
        more = simpler[1 if scene.contacts() or scene.stops() else 0]()
        there = {q.name: effect_size.reference_size(more, q) for q in quantities if _has_quantity(more, q)}
        sizes = {name: max(size, there.get(name, 0.0)) for name, size in sizes.items()}
    if all(accuracies[name] >= size for name, size in sizes.items()):
        q = quantities[0]
        raise InputError(
            f"{where} {q.name}",
            f"{accuracies[q.name]:.3g} {q.unit} exceeds its change ({sizes[q.name]:.3g} {q.unit}), "
            "and so are all other requested accuracies: the plan would remove all effects, even the motion",
            "request an accuracy below the change of the quantity",
        )
    return accuracies


def _has_quantity(point: Point, quantity: Quantity) -> bool:
    return any(name.rpartition(".")[0] == quantity.name for name in point.values)


def _run_ideal(search: Search, dropped: Sequence[Effect]) -> Run:
    """Run the ideal mechanism."""
    run = integrate(search.runs.variant(dropped), {}, silent)
    search.runs.evaluations += int(run.trajectory.counters["evaluations"])
    return run


def _decide_clearances(search: Search, loose: Sequence[Effect], soft: Sequence[Effect], rigid: Run | None) -> None:
    """Decide which joints keep their clearance: by bounds if only poses are requested, else by runs of rigid bodies."""
    asked = {t.owner for q in search.runs.chosen for t in q.terms() if KINDS[t.kind].owner in OF_CLEARANCE}
    for effect in loose:
        if effect.owner in asked:
            search.decide(effect, True, NONE, "a quantity of this contact is requested")
    free = [effect for effect in loose if effect.owner not in asked]
    if not free:
        return
    runs, bounded = search.runs, dict[str, Mapping[str, float]]()
    if rigid is not None and any(q.kind in OF_POSE for q in runs.chosen):
        bounded = dict(bound_effects(runs.scene, rigid, runs.chosen))
    reach = {effect.name: bounded.get(effect.owner, {}) for effect in free}
    total = sum_by_quantity(reach.values(), search.requested)
    if search.fits(total, BY_BOUND):
        search.spend(total)
        for effect in free:
            search.decide(effect, False, BOUND, "its effect is below the budget", reach[effect.name])
        return
    flexible = any(effect.kind == FLEXIBILITY or effect.within for effect in runs.all_effects)
    ordered = sorted(free, key=lambda e: max(reach[e.name].values(), default=np.inf))
    _drop_in_turn(search, ordered, soft, reach, "its impacts change the requested quantities by less", flexible)


def _drop_in_turn(
    search: Search,
    ordered: Sequence[Effect],
    others: Sequence[Effect],
    reach: Mapping[str, Mapping[str, float]],
    why: str,
    flexible: bool,
) -> None:
    """Drop effects one after the other, as long as their joint effect size fits into the budget.

    others: effects that no run has.  reach: bounds by effect, where known.  flexible: as of `Search.compare`.
    """
    runs, dropped, left = search.runs, list[Effect](), dict[str, float]()
    reference = runs.point(others)
    for effect in ordered:
        trial = [*dropped, effect]
        sizes, most = search.compare(runs.point([*others, *trial]), reference, flexible=flexible)
        bound = sum_by_quantity([reach.get(e.name, {}) for e in trial], search.requested)
        upper = {name: min(value, bound[name]) for name, value in most.items()}
        small = search.fits(upper)
        search.judge(effect, why if small else "", upper, sizes)
        if small:
            dropped, left = trial, upper
    if dropped:
        search.spend(left)


def _decide_interactions(search: Search, soft: Sequence[Effect]) -> None:
    """Keep clearances that rigid bodies can do without but flexible bodies, excited by impacts, cannot.

    This concerns rates and forces only: vibrations after impacts are small in positions and large in rates and forces.
    """
    runs = search.runs
    dropped = [e for e in search.dropped if e.kind == CLEARANCE and search.decisions[e.name].evidence == PILOT]
    if not soft or not dropped or all(q.kind in OF_POSE for q in runs.chosen):
        return
    fraction = runs.affordable_part(())
    changed, full = (runs.point(gone, fraction=fraction) for gone in (dropped, ()))
    sizes, upper = search.compare(changed, full, fraction=fraction)
    if all(upper[name] <= BUDGET * requested for name, requested in search.requested.items()):
        return
    search.used = {}
    for effect in dropped:
        search.judge(effect, "", upper, sizes)


def sum_by_quantity(parts: Collection[Mapping[str, float]], requested: Mapping[str, float]) -> dict[str, float]:
    """Return the sum by quantity, infinite where a part lacks the quantity."""
    return {name: sum(part.get(name, np.inf) for part in parts) for name in requested}


def _decide_flexibility(search: Search, soft: Sequence[Effect], loose: Sequence[Effect], rigid: Run | None) -> None:
    """Decide which bodies stay flexible."""
    if not soft:
        return
    if any(search.decisions[e.name].kept for e in loose):
        decide_bending(search, soft)
        return
    bundles, bending = search.runs.bundles, dict[str, Mapping[str, float]]()
    if rigid is not None:
        together = response(rigid, bundles, search.runs.chosen)
        for effect in soft:
            own = {effect.owner: bundles[effect.owner]}
            single = together if len(soft) == 1 else response(rigid, own, search.runs.chosen)
            bending[effect.name] = _add_margin(single.influence)
        total = _add_margin(together.influence)
        if search.fits(total):
            search.spend(total)
            why = f"its effect is below the budget: {_describe_vibration(together)}"
            for effect in soft:
                search.decide(effect, False, RESPONSE, why, bending[effect.name])
            return
    ordered = sorted(soft, key=lambda e: max(bending.get(e.name, {}).values(), default=np.inf))
    _drop_in_turn(
        search, ordered, search.dropped, {}, "its deformation changes the requested quantities by less", False
    )


def _add_margin(influence: Mapping[str, float]) -> dict[str, float]:
    """Return a first-order response with its uncertainty."""
    return {name: OF_RESPONSE * value for name, value in influence.items()}


def _describe_vibration(estimated: Response) -> str:
    """Describe the mechanism's first vibration, and the amplification of the first one that the loads excite."""
    first = f"the mechanism's first frequency is {estimated.first:.3g} Hz"
    if np.isnan(estimated.excited):
        return f"{first}, and the loads of the ideal motion excite no vibration"
    which = (
        "that vibration"
        if estimated.excited == estimated.first
        else f"the first excited vibration, of {estimated.excited:.3g} Hz,"
    )
    size = f"{estimated.amplification:.2g} times its quasi-static value"
    return f"{first}, and the loads of the ideal motion take {which} to {size}"


def _confirm_clearances(search: Search, soft: Sequence[Effect]) -> None:
    """Test dropped clearances together with bodies that stay flexible, by one run of the whole scene.

    Bounds hold along the motion of rigid bodies, and flexible bodies may move differently.
    """
    runs = search.runs
    dropped = [effect for effect in search.dropped if effect.kind == CLEARANCE]
    if not dropped or all(effect in search.dropped for effect in soft):
        return
    fraction = min(1.0, MEMBERS * runs.affordable_part(()))
    sizes = runs.differences(runs.point(search.dropped, fraction=fraction), runs.must_run((), fraction, 0))
    upper = {name: (1.0 + possible_increase(fraction)) * i.difference for name, i in sizes.items()}
    if all(upper[name] <= requested for name, requested in search.requested.items()):
        return
    for effect in dropped:
        search.judge(effect, "", upper, sizes)


def _decide_others(search: Search) -> None:
    """Decide on gravity, friction, damping, stiffening, stops: they stay unless a cheap run shows a small effect."""
    every = {effect.name: effect for effect in search.runs.all_effects}
    others = [effect for effect in every.values() if effect.kind not in (CLEARANCE, FLEXIBILITY)]
    remaining = {d.effect.name: d.effect.kind for d in search.decisions.values() if d.kept}
    dear = {CLEARANCE, FLEXIBILITY} <= set(remaining.values())
    for effect in others:
        if effect.within and effect.within not in remaining:
            owner = every[effect.within]
            search.decide(effect, False, search.decisions[owner.name].evidence, f"goes with the {owner.words}")
    for effect in others:
        if effect.name in search.decisions:
            continue
        if dear:
            search.decide(effect, True, NONE, NOT_WORTH)
            continue
        dropped = search.dropped
        reference, changed = search.runs.point(dropped), search.runs.point([*dropped, effect])
        sizes = search.runs.differences(changed, reference)
        upper = upper_bounds(sizes)
        small = search.fits(upper)
        free = effect.kind in FREE or bool(effect.within)  # friction is dropped together with its contact
        if small and free and not search.fits(upper, NEGLIGIBLE + max(search.used.values(), default=0.0)):
            search.judge(effect, "", upper, sizes, "it costs no time, and ")
            continue
        if small:
            search.spend(upper)
        search.judge(effect, "its effect is below the budget" if small else "", upper, sizes)


def _choose_integration(search: Search) -> Integration:
    """Choose number of modes, integrator and tolerance for the remaining effects."""
    runs, dropped = search.runs, search.dropped
    scene = runs.variant(dropped)
    if scene.contacts() or scene.stops():
        return choose_with_contacts(search)
    for level in range(len(runs.fewer)):
        if not runs.modes(level, scene.flexible()):
            continue
        _, upper = search.compare(runs.point(dropped, level=level), runs.point(dropped))
        if search.fits(upper):
            search.spend(upper)
            return choose_without_contacts(runs, dropped, search.requested, level)
    return choose_without_contacts(runs, dropped, search.requested, None)


def _complete_plan(
    search: Search,
    every: Sequence[Effect],
    uncoupled_parts: tuple[str, ...],
) -> Plan:
    order = {effect.name: k for k, effect in enumerate(every)}
    chosen = cheaper_method(search, _choose_integration(search))
    if scene_is_cheaper(search, chosen):
        chosen = UNCHANGED
        for decision in [d for d in search.decisions.values() if not d.kept]:
            search.decisions[decision.effect.name] = replace(decision, kept=True, reason=NO_CHEAPER)
    left = search.runs.variant(search.dropped).flexible()
    modes = {} if chosen.level is None else search.runs.modes(chosen.level, left)
    for effect in every:
        if ".".join(effect.name.split(".")[:2]) in uncoupled_parts:
            search.decide(effect, False, BOUND, UNCOUPLED, dict.fromkeys(search.requested, 0.0))
    decisions = sorted(search.decisions.values(), key=lambda d: order[d.effect.name])
    runs = search.runs
    return Plan(
        tuple(decisions),
        dict(search.requested),
        chosen.integrator,
        chosen.rtol,
        chosen.error,
        modes,
        runs.evaluations,
        len(runs.points),
        uncoupled_parts,
        chosen.ledger_tolerance,
    )
