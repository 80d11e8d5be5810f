"""Scenes of the paper's mechanism with another layout, as edits of a scene of any layout."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.geometry.identify import Layout
from flexclear.commands.scenes import find_scene
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.schema import Scene

#: places along a leg [m]: rod's lower end and centre from A1 down, cylinder's centre from B up
ROD_END, ROD_CENTRE, CYLINDER_CENTRE = 0.28, 0.16, 0.146
#: the central chain: centre of its rod below the joint, lower end of the rod below it
CENTRAL_ROD, CENTRAL_END = 0.16, 0.28


def edits(layout: Layout, *, flexible: bool = False, along: float = 0.0, aside: float = 0.0) -> dict[str, Any]:
    """All that the layout decides, by place.

    flexible: whether rod 1 is.  along: where the prismatic joints are on the rods, from the lower ends [m].
    aside: leg 1 starts turned about B1, so that its ball is so far from the centre of its socket [m], downwards as far
    as that goes.
    """
    found: dict[str, Any] = {"body.platform.pose.position": [0.0, 0.0, layout.height]}
    for k in range(4):
        found[f"body.platform.frames.A{k + 1}.position"] = layout.A[k].tolist()
        found[f"body.ground.frames.B{k + 1}.position"] = layout.B[k].tolist()
        found |= _leg(layout, k, flexible=flexible and k == 0, along=along, aside=aside if k == 0 else 0.0)
    found["body.ground.frames.Z.position"] = [0.0, 0.0, layout.height - CENTRAL_END]
    found["body.central_rod.pose.position"] = [0.0, 0.0, layout.height - CENTRAL_ROD]
    return {place: _plain(value) for place, value in found.items()}


def _leg(layout: Layout, k: int, *, flexible: bool, along: float, aside: float) -> dict[str, Any]:
    """Poses of a leg's bodies: z along it from B to A, x horizontal; of a flexible rod x along it, y horizontal."""
    way = layout.A[k] + [0.0, 0.0, layout.height] - layout.B[k]
    length = float(np.linalg.norm(way))
    if aside:
        down = np.array([0.0, 0.0, -1.0])
        across = down - way * (down @ way) / length**2
        way = way + aside * across / np.linalg.norm(across)
    axis, level = way / np.linalg.norm(way), np.array([-way[1], way[0], 0.0])
    pose = {"z": axis.tolist(), "x": level.tolist()}

    def at(distance: float) -> list[float]:
        place: list[float] = (layout.B[k] + distance * axis).tolist()
        return place

    n = k + 1
    rod: dict[str, Any] = {"position": at(length - ROD_CENTRE), "axes": pose}
    if flexible:
        rod = {"position": at(length - ROD_END), "axes": {"x": axis.tolist(), "y": level.tolist()}}
    return {
        f"body.cylinder{n}.pose": {"position": at(CYLINDER_CENTRE), "axes": pose},
        f"body.cylinder{n}.frames.P.position": [0.0, 0.0, length - ROD_END - CYLINDER_CENTRE + along],
        f"body.rod{n}.pose": rod,
    }


def _plain(value: Any) -> Any:
    """Numbers as TOML and JSON have them."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    return [float(v) for v in value] if isinstance(value, list | tuple) else float(value)


def scene(name: str, layout: Layout, more: dict[str, Any] | None = None, *, aside: float = 0.0) -> Scene:
    """A scene of the paper's mechanism with this layout. more: other edits."""
    plain = load_scene(find_scene(name))
    return load_scene(find_scene(name), edits(layout, flexible="rod1" in plain.flexible(), aside=aside) | (more or {}))
