"""Closure rows near singular poses: selection of the rows to solve for, condition numbers, reasons of refusals."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.projection import BLIND
from flexclear.dynamics.integrate.singular_step import NEVER
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.mobility import INFINITE
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.numbering import Numbering
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.system.errors import SolverError

#: length that scales rows and coordinates of the closures in condition numbers [m]
SCALE = 0.1
#: a selection is checked again when its pivot ratio has fallen to this fraction of its first value, and replaced when
#: another one is better by this factor; by the third factor when the pose ahead may be singular for this selection only
WORN, BETTER, CLEARLY = 1e-2, 10.0, 4.0


def evaluate(engine: Engine, y: np.ndarray, t: float, repeat: int = 1) -> np.ndarray:
    """Return f(t, y) with the contacts' present modes. Raise SolverError when the equations are singular."""
    if engine.attempt(y, t, repeat):
        return engine.slope.copy()
    why = engine.explained() or f"the equations are singular in this pose: {diagnosis(engine)}"
    raise SolverError(f"at t = {t:.6g} s: {why}")


def select_rows(engine: Engine, y: np.ndarray, t: float) -> float:
    """Select the best conditioned closure rows in the state y, as many as the mechanism's rank; return their pivot
    ratio.

    Without redundant rows there is no choice.
    """
    if not engine.mobility.redundant:
        return 1.0
    from flexclear.dynamics.run.evaluation.matrices import Matrices  # here: it imports the compiler

    engine.view(m.Y)[:] = y
    engine.evaluate_laws(t)
    found = Matrices(engine, every_row=True)
    spread = found.dense({number: one.V for number, one in found.loops.found.items()})[:, : engine.model.nv]
    scales = selection.row_scales(engine.model, spread, found.natural_lengths(found.factor))
    selected, ratio = selection.choose(spread, scales, engine.mobility.rank)
    engine.keep(selected)
    engine.view(m.ROW_SCALE)[: selected.sum()] = scales[selected] ** 2
    return ratio


def improve(engine: Engine, t: float, requested: float = BETTER) -> bool:
    """Select other rows when the present ones have become nearly dependent; return True when that was worthwhile.

    The state in Y and its slope do not change: the motion does not depend on the selection.
    """
    row_scale = engine.view(m.ROW_SCALE)[: len(engine.selected)].copy()
    y, slope = engine.view(m.Y).copy(), engine.slope.copy()
    pivots, before = engine.view(m.PIVOT), engine.selected.copy()
    present = float(pivots[m.LAST_PIVOT])
    ratio = select_rows(engine, y, t) if engine.mobility.redundant else present
    better = ratio > max(requested * present, BLIND) and not np.array_equal(before, engine.selected)
    if not better:
        engine.keep(before)
        engine.view(m.ROW_SCALE)[: len(row_scale)] = row_scale
    engine.view(m.Y)[:], engine.slope[:] = y, slope
    pivots[m.LAST_PIVOT] = ratio if better else present
    pivots[m.LEAST_PIVOT] = WORN * ratio if better else WORN * present
    if better:
        engine.view(m.INDEPENDENCE.at)[:] = 0.0  # that of other rows
        engine.control[[m.PASS_TIME, m.MOST_REACH, m.LEFT]] = NEVER, NEVER, 1.0
    return better


def scale_rows(model: Model, h: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return closure Jacobians (..., selected rows, nv), lengths in units of `SCALE`, for reported conditions."""
    return J * np.outer(1.0 / row_units(model, h, SCALE), coordinate_scales(model.numbering))


def natural(model: Model, h: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return closure Jacobians scaled by the mechanism's size, modes also by the root of their body's mass."""
    return J * np.outer(1.0 / row_units(model, h, model.length), model.speed_scales)


def row_units(model: Model, h: np.ndarray, length: float) -> np.ndarray:
    """Return the unit of each selected row: a length along an axis [m], 1 between two axes [-]."""
    kinds = model.arrays.table(m.CLOSURE_ROWS, h)["kind"][selection.selected_indices(model, h)]
    return np.where(kinds == 0, length, 1.0)


def coordinate_scales(numbering: Numbering) -> np.ndarray:
    """Return one radian, `SCALE`, or `SCALE` times the root of a kilogram, per free coordinate."""
    scales = np.full(numbering.nv, SCALE)
    for i, link in enumerate(numbering.mechanism.links):
        if i and not link.drives:
            for k, letter in enumerate(joint_type(link.kind).SPEEDS):
                scales[numbering.coordinates[i][k]] = 1.0 if letter == "r" else SCALE
    return scales


def diagnosis(engine: Engine) -> str:
    """Return the condition number at the state evaluated last, and the joint whose closure is nearest to dependent."""
    if not engine.model.closures:
        return "no loop is closed"
    J = scale_rows(engine.model, engine.h, engine.jacobian)
    if not J.size:
        return "the closures constrain no free coordinate of the tree"
    if not np.isfinite(J).all():
        return "the closures cannot be evaluated"
    U, values, _ = np.linalg.svd(J)
    if len(values) < len(J):
        return "more independent closure rows than free coordinates"
    joint = worst_joint(engine, U[:, -1])
    return f"condition number {condition(values):.3g}, at joint {joint}"


def worst_joint(engine: Engine, left: np.ndarray) -> str:
    """Return the joint with the largest part of a left singular vector."""
    return selection.joints_of_rows(engine.model, engine.h)[int(np.argmax(np.abs(left)))]


def condition(values: np.ndarray) -> float:
    """Return the ratio of the largest to the smallest singular value, at most `INFINITE`."""
    return float(min(values[0] / max(values[-1], values[0] / INFINITE), INFINITE))
