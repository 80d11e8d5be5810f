"""The mechanism of a model: its objects, with the places of their numbers in f, w and the state."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics.actions import actions_of, gear, rubbing_of
from flexclear.dynamics.mechanics.closures import closure
from flexclear.dynamics.mechanics.flexible import Modal, Port, Shapes, Station
from flexclear.dynamics.mechanics.gears import coupling
from flexclear.dynamics.mechanics.mechanism import Carrier, Closure, Frame, Link, Mechanism, Modes
from flexclear.dynamics.mechanics.trees import Body, Bounds, Coordinates, Site
from flexclear.dynamics.mechanics.vectors import Matrix, Symmetric, Vector
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.routines.calls import RATES, SCENE, STATE, WORK, Cell, cells


def mechanism_of(model: Model, h: np.ndarray) -> Mechanism:
    """Return the mechanism of a model; h: its topology with the closure rows to solve for and the offsets in w."""
    ground, table = Carrier(), model.arrays.table
    carriers, frames, sites = (
        [ground],
        list[Frame](),
        table(m.SITES, h).tolist(),
    )
    flexible, links = dict(zip(table(m.FLEXES, h)["link"].tolist(), table(m.FLEXES, h), strict=True)), list[Link]()

    def place(k: int) -> None:
        """Add the frame of a site."""
        link, port = sites[k]
        frames.append(Frame(carriers[link], _site(h, m.SITE_NUMBERS, k) if port < 0 else _port(model, h, port)))

    for i, link in enumerate(model.links[1:], start=1):
        place(i - 1)
        numbers, modes = _numbers(h, m.LINK_NUMBERS, i), _modes(model, h, i, flexible[i]) if i in flexible else None
        body = Body(numbers[0], Vector(numbers[1:4]), Symmetric(numbers[4:10]))
        links.append(Link(frames[-1], link.kind, body, Bounds(*numbers[10:]), *_joint_state(model, h, i), modes))
        carriers.append(links[-1])
    for k in range(len(links), len(sites)):
        place(k)
    actions = actions_of(model, h, ground, frames)
    gravity, least = _numbers(h, m.GRAVITY, 0), Cell(WORK, int(h[m.PIVOT]) + m.LAST_PIVOT)
    closures, rubbing = _closures(model, h, frames), rubbing_of(model, h, frames, carriers)
    stored = {cell.key for one in (*actions, *closures) for cell in one.results}
    stored |= {cell.key for joint in rubbing for one in joint.bearings for cell in one.sliding}
    books = enumerate(cells(RATES, model.nq + model.nv, model.arrays.size(m.N_LEDGER)))
    ledger = {book: cell for book, cell in books if cell.key not in stored}
    return Mechanism(ground, links, closures, actions, rubbing, gravity, ledger, least)


def _numbers(h: np.ndarray, table: Any, row: int, count: int = 1) -> list[Cell]:
    """Return rows of a table of f."""
    return cells(SCENE, int(h[table.at]) + table.size * row, table.size * count)


def _site(h: np.ndarray, table: Any, k: int) -> Site:
    numbers = _numbers(h, table, k)
    return Site(Vector(numbers[:3]), Matrix(numbers[3:]))


class _Stretch:
    """Numbers of a table of f that follow each other."""

    def __init__(self, h: np.ndarray, table: Any, row: int) -> None:
        self.h, self.table, self.row = h, table, int(row)

    def rows(self, count: int, length: int) -> list[list[Cell]]:
        """Return the next rows."""
        found = _numbers(self.h, self.table, self.row, count * length)
        self.row += count * length
        return [found[length * k : length * (k + 1)] for k in range(count)]


def _stiffened(model: Model) -> bool:
    return "stiffening" in model.parts.effects


def _second(model: Model, numbers: _Stretch, n: int) -> list[Any]:
    """Return the next three forms of n modes; none where loads do not stiffen bodies."""
    return [numbers.rows(n, n) for _ in range(3)] if _stiffened(model) else []


def _port(model: Model, h: np.ndarray, p: int) -> Port:
    port, undeformed = model.arrays.table(m.PORTS, h)[p], _site(h, m.PORT_NUMBERS, p)
    body, numbers = model.arrays.table(m.FLEXES, h)[port["flex"]], _Stretch(h, m.PORT_DATA, port["shapes"])
    n = int(body["n_modes"] - body["n_held"])
    linear = [numbers.rows(3, n) for _ in range(2)]
    second = [_second(model, numbers, n) for _ in range(2)]
    return Port(undeformed.p_BS, undeformed.R_BS, *map(Shapes, linear, second))


def _modes(model: Model, h: np.ndarray, i: int, body: Any) -> Modes:
    table, n, held, u = model.arrays.table, int(body["n_modes"]), int(body["n_held"]), model.nq + int(body["c0"])
    k, q = int(np.flatnonzero(table(m.FLEXES, h)["link"] == i)[0]), int(body["q0"])
    inboard = int(table(m.LINKS, h)["inboard_port"][i])
    of_body, data = _numbers(h, m.FLEX_NUMBERS, k), _Stretch(h, m.FLEX_DATA, body["data0"])
    linear, E, _, diagonals = (data.rows(count, n) for count in (3, 9, n, 2))
    in_shapes = _Stretch(h, m.INTERFACE_DATA, body["interface0"])
    moved, mass = in_shapes.rows(3, n), in_shapes.rows(n, n)
    coupled = [int(body["coupled"]) and i >= held for i in range(n)]
    first, ends = int(body["moment_row0"]), table(m.MOMENT_ROWS, h)["end"]
    begin, entries = int(body["moment0"]), range(int(body["basis0"]), int(body["basis0"] + body["n_basis"]))
    rows = np.searchsorted(ends[first : first + 9 * n], np.arange(begin, ends[first + 9 * n - 1]), side="right")
    modes = table(m.MOMENTS, h)["mode"][begin:]
    modal = Modal(
        of_body[0], Vector(of_body[1:4]), Matrix(of_body[4:13]), Symmetric(of_body[13:]),
        Shapes(linear, _second(model, data, n)), E, *diagonals,
        [tuple(_numbers(h, m.MOMENT_VALUES, begin + e)) for e in range(len(rows))],
        _numbers(h, m.BASIS_VALUES, entries.start, len(entries)),
        moved, [[mass[i][j] if i == j or coupled[i] else 0.0 for j in range(i + 1)] for i in range(n)],
    )  # fmt: skip
    return Modes(
        _port(model, h, inboard) if body["inboard"] else _site(h, m.PORT_NUMBERS, inboard),
        modal, *(cells(STATE, at, n) for at in (q, u)), [*cells(RATES, q, n), *cells(RATES, u, n)],
        tuple((int(r) // n, int(mode), int(r) % n) for r, mode in zip(rows, modes)),
        tuple((int(mode), int(shape)) for mode, shape in table(m.BASIS, h)[entries.start : entries.stop]),
        held, _stations(model, h, k, n), int(body["book"]),
    )  # fmt: skip


def _stations(model: Model, h: np.ndarray, k: int, n: int) -> list[Station]:
    """Return the stations of flexible body k."""
    made = list[Station]()
    for s, (flex, data) in enumerate(model.arrays.table(m.OF_EFFECTS["stations"], h).tolist()):
        if flex == k:
            numbers = _Stretch(h, m.OF_EFFECTS["station_data"], data)
            stiffness = Symmetric(_numbers(h, m.OF_EFFECTS["station_stiffness"], s))
            made.append(Station(numbers.rows(3, n), numbers.rows(3, n), stiffness))
    return made


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
        factor, of_joint = (diagonal, roots, scales), (tuple(rows[row0 : row0 + count]),)
        if one["coupling"] >= 0:
            given, joined, turning = gear(model, h, frames, int(one["coupling"]))
            made.append(Closure(coupling, given, joined, [*residuals, *turning], *factor))
        else:
            joined = [frames[one["site_a"]], frames[one["site_b"]]]
            made.append(Closure(closure, of_joint, joined, residuals, *factor))
    return made
