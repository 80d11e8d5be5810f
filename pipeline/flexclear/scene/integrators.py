"""Properties of each integrator, for scenes, stages, studies and refusals, which must not import its code.

To add one: a module of `dynamics.integrate` with a `METHOD` (`dynamics.integrate.method`), and a line
in `INTEGRATORS`. A method with parameters of its own also has their keys in `scene.solver`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: integrator of a scene that names none
DEFAULT = "dop853"
#: implicit integrator for stiff equations
STIFF = "radau"
#: integrator that vibrations of flexible bodies do not slow down
VIBRATING = "exponential"
#: tolerances (decades, as far as rounding or processor time allow) and steps [s] that studies of costs compare
TO_1E_9, TO_1E_13 = (tuple(10.0**-k for k in range(3, last + 1)) for last in (9, 13))
STEPS = (1e-4, 3e-5, 1e-5, 3e-6)


def selectable_integrators(flexible: bool) -> tuple[str, ...]:
    """Return the integrators among which the program chooses where a scene requests an accuracy only."""
    return (DEFAULT, *((VIBRATING,) if flexible else ()), STIFF)


@dataclass(frozen=True)
class Traits:
    """Properties of a method without its code; compiled code must not depend on them, since no key contains them.

    module: of `dynamics.integrate`, which holds its METHOD.
    order: the error of a run falls with this power of the step.
    implicit: its steps solve equations, by iteration.
    estimates: it estimates its error, which controls its steps; otherwise a scene must give the step.
    dissipative: it damps by its order, so that energy is lost long before a run is wrong.
    long_steps: they span many vibrations, whose work on the drives is known less exactly than the motion.
    retracts: it needs positions after a displacement.
    hands_over_to: implicit method that continues where stability limits the steps that it chooses, and that messages
        recommend where steps are given; empty for methods that are stable themselves.
    tolerances, steps: those at which `flexclear cost` runs it; steps in s.
    """

    module: str
    order: int
    implicit: bool = False
    estimates: bool = True
    dissipative: bool = False
    long_steps: bool = False
    retracts: bool = False
    hands_over_to: str = ""
    tolerances: tuple[float, ...] = ()
    steps: tuple[float, ...] = ()


#: properties by the name of the integrator in scenes
INTEGRATORS: Mapping[str, Traits] = MappingProxyType(
    {
        "dop853": Traits("dop853", 8, hands_over_to=STIFF, tolerances=TO_1E_13),
        "dopri5": Traits("dopri5", 5, hands_over_to=STIFF, tolerances=TO_1E_13),
        "rk4": Traits("rk4", 4, estimates=False, hands_over_to=STIFF, steps=STEPS),
        "adams-bashforth-moulton": Traits("adams", 4, estimates=False, hands_over_to=STIFF, steps=STEPS),
        "generalized-alpha": Traits(
            "generalized_alpha", 2, implicit=True, dissipative=True, retracts=True, steps=STEPS
        ),
        "radau": Traits("radau", 5, implicit=True, tolerances=TO_1E_9),
        "exponential": Traits("exponential", 6, implicit=True, long_steps=True, tolerances=TO_1E_9),
    }
)
