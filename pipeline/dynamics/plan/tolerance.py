"""Integrator and tolerance of a planned run: the loosest tolerance whose error is a small fraction of the requested
accuracy, and no more expensive than the scene's own method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexclear.pipeline.core.scene.integrators import DEFAULT, STIFF
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.dynamics.plan.budget import AS_IT_IS, Chosen, Search
from flexclear.pipeline.dynamics.plan.screening_runs import (
    MEMBERS,
    OF_TIGHT,
    RTOL,
    SMOOTH,
    SMOOTH_RTOL,
    TAKES_LONG,
    Pilots,
)
from flexclear.pipeline.dynamics.run.progress_rate import AFFORDABLE, UNVERIFIED

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


def smooth(pilots: Pilots, gone: Sequence[Effect], requested: Mapping[str, float], level: int | None) -> Chosen:
    """Choose integrator and tolerance for the scene without its dropped effects, where it has no contacts.

    level: of modes of its flexible bodies; None: all modes.
    """
    if not pilots.variant(gone).flexible():
        return _loosest(pilots, gone, requested, DEFAULT, TRIED, RTOL, level)
    choice = _loosest(pilots, gone, requested, SMOOTH, STIFF_TRIED, SMOOTH_RTOL, level)
    if choice.rtol > SMOOTH_RTOL or _within(choice.error, requested):
        return choice
    unknown, own = dict.fromkeys(requested, np.nan), own_method(pilots.scene)
    if own is None:
        return Chosen(DEFAULT, TIGHT, unknown, level)
    # no candidate was accurate enough, so use the method of the full scene
    integrator, rtol = own
    return Chosen(integrator, max(rtol, TIGHT) if integrator == DEFAULT else rtol, unknown, level)


def own_method(scene: Scene) -> tuple[str, float] | None:
    """Return integrator and tolerance that the scene names; None where it leaves them open or steps are fixed."""
    if scene.by_need() or scene.solver.step is not None:
        return None
    return scene.solver.integrator, scene.solver.rtol


def no_dearer(search: Search, chosen: Chosen) -> Chosen:
    """Return the choice, or the scene's own method where that takes fewer evaluations at sufficient accuracy.

    Both integrate the scene without dropped effects, over the part of the time that screening runs with contacts cover.
    """
    pilots, gone, own = search.pilots, search.gone, own_method(search.pilots.scene)
    if own is None or chosen == AS_IT_IS or (own[0] == chosen.integrator and own[1] <= chosen.rtol):
        return chosen
    bare = pilots.variant(gone)
    loose = bool(bare.contacts() or bare.stop)
    fraction = pilots.part(gone) if loose else 1.0
    there = pilots.point(gone, level=chosen.level, fraction=fraction, integrator=chosen.integrator, rtol=chosen.rtol)
    # no more evaluations of each member than the other run took
    most = {} if there.refused else {"evaluations": there.evaluations // (MEMBERS if loose else 1) + 1}
    mine = pilots.point(gone, level=chosen.level, fraction=fraction, integrator=own[0], rtol=own[1], **most)
    if mine.refused or (not there.refused and mine.evaluations >= there.evaluations):
        return chosen
    differences = {name: i.difference for name, i in pilots.between(mine, there).items()}
    known = all(np.isfinite(error) for error in chosen.error.values())
    good = search.fits(differences) if loose else _within(differences, search.requested)
    if known and not there.refused and not good:
        return chosen
    return Chosen(*own, differences if known else chosen.error, chosen.level)


def as_it_is(search: Search, chosen: Chosen) -> bool:
    """Return True when no planned run with contacts is accurate enough, or none is cheaper by the factor CHEAPER.

    Both are run over a part of the time; their costs are evaluations times variables.
    """
    if chosen == AS_IT_IS:
        return True
    pilots, gone, scene = search.pilots, search.gone, search.pilots.scene
    bare = pilots.variant(gone)
    if scene.solver.step is not None or not (bare.contacts() or bare.stop):
        return False
    fewer = 1.0 if chosen.level is None else pilots.saved(chosen.level)
    integrator, rtol = own_method(scene) or (DEFAULT, scene.solver.rtol)
    # the reference is the scene by its own method, at no tighter tolerance
    known = not gone and integrator == DEFAULT and rtol <= TIGHTEST
    dear = scene.by_need() and not chosen.reference < AFFORDABLE / AT_MOST
    if known and not dear and CHEAPER * chosen.evaluations / fewer <= chosen.reference:
        return False
    fraction, most = pilots.part(gone), OF_TIGHT * pilots.extent.most
    ways = {"integrator": chosen.integrator, "rtol": chosen.rtol, "evaluations": most}
    planned = pilots.point(gone, level=chosen.level, fraction=fraction, members=0, **ways)
    full = pilots.point((), fraction=fraction, members=0, integrator=integrator, rtol=rtol, evaluations=most)
    taken = most if TAKES_LONG in full.refused else full.evaluations
    if scene.by_need() and taken > fraction * AFFORDABLE:
        full = pilots.point((), fraction=fraction, members=0, integrator=STIFF, rtol=UNVERIFIED, evaluations=most)
        taken = most if TAKES_LONG in full.refused else full.evaluations
    if planned.refused or not taken:
        return bool(planned.refused)
    return CHEAPER * planned.evaluations / fewer > taken


def _within(error: Mapping[str, float], requested: Mapping[str, float]) -> bool:
    return all(error[name] <= FRACTION * requested[name] for name in requested)


def _loosest(
    pilots: Pilots,
    gone: Sequence[Effect],
    requested: Mapping[str, float],
    integrator: str,
    tried: Sequence[float],
    reference: float,
    level: int | None,
) -> Chosen:
    """Return the loosest of the tolerances that agrees with the reference, or the reference itself."""
    there = pilots.point(gone, level=level, integrator=integrator, rtol=reference)
    error = dict.fromkeys(requested, np.nan)
    tried = [rtol for rtol in tried if rtol > reference]
    for rtol in tried:
        effect_sizes = pilots.between(pilots.point(gone, level=level, integrator=integrator, rtol=rtol), there)
        error = {name: i.difference for name, i in effect_sizes.items()}
        if _within(error, requested):
            return Chosen(integrator, rtol, error, level)
    if not tried:
        return Chosen(integrator, reference, error, level)
    # errors decrease at least with the square root of the tolerance
    fall = float(np.sqrt(reference / tried[-1]))
    return Chosen(integrator, reference, {name: fall * value for name, value in error.items()}, level)
