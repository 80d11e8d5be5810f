"""Design of a cost study: the runs, their factors, their predicted cost and their order.

First the neighbourhood of the scene's own setting: looser and tighter tolerances, another family of methods, denser
output. Then, cheapest first, all methods over all their tolerances and steps. No run is a reference by itself: the
study takes the tightest run that succeeded (`post.cost.study`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexclear.scene.integrators import DEFAULT, INTEGRATORS, STIFF, VIBRATING
from flexclear.scene.load import edited
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.solver import NAMING
from flexclear.scene.toml_files import read_toml
from flexclear.system.errors import InputError

#: multiples of the scene's own tolerance and step, in this order; half and a tenth show whether tighter runs agree
TOLERANCES, STEPS = (0.1, 10.0, 1.0, 0.5, 0.01, 100.0), (0.5, 2.0, 1.0, 0.25, 4.0)
#: the same for another family of methods, which confirms the tightest run; tolerances next to fixed steps
CONFIRMING, CONFIRMING_STEPS = (0.1, 0.01), (1e-6, 1e-8)
#: a common choice for comparison: Wang & Wang (2019), sec. 5, take a predictor-corrector, unnamed, with this step [s]
PAPER: Mapping[str, Any] = {"integrator": "adams-bashforth-moulton", "step": 1e-5}
#: number of neighbours that give a first answer
FIRST = 4
#: limits of tolerances: tighter ones drown in rounding
TIGHTEST, LOOSEST = 1e-14, 1e-2
#: mode sets that are compared, limits of their frequencies as multiples of the scene's own, and refinements of its mesh
MODE_SETS = ("craig-bampton", "free-free", "fixed-fixed")
LIMITS = (0.25, 0.5, 1.0, 2.0)
REFINEMENTS = (1, 2, 4)
FINER_OUTPUT = 10.0
#: keys of the scene that no point of a study has
PLAIN: Mapping[str, None] = {"accuracy": None, "ensemble": None}
#: predicted evaluations of a method without a known run, in multiples of those of the scene's own run
UNSEEN = 3.0


@dataclass(frozen=True)
class Setting:
    """Integrator and tolerance of the scene's own run, and its evaluations; step: its fixed step [s], else None."""

    integrator: str
    rtol: float
    step: float | None = None
    evaluations: int = 0

    @property
    def attributes(self) -> dict[str, Any]:
        """Setting as attributes of a study."""
        setting = {"own_rtol": self.rtol} if self.step is None else {"own_step": self.step}
        return {"own_integrator": self.integrator, **setting}


@dataclass(frozen=True)
class Design:
    """One run: its group and factors (see `post.cost.study`), the edited scene and edits of its recipes."""

    key: str
    group: str
    factors: Mapping[str, Any]
    scene: Scene
    recipe: Mapping[str, Any] = field(default_factory=dict)

    @property
    def chooses_steps(self) -> bool:
        """True when the run has the scene's own model and steps of variable length."""
        return self.scene.solver.step is None and self.group in ("tolerance", "sampling")

    def evaluations(self, measured: Mapping[str, Mapping[float, float]], own: float) -> float:
        """Predict the evaluations of the right-hand side.

        measured: those of runs with variable steps, by integrator and tolerance.  own: those of the scene's own run.
        """
        solver = self.scene.solver
        order = INTEGRATORS[solver.integrator].order
        if solver.step is not None:
            return (self.scene.time.end - self.scene.time.start) / solver.step * order
        known = measured.get(solver.integrator)
        if not self.chooses_steps:
            return UNSEEN * own
        if not known:
            return UNSEEN * own * max(1.0, 1e-6 / solver.rtol) ** (1.0 / (order + 1.0))
        at = min(known, key=lambda rtol: max(rtol / solver.rtol, solver.rtol / rtol))
        return known[at] * (at / solver.rtol) ** (1.0 / (order + 1.0))


def neighbours(scene: Scene, own: Setting) -> list[Design]:
    """Return the scene as it is and its neighbours, the most informative first: runs by its own method, since another
    one must be compiled. Only fixed steps, which are no reference, need the other method early."""
    asis, denser = _sampling(scene, own)
    if own.step is not None:
        mine = [_stepped(scene, own.integrator, own.step * factor) for factor in STEPS]
        confirming: tuple[float, ...] = CONFIRMING_STEPS
    else:
        tolerances = dict.fromkeys(min(max(own.rtol * factor, TIGHTEST), LOOSEST) for factor in TOLERANCES)
        mine = [_tolerant(scene, own.integrator, rtol) for rtol in tolerances]
        confirming = tuple(dict.fromkeys(max(own.rtol * factor, TIGHTEST) for factor in CONFIRMING))
    others = [_tolerant(scene, other, rtol) for rtol in confirming for other in _others(scene, own)]
    early = 2 if own.step is not None else 4
    return [asis, *mine[:early], *others[:1], *mine[early:4], denser, *others[1:], *mine[4:]]


