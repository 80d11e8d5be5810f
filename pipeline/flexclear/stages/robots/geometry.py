"""What pictures show of a compiled model: primitives, and surfaces as files next to the scene."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from flexclear.dynamics.model.merge import GROUND, Placement
from flexclear.stages.robots.mechanism import Assembly, clean, placement, pose

GEOM = mujoco.mjtGeom
#: groups of geoms from this one on are hidden in MuJoCo's viewer at first
HIDDEN = 3
#: parallels and meridians of a drawn ellipsoid
PARALLELS, MERIDIANS = 12, 24


def take_geometry(at: Assembly, folder: str) -> dict[str, bytes]:
    """Add shapes and colours to all bodies and return the files of surfaces, named by their paths in this folder."""
    model, files, unseen = at.model, dict[str, bytes](), dict[str, int]()
    shapes: dict[str, list[tuple[int, list[dict[str, Any]]]]] = {}
    for n in range(model.ngeom):
        owner, here = at.places[model.geom_bodyid[n]]
        made = _shapes(model, n, here.of(placement(model.geom_pos[n], model.geom_quat[n])), folder, files)
        if made:
            shapes.setdefault(owner, []).append((n, made))
        else:
            kind = GEOM(int(model.geom_type[n])).name.removeprefix("mjGEOM_").lower()
            unseen[kind] = unseen.get(kind, 0) + 1
    for body, drawn in shapes.items():
        chosen = _visible(model, drawn)
        at.draft.parts["body"][body]["geometry"] = [shape for _, made in chosen for shape in made]
        if body != GROUND and (color := _color(model, chosen[0][0])):
            at.draft.parts["body"][body]["color"] = color
    used = {
        shape["file"]
        for part in at.draft.parts["body"].values()
        for shape in part.get("geometry", ())
        if "file" in shape
    }
    if unseen:
        at.draft.lost.append(f"not drawn: {', '.join(f'{count} {kind}' for kind, count in unseen.items())}")
    return {name: content for name, content in files.items() if name in used}


def _visible(model: Any, drawn: list[Any]) -> list[Any]:
    """Return those geoms that are there to be seen: without collisions, else those not hidden, else all."""
    for seen in (
        lambda n: not model.geom_contype[n] and not model.geom_conaffinity[n],
        lambda n: model.geom_group[n] < HIDDEN,
    ):
        if chosen := [one for one in drawn if seen(one[0])]:
            return chosen
    return drawn


def _color(model: Any, n: int) -> str:
    material = model.geom_matid[n]
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[n]
    return "#" + "".join(f"{round(255 * float(np.clip(c, 0.0, 1.0))):02X}" for c in rgba[:3])


def _shapes(model: Any, n: int, place: Placement, folder: str, files: dict[str, bytes]) -> list[dict[str, Any]]:
    """Return the shapes of a geom, none for a kind that is not drawn."""
    kind, size = GEOM(int(model.geom_type[n])), model.geom_size[n]
    put = {"pose": at} if (at := pose(place)) else {}
    if kind == GEOM.mjGEOM_BOX:
        return [{"type": "box", "size": clean(2.0 * size), **put}]
    if kind == GEOM.mjGEOM_SPHERE:
        return [{"type": "sphere", "radius": size[0], **put}]
    if kind in (GEOM.mjGEOM_CYLINDER, GEOM.mjGEOM_CAPSULE):
        shapes: list[dict[str, Any]] = [{"type": "cylinder", "radius": size[0], "length": 2.0 * size[1], **put}]
        for end in (-size[1], size[1]) if kind == GEOM.mjGEOM_CAPSULE else ():
            centre = pose(Placement(place.point(np.array([0.0, 0.0, end]))))
            shapes.append({"type": "sphere", "radius": size[0], **({"pose": centre} if centre else {})})
        return shapes
    if kind == GEOM.mjGEOM_ELLIPSOID:
        name, triangles = f"ellipsoid_{n}", _ellipsoid(size)
    elif kind == GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[n]
        name = f"{mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MESH, mesh) or 'mesh'}_{mesh}"
        first, corner = model.mesh_faceadr[mesh], model.mesh_vertadr[mesh]
        triangles = model.mesh_vert[corner + model.mesh_face[first : first + model.mesh_facenum[mesh]]]
    else:
        return []
    file = f"{folder}/{''.join(c if c.isalnum() or c in '_-' else '_' for c in name)}.stl"
    files.setdefault(file, _stl(triangles))
    return [{"type": "file", "file": file, **put}]


def _ellipsoid(size: np.ndarray) -> np.ndarray:
    """Return the triangles of an ellipsoid with these half axes, shape (triangles, 3, 3)."""
    theta, phi = np.meshgrid(np.linspace(0.0, np.pi, PARALLELS + 1), np.linspace(0.0, 2.0 * np.pi, MERIDIANS + 1))
    grid = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1) * size
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _stl(triangles: np.ndarray) -> bytes:
    """Return a binary STL; readers compute the normals, which are zero here."""
    rows = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("byte", "<u2")])
    rows["corners"] = triangles
    return b"\0" * 80 + np.uint32(len(triangles)).astype("<u4").tobytes() + rows.tobytes()
