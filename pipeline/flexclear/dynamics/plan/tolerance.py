"""Integrator and tolerance of a planned run: the loosest tolerance whose error is a small fraction of the requested
accuracy, and no more expensive than the scene's own method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexclear.dynamics.plan.budget import UNCHANGED, Integration, Search
from flexclear.dynamics.plan.screening_runs import (
    MEMBERS,
    OF_TIGHT,
    RTOL,
    SMOOTH,
    SMOOTH_RTOL,
    TAKES_LONG,
    ScreeningRuns,
)
from flexclear.dynamics.run.progress_rate import AFFORDABLE, scene_without_comparison
from flexclear.scene.integrators import DEFAULT, STIFF
from flexclear.scene.schema import Scene
from flexclear.scene.variants import Effect

#: fraction of the requested accuracy that the integration error may take
FRACTION = 0.15
#: tolerances to test, loosest first, down to that of the reference
TRIED = (1e-4, 1e-5, 1e-6)
STIFF_TRIED = (1e-3, 1e-4)
TIGHT = 1e-8
#: factor by which a planned run must be cheaper than the scene as it is
CHEAPER = 1.2
#: tightest tolerance of references, and their largest cost as a multiple of the evaluations at the scene's own
#: tolerance: a thousandth of the tolerance costs 2.4 times as much, by the method's order 8
TIGHTEST, AT_MOST = 1e-10, 4.0


def choose_without_contacts(
    runs: ScreeningRuns, dropped: Sequence[Effect], requested: Mapping[str, float], level: int | None
) -> Integration:
    """Choose integrator and tolerance for the scene without its dropped effects, where it has no contacts.

    level: of modes of its flexible bodies; None: all modes.
    """
    if not runs.variant(dropped).flexible():
        return _loosest_tolerance(runs, dropped, requested, DEFAULT, TRIED, RTOL, level)
    choice = _loosest_tolerance(runs, dropped, requested, SMOOTH, STIFF_TRIED, SMOOTH_RTOL, level)
    if choice.rtol > SMOOTH_RTOL or _is_within(choice.error, requested):
        return choice
    unknown, own = dict.fromkeys(requested, np.nan), own_method(runs.scene)
    if own is None:
        return Integration(DEFAULT, TIGHT, unknown, level)
    # no candidate was accurate enough, so use the method of the full scene
    integrator, rtol = own
    return Integration(integrator, max(rtol, TIGHT) if integrator == DEFAULT else rtol, unknown, level)


def own_method(scene: Scene) -> tuple[str, float] | None:
    """Return integrator and tolerance that the scene names; None where it leaves them open or steps are fixed."""
    if scene.by_need() or scene.solver.step is not None:
        return None
    return scene.solver.integrator, scene.solver.rtol


def cheaper_method(search: Search, chosen: Integration) -> Integration:
    """Return the choice, or the scene's own method where that takes fewer evaluations at sufficient accuracy.

    Both integrate the scene without dropped effects, over the part of the time that screening runs with contacts cover.
    """
    runs, dropped, own = search.runs, search.dropped, own_method(search.runs.scene)
    if own is None or chosen == UNCHANGED or (own[0] == chosen.integrator and own[1] <= chosen.rtol):
        return chosen
    bare = runs.variant(dropped)
    loose = bool(bare.contacts() or bare.stops())
    fraction = runs.affordable_part(dropped) if loose else 1.0
    planned = runs.point(dropped, level=chosen.level, fraction=fraction, integrator=chosen.integrator, rtol=chosen.rtol)
    # no more evaluations of each member than the other run took
    limit = {} if planned.refused else {"evaluations": planned.evaluations // (MEMBERS if loose else 1) + 1}
    own_run = runs.point(dropped, level=chosen.level, fraction=fraction, integrator=own[0], rtol=own[1], **limit)
    if own_run.refused or (not planned.refused and own_run.evaluations >= planned.evaluations):
        return chosen
    differences = {name: i.difference for name, i in runs.differences(own_run, planned).items()}
    known = all(np.isfinite(error) for error in chosen.error.values())
    good = search.fits(differences) if loose else _is_within(differences, search.requested)
    if known and not planned.refused and not good:
        return chosen
    return Integration(*own, differences if known else chosen.error, chosen.level)


def scene_is_cheaper(search: Search, chosen: Integration) -> bool:
    """Return True when no planned run with contacts is accurate enough, or none is cheaper by the factor CHEAPER.

    Both are run over a part of the time; their costs are evaluations times variables.
    """
    if chosen == UNCHANGED:
        return True
    runs, dropped, scene = search.runs, search.dropped, search.runs.scene
    bare = runs.variant(dropped)
    if scene.solver.step is not None or not (bare.contacts() or bare.stops()):
        return False
    fewer = 1.0 if chosen.level is None else runs.saved_work(chosen.level)
    integrator, rtol = own_method(scene) or (DEFAULT, scene.solver.rtol)
    # the reference is the scene by its own method, at no tighter tolerance
    known = not dropped and integrator == DEFAULT and rtol <= TIGHTEST
    dear = scene.by_need() and not chosen.reference < AFFORDABLE / AT_MOST
    if known and not dear and CHEAPER * chosen.evaluations / fewer <= chosen.reference:
        return False
    fraction, limit = runs.affordable_part(dropped), OF_TIGHT * runs.extent.most
    ways = {"integrator": chosen.integrator, "rtol": chosen.rtol, "evaluations": limit}
    planned = runs.point(dropped, level=chosen.level, fraction=fraction, members=0, **ways)

    def evaluations(integrator: str, rtol: float) -> int:
        full = runs.point((), fraction=fraction, members=0, integrator=integrator, rtol=rtol, evaluations=limit)
        return limit if TAKES_LONG in full.refused else full.evaluations

    taken = evaluations(integrator, rtol)
    if scene.by_need() and taken > fraction * AFFORDABLE:
        taken = evaluations(STIFF, scene_without_comparison(scene).solver.rtol)
    return bool(planned.refused) or 0 < taken < CHEAPER * planned.evaluations / fewer


def _is_within(error: Mapping[str, float], requested: Mapping[str, float]) -> bool:
    return all(error[name] <= FRACTION * requested[name] for name in requested)


def _loosest_tolerance(
    runs: ScreeningRuns,
    dropped: Sequence[Effect],
    requested: Mapping[str, float],
    integrator: str,
    tried: Sequence[float],
    reference: float,
    level: int | None,
) -> Integration:
    """Return the loosest of the tolerances that agrees with the reference, or the reference itself."""
    reference_run = runs.point(dropped, level=level, integrator=integrator, rtol=reference)
    error = dict.fromkeys(requested, np.nan)
    tried = [rtol for rtol in tried if rtol > reference]
    for rtol in tried:
        effect_sizes = runs.differences(
            runs.point(dropped, level=level, integrator=integrator, rtol=rtol), reference_run
        )
        error = {name: i.difference for name, i in effect_sizes.items()}
        if _is_within(error, requested):
            return Integration(integrator, rtol, error, level)
    if not tried:
        return Integration(integrator, reference, error, level)
    # errors decrease at least with the square root of the tolerance
    fall = float(np.sqrt(reference / tried[-1]))
    return Integration(integrator, reference, {name: fall * value for name, value in error.items()}, level)
