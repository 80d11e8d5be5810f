"""The integrator and the tolerance of a planned run: the loosest whose error is a small fraction of the requested
accuracy, and no dearer ones than the scene names itself."""

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

#: fraction of the requested accuracy that the integration may err by
FRACTION = 0.15
#: tolerances that are tried, loosest first, down to that of the reference
TRIED = (1e-4, 1e-5, 1e-6)
STIFF_TRIED = (1e-3, 1e-4)
TIGHT = 1e-8
#: by so much a planned run must be cheaper than the scene as it is
CHEAPER = 1.2
#: tightest tolerance of references, and how many times the evaluations the scene's own one may call for at most: a
#: thousandth of the tolerance 2.4 times, by the method's order 8
TIGHTEST, AT_MOST = 1e-10, 4.0


def smooth(pilots: Pilots, gone: Sequence[Effect], requested: Mapping[str, float], level: int | None) -> Chosen:
    """Integrator and tolerance of the scene without what is gone, where that has no contacts.

    level: of modes of its flexible bodies; None: all.
    """
    if not pilots.variant(gone).flexible():
        return _loosest(pilots, gone, requested, DEFAULT, TRIED, RTOL, level)
    choice = _loosest(pilots, gone, requested, SMOOTH, STIFF_TRIED, SMOOTH_RTOL, level)
    if choice.rtol > SMOOTH_RTOL or _within(choice.error, requested):
        return choice
    unknown, own = dict.fromkeys(requested, np.nan), own_method(pilots.scene)
    if own is None:
        return Chosen(DEFAULT, TIGHT, unknown, level)
    # nothing was shown to do, and what the full scene itself is run with does for it
    integrator, rtol = own
    return Chosen(integrator, max(rtol, TIGHT) if integrator == DEFAULT else rtol, unknown, level)


def own_method(scene: Scene) -> tuple[str, float] | None:
    """The integrator and the tolerance that a scene names itself; None where it leaves them open or steps are fixed."""
    if scene.by_need() or scene.solver.step is not None:
        return None
    return scene.solver.integrator, scene.solver.rtol


def no_dearer(search: Search, chosen: Chosen) -> Chosen:
    """What was chosen; instead the scene's own method, where that takes fewer evaluations and does as well.

    Both integrate what is left of the scene, over the part of the time that pilots with contacts are run for.
    """
    pilots, gone, own = search.pilots, search.gone, own_method(search.pilots.scene)
    if own is None or chosen == AS_IT_IS or (own[0] == chosen.integrator and own[1] <= chosen.rtol):
        return chosen
    bare = pilots.variant(gone)
    loose = bool(bare.contacts() or bare.stop)
    fraction = pilots.part(gone) if loose else 1.0
    there = pilots.point(gone, level=chosen.level, fraction=fraction, integrator=chosen.integrator, rtol=chosen.rtol)
    # no more of each member than the other one took
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
    """Whether no planned run with contacts was shown to do, or none that is predicted to be cheaper by CHEAPER.

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
    """The loosest of the tolerances that is good enough next to the reference, which represents itself."""
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
    # errors fall at least as the tolerance to the power 1/2
    fall = float(np.sqrt(reference / tried[-1]))
    return Chosen(integrator, reference, {name: fall * value for name, value in error.items()}, level)
