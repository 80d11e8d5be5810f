"""Closures near singular poses: choice of the rows to solve for, condition numbers, refusals in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.equations.projection import BLIND
from pipeline.dynamics.integrate.singular_step import NEVER
from pipeline.dynamics.model import selection
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.numbering import Numbering

if TYPE_CHECKING:
    from pipeline.dynamics.run.engine import Engine

#: length that makes rows and coordinates of the closures comparable in condition numbers [m]
SCALE = 0.1
#: condition numbers are not told apart from infinity above this
INFINITE = 1e15
#: a selection is looked at again when its pivot ratio has fallen to this share of what it was, and replaced when
#: another is this much better; or this much, where a singular pose seems ahead that may only be one of the selection
WORN, BETTER, CLEARLY = 1e-2, 10.0, 4.0


def select_rows(engine: Engine, y: np.ndarray, t: float) -> float:
    """Solve from now on for the closure rows that are best conditioned in the state y; their pivot ratio.

    As many as the rank of the mechanism.  Where no row is redundant there is nothing to choose.
    """
    everything = np.ones(len(engine.kept), dtype=bool)
    if not engine.mobility.redundant:
        return 1.0
    engine.keep(everything)
    engine.attempt(y, t)
    spread = engine.rows(m.SPREAD)
    scales = selection.row_scales(engine.model, spread)
    kept, ratio = selection.choose(spread, scales, engine.mobility.rank)
    engine.keep(kept)
    engine.view(m.ROW_SCALE, int(kept.sum()))[:] = scales[kept] ** 2
    return ratio


def improve(engine: Engine, t: float, wanted: float = BETTER) -> bool:
    """Select rows anew where the present ones have become nearly dependent; whether others are so much better.

    The state in Y and its slope stay as they are: the motion does not depend on the selection.
    """
    size, rows = engine.model.arrays.size(m.NY), len(engine.kept)
    row_scale = engine.view(m.ROW_SCALE, rows).copy()
    y, slope = engine.view(m.Y, size).copy(), engine.view(m.SLOPES, size).copy()
    pivots, before = engine.view(m.PIVOT, m.PIVOT_SIZE), engine.kept.copy()
    present = float(pivots[m.LAST_PIVOT])
    ratio = select_rows(engine, y, t) if engine.mobility.redundant else present
    better = ratio > max(wanted * present, BLIND) and not np.array_equal(before, engine.kept)
    if not better:
        engine.keep(before)
        engine.view(m.ROW_SCALE, rows)[:] = row_scale
    engine.view(m.Y, size)[:], engine.view(m.SLOPES, size)[:] = y, slope
    pivots[m.LAST_PIVOT] = ratio if better else present
    pivots[m.WANTED_PIVOT] = WORN * ratio if better else WORN * present
    if better:
        engine.view(m.INDEPENDENCE, 3 * rows)[:] = 0.0  # that of other rows
        engine.view(m.CONTROL, m.N_CONTROLS)[[m.PASS_TIME, m.MOST_REACH, m.LEFT]] = NEVER, NEVER, 1.0
    return better


def scaled(model: Model, h: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Closure Jacobians (..., kept rows, nv) with lengths in units of `SCALE`, so that all entries are pure numbers."""
    along = built_rows(model, h) == 0
    return J * np.where(along, 1.0 / SCALE, 1.0)[:, None] * coordinate_scales(model.numbering)


def dimensionless(engine: Engine, J: np.ndarray) -> np.ndarray:
    """Closure Jacobian (kept rows, nv) with lengths in units of the mechanism's size, whatever that is written in."""
    numbering = engine.model.numbering
    along = built_rows(engine.model, engine.h) == 0
    units = np.where(along, 1.0 / engine.model.mechanism.length, 1.0)
    return np.asarray(J * units[:, None] * engine.floors[numbering.nq : numbering.nq + numbering.nv])


def built_rows(model: Model, h: np.ndarray) -> np.ndarray:
    """Kind of each kept row: 0 along an axis [m], 1 of two axes [-]."""
    kinds = []
    rows = model.arrays.table(m.CLOSURE_ROWS, h)
    for c in model.arrays.table(m.CLOSURES, h):
        kinds.append(rows["kind"][c["row0"] : c["row0"] + c["n_kept"]])
    return np.concatenate([*kinds, np.zeros(0, dtype=np.int64)])


def coordinate_scales(numbering: Numbering) -> np.ndarray:
    """One radian, `SCALE`, or `SCALE` times the root of a kilogram, per free coordinate."""
    scales = np.full(numbering.nv, SCALE)
    for i, link in enumerate(numbering.mechanism.links):
        if i and numbering.driven(i) < 0:
            for k, letter in enumerate(joint_class(link.kind).SPEEDS):
                scales[numbering.c0[i] + k] = 1.0 if letter == "r" else SCALE
    return scales


def diagnosis(engine: Engine) -> str:
    """Condition number at the last evaluated state, and the joint whose closure is nearest to dependent."""
    if not engine.model.mechanism.closures:
        return "no loop is closed"
    J = scaled(engine.model, engine.h, engine.rows(m.JACOBIAN))
    if not J.size or not np.isfinite(J).all():
        return "the closures cannot be evaluated"
    U, values, _ = np.linalg.svd(J)
    if len(values) < len(J):
        return "more independent closure rows than free coordinates"
    joint = worst_joint(engine, U[:, -1])
    return f"condition number {condition(values):.3g}, at joint {joint}"


def worst_joint(engine: Engine, left: np.ndarray) -> str:
    """Joint with the largest share of a left singular vector."""
    return selection.joints_of_rows(engine.model, engine.h)[int(np.argmax(np.abs(left)))]


def condition(values: np.ndarray) -> float:
    """Ratio of the largest to the smallest singular value, at most `INFINITE`."""
    return float(min(values[0] / max(values[-1], values[0] / INFINITE), INFINITE))