def _others(scene: Scene, own: Setting) -> list[str]:
    """Return methods of other families than the scene's: an explicit one, and one for stiff or vibrating systems."""
    implicit = VIBRATING if scene.flexible() and own.integrator != VIBRATING else STIFF
    return [name for name in (DEFAULT, implicit) if name != own.integrator]


def wide(scene: Scene, integrators: Collection[str] = ()) -> list[Design]:
    """Return all methods over all their tolerances and steps, and the paper's choice.

    integrators: methods to compare, all when empty.  Raises InputError for a method that is never compared.
    """
    known = [name for name, traits in INTEGRATORS.items() if traits.tolerances or traits.steps]
    for name in integrators:
        if name not in known:
            raise InputError(f"--integrators {name}", "is not one of the compared integrators", suggestion(name, known))
    result = list[Design]()
    for name in integrators or known:
        result += [_tolerant(scene, name, rtol) for rtol in INTEGRATORS[name].tolerances]
        result += [_stepped(scene, name, step) for step in INTEGRATORS[name].steps]
    paper = {**PAPER, **({"events": "at step ends"} if scene.contacts() else {})}
    return [*result, _design(scene, "paper", paper, f"{_words(paper)}, as the paper")]


def _tolerant(scene: Scene, integrator: str, rtol: float) -> Design:
    solver = {"integrator": integrator, "rtol": rtol}
    return _design(scene, "tolerance", solver, adaptive_integrator=integrator, rtol=rtol)


def _stepped(scene: Scene, integrator: str, step: float) -> Design:
    solver = {"integrator": integrator, "step": step}
    return _design(scene, "step", solver, fixed_integrator=integrator, step=step)


def _design(scene: Scene, group: str, solver: Mapping[str, Any], key: str = "", **factors: Any) -> Design:
    change = {"solver": _solver(scene, **solver), **PLAIN}
    return Design(key or _words(solver), group, factors, edited(scene, change))


def _words(solver: Mapping[str, Any]) -> str:
    setting = f"rtol {solver['rtol']:g}" if "rtol" in solver else f"step {solver['step']:g} s"
    return f"{solver['integrator']}, {setting}" + (", unlocated contacts" if "events" in solver else "")


def _solver(scene: Scene, **changes: Any) -> dict[str, Any]:
    """Return the scene's solver with another method and with its own limits."""
    own = scene.solver.model_dump(mode="json", exclude_none=True, exclude={*NAMING, "events", "by_need"})
    return own | changes


def _own(scene: Scene, own: Setting) -> dict[str, Any]:
    fixed = {} if own.step is None else {"step": own.step, "events": scene.solver.events}
    return _solver(scene, integrator=own.integrator, rtol=own.rtol, **fixed)


def _sampling(scene: Scene, own: Setting) -> Iterator[Design]:
    """Yield the scene as it is, and with denser output, which records the stresses of no bodies but those asked for."""
    interval, plain = scene.output.interval, {"solver": _own(scene, own), **PLAIN}
    yield Design("as it is", "sampling", {"interval": interval}, edited(scene, plain))
    finer = edited(scene.with_requested_output(), {**plain, "output.interval": interval / FINER_OUTPUT})
    yield Design("denser output", "sampling", {"interval": interval / FINER_OUTPUT}, finer)


def models(scene: Scene, own_setting: Setting, highest: float) -> Iterator[Design]:
    """Yield mode sets by their highest frequencies, finer meshes, and other beam theories, with the scene's integrator.

    highest: the highest frequency of the scene's bundles [Hz].
    """
    recipes = [read_toml(Path(body.mesh)) for body in scene.flexible().values()]
    own_theory = str(recipes[0].get("theory", "rayleigh"))
    own = next(iter(scene.flexible().values())).modes.reference

    def design(reference: str, limit: float, refinement: int, theory: str) -> Design:
        modes = {"reference": reference, "up_to": limit * highest}
        bodies = {f"body.{name}.modes": modes for name in scene.flexible()}
        change = edited(scene, {**bodies, "solver": _own(scene, own_setting), **PLAIN})
        elements = refinement * int(recipes[0].get("elements", 1))
        key = f"{reference} up to {limit * highest:.4g} Hz, {elements} elements, {theory}"
        own_one = (reference, limit, refinement, theory) == (own, 1.0, 1, own_theory)
        factors = {"theory": theory, "mode_set": reference, "modes": limit * highest, "elements": elements}
        factors |= {"own": own_one}
        return Design(key, "model", factors, change, {"elements": refinement, "theory": theory})

    yield design(own, 1.0, 1, own_theory)
    for reference in dict.fromkeys((own, *MODE_SETS)):
        for limit in LIMITS:
            if (reference, limit) != (own, 1.0):
                yield design(reference, limit, 1, own_theory)
    if all("elements" in recipe for recipe in recipes):
        for refinement in REFINEMENTS[1:]:
            yield design(own, 1.0, refinement, own_theory)
        for other in ("euler-bernoulli", "rayleigh", "timoshenko"):
            if other != own_theory:
                yield design(own, 1.0, 1, other)
