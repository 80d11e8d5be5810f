"""Which runs a cost study makes of a scene: the factors, the reference and its confirmation."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.core.registry import suggestion
from flexclear.pipeline.core.scene.load import edited, read_toml
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.stages.timing import paper_solver

REFERENCE: Mapping[str, Any] = {"integrator": "dop853", "rtol": 1e-14}
#: another family of methods
CONFIRMATION: Mapping[str, Any] = {"integrator": "radau", "rtol": 1e-12}
#: mode sets that are compared, limits of their frequencies as multiples of the scene's own, and refinements of its mesh
MODE_SETS = ("craig-bampton", "free-free", "fixed-fixed")
LIMITS = (0.25, 0.5, 1.0, 2.0)
REFINEMENTS = (1, 2, 4)
FINER_OUTPUT = 10.0
#: what no point of a study has
PLAIN: Mapping[str, None] = {"accuracy": None, "ensemble": None}


@dataclass(frozen=True)
class Design:
    """One run: its group and factors (see `pipeline.post.cost.study`), the edited scene and edits of its recipes."""

    key: str
    group: str
    factors: Mapping[str, Any]
    scene: Scene
    recipe: Mapping[str, Any] = field(default_factory=dict)


def runs(scene: Scene, highest: float | None, integrators: Collection[str] = ()) -> list[Design]:
    """All runs of a study.

    highest: the highest frequency that the scene's bundles hold [Hz], None if all is rigid.  integrators: those that
    are compared, all when empty; reference, confirmation and the paper's choice are always there.
    Raises InputError for a method that is not compared.
    """
    known = [name for name, traits in INTEGRATORS.items() if traits.tolerances or traits.steps]
    for name in integrators:
        if name not in known:
            raise InputError(f"--integrators {name}", "is not among those that are compared", suggestion(name, known))
    designs = [d for d in _integration(scene) if _chosen(d, integrators)] + list(_sampling(scene))
    return designs + (list(_models(scene, highest)) if highest is not None else [])


def _chosen(design: Design, integrators: Collection[str]) -> bool:
    method = design.factors.get("adaptive_integrator") or design.factors.get("fixed_integrator")
    return not integrators or method is None or method in integrators


def _solver(scene: Scene, **changes: Any) -> dict[str, Any]:
    """The scene's solver with another method; its limits stay."""
    own = scene.solver.model_dump(mode="json", exclude_none=True, exclude={"integrator", "rtol", "step", "events"})
    return own | changes


def _integration(scene: Scene) -> Iterator[Design]:
    def design(group: str, solver: Mapping[str, Any], **factors: Any) -> Design:
        setting = f"rtol {solver['rtol']:g}" if "rtol" in solver else f"step {solver['step']:g} s"
        located = ", unlocated contacts" if "events" in solver else ""
        key = f"{solver['integrator']}, {setting}{located}" + (", as the paper" if group == "paper" else "")
        return Design(key, group, factors, edited(scene, {"solver": _solver(scene, **solver), **PLAIN}))

    yield design("reference", REFERENCE)
    yield design("confirmation", CONFIRMATION)
    for method, traits in INTEGRATORS.items():
        for rtol in traits.tolerances:
            solver = {"integrator": method, "rtol": rtol}
            yield design("tolerance", solver, adaptive_integrator=method, rtol=rtol)
    for method, traits in INTEGRATORS.items():
        for step in traits.steps:
            yield design("step", {"integrator": method, "step": step}, fixed_integrator=method, step=step)
    yield design("paper", paper_solver(scene))


def _sampling(scene: Scene) -> Iterator[Design]:
    """The scene as it is, and with denser output."""
    interval = scene.output.interval
    yield Design("as it is", "sampling", {"interval": interval}, edited(scene, PLAIN))
    finer = edited(scene, {**PLAIN, "output": {"interval": interval / FINER_OUTPUT}})
    yield Design("denser output", "sampling", {"interval": interval / FINER_OUTPUT}, finer)


def _models(scene: Scene, highest: float) -> Iterator[Design]:
    """Mode sets by the frequencies that they reach, finer meshes, and another beam theory."""
    recipes = [read_toml(Path(body.mesh)) for body in scene.flexible().values()]
    own_theory = str(recipes[0].get("theory", "rayleigh"))
    own = next(iter(scene.flexible().values())).modes.reference

    def design(reference: str, limit: float, refinement: int, theory: str) -> Design:
        modes = {"reference": reference, "up_to": limit * highest}
        bodies = {f"body.{name}.modes": modes for name in scene.flexible()}
        solver = _solver(scene, integrator="dop853", rtol=1e-12)
        change = edited(scene, {**bodies, "solver": solver, **PLAIN})
        elements = refinement * int(recipes[0].get("elements", 1))
        key = f"{reference} up to {limit * highest:.4g} Hz, {elements} elements, {theory}"
        own_one = (reference, limit, refinement, theory) == (own, 1.0, 1, own_theory)
        factors = {"theory": theory, "mode_set": reference, "modes": limit * highest, "elements": elements}
        factors |= {"own": own_one}
        return Design(key, "model", factors, change, {"elements": refinement, "theory": theory})

    for reference in dict.fromkeys((own, *MODE_SETS)):
        for limit in LIMITS:
            yield design(reference, limit, 1, own_theory)
    if all("elements" in recipe for recipe in recipes):
        for refinement in REFINEMENTS[1:]:
            yield design(own, 1.0, refinement, own_theory)
        for other in ("euler-bernoulli", "rayleigh", "timoshenko"):
            if other != own_theory:
                yield design(own, 1.0, 1, other)
