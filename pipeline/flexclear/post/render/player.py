"""Data for the viewer of the pages (`pipeline/flexclear/post/pages/viewer.js`): a motion, modes of bodies, vibrations.

A bent body is its resting points plus fields times weights, as in reduced bodies; so a page holds each field once, and
the viewer can enlarge deformations. Nothing here draws, and no GL library is needed.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.post import body_shape
from flexclear.post.body_shape import box, faces, fields_of, format_frequency, linear_fields, scale_to
from flexclear.post.overview.curves import in_unit, readable_unit
from flexclear.post.render import film_speed, layout, mechanism, panel, surfaces
from flexclear.post.render.vibrations import Vibrations
from flexclear.post.render.view import View, axes_of, eye

#: frames of a motion, and width over height of a picture that is neither wide nor narrow
FRAMES, ASPECT = 240, 1.2
#: drawn size of the largest displacement of a mode, as a fraction of the body's length
FRACTION = 0.12


def motion(drawn: mechanism.Mechanism, frames: int = FRAMES) -> dict[str, Any]:
    """Return a run for the viewer: bodies on their tracks, flexible ones bent."""
    run, steps = drawn.run, _steps(drawn.run, drawn.looks, frames)
    tracks: dict[tuple[int | None, ...], tuple[int, layout.Part]] = {}

    def track(part: layout.Part) -> int:
        key = (part.owner, part.frame, None if part.ends is None else id(part))
        return tracks.setdefault(key, (len(tracks), part))[0]

    meshes = []
    for part in drawn.parts:
        own = -1 if part.owner is None else track(part)
        meshes.append(_still_part(part.surface, part.color, part.opacity) | {"track": own})
    for body in drawn.flexible:
        whole = layout.Part(body.index, surfaces.EMPTY, "")
        meshes.append(_flexible_track(run, body, steps) | {"track": track(whole)})
    tracks_of = [_track(run, part, steps) for _, part in tracks.values()]
    return {
        "meshes": meshes,
        "tracks": [_encode_floats(track) for track in tracks_of],
        "times": _rounded_times(run, steps),
        "rate": len(steps) / (drawn.looks.duration or film_speed.SECONDS),
        "exaggeration": max((body.scale for body in drawn.flexible), default=1.0),
        **({"readings": [_largest_stress(drawn, steps)]} if drawn.stress else {}),
        **_camera(drawn.view, drawn.cloud, drawn.looks.zoom),
    }


def _largest_stress(drawn: mechanism.Mechanism, steps: np.ndarray) -> dict[str, Any]:
    factor, unit = readable_unit(drawn.stress or 0.0, "Pa")
    values = factor * body_shape.stress_of_bodies(drawn.run)[steps].max(axis=1)
    return {"label": "largest stress", "unit": unit, "values": [float(f"{v:.4g}") for v in values]}


def joint(run: xr.Dataset, contact: int, looks: mechanism.Looks) -> dict[str, Any]:
    """Return a ball or pin in its socket for the viewer: the region of its centre, its path, and its centre.

    contact: index of a joint with clearance, not of the end of a stop.
    """
    steps, shown = _steps(run, looks, FRAMES), panel.drawn_joint(run, contact)
    centre = run["contact_offset"].values[steps, contact]
    unturned = np.tile([1.0, 0.0, 0.0, 0.0, 1.0], (len(steps), 1))
    readings = [
        {"label": label, "unit": unit, "values": [float(f"{v:.4g}") for v in factor * run[name].values[steps, contact]]}
        for name, label, unit, factor in (
            ("contact_gap", "gap", "µm", 1e6),
            ("contact_normal_force", "normal force", "N", 1.0),
        )
    ]
    return {
        "meshes": [
            _still_part(shown.path, panel.PATH_COLOR, 1.0) | {"track": -1},
            _still_part(shown.mark, layout.CLEARANCE_COLOR, 1.0) | {"track": 0},
            _still_part(shown.room, layout.SOCKET_COLOR, 0.3) | {"track": -1},
        ],
        "tracks": [_encode_floats(np.column_stack([centre, unturned]))],
        "times": _rounded_times(run, steps),
        "rate": len(steps) / (looks.duration or film_speed.SECONDS),
        "readings": readings,
        "exaggeration": 1.0,
        **_camera(shown.view, np.concatenate([shown.room.points, shown.path.points])),
    }


def modes(bundle: xr.Dataset) -> dict[str, Any]:
    """Return all modes of a reduced body for the viewer."""
    points, fields = fields_of(bundle)
    largest = np.linalg.norm(fields, axis=2).max(axis=1)
    names = [f"mode {k + 1}: {format_frequency(f)}" for k, f in enumerate(bundle["frequency"].values)]
    scale = scales(bundle)
    shapes = [
        {"label": name, "fields": [k, None], "scale": float(scale[k]), "largest": float(largest[k]) or 1.0}
        for k, name in enumerate(names)
    ]
    mesh = _skin(bundle, points) | {"fields": [_as_16_bits(values) for values in fields], "track": -1}
    ghost = _skin(bundle, points) | {"track": -1, "opacity": 0.18, "color": "#7c8894"}
    return {"meshes": [mesh, ghost], "shapes": shapes, "unit": 1.0, **_camera(side(bundle), points)}


def scales(bundle: xr.Dataset) -> np.ndarray:
    """Return the factor by which each mode of a body is drawn [kg^0.5 m], shape (mode,)."""
    return np.array([scale_to(bundle, unit, FRACTION) for unit in np.eye(bundle.sizes["mode"])])


def vibrations(drawn: mechanism.Mechanism, linear: Vibrations) -> dict[str, Any]:
    """Return the natural vibrations of a mechanism about a pose, for the viewer.

    Real and imaginary part of each complex shape are shown in turn, so that travelling waves travel.
    """
    meshes = []
    for piece in linear.pieces:
        mesh = _still_part(piece.surface, piece.color, piece.opacity) | {"track": -1, "plain": piece.plain}
        if piece.moved.any():
            mesh["fields"] = [_as_16_bits(f) for f in piece.moved.reshape(-1, *piece.moved.shape[2:])]
            mesh.pop("normals")
        meshes.append(mesh)
    shapes = [
        {
            "label": label, "fields": [2 * k, 2 * k + 1], "scale": float(linear.scale[k]),
            "largest": float(linear.largest[k]) or 1.0,
        }
        for k, label in enumerate(linear.labels)
    ]  # fmt: skip
    return {"meshes": meshes, "shapes": shapes, "unit": 1.0, **_camera(drawn.view, drawn.cloud, drawn.looks.zoom)}


def side(bundle: xr.Dataset) -> View:
    """Return the view of a body alone: its length across the picture."""
    x = bundle["node_position"].values
    (axis, *_), _ = box(bundle)
    axis = axis * (1.0 if axis @ (x[-1] - x[0]) >= 0.0 else -1.0)
    up = np.eye(3)[2] if abs(axis[2]) < 0.9 else np.eye(3)[0]
    across = np.cross(axis, up)
    return View(across / np.linalg.norm(across) + 0.6 * up - 0.25 * axis, up, False)


def _steps(run: xr.Dataset, looks: mechanism.Looks, frames: int) -> np.ndarray:
    """Return the outputs that are shown."""
    if run.sizes["time"] == 1:
        return np.zeros(1, dtype=int)
    return film_speed.frame_times(run, looks.duration, looks.impact_slowdown).steps(run, frames)


def _rounded_times(run: xr.Dataset, steps: np.ndarray) -> list[float]:
    return [round(float(t), 9) for t in run["time"].values[steps]]


def _flexible_track(run: xr.Dataset, body: mechanism.Flexible, steps: np.ndarray) -> dict[str, Any]:
    bundle, q = body.bundle, run["modal_coordinate"].values[:, body.columns]
    fields = linear_fields(bundle)
    some = np.unique(np.linspace(0, len(q) - 1, 60).astype(int))
    largest = max(float(np.linalg.norm(np.tensordot(q[k], fields, axes=1), axis=1).max()) for k in some)
    content = _skin(bundle, mechanism.points_at_rest(bundle)) | {
        "fields": [_as_16_bits(values) for values in fields],
        "weights": _encode_floats(q[steps]),
        "largest": largest,
    }
    if body.stressed:  # one byte for each point and frame
        top = body_shape.largest_stress(run) or 1.0
        name = str(run["body"].values[body.index])
        levels = np.array([body_shape.stress_on_surface(run, bundle, name, int(step)) for step in steps]) / top
        data = np.round(255.0 * np.clip(levels, 0.0, 1.0)).astype(np.uint8)
        content |= {"levels": base64.b64encode(data.tobytes()).decode(), "top": in_unit(top, "Pa", 3)}
    return content | ({"color": body.color, "plain": True} if body.color else {})


def _track(run: xr.Dataset, part: layout.Part, steps: np.ndarray) -> np.ndarray:
    """Return position, quaternion, and stretch along z of a part at outputs, shape (frame, 8)."""
    rows = []
    for step in steps:
        matrix = layout.part_pose(run, part, int(step))
        stretch = np.linalg.norm(matrix[:3, :3], axis=0)
        rows.append([*matrix[:3, 3], *matrix_to_quaternion(matrix[:3, :3] / stretch), stretch[2]])
    return np.array(rows)


def _still_part(part: surfaces.Surface, color: str, opacity: float) -> dict[str, Any]:
    return {
        "points": _encode_floats(part.points),
        "normals": _encode_floats(part.normals),
        "triangles": _encode_integers(part.triangles),
        "color": color,
        "opacity": opacity,
    }


def _skin(bundle: xr.Dataset, points: np.ndarray) -> dict[str, Any]:
    """Return a skin whose points keep their number, so that fields fit; sharp edges of solids are shaded softly."""
    triangles = surfaces.triangulate(faces(bundle))
    return {
        "points": _encode_floats(points),
        "triangles": _encode_integers(triangles),
        "color": mechanism.COLORS[0],
        "opacity": 1.0,
    }


def _camera(view: View, cloud: np.ndarray, zoom: float = 1.0) -> dict[str, Any]:
    """Return eye, focus, upward direction, and the reach of the scene across and upright over its distance."""
    position, focus = eye(view, cloud, ASPECT)
    local = (cloud - position) @ axes_of(view, position, focus)
    reach = np.abs(local[:, :2] / local[:, 2:]).max(axis=0) / zoom
    return {"eye": position.tolist(), "focus": focus.tolist(), "up": view.up.tolist(), "reach": reach.tolist()}


def _encode_floats(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _encode_integers(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<u4").tobytes()).decode()


def _as_16_bits(values: np.ndarray) -> dict[str, Any]:
    """Return numbers as 16 bits of their largest: three digits are more than a picture shows."""
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    data = np.round(values / largest * 32767).astype("<i2")
    return {"data": base64.b64encode(data.tobytes()).decode(), "largest": largest}
