"""Tables of the loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.effects import load_kind
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads import LOADS
from flexclear.dynamics.loads.gravity import field as gravity_field
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.model.driving import coordinate_of, named_coordinate
from flexclear.dynamics.model.gauges import Gauges
from flexclear.dynamics.model.laws import NO_LAWS, checked_law
from flexclear.dynamics.model.mechanism import Mechanism, Site
from flexclear.dynamics.model.merge import Placement, find_frame
from flexclear.dynamics.model.numbering import Numbering
from flexclear.scene.films import actions_of
from flexclear.scene.formulas import formula
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, all_or_errors

#: stands for the first site of a load on one frame, which acts between the world and that frame
WORLD = -1


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
    return gravity_field(scene)


def tabulate(mechanism: Mechanism, numbering: Numbering, gauges: Gauges, given: Mapping[str, Pieces]) -> Loaded:
    """Validate the loads of a mechanism, add sites for their frames, fill their tables; given: as in `model.tabulate`.

    gauges: receives those of the loads and their internal states.
    """
    scene, forces = mechanism.scene, actions_of(mechanism.scene)
    kind_of = {name: load_kind(scene, name) for name in forces}
    names = sorted(forces, key=kind_of.__getitem__)  # stable: the scene's order within a kind
    kinds = tuple(sorted(set(kind_of.values())))
    loads: list[Load] = []
    rows: list[tuple[int, ...]] = []
    bends, looks = list[tuple[float, ...]](), list[int]()
    numbers, laws = list[float](), list[Pieces]()
    described = all_or_errors(partial(describe, scene, name, given) for name in names)
    frames_of = all_or_errors(
        partial(acting_frames, mechanism, name, one.row) for name, one in zip(names, described, strict=True)
    )
    for name, frames, (row, coordinate, measured, its_laws) in zip(names, frames_of, described, strict=True):
        loads.append(Load(name, frames))
        *first_site, b = [numbering.site(mechanism.site(frame)) for frame in frames]
        a = first_site[0] if first_site else WORLD
        gauge = -1 if coordinate is None else gauges.add(a, b, coordinate, counts=row.counts_turns)
        look = -1 if measured is None else gauges.add(*numbering.sites_of(measured[0]), measured[1], counts=True)
        internal = gauges.states(row.states, a, b) if row.states else -1
        first = numbering.known + len(laws)
        laws += its_laws
        kind = kinds.index(kind_of[name])
        rows.append((kind, a, b, first, len(numbers), gauge, look, internal, int(row.follows), len(looks), len(bends)))
        numbers += [*(mechanism.origin if row.located else ()), *row.numbers]
        looks += [_read_index(mechanism, numbering, gauges, *one) for one in row.reads]
        bends += row.bends
    tables = {
        m.LOADS: rows,
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


class Description(NamedTuple):
    """A load's row, its joint coordinate, the coordinate that it measures with that joint's name, and its laws."""

    row: Row
    coordinate: Coordinate | None
    measured: tuple[str, Coordinate] | None
    laws: list[Pieces]


def describe(scene: Scene, name: str, given: Mapping[str, Pieces] = NO_LAWS) -> Description:
    """Return the description of a load; raise InputError for one that cannot exist.  given: as in `model.tabulate`."""
    load: Any = actions_of(scene)[name]
    path = f"[{getattr(load, 'place', f'load.{name}')}]"
    part = LOADS[load.type]
    coordinate: Coordinate | None = None
    measured: tuple[str, Coordinate] | None = None
    if hasattr(load, "joint"):
        coordinate = coordinate_of(scene, load.joint, load.coordinate, path)[2]
    if hasattr(load, "measured") and coordinate is not None:
        measured = load.joint, coordinate
        if load.measured is not None:
            measured = named_coordinate(scene, load.measured, f"[load.{name}.measured]")
    written = formula(scene, name)
    entries: list[Any] = [
        *([written] if written else []),
        *([coordinate] if coordinate else []),
        *([measured[1]] if measured else []),
    ]
    try:
        row: Row = part.row(load, path, *entries)
    except ValueError as error:
        raise InputError(path, str(error)) from None
    if f"load.{name}" in given:
        return Description(row, coordinate, measured, [given[f"load.{name}"]])
    return Description(row, coordinate, measured, all_or_errors(partial(checked_law, scene, *one) for one in row.laws))


def acting_frames(mechanism: Mechanism, name: str, row: Row) -> tuple[str, ...]:
    """Return the frames between which, or the one on which, a load acts; raise InputError where it has no effect."""
    path, frames = f"[load.{name}]", row.frames if row.joint is None else mechanism.scene.joint[row.joint].between
    links = [mechanism.link_of[find_frame(mechanism.frames, frame, path).body] for frame in frames]
    if len(links) == 2 and links[0] == links[1]:
        raise InputError(path, f"{frames[0]} and {frames[1]} belong to bodies that move as one", "name other frames")
    if links == [0]:
        raise InputError(path, f"{frames[0]} does not move, so that the load has no effect", "name a frame that moves")
    return frames
