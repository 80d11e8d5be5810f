"""The mechanism of a model: its objects, with the places of their numbers in f, w and the state."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics.mechanism import Carrier, Closure, Frame, Link, Mechanism
from flexclear.dynamics.mechanics.trees import Body, Coordinates, Site
from flexclear.dynamics.mechanics.vectors import Matrix, Symmetric, Vector
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.routines.calls import RATES, SCENE, STATE, WORK, Cell, cells


def mechanism_of(model: Model, h: np.ndarray) -> Mechanism:
    """Return the mechanism of a model; h: its topology with the closure rows to solve for and the offsets in w."""
    ground, numbering = Carrier(), model.numbering
    sites = [_site(h, k) for k in range(len(numbering.sites))]
    carriers, links = [ground], list[Link]()
    for i, link in enumerate(model.links[1:], start=1):
        given = carriers[link.branch.parent], link.kind, sites[i - 1], _body(h, i)
        links.append(Link(*given, *_joint_state(model, h, i)))
        carriers.append(links[-1])
    frames = [(carriers[site.link], own) for site, own in zip(numbering.sites, sites, strict=True)]
    ledger = cells(RATES, model.nq + model.nv, model.arrays.size(m.N_LEDGER))
    gravity, least = _numbers(h, m.GRAVITY, 0), Cell(WORK, int(h[m.PIVOT]) + m.LAST_PIVOT)
    return Mechanism(ground, links, _closures(model, h, frames), gravity, ledger, least)


def _numbers(h: np.ndarray, table: Any, row: int) -> list[Cell]:
    """Return a row of a table of f."""
    return cells(SCENE, int(h[table.at]) + table.size * row, table.size)


def _site(h: np.ndarray, k: int) -> Site:
    numbers = _numbers(h, m.SITE_NUMBERS, k)
    return Site(Vector(numbers[:3]), Matrix(numbers[3:]))


def _body(h: np.ndarray, i: int) -> Body:
    numbers = _numbers(h, m.LINK_NUMBERS, i)
    return Body(numbers[0], Vector(numbers[1:4]), Symmetric(numbers[4:10]), *numbers[10:])


def _joint_state(model: Model, h: np.ndarray, i: int) -> tuple[Coordinates, list[Cell], int]:
    """Return the coordinates of a link's joint, where their rates are stored, and the book of its drives or -1."""
    q, u = model.numbering.positions[i], model.numbering.coordinates[i]
    if model.links[i].drives:
        laws = [cells(WORK, int(h[m.LAW.at]) + m.LAW.size * (k - model.nv), m.LAW.size) for k in u]
        book = int(model.arrays.table(m.DRIVES)["book"][u.start - model.nv])
        return Coordinates(*map(list, zip(*laws, strict=True))), [], book
    places = (q.start, len(q)), (model.nq + u.start, len(u))
    x, v = (cells(STATE, *place) for place in places)
    return Coordinates(x, v, [0.0] * len(u)), [cell for place in places for cell in cells(RATES, *place)], -1


def _closures(model: Model, h: np.ndarray, frames: list[Frame]) -> list[Closure]:
    table, made = model.arrays.table, list[Closure]()
    rows, origins = table(m.CLOSURE_ROWS, h).tolist(), table(m.CLOSURE_ENVELOPE, h)["origin"]
    for one in table(m.CLOSURES, h):
        row0, count, kept0, kept = (int(one[name]) for name in ("row0", "n_rows", "kept0", "n_kept"))
        scales = cells(WORK, int(h[m.ROW_SCALE]) + kept0, kept)
        diagonal = cells(WORK, scales[0].index + model.arrays.size(m.N_CLOSURE_ROWS), kept) if kept else []
        roots = [Cell(WORK, int(h[m.SCHUR] + origins[r]) + r) for r in range(kept0, kept0 + kept)]
        residuals = [cell for at in (m.RESIDUAL, m.RESIDUAL_RATE) for cell in cells(WORK, int(h[at]) + row0, count)]
        a, b = frames[one["site_a"]], frames[one["site_b"]]
        made.append(Closure(a, b, tuple(rows[row0 : row0 + count]), residuals, diagonal, roots, scales))
    return made
