"""Joint coordinates and their rates, as every joint with named freedoms has them."""

from __future__ import annotations

import numpy as np

from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.tree import PATH

Series = tuple[np.ndarray, np.ndarray, np.ndarray]  #: coordinate, rate and second rate, shape (time,) each


def joint_coordinates(model: Model, seen: dict[str, np.ndarray]) -> dict[str, Series]:
    """By ``joint`` or, where it has several, ``joint.coordinate``; angles go on beyond half a turn."""
    found: dict[str, Series] = {}
    for i, link in enumerate(model.mechanism.links):
        edge, stage = link.branch.edge, link.stage
        if edge is None or stage is None or edge.kind == PATH:
            continue
        declared = joint_class(edge.kind).COORDINATES
        if not declared:
            continue
        q, c = model.numbering.q0[i], model.numbering.c0[i]
        for k, place in enumerate(stage.positions):
            places = (("coordinate", q + k), ("speed", c + k), ("acceleration", c + k))
            position, rate, second = (stage.sign * seen[name][:, o] for name, o in places)
            found[_label(edge.name, declared, place)] = position, rate, second
    for row, k in enumerate(model.closure_order):
        edge = model.mechanism.closures[k][0]
        declared = joint_class(edge.kind).COORDINATES
        for place, coordinate in enumerate(declared):
            found[_label(edge.name, declared, place)] = _measured(model, seen, row, coordinate)
    return {name: found[name] for name in _in_order(model, found)}


def label(scene: Scene, joint: str, k: int) -> str:
    """Name of coordinate k of a joint in records."""
    return _label(joint, joint_class(scene.joint[joint].type).COORDINATES, k)


def _label(joint: str, declared: tuple[Coordinate, ...], k: int) -> str:
    return joint if len(declared) == 1 else f"{joint}.{declared[k].name}"


def _in_order(model: Model, found: dict[str, Series]) -> list[str]:
    """Joints as the scene lists them."""
    names = [
        _label(joint, joint_class(part.type).COORDINATES, k)
        for joint, part in model.scene.joint.items()
        if joint not in model.scene.contacts()
        for k in range(len(joint_class(part.type).COORDINATES))
    ]
    return [name for name in names if name in found]


def _measured(model: Model, seen: dict[str, np.ndarray], row: int, coordinate: Coordinate) -> Series:
    """Coordinate of a joint that closes a loop, from the frames of its two sites."""
    sites = seen["site_frame"].reshape(len(seen["site_frame"]), -1, m.FRAME.size)
    a, b = (sites[:, model.arrays.table(m.CLOSURES)[side][row]] for side in ("site_a", "site_b"))
    F, G = (x[:, m.FRAME.axes : m.FRAME.axes + 9].reshape(-1, 3, 3) for x in (a, b))
    along = (G if coordinate.side else F)[:, :, coordinate.axis]
    omega = a[:, m.FRAME.omega : m.FRAME.omega + 3]
    turning = b[:, m.FRAME.omega : m.FRAME.omega + 3] - omega
    if coordinate.turning:
        R = np.einsum("tki,tkj->tij", F, G)
        (i, j), (k, l) = coordinate.sine, coordinate.cosine
        angle = np.unwrap(np.arctan2(R[:, i, j], R[:, k, l]))
        swing = np.cross((b if coordinate.side else a)[:, m.FRAME.omega : m.FRAME.omega + 3], along)
        second = b[:, m.FRAME.alpha : m.FRAME.alpha + 3] - a[:, m.FRAME.alpha : m.FRAME.alpha + 3]
        return angle, _dot(along, turning), _dot(along, second) + _dot(swing, turning)
    r, v, acceleration = (
        b[:, o : o + 3] - a[:, o : o + 3] for o in (m.FRAME.origin, m.FRAME.velocity, m.FRAME.acceleration)
    )
    slide = v - np.cross(omega, r)
    second = (
        acceleration
        - np.cross(a[:, m.FRAME.alpha : m.FRAME.alpha + 3], r)
        - np.cross(omega, np.cross(omega, r) + 2.0 * slide)
    )
    return _dot(along, r), _dot(along, slide), _dot(along, second)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = np.einsum("ti,ti->t", a, b)
    return product
