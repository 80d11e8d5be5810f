"""Closures near singular poses: choice of the rows to solve for, condition numbers, refusals in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.dynamics import tables
from pipeline.dynamics.assembly import selection
from pipeline.dynamics.assembly.driving import joint_class
from pipeline.dynamics.assembly.layout import Layout
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.assembly.places import LAST_PIVOT, PIVOT_SIZE, WANTED_PIVOT

if TYPE_CHECKING:
    from pipeline.dynamics.integrate.engine import Engine

#: length that makes rows and coordinates of the closures comparable in condition numbers [m]
SCALE = 0.1
#: condition numbers are not told apart from infinity above this
INFINITE = 1e15
#: a selection is looked at again when its pivot ratio has fallen to this share of what it was, and replaced when
#: another is this much better
WORN, BETTER = 1e-2, 10.0


def select_rows(engine: Engine, y: np.ndarray, t: float) -> float:
    """Solve from now on for the closure rows that are best conditioned in the state y; their pivot ratio.

    As many as the rank of the mechanism.  Where no row is redundant there is nothing to choose.
    """
    everything = np.ones(len(engine.kept), dtype=bool)
    if not engine.mobility.redundant:
        return 1.0
    engine.keep(everything)
    engine.attempt(y, t)
    spread = engine.rows("SPREAD")
    scales = selection.row_scales(engine.built, spread, _natural_lengths(engine))
    kept, ratio = selection.choose(spread, scales, engine.mobility.rank)
    engine.keep(kept)
    engine.view("ROW_SCALE", int(kept.sum()))[:] = scales[kept] ** 2
    return ratio


def _natural_lengths(engine: Engine) -> np.ndarray:
    built = engine.built
    columns = engine.view("COLUMNS", 6 * built.layout.columns).reshape(-1, 6)
    sites = engine.view("SITE_FRAMES", tables.FRAME_SIZE * built.packed.sizes["N_SITES"])
    points = sites.reshape(-1, tables.FRAME_SIZE)[:, tables.ORIGIN : tables.ORIGIN + 3]
    return selection.natural_lengths(built, columns, points, engine.mass_factor())


def improve(engine: Engine, t: float) -> bool:
    """Select rows anew where the present ones have become nearly dependent; whether others are better.

    The state in Y and its slope stay as they are: the motion does not depend on the selection.
    """
    size, rows = engine.built.packed.sizes["NY"], len(engine.kept)
    row_scale = engine.view("ROW_SCALE", rows).copy()
    y, slope = engine.view("Y", size).copy(), engine.view("SLOPES", size).copy()
    pivots, before = engine.view("PIVOT", PIVOT_SIZE), engine.kept.copy()
    present = float(pivots[LAST_PIVOT])
    ratio = select_rows(engine, y, t) if engine.mobility.redundant else present
    better = ratio > BETTER * present and not np.array_equal(before, engine.kept)
    if not better:
        engine.keep(before)
        engine.view("ROW_SCALE", rows)[:] = row_scale
    engine.view("Y", size)[:], engine.view("SLOPES", size)[:] = y, slope
    pivots[LAST_PIVOT] = ratio if better else present
    pivots[WANTED_PIVOT] = WORN * ratio if better else WORN * present
    return better


def scaled(built: Tables, h: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Closure Jacobians (..., kept rows, nv) with lengths in units of `SCALE`, so that all entries are pure numbers."""
    along = built_rows(built, h) == 0
    return J * np.where(along, 1.0 / SCALE, 1.0)[:, None] * coordinate_scales(built.layout)


def built_rows(built: Tables, h: np.ndarray) -> np.ndarray:
    """Kind of each kept row: 0 along an axis [m], 1 of two axes [-]."""
    kinds = []
    rows = selection.view(built.packed, h, "CLOSURE_ROWS")
    for c in selection.view(built.packed, h, "CLOSURES"):
        kinds.append(rows[c[tables.ROW0] : c[tables.ROW0] + c[tables.N_KEPT], 0])
    return np.concatenate([*kinds, np.zeros(0, dtype=np.int64)])


def coordinate_scales(layout: Layout) -> np.ndarray:
    """One radian, `SCALE`, or `SCALE` times the root of a kilogram, per free coordinate."""
    scales = np.full(layout.nv, SCALE)
    for i, link in enumerate(layout.system.links):
        if i and layout.driven(i) < 0:
            for k, letter in enumerate(joint_class(link.kind).SPEEDS):
                scales[layout.c0[i] + k] = 1.0 if letter == "r" else SCALE
    return scales


def diagnosis(engine: Engine) -> str:
    """Condition number at the last evaluated state, and the joint whose closure is nearest to dependent."""
    if not engine.built.system.closures:
        return "no loop is closed"
    J = scaled(engine.built, engine.h, engine.rows("JACOBIAN"))
    if not J.size:
        return "no closure holds anything that the tree's joints leave free"
    if not np.isfinite(J).all():
        return "the closures cannot be evaluated"
    U, values, _ = np.linalg.svd(J)
    if len(values) < len(J):
        return "more independent closure rows than free coordinates"
    joint = worst_joint(engine, U[:, -1])
    return f"condition number {condition(values):.3g}, at joint {joint}"


def worst_joint(engine: Engine, left: np.ndarray) -> str:
    """Joint with the largest share of a left singular vector."""
    return selection.joints_of_rows(engine.built, engine.h)[int(np.argmax(np.abs(left)))]


def condition(values: np.ndarray) -> float:
    """Ratio of the largest to the smallest singular value, at most `INFINITE`."""
    return float(min(values[0] / max(values[-1], values[0] / INFINITE), INFINITE))
