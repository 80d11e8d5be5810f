"""Reasons why a run does not continue, with remedies."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.refusals.reach import beyond_reach, end_in_pose
from flexclear.scene.plausibility import negative_gains
from flexclear.system.errors import EVALUATIONS

#: fraction of steps limited by stability above which stiffness is named as the cause of a long run
STIFF_SHARE = 0.3
#: the stepper's status where loops may be pulled further than they reach
LOOPS = (m.STEP_TOO_SMALL, m.NO_START, m.NO_CONVERGENCE, m.AT_SINGULAR, m.LOST_CLOSURE)
#: events per step above which they are named as the cause
OFTEN = 0.05


def text(engine: Engine, rows: np.ndarray) -> str:
    """Say when and why the stepper stopped; rows: the record so far."""
    failed = int(engine.n[m.EVALUATION])
    engine.evaluate(float(engine.control[m.TIME]))  # the end of the last step
    engine.n[m.EVALUATION] = failed  # of the trial that came to nothing
    control, n, contacts = engine.control, engine.n, engine.model.contacts
    why = engine.explained()
    if why is not None:
        return f"at t = {control[m.TIME]:.6g} s: {why}"
    if n[m.STATUS] in LOOPS:
        message = beyond_reach(engine) or end_in_pose(engine, rows)
        if message:
            return message
    where = closure_rows.diagnosis(engine)
    culprit = contacts[n[m.CULPRIT]].words if contacts else ""
    fixed = f"{control[m.FIXED]:.2g} s"
    too_long = f"the fixed step of {fixed} is too long for it, or " if control[m.FIXED] else ""
    unsolvable = (
        f"the loops cannot be closed: {too_long}a singular pose in which they can continue in several ways ({where})"
    )
    if not engine.model.closures:
        unsolvable = f"the equations cannot be solved here: {too_long}the motion diverges"
    reasons = {
        m.CAP_REACHED: f"the limit of {n[m.CAP]} evaluations is reached {EVALUATIONS}; "
        + _why_so_many(engine, n, control),
        m.STEP_TOO_SMALL: f"the step shrank to {control[m.STEP]:.2g} s: the motion is singular here, "
        f"or stiffer than the integrator can follow ({where})",
        m.NO_START: f"the equations are singular here ({where})",
        m.NOT_A_NUMBER: f"the right-hand side is not a number here: {too_long}a force or a law overflows or "
        "divides by zero",
        m.NO_CONVERGENCE: f"Newton's iteration fails at the fixed step of {fixed}: "
        "take a shorter step, or leave [solver.step] out",
        m.STUCK_EVENT: f"{culprit} opens and closes repeatedly at the same time: choose a smaller rtol, a softer "
        "contact or more damping",
        m.STEPPED_OVER: f"the contact of {culprit} began undetected within a step: choose a smaller rtol or "
        "a shorter step",
        m.AT_SINGULAR: "the motion remains in a singular pose, where it can continue in several ways "
        f"({where}): let it pass the pose at speed, or stop elsewhere",
        m.LOST_CLOSURE: unsolvable,
    }
    status = int(n[m.STATUS])
    if status == m.NO_CONVERGENCE and not engine.method.traits.implicit:
        status = m.LOST_CLOSURE  # it was the loops that could not be closed
    return f"at t = {control[m.TIME]:.6g} s: {reasons[status]}{_doubts(engine)}"


def _doubts(engine: Engine) -> str:
    """Return the probable cause of the end: negative gains, else doubts about flexible bodies; or nothing."""
    gains = [f"load.{name}.{key}" for name, key in negative_gains(engine.model.scene)]
    if gains:
        return f"; a negative gain pushes away from the reference: {', '.join(gains)}"
    if not engine.model.numbering.flexible:
        return ""
    from flexclear.dynamics.run.refusals.validity import doubts, flexibles

    return "".join(f"; {sentence}" for sentence in doubts(engine, flexibles(engine.model)))


def _why_so_many(engine: Engine, n: np.ndarray, control: np.ndarray) -> str:
    """Say what used the evaluations up, and what helps."""
    name, done = engine.model.scene.solver.integrator, control[m.TIME] - engine.start
    other = engine.method.traits.hands_over_to
    steps, rejected, events = (int(n[k]) for k in (m.STEPS, m.REJECTED, m.N_EVENTS))
    parts = [f"{steps} steps and {rejected} rejected ones, {events} events, the last one by {name}"]
    if n[m.STIFF_STEPS] > STIFF_SHARE * max(1, steps):
        choice = f"choose an implicit integrator ({other}), or " if other else ""
        return f"{parts[0]}; {stiffness(n, control)}; {choice}a larger v_static"
    if control[m.STEEPEST] > 0.0:
        parts.append(f"rates up to {control[m.STEEPEST]:.2g} 1/s")
    if done > 0.0:
        whole = n[m.EVALUATIONS] * control[m.SPAN] / done
        parts.append(f"at this progress rate the whole run takes {whole:.1g} evaluations")
    return "; ".join([*parts, _remedy(steps, rejected, events, other)])


def _remedy(steps: int, rejected: int, events: int, other: str) -> str:
    """Return the remedy for the largest cost; other: the implicit method that may help, or nothing."""
    implicit = f", {other} where contacts or friction are stiff," if other else ""
    if events > OFTEN * steps:
        return "contacts begin and end continually: soften or damp them, end the run earlier, or allow more evaluations"
    if rejected > steps:
        return (
            f"most steps are rejected, as when forces rise steeply: choose a looser rtol{implicit} or more evaluations"
        )
    return f"choose a looser rtol{implicit} or more evaluations"


def stiffness(n: np.ndarray, control: np.ndarray) -> str:
    """Say how many steps stability limited, and by which rates."""
    return (
        f"{n[m.STIFF_STEPS]} of {n[m.STEPS]} steps were limited by stability: the equations have rates up "
        f"to {control[m.STEEPEST]:.2g} 1/s, as the slope of friction at small sliding speeds has"
    )
