"""Design of a cost study: the runs, their factors, their predicted cost and their order.

First the neighbourhood of the scene's own setting: looser and tighter tolerances, another family of methods. Then,
cheapest first, all methods over all their tolerances and steps. No run is a reference by itself: the study takes the
tightest run that succeeded (`post.cost.study`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from flexclear.scene.integrators import DEFAULT, INTEGRATORS, STIFF, VIBRATING
from flexclear.scene.load import edited
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.solver import NAMING
from flexclear.system.errors import InputError

#: multiples of the scene's own tolerance and step, in this order; half and a tenth show whether tighter runs agree
TOLERANCES, STEPS = (0.1, 10.0, 1.0, 0.5, 0.01, 100.0), (0.5, 2.0, 1.0, 0.25, 4.0)
#: the same for another family of methods, which confirms the tightest run; tolerances next to fixed steps
CONFIRMING, CONFIRMING_STEPS = (0.1, 0.01), (1e-6, 1e-8)
#: number of neighbours that give a first answer
FIRST = 4
#: limits of tolerances: tighter ones drown in rounding
TIGHTEST, LOOSEST = 1e-14, 1e-2
#: keys of the scene that no point of a study has
PLAIN: Mapping[str, None] = {"accuracy": None, "ensemble": None}
#: evaluations allowed to the first neighbour, the tighter run from which the error of the scene's own run follows: a
#: multiple of those of that run, and at least the second number
TIGHTER_EVALUATIONS, FEWEST_EVALUATIONS = 4, 100_000
#: predicted evaluations of a method without a known run, in multiples of those of the scene's own run
UNSEEN = 3.0


@dataclass(frozen=True)
class Setting:
    """Integrator and tolerance of the scene's own run, and its evaluations; step: its fixed step [s], else None."""

    integrator: str
    rtol: float
    step: float | None = None
    evaluations: int = 0


@dataclass(frozen=True)
class Design:
    """One run of a study: its name and the edited scene."""

    key: str
    scene: Scene

    @property
    def setting(self) -> dict[str, Any]:
        """Integrator, and tolerance or fixed step [s], as of `post.cost.study.MeasuredRun`."""
        solver = self.scene.solver
        chosen = {"rtol": solver.rtol} if self.chooses_steps else {"step": solver.step}
        return {"integrator": solver.integrator, **chosen}

    @property
    def chooses_steps(self) -> bool:
        """True when the run has steps of variable length."""
        return self.scene.solver.step is None

    def evaluations(self, measured: Mapping[str, Mapping[float, float]], own: float) -> float:
        """Predict the evaluations of the right-hand side.

        measured: those of runs with variable steps, by integrator and tolerance.  own: those of the scene's own run.
        """
        solver = self.scene.solver
        order = INTEGRATORS[solver.integrator].order
        if solver.step is not None:
            return (self.scene.time.end - self.scene.time.start) / solver.step * order
        known = measured.get(solver.integrator)
        if not known:
            return UNSEEN * own * max(1.0, 1e-6 / solver.rtol) ** (1.0 / (order + 1.0))
        at = min(known, key=lambda rtol: max(rtol / solver.rtol, solver.rtol / rtol))
        return known[at] * (at / solver.rtol) ** (1.0 / (order + 1.0))


def neighbours(scene: Scene, own: Setting) -> list[Design]:
    """Return the scene as it is and its neighbours, the most informative first: runs by its own method, since another
    one must be compiled. Only fixed steps, which are no reference, need the other method early."""
    fixed = {} if own.step is None else {"step": own.step, "events": scene.solver.events}
    asis = Design("as it is", _with_solver(scene, integrator=own.integrator, rtol=own.rtol, **fixed))
    if own.step is not None:
        mine = [_design(scene, own.integrator, step=own.step * factor) for factor in STEPS]
        confirming: tuple[float, ...] = CONFIRMING_STEPS
    else:
        tolerances = dict.fromkeys(min(max(own.rtol * factor, TIGHTEST), LOOSEST) for factor in TOLERANCES)
        mine = [_design(scene, own.integrator, rtol=rtol) for rtol in tolerances]
        confirming = tuple(dict.fromkeys(max(own.rtol * factor, TIGHTEST) for factor in CONFIRMING))
    if own.step is not None or mine[0].scene.solver.rtol < own.rtol:
        most = min(max(TIGHTER_EVALUATIONS * own.evaluations, FEWEST_EVALUATIONS), scene.solver.evaluations)
        mine[0] = Design(mine[0].key, edited(mine[0].scene, {"solver.evaluations": most}))
    others = [_design(scene, other, rtol=rtol) for rtol in confirming for other in _others(scene, own)]
    early = 2 if own.step is not None else 4
    return [asis, *mine[:early], *others[:1], *mine[early:4], *others[1:], *mine[4:]]


def _others(scene: Scene, own: Setting) -> list[str]:
    """Return methods of other families than the scene's: an explicit one, and one for stiff or vibrating systems."""
    implicit = VIBRATING if scene.flexible() and own.integrator != VIBRATING else STIFF
    return [name for name in (DEFAULT, implicit) if name != own.integrator]


def all_methods(scene: Scene, integrators: Collection[str] = ()) -> list[Design]:
    """Return all methods over all their tolerances and steps.

    integrators: methods to compare, all when empty.  Raises InputError for a method that is never compared.
    """
    known = [name for name, traits in INTEGRATORS.items() if traits.tolerances or traits.steps]
    for name in integrators:
        if name not in known:
            raise InputError(f"--integrators {name}", "is not one of the compared integrators", suggestion(name, known))
    result = list[Design]()
    for name in integrators or known:
        result += [_design(scene, name, rtol=rtol) for rtol in INTEGRATORS[name].tolerances]
        result += [_design(scene, name, step=step) for step in INTEGRATORS[name].steps]
    return result


def _design(scene: Scene, integrator: str, **setting: float) -> Design:
    """Return the run by a method at a tolerance `rtol` or with a fixed `step` [s]."""
    ((name, value),) = setting.items()
    key = f"{integrator}, {name} {value:g}{' s' if name == 'step' else ''}"
    return Design(key, _with_solver(scene, integrator=integrator, **setting))


def _with_solver(scene: Scene, **solver: Any) -> Scene:
    """Return the scene with another method and with its own limits."""
    own = scene.solver.model_dump(mode="json", exclude_none=True, exclude={*NAMING, "events", "by_need"})
    return edited(scene, {"solver": own | solver, **PLAIN})
