"""Tables of the loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.effects import LOADS, load_kind
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.model.driving import coordinate_of, named_coordinate
from flexclear.dynamics.model.gauges import Gauges
from flexclear.dynamics.model.laws import checked_law
from flexclear.dynamics.model.mechanism import Mechanism, Site
from flexclear.dynamics.model.merge import Placement, find_frame
from flexclear.dynamics.model.numbering import Numbering
from flexclear.scene.formulas import formula
from flexclear.scene.registry import lookup
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError


class Load(NamedTuple):
    """A load: its name, and the frame on which, or the two between which, it acts."""

    name: str
    frames: tuple[str, ...]


@dataclass(frozen=True)
class Loaded:
    """Tables of the loads, ordered by kind, and their laws.

    bends: of each row of LOAD_BENDS, the levels at which its load has kinks (`loads.row`).
    """

    loads: tuple[Load, ...]
    tables: dict[Any, Any]
    bends: list[tuple[float, ...]]
    laws: list[Pieces] = field(default_factory=list)


def gravity(scene: Scene) -> np.ndarray:
    """Return the sum of the scene's gravity fields [m/s^2], shape (3,)."""
    if len(scene.forces()) == len(scene.load):
        return np.zeros(3)
    field: np.ndarray = lookup(LOADS, "gravity", where="[load]")(scene)
    return field


def tabulate(mechanism: Mechanism, numbering: Numbering, gauges: Gauges, given: Mapping[str, Pieces]) -> Loaded:
    """Validate the loads of a mechanism, add sites for their frames, fill their tables; given: as in `model.tabulate`.

    gauges: receives those of the loads and their internal states.
    """
    scene, forces = mechanism.scene, mechanism.scene.forces()
    kind_of = {name: load_kind(scene, name) for name in forces}
    names = sorted(forces, key=kind_of.__getitem__)  # stable: the scene's order within a kind
    kinds = tuple(sorted(set(kind_of.values())))
    loads: list[Load] = []
    rows: list[tuple[int, ...]] = []
    bends, looks = list[tuple[float, ...]](), list[int]()
    numbers, laws = list[float](), list[Pieces]()
    for name in names:
        row, coordinate, measured = _describe(scene, name)
        frames = row.frames if row.joint is None else tuple(scene.joint[row.joint].between)
        loads.append(Load(name, frames))
        a, b = _sites(mechanism, numbering, loads[-1])
        gauge = -1 if coordinate is None else gauges.add(a, b, coordinate, counts=row.counts_turns)
        look = -1 if measured is None else gauges.add(*numbering.sites_of(measured[0]), measured[1], counts=True)
        internal = gauges.states(row.states, a, b) if row.states else -1
        first = numbering.known + len(laws)
        if f"load.{name}" in given:
            laws.append(given[f"load.{name}"])
        else:
            laws += [checked_law(scene, law, dimension, path) for law, dimension, path in row.laws]
        rows.append((a, b, first, len(numbers), gauge, look, internal, int(row.follows), len(looks), len(bends)))
        numbers += [*(mechanism.origin if row.located else ()), *row.numbers]
        looks += [_read_index(mechanism, numbering, gauges, *one) for one in row.reads]
        bends += row.bends
    counts = [list(kind_of.values()).count(kind) for kind in kinds]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(int)
    tables = {
        m.LOADS: rows,
        m.LOAD_KINDS: [(int(s), c) for s, c in zip(starts, counts, strict=False)],
        m.LOAD_NUMBERS: numbers,
        m.LOOKS: looks,
    }
    return Loaded(tuple(loads), tables, bends, laws)


def _read_index(mechanism: Mechanism, numbering: Numbering, gauges: Gauges, sort: str, name: str) -> int:
    """Return the number of the site, or of the gauge, that an expression reads."""
    scene = mechanism.scene
    if sort == "coordinate":
        joint, coordinate = named_coordinate(scene, name, "[load]")
        return gauges.add(*numbering.sites_of(joint), coordinate, counts=True)
    if sort == "frame":
        return numbering.site(mechanism.site(name))
    i = mechanism.link_of[name]
    place = mechanism.links[i].placements[name].of(Placement(np.array(scene.rigid()[name].com)))
    return numbering.site(Site(i, place, None))


def _describe(scene: Scene, name: str) -> tuple[Row, Coordinate | None, tuple[str, Coordinate] | None]:
    """Return a load's row, its joint coordinate, and the coordinate that it measures with that joint's name.

    Raises InputError for a load that cannot exist.
    """
    load: Any = scene.load[name]
    path = f"[load.{name}]"
    part = lookup(LOADS, load.type, where=path)
    coordinate: Coordinate | None = None
    measured: tuple[str, Coordinate] | None = None
    if hasattr(load, "joint"):
        coordinate = coordinate_of(scene, load.joint, load.coordinate, path)[2]
    if hasattr(load, "measured") and coordinate is not None:
        measured = load.joint, coordinate
        if load.measured is not None:
            measured = named_coordinate(scene, load.measured, f"[load.{name}.measured]")
    written = formula(scene, name)
    given: list[Any] = [
        *([written] if written else []),
        *([coordinate] if coordinate else []),
        *([measured[1]] if measured else []),
    ]
    try:
        row: Row = part.row(load, path, *given)
    except ValueError as error:
        raise InputError(path, str(error)) from None
    return row, coordinate, measured


def _sites(mechanism: Mechanism, numbering: Numbering, load: Load) -> tuple[int, int]:
    """Return the numbers of the load's sites a and b; a is -1 for a load between the world and b."""
    path, frames = f"[load.{load.name}]", load.frames
    links = [mechanism.link_of[find_frame(mechanism.frames, frame, path).body] for frame in frames]
    if len(links) == 2 and links[0] == links[1]:
        raise InputError(path, f"{frames[0]} and {frames[1]} belong to bodies that move as one", "name other frames")
    if links == [0]:
        raise InputError(path, f"{frames[0]} does not move, so that the load has no effect", "name a frame that moves")
    sites = [numbering.site(mechanism.site(frame)) for frame in frames]
    return (sites[0], sites[1]) if len(sites) == 2 else (-1, sites[0])
