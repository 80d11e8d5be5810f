"""Joint coordinates and their rates, for every joint with named freedoms."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.joints.conditions import along, frame_motion, second_rate
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import joint_type, label
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.model import Model
from flexclear.scene.schema import Scene

Series = tuple[np.ndarray, np.ndarray, np.ndarray]  #: coordinate, rate and second rate, shape (time,) each


def joint_coordinates(model: Model, seen: Observed) -> dict[str, Series]:
    """Return coordinates and rates by ``joint`` or ``joint.coordinate``; angles continue beyond half a turn."""
    series: dict[str, Series] = {}
    for i, link in enumerate(model.links):
        edge = link.branch.edge
        if edge is None or link.on_path or not joint_type(edge.kind).COORDINATES:
            continue
        positions, coordinates = model.numbering.positions[i], model.numbering.coordinates[i]
        for index, q, c in zip(link.joint.positions, positions, coordinates, strict=True):
            parts = (seen.positions[:, q], seen.speeds[:, c], seen.accelerations[:, c])
            position, rate, second = (link.joint.sign * part for part in parts)
            series[label(edge.name, edge.kind, index)] = position, rate, second
    closures = model.arrays.table(m.CLOSURES)
    for row, closure in zip(closures, model.closures, strict=True):
        if isinstance(closure, Coupling):
            continue
        edge = closure.edge
        a, b = seen.sites[:, row["site_a"]], seen.sites[:, row["site_b"]]
        for index, coordinate in enumerate(joint_type(edge.kind).COORDINATES):
            series[label(edge.name, edge.kind, index)] = _loop_coordinate(a, b, coordinate)
    return {name: series[name] for name, _, _ in named_coordinates(model.scene) if name in series}


def named_coordinates(scene: Scene) -> list[tuple[str, str, bool]]:
    """List the coordinates of all joints in the scene's order: name in records, joint, whether it is an angle."""
    contacts = scene.contacts()
    kinds = {name: joint.type for name, joint in scene.joint.items() if name not in contacts}
    return [
        (label(name, kind, k), name, coordinate.turning)
        for name, kind in kinds.items()
        for k, coordinate in enumerate(joint_type(kind).COORDINATES)
    ]


def _loop_coordinate(a: np.ndarray, b: np.ndarray, coordinate: Coordinate) -> Series:
    """Return the coordinate of a loop-closing joint from the frames of its two sites, named fields over the rows."""
    gauge, F, G = coordinate.gauge, frame_motion(a), frame_motion(b)
    value, rate, _ = along(gauge, (), F, G)
    return np.unwrap(value) if coordinate.turning else value, rate, second_rate(gauge, F, G)
