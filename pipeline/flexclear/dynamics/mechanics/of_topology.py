"""The mechanism of a topology: its objects, with the places of their numbers in f, w and the state."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.joints import JOINTS
from flexclear.dynamics.mechanics.actions import actions_of, gear, rubbing_of
from flexclear.dynamics.mechanics.closures import closure
from flexclear.dynamics.mechanics.evaluation import evaluate
from flexclear.dynamics.mechanics.flexible import Modal, Port, Shapes
from flexclear.dynamics.mechanics.mechanism import Carrier, Closure, Frame, Link, Mechanism
from flexclear.dynamics.mechanics.modes import Modes, split
from flexclear.dynamics.mechanics.record import describe
from flexclear.dynamics.mechanics.responses import LISTS, append_list
from flexclear.dynamics.mechanics.sections import Station
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.mechanics.trees import Body, Bounds, Coordinates, Site
from flexclear.dynamics.routines.calls import RATES, STATE, CallList, Cell, cells
from flexclear.dynamics.routines.straight import OneTape
from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.topology import Topology
from flexclear.dynamics.vectors import Matrix, Symmetric, Vector


def list_of(parts: Parts, topology: Topology, where: int = m.CALLS, calls: CallList | None = None) -> CallList:
    """Return the list of calls that evaluates a mechanism, or another one by the place of its address in h.

    In RECORD_CALLS it stores, as well, all that the record has of the mechanism.  calls: to which the calls are
    appended.  See `evaluation.evaluate`, `record.describe` and `responses.append_list`.
    """
    tables, made = Tables(parts, topology, where == m.RECORD_CALLS), CallList() if calls is None else calls
    mechanism = mechanism_of(tables)
    if where in LISTS:
        return append_list(mechanism, made, where)
    loops = evaluate(mechanism, made)
    if tables.recorded:
        describe(tables, mechanism, loops, made)
    return made


def program_of(parts: Parts, topology: Topology, longest: int) -> Program:
    """Return these calls as straight code; raise UnsuitedError when it has more than `longest` operations."""
    tape = OneTape(longest)
    evaluate(mechanism_of(Tables(parts, topology)), tape)
    return tape.program


def mechanism_of(tables: Tables) -> Mechanism:
    """Return the mechanism of a topology, which has the closure rows to solve for."""
    ground, table = Carrier(), tables.table
    carriers, frames, sites = [ground], list[Frame](), table(m.SITES).tolist()
    flexible, links = {int(body["link"]): k for k, body in enumerate(table(m.FLEXES))}, list[Link]()

    def place(k: int) -> None:
        """Add the frame of a site."""
        link, port = sites[k]
        frames.append(Frame(carriers[link], _site(tables, m.SITE_NUMBERS, k) if port < 0 else _port(tables, port)))

    for i, row in enumerate(table(m.LINKS)[1:], start=1):
        place(i - 1)
        numbers, modes = tables.row(m.LINK_NUMBERS, i), _modes(tables, flexible[i]) if i in flexible else None
        body, kind = Body(numbers[0], Vector(numbers[1:4]), Symmetric(numbers[4:10])), tables.parts.joints[row["joint"]]
        state = _joint_state(tables, row, kind)
        links.append(Link(frames[-1], kind, body, Bounds(*numbers[10:]), *state, modes, tables.recorded))
        carriers.append(links[-1])
    for k in range(len(links), len(sites)):
        place(k)
    actions = actions_of(tables, ground, frames)
    closures, rubbing = _closures(tables, frames), rubbing_of(tables, frames, carriers)
    results = [*(one.results for one in actions), *(one.results for one in closures)]
    stored = {cell.key for one in results for cell in one}
    stored |= {cell.key for joint in rubbing for one in joint.bearings for cell in one.sliding}
    books = enumerate(cells(RATES, tables.nq + tables.nv, tables.size(m.N_LEDGER)))
    ledger, (least,) = (
        {k: cell for k, cell in books if cell.key not in stored},
        tables.stretch(m.PIVOT, m.LAST_PIVOT, 1),
    )
    return Mechanism(ground, links, frames, closures, actions, rubbing, tables.row(m.GRAVITY, 0), ledger, least)


def _site(tables: Tables, table: Any, k: int) -> Site:
    numbers = tables.row(table, k)
    return Site(Vector(numbers[:3]), Matrix(numbers[3:]))


class _Stretch:
    """Numbers of a table of f that follow each other."""

    def __init__(self, tables: Tables, table: Any, row: int) -> None:
        self.tables, self.table, self.row = tables, table, int(row)

    def rows(self, count: int, length: int) -> list[list[Cell]]:
        """Return the next rows."""
        found = self.tables.row(self.table, self.row, count * length)
        self.row += count * length
        return [found[length * k : length * (k + 1)] for k in range(count)]

    def lower(self, count: int, full: list[bool]) -> list[list[Any]]:
        """Return the lower part of the next square matrix; of rows that are not full only the diagonal."""
        begin = self.row
        self.row += count * count
        made = list[list[Any]]()
        for i in range(count):
            first = 0 if full[i] else i
            made.append([0.0] * first + self.tables.row(self.table, begin + count * i + first, i + 1 - first))
        return made


def _second(tables: Tables, numbers: _Stretch, n: int) -> list[Any]:
    """Return the next three forms of n modes; none where loads do not stiffen bodies."""
    return [numbers.rows(n, n) for _ in range(3)] if "stiffening" in tables.parts.effects else []


def _port(tables: Tables, p: int) -> Port:
    port, undeformed = tables.table(m.PORTS)[p], _site(tables, m.PORT_NUMBERS, p)
    body, numbers = tables.table(m.FLEXES)[port["flex"]], _Stretch(tables, m.PORT_DATA, port["shapes"])
    n = int(body["n_modes"] - body["n_held"])
    linear = [numbers.rows(3, n) for _ in range(2)]
    second = [_second(tables, numbers, n) for _ in range(2)]
    return Port(undeformed.p_BS, undeformed.R_BS, *map(Shapes, linear, second))


def _modes(tables: Tables, k: int) -> Modes:
    """Return the modes of flexible body k."""
    table, body = tables.table, tables.table(m.FLEXES)[k]
    n, held, q, u = int(body["n_modes"]), int(body["n_held"]), int(body["q0"]), tables.nq + int(body["c0"])
    inboard = int(table(m.LINKS)["inboard_port"][body["link"]])
    of_body, data = tables.row(m.FLEX_NUMBERS, k), _Stretch(tables, m.FLEX_DATA, body["data0"])
    linear, E = (data.rows(count, n) for count in (3, 9))
    data.row += n * n
    diagonals = data.rows(2, n)
    in_shapes = _Stretch(tables, m.INTERFACE_DATA, body["interface0"])
    moved = in_shapes.rows(3, n)
    # without held shapes, shapes are eigenmodes
    wanted = [bool(body["coupled"]) and i >= held for i in range(n)], [i >= held > 0 for i in range(n)]
    mass, stiff = (in_shapes.lower(n, full) for full in wanted)
    first, ends = int(body["moment_row0"]), table(m.MOMENT_ROWS)["end"]
    begin, entries = int(body["moment0"]), range(int(body["basis0"]), int(body["basis0"] + body["n_basis"]))
    rows = np.searchsorted(ends[first : first + 9 * n], np.arange(begin, ends[first + 9 * n - 1]), side="right")
    modes = table(m.MOMENTS)["mode"][begin : begin + len(rows)]
    pairs = tables.row(m.MOMENT_VALUES, begin, len(rows) if len(split(n)) == 1 else min(len(rows), 1))
    modal = Modal(
        of_body[0], Vector(of_body[1:4]), Matrix(of_body[4:13]), Symmetric(of_body[13:]),
        Shapes(linear, _second(tables, data, n)), E, diagonals[0], diagonals[1],
        list(zip(pairs[::2], pairs[1::2], strict=True)),
        tables.row(m.BASIS_VALUES, entries.start, len(entries)),
        moved, mass,
    )  # fmt: skip
    return Modes(
        _port(tables, inboard) if body["inboard"] else _site(tables, m.PORT_NUMBERS, inboard),
        modal, cells(STATE, q, n), cells(STATE, u, n), [*cells(RATES, q, n), *cells(RATES, u, n)],
        list(zip((rows // n).tolist(), modes.tolist(), (rows % n).tolist(), strict=True)),
        table(m.BASIS)[entries.start : entries.stop].tolist(),
        held, _stations(tables, k, n), stiff, int(body["book"]),
    )  # fmt: skip


def _stations(tables: Tables, k: int, n: int) -> list[Station]:
    """Return the stations of flexible body k."""
    made = list[Station]()
    for s, (flex, data) in enumerate(tables.table(m.OF_EFFECTS["stations"]).tolist()):
        if flex == k:
            numbers = _Stretch(tables, m.OF_EFFECTS["station_data"], data)
            stiffness = Symmetric(tables.row(m.OF_EFFECTS["station_stiffness"], s))
            made.append(Station(numbers.rows(3, n), numbers.rows(3, n), stiffness))
    return made


def _joint_state(tables: Tables, link: Any, kind: str) -> tuple[Coordinates, list[Cell], int]:
    """Return the coordinates of a link's joint, where their rates are stored, and the book of its drives or -1."""
    q, u, count = int(link["q0"]), int(link["c0"]), int(link["n_speeds"])
    if u >= tables.nv and count:
        laws = [tables.row(m.LAW, k - tables.nv) for k in range(u, u + count)]
        book = int(tables.table(m.DRIVES)["book"][u - tables.nv])
        return Coordinates(*map(list, zip(*laws, strict=True))), [], book
    places = (q, len(JOINTS[kind].POSITIONS) if count else 0), (tables.nq + u, count)
    x, v = (cells(STATE, *place) for place in places)
    return Coordinates(x, v, [0.0] * count), [cell for place in places for cell in cells(RATES, *place)], -1


def _closures(tables: Tables, frames: list[Frame]) -> list[Closure]:
    made, every = list[Closure](), tables.size(m.N_CLOSURE_ROWS)
    rows = tables.table(m.CLOSURE_ROWS).tolist()
    for one in tables.table(m.CLOSURES):
        row0, count, kept0, kept = (int(one[name]) for name in ("row0", "n_rows", "kept0", "n_kept"))
        scales, diagonal = (tables.stretch(m.ROW_SCALE, first + kept0, kept) for first in (0, every))
        roots = tables.stretch(m.ROOTS, kept0, kept)
        residuals, opening = (tables.stretch(at, row0, count) for at in (m.RESIDUAL, m.RESIDUAL_RATE))
        results, of_joint = [*residuals, *opening], (tuple(rows[row0 : row0 + count]),)
        factor = residuals[:kept], opening[:kept], diagonal, roots, scales
        if one["coupling"] >= 0:
            which, given, joined, turning = gear(tables, frames, int(one["coupling"]))
            made.append(Closure(which, given, joined, [*results, *turning], *factor))
        else:
            joined = [frames[one["site_a"]], frames[one["site_b"]]]
            made.append(Closure(closure, of_joint, joined, results, *factor))
    return made
