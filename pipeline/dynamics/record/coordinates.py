"""Joint coordinates and their rates, as every joint with named freedoms has them."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.assembly.driving import joint_class
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.assembly.tree import PATH
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.tables import AXES, FRAME_SIZE, OMEGA, ORIGIN, SITE_A, SITE_B, VELOCITY

Series = tuple[np.ndarray, np.ndarray]  #: coordinate and rate, shape (time,) each


def joint_coordinates(built: Tables, seen: dict[str, np.ndarray]) -> dict[str, Series]:
    """By ``joint`` or, where it has several, ``joint.coordinate``; angles go on beyond half a turn."""
    found: dict[str, Series] = {}
    for i, link in enumerate(built.system.links):
        edge, stage = link.branch.edge, link.stage
        if edge is None or stage is None or edge.kind == PATH:
            continue
        declared = joint_class(edge.kind).COORDINATES
        if not declared:
            continue
        q, c = built.layout.q0[i], built.layout.c0[i]
        for k, place in enumerate(stage.positions):
            series = stage.sign * seen["coordinate"][:, q + k], stage.sign * seen["speed"][:, c + k]
            found[_label(edge.name, declared, place)] = series
    for row, k in enumerate(built.closure_order):
        edge = built.system.closures[k][0]
        declared = joint_class(edge.kind).COORDINATES
        for place, coordinate in enumerate(declared):
            found[_label(edge.name, declared, place)] = _measured(built, seen, row, coordinate)
    return {name: found[name] for name in _in_order(built, found)}


def _label(joint: str, declared: tuple[Coordinate, ...], k: int) -> str:
    return joint if len(declared) == 1 else f"{joint}.{declared[k].name}"


def _in_order(built: Tables, found: dict[str, Series]) -> list[str]:
    """Joints as the scene lists them."""
    names = [
        _label(joint, joint_class(part.type).COORDINATES, k)
        for joint, part in built.system.scene.joint.items()
        if joint not in built.system.scene.contacts()
        for k in range(len(joint_class(part.type).COORDINATES))
    ]
    return [name for name in names if name in found]


def _measured(built: Tables, seen: dict[str, np.ndarray], row: int, coordinate: Coordinate) -> Series:
    """Coordinate of a joint that closes a loop, from the frames of its two sites."""
    sites = seen["site_frame"].reshape(len(seen["site_frame"]), -1, FRAME_SIZE)
    a, b = (sites[:, built.packed.table("CLOSURES")[row, side]] for side in (SITE_A, SITE_B))
    F, G = (x[:, AXES : AXES + 9].reshape(-1, 3, 3) for x in (a, b))
    along = (G if coordinate.side else F)[:, :, coordinate.axis]
    omega = a[:, OMEGA : OMEGA + 3]
    if coordinate.turning:
        R = np.einsum("tki,tkj->tij", F, G)
        angle = np.unwrap(np.arctan2(R[:, *coordinate.sine], R[:, *coordinate.cosine]))
        return angle, np.einsum("ti,ti->t", along, b[:, OMEGA : OMEGA + 3] - omega)
    r = b[:, ORIGIN : ORIGIN + 3] - a[:, ORIGIN : ORIGIN + 3]
    slide = b[:, VELOCITY : VELOCITY + 3] - a[:, VELOCITY : VELOCITY + 3] - np.cross(omega, r)
    return np.einsum("ti,ti->t", along, r), np.einsum("ti,ti->t", along, slide)
