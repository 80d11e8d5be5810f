"""Why a run does not go on, in words that say what to do about it."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.integrate import singular, state
from pipeline.dynamics.integrate.engine import Engine

#: above this share of steps that stability limits, stiffness is named as the cause of a long run
STIFF_SHARE = 0.3
#: integrators with Newton iterations
IMPLICIT = ("generalized-alpha", "radau")


def text(engine: Engine) -> str:
    """When and why the stepper stopped, in words."""
    control, n = engine.view("CONTROL", state.N_CONTROLS), engine.n
    where = singular.diagnosis(engine)
    contacts = [name for name, *_ in engine.built.system.contacts]
    culprit = contacts[n[state.CULPRIT]] if contacts else ""
    fixed = f"{control[state.FIXED]:.2g} s"
    too_long = f"; or the fixed step of {fixed} is too long for it" if control[state.FIXED] else ""
    unsolvable = f"the loops cannot be kept closed: a singular pose in which they can go on in several ways ({where})"
    unsolvable += _other_integrator(engine)
    if not engine.built.system.closures:
        unsolvable = "the equations cannot be solved here: the motion has grown beyond bounds"
    reasons = {
        state.CAP_REACHED: f"the limit of {n[state.CAP]} evaluations is used up ([solver.evaluations]); "
        + _why_so_many(n, control),
        state.STEP_TOO_SMALL: f"the step shrank to {control[state.STEP]:.2g} s: the motion is singular here, "
        f"or stiffer than the integrator can follow ({where})",
        state.NO_START: f"the equations are singular here ({where})",
        state.NOT_A_NUMBER: "the right-hand side is not a number here: a force or a law overflows or divides by zero"
        + too_long,
        state.NO_CONVERGENCE: f"Newton's iteration fails at the fixed step of {fixed}: "
        "take a shorter step, or leave [solver.step] out",
        state.STUCK_EVENT: f"joint {culprit} opens and closes without end at one time",
        state.AT_SINGULAR: "the mechanism comes to rest in a singular pose, where it can go on in several ways "
        f"({where}): give it another motion{_other_integrator(engine)}",
        state.LOST_CLOSURE: unsolvable + too_long,
    }
    return f"at t = {control[state.TIME]:.6g} s: {reasons[int(n[state.STATUS])]}"


def _other_integrator(engine: Engine) -> str:
    """Advice for a singular pose where implicit iterations, whose matrix turns over in it, may have failed."""
    name = engine.built.system.scene.solver.integrator
    return f"; or it moves on and {name} does not get over the pose: try dop853" if name in IMPLICIT else ""


def _why_so_many(n: np.ndarray, control: np.ndarray) -> str:
    """What used the evaluations up."""
    if n[state.STIFF_STEPS] > STIFF_SHARE * max(1, n[state.STEPS]):
        return f"{stiffness(n, control)}; choose an implicit integrator, or a larger v_static"
    return "contacts may be collapsing in time, or the tolerance is too tight"


def stiffness(n: np.ndarray, control: np.ndarray) -> str:
    """How many steps stability limited, and the rates that did it."""
    return (
        f"{n[state.STIFF_STEPS]} of {n[state.STEPS]} steps were limited by stability: the equations have rates up "
        f"to {control[state.STEEPEST]:.2g} 1/s, as the slope of friction at small sliding speeds has"
    )
