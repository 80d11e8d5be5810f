"""How a scene asks for its integration: an integrator, and only the parameters that it has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from pipeline.core.registry import suggestion
from pipeline.core.scene.fields import Number, Part, Time

DEFAULT = "dop853"


class Stepping(Part):
    """What all integrators have.

    rtol: relative tolerance; of the steps where they are chosen, and always of loop closures and Newton iterations.
    ledger_tolerance: largest energy error of a run, as a share of the energy that it turns over; default 1e5 rtol,
        but from 1e-4 to 1e-3, where the error chooses the steps (generalized-alpha: 1e-3), and 1 for fixed steps.
    evaluations: most right-hand sides of one run.  step: present means steps of this length.
    events: where contacts begin and end, ``at step ends`` only with fixed steps.
    """

    rtol: Annotated[Number, Field(ge=1e-14, le=1e-2)] = 1e-10
    ledger_tolerance: Annotated[Number, Field(gt=0.0)] | None = None
    evaluations: Annotated[int, Field(gt=0, le=10**15)] = 50_000_000
    step: Annotated[Time, Field(gt=0.0)] | None = None
    events: Literal["located", "at step ends"] = "located"

    @model_validator(mode="after")
    def _located_unless_fixed(self) -> Stepping:
        if self.events != "located" and self.step is None:
            raise ValueError('events = "at step ends" needs fixed steps: give step, or leave events out')
        return self


class ExplicitPair(Stepping):
    """Embedded Runge-Kutta pair of Dormand and Prince, of order 8 or 5."""

    integrator: Literal["dop853", "dopri5"] = "dop853"


class FixedStep(Stepping):
    """A method without an error estimate, so with fixed steps only."""

    integrator: Literal["rk4", "adams-bashforth-moulton"]

    @model_validator(mode="after")
    def _has_step(self) -> FixedStep:
        if self.step is None:
            raise ValueError(f'{self.integrator} has no error estimate to choose steps by: give step, e.g. "1e-5 s"')
        return self


class GeneralizedAlpha(Stepping):
    """Implicit structural integrator; rho_inf: spectral radius at infinite frequency, 1 damps nothing."""

    integrator: Literal["generalized-alpha"]
    rho_inf: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.8


class Radau(Stepping):
    """Implicit Runge-Kutta method of order 5 for stiff scenes."""

    integrator: Literal["radau"]


#: integrator -> tag of its model; tags stand in angles because error messages leave those out
OWNERS: Mapping[str, str] = {
    "dop853": "<explicit>",
    "dopri5": "<explicit>",
    "rk4": "<fixed>",
    "adams-bashforth-moulton": "<fixed>",
    "generalized-alpha": "<generalized-alpha>",
    "radau": "<radau>",
}


def _known(value: Any) -> Any:
    """Refuse a name that no integrator has, and a parameter that belongs to another one."""
    if isinstance(value, Mapping):
        name = str(value.get("integrator", DEFAULT))
        if name not in OWNERS:
            raise ValueError(f"no integrator is called '{name}'; {suggestion(name, list(OWNERS))}")
        if "rho_inf" in value and name != "generalized-alpha":
            raise ValueError(f"rho_inf belongs to generalized-alpha, {name} does not have it: remove it")
    return value


def _owner(value: Any) -> str:
    """Tag of the model that knows the named integrator."""
    name = value.get("integrator", DEFAULT) if isinstance(value, Mapping) else getattr(value, "integrator", DEFAULT)
    return OWNERS[name]


Solver = Annotated[
    Annotated[ExplicitPair, Tag("<explicit>")]
    | Annotated[FixedStep, Tag("<fixed>")]
    | Annotated[GeneralizedAlpha, Tag("<generalized-alpha>")]
    | Annotated[Radau, Tag("<radau>")],
    Discriminator(_owner),
    BeforeValidator(_known),
]
