"""The integration settings of a scene: an integrator, and only the parameters that it has."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, WithJsonSchema, model_validator

from flexclear.scene.fields import Number, Part, Time
from flexclear.scene.integrators import DEFAULT, INTEGRATORS
from flexclear.scene.registry import suggestion

#: keys that fix the integration of a scene
NAMING = ("integrator", "rtol", "step")
#: key of an integrator's own parameter -> the integrator, and the parameter's default
OWN: Mapping[str, tuple[str, float]] = {"rho_inf": ("generalized-alpha", 0.8)}


class Solver(Part):
    """An integrator and its tolerance."""

    integrator: Annotated[str, WithJsonSchema({"type": "string", "enum": list(INTEGRATORS)})] = DEFAULT
    """name of the integrator, as docs/integrators.md lists them"""
    rtol: Annotated[Number, Field(ge=1e-14, le=1e-2)] = 1e-10
    """relative tolerance of adaptive steps, and always of loop closures and Newton iterations"""
    ledger_tolerance: Annotated[Number, Field(gt=0.0)] | None = None
    """largest energy error of a run, as a fraction of the energy exchanged; default 1e5 rtol, from 1e-4 to 1e-3 (1e-3
    of generalized-alpha), and 0.1 for fixed steps"""
    evaluations: Annotated[int, Field(gt=0, le=10**15)] = 50_000_000
    """largest number of right-hand sides of one run"""
    step: Annotated[Time, Field(gt=0.0)] | None = None
    """length of fixed steps; default: the integrator chooses steps"""
    events: Literal["located", "at step ends"] = "located"
    """where contacts begin and end: at located times, or, for fixed steps only, ``at step ends``"""
    by_need: bool | Literal["integrator"] | None = None
    """whether an expensive run without `[accuracy]` gets another integrator and tolerance, or the integrator only;
    default: true if `[solver]` gives none of integrator, step and rtol, "integrator" if it gives rtol only"""
    rho_inf: Annotated[Number, Field(ge=0.0, le=1.0)] | None = None
    """spectral radius at infinite frequency, for generalized-alpha only; 1 damps nothing; default 0.8"""

    @model_validator(mode="before")
    @classmethod
    def _require_known_names(cls, table: Any) -> Any:
        """Refuse the name of an unknown integrator, and a parameter that belongs to another integrator."""
        if not isinstance(table, Mapping):
            return table
        name = str(table.get("integrator", DEFAULT))
        if name not in INTEGRATORS:
            raise ValueError(f"no integrator is called '{name}'; {suggestion(name, INTEGRATORS)}")
        for key, (owner, _) in OWN.items():
            if table.get(key) is not None and owner != name:
                raise ValueError(f"{key} is a setting of {owner}, not of {name}: remove it")
        own = {key: default for key, (owner, default) in OWN.items() if owner == name and table.get(key) is None}
        return dict(table) | own

    @model_validator(mode="after")
    def _require_step_for_events(self) -> Self:
        if self.events != "located" and self.step is None:
            raise ValueError('events = "at step ends" needs fixed steps: give step, or leave events out')
        return self

    @model_validator(mode="after")
    def _has_what_chooses_steps(self) -> Self:
        if self.step is None and not INTEGRATORS[self.integrator].estimates:
            raise ValueError(f'{self.integrator} has no error estimate to choose steps: give step, e.g. "1e-5 s"')
        return self


def of_run(solver: Solver, by_need: bool, attributes: Mapping[str, Any]) -> tuple[str, float]:
    """Return integrator and relative tolerance with which a finished run began.

    solver, by_need: of its scene. attributes: of its dataset, which count where the scene left them open.
    """
    rtol = float(attributes.get("accuracy_rtol", solver.rtol))
    named = "switched" in attributes and not by_need
    return solver.integrator if named else str(attributes["method"]), rtol


def close_choice(solver: dict[str, Any], keys: Iterable[str]) -> None:
    """Note in a table `solver` that an edit gives these keys: a tolerance leaves the integrator open."""
    if {"integrator", "step"} & set(keys):
        solver["by_need"] = False
    elif "rtol" in keys and solver.get("by_need"):
        solver["by_need"] = "integrator"
