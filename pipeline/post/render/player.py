"""What the viewer of the pages shows (`pipeline/post/pages/viewer.js`): a motion, modes of bodies, vibrations.

A bent body is its resting points plus fields times weights, as reduced bodies are; so a page holds each field once, and
deformations can be made larger there. Nothing here draws, and no GL library is needed.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.algebra import matrix_to_quaternion
from flexclear.pipeline.post.body_shape import box, faces, scale_to, surface
from flexclear.pipeline.post.render import pace, surfaces
from flexclear.pipeline.post.render.mechanism import COLORS, Flexible, Mechanism, Part, part_pose, pose
from flexclear.pipeline.post.render.view import View, eye

#: frames of a motion, and width over height of a picture that is neither wide nor narrow
FRAMES, ASPECT = 240, 1.2
#: drawn size of the largest displacement of a mode, as a share of the body's or the mechanism's length
SHARE = 0.12
#: a small step of a coordinate, in which a skin moves linearly
SMALL = 1e-6


def motion(drawn: Mechanism, frames: int = FRAMES) -> dict[str, Any]:
    """A run, for the viewer: bodies on their tracks, flexible ones bent."""
    run = drawn.run
    shown = pace.pace(run, drawn.looks.duration, drawn.looks.impact_slowdown)
    times = shown.times[np.unique(np.linspace(0, shown.times.size - 1, frames).astype(int))]
    steps = np.clip(np.searchsorted(run["time"].values, times - 1e-12), 0, run.sizes["time"] - 1)
    tracks: dict[tuple[int | None, int | None], int] = {}
    meshes = []
    for part in drawn.parts:
        place = (part.owner, part.frame)
        track = -1 if part.owner is None else tracks.setdefault(place, len(tracks))
        meshes.append(_still(part.surface, part.color, part.opacity) | {"track": track})
    for body in drawn.flexible:
        track = tracks.setdefault((body.index, None), len(tracks))
        meshes.append(_bent(run, body, steps) | {"track": track})
    kept = [_track(run, owner, frame, steps) for owner, frame in tracks]
    return {
        "meshes": meshes,
        "tracks": [_floats(track) for track in kept],
        "times": [round(float(t), 9) for t in run["time"].values[steps]],
        "rate": len(steps) / (drawn.looks.duration or pace.SECONDS),
        "exaggeration": max((body.scale for body in drawn.flexible), default=1.0),
        **_camera(drawn.view, drawn.cloud, drawn.looks.zoom),
    }


def modes(bundle: xr.Dataset) -> dict[str, Any]:
    """All modes of a reduced body, for the viewer."""
    rest, _ = surface(bundle, np.zeros(bundle.sizes["mode"]))
    fields = np.array([field(bundle, k, rest) for k in range(bundle.sizes["mode"])])
    largest = np.linalg.norm(fields, axis=2).max(axis=1)
    names = [f"mode {k + 1}: {hertz(f)}" for k, f in enumerate(bundle["frequency"].values)]
    scale = scales(bundle)
    shapes = [
        {"label": name, "fields": [k, None], "scale": float(scale[k]), "largest": float(largest[k]) or 1.0}
        for k, name in enumerate(names)
    ]
    mesh = _skin(bundle, rest) | {"fields": [_scaled(values) for values in fields], "track": -1}
    ghost = _skin(bundle, rest) | {"track": -1, "opacity": 0.18, "color": "#7c8894"}
    return {"meshes": [mesh, ghost], "shapes": shapes, "unit": 1.0, **_camera(side(bundle), rest)}


def scales(bundle: xr.Dataset) -> np.ndarray:
    """The factor by which each mode of a body is drawn [kg^0.5 m], shape (mode,)."""
    return np.array([scale_to(bundle, unit, SHARE) for unit in np.eye(bundle.sizes["mode"])])


def vibrations(drawn: Mechanism, linear: xr.Dataset) -> dict[str, Any]:
    """The natural vibrations of a mechanism about a pose, for the viewer.

    drawn: of the equilibrium as a run of one output (`as_run`).  linear: schema LINEAR; of each complex shape real and
    imaginary part are shown in turn, so that running waves run.
    """
    count, motions = linear.sizes["vibration"], body_motions(drawn.run, linear, drawn.flexible)
    pieces = [(part, None) for part in drawn.parts] + [(None, body) for body in drawn.flexible]
    meshes, moved = [], []
    for part, body in pieces:
        if part is not None:
            matrix = part_pose(drawn.run, part, 0)
            surface_ = surfaces.moved(part.surface, matrix[:3, 3], matrix[:3, :3])
            points, told = surface_.points, _still(surface_, part.color, part.opacity) | {"plain": True}
            shown = np.zeros((count, 2, *points.shape))
            if part.owner is not None:
                shown = _rigid(motions, part.owner, points, drawn.run.position.values[0, part.owner])
        else:
            assert body is not None
            points, told, shown = _vibrating(drawn.run, body, linear, motions)
        meshes.append(told | {"track": -1})
        moved.append(shown)
    largest = np.max([np.linalg.norm(f, axis=-1).reshape(count, -1).max(axis=1) for f in moved if f.size], axis=0)
    scale = SHARE * drawn.size / np.where(largest > 0.0, largest, 1.0)
    for told, shown in zip(meshes, moved, strict=True):
        if shown.any():
            told["fields"] = [_scaled(f) for f in shown.reshape(-1, *shown.shape[2:])]
            told.pop("normals", None)
    shapes = [
        {
            "label": f"vibration {k + 1}: {hertz(frequency)}, damping {damping:.2g}",
            "fields": [2 * k, 2 * k + 1], "scale": float(scale[k]), "largest": float(largest[k]) or 1.0,
        }
        for k, (frequency, damping) in enumerate(
            zip(linear["frequency"].values, linear["damping_ratio"].values, strict=True)
        )
    ]  # fmt: skip
    return {"meshes": meshes, "shapes": shapes, "unit": 1.0, **_camera(drawn.view, drawn.cloud, drawn.looks.zoom)}


def hertz(frequency: float) -> str:
    """A frequency in words."""
    return "static" if not frequency > 0.0 else f"{frequency:.5g} Hz"


def side(bundle: xr.Dataset) -> View:
    """From where a body alone is looked at: its length across the picture."""
    x = bundle["node_position"].values
    (axis, *_), _ = box(bundle)
    axis = axis * (1.0 if axis @ (x[-1] - x[0]) >= 0.0 else -1.0)
    up = np.eye(3)[2] if abs(axis[2]) < 0.9 else np.eye(3)[0]
    across = np.cross(axis, up)
    return View(across / np.linalg.norm(across) + 0.6 * up - 0.25 * axis, up, False)


def linear_fields(body: Flexible, rest: np.ndarray) -> np.ndarray:
    """How each point of a flexible body's skin moves per unit of each coordinate, about its centre of mass.

    Shape (mode, point, 3); body axes.
    """
    bundle = body.bundle
    centre = bundle["modal_first_moment"].values / float(bundle["mass"])
    return np.array([field(bundle, k, rest) - centre[:, k] for k in range(bundle.sizes["mode"])])


def field(bundle: xr.Dataset, mode: int, rest: np.ndarray) -> np.ndarray:
    """How each point of a body's skin moves per unit of a modal coordinate, (point, 3); `rest`: the points at zero."""
    q = np.zeros(bundle.sizes["mode"])
    q[mode] = SMALL
    moved: np.ndarray = (surface(bundle, q)[0] - rest) / SMALL
    return moved


def _bent(run: xr.Dataset, body: Flexible, steps: np.ndarray) -> dict[str, Any]:
    bundle, q = body.bundle, run["modal_coordinate"].values[:, body.columns]
    rest, _ = surface(bundle, np.zeros(bundle.sizes["mode"]))
    fields = linear_fields(body, rest)
    some = np.unique(np.linspace(0, len(q) - 1, 60).astype(int))
    largest = max(float(np.linalg.norm(np.tensordot(q[k], fields, axes=1), axis=1).max()) for k in some)
    rest_centre = bundle["first_moment"].values / float(bundle["mass"])
    told = _skin(bundle, rest - rest_centre) | {
        "fields": [_scaled(values) for values in fields],
        "weights": _floats(q[steps]),
        "largest": largest,
    }
    return told | ({"color": body.color, "plain": True} if body.color else {})


def _rigid(motions: Motions, owner: int, points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Displacements of points of a rigid body in each vibration, (vibration, part, point, 3)."""
    move, turn = motions[owner]
    moved: np.ndarray = move[:, :, None, :] + np.cross(turn[:, :, None, :], points - centre)
    return moved


#: displacement of the centre of mass and rotation in each vibration, (vibration, part, 3), by index of the body
Motions = Mapping[int, tuple[np.ndarray, np.ndarray]]


def body_motions(
    run: xr.Dataset, linear: xr.Dataset, flexible: Sequence[Flexible]
) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """How each body moves in the vibrations, from one of its named frames; bodies without one rest.

    What a flexible body bends there is taken off.
    """
    bent = {body.index: body for body in flexible}
    frames = [str(name) for name in linear["frame"].values]
    found = {}
    for k, name in enumerate(str(body) for body in run["body"].values):
        at = next((i for i, frame in enumerate(frames) if frame.partition(".")[0] == name), None)
        zero = np.zeros((linear.sizes["vibration"], 2, 3))
        if at is None:
            found[k] = (zero, zero)
            continue
        move, turn = linear["frame_translation"].values[:, :, at], linear["frame_rotation"].values[:, :, at]
        if k in bent:
            body, R = bent[k], pose(run, k, 0)[:3, :3]
            own = body.bundle.sel(frame=frames[at].partition(".")[2])
            centre = body.bundle["modal_first_moment"].values / float(body.bundle["mass"])
            q = linear["modal_shape"].values[:, :, body.columns]
            turn = turn - q @ own["frame_rotation_shape"].values.T @ R.T
            move = move - q @ (own["frame_translation_shape"].values - centre).T @ R.T
        arm = run["position"].values[0, k] - run["frame_position"].values[0, at]
        found[k] = (move + np.cross(turn, arm), turn)
    return found


def as_run(linear: xr.Dataset) -> xr.Dataset:
    """An equilibrium as a run of one output, in which nothing moves."""
    still = linear[
        [n for n in ("position", "quaternion", "frame_position", "modal_coordinate", "joint_position") if n in linear]
    ]
    zero = xr.zeros_like(linear["position"])
    return still.assign(velocity=zero, angular_velocity=zero).expand_dims(time=[0.0]).assign_attrs(linear.attrs)


def _vibrating(
    run: xr.Dataset, body: Flexible, linear: xr.Dataset, motions: Motions
) -> tuple[np.ndarray, dict[str, Any], np.ndarray]:
    matrix = pose(run, body.index, 0)
    rest, _ = surface(body.bundle, np.zeros(body.bundle.sizes["mode"]))
    fields = linear_fields(body, rest) @ matrix[:3, :3].T
    centre = body.bundle["first_moment"].values / float(body.bundle["mass"])
    points = (rest - centre) @ matrix[:3, :3].T + matrix[:3, 3]
    shape = linear["modal_shape"].values[:, :, body.columns]
    moved = _rigid(motions, body.index, points, matrix[:3, 3]) + np.tensordot(shape, fields, axes=1)
    return points, _skin(body.bundle, points), moved


def _track(run: xr.Dataset, owner: int | None, frame: int | None, steps: np.ndarray) -> np.ndarray:
    assert owner is not None
    part = Part(owner, surfaces.EMPTY, "", frame=frame)
    rows = []
    for step in steps:
        matrix = part_pose(run, part, int(step))
        rows.append([*matrix[:3, 3], *matrix_to_quaternion(matrix[:3, :3])])
    return np.array(rows)


def _still(part: surfaces.Surface, color: str, opacity: float) -> dict[str, Any]:
    return {
        "points": _floats(part.points),
        "normals": _floats(part.normals),
        "triangles": _wholes(part.triangles),
        "color": color,
        "opacity": opacity,
    }


def _skin(bundle: xr.Dataset, points: np.ndarray) -> dict[str, Any]:
    """Points keep their number, so that fields fit; sharp edges of solids are shaded softly."""
    triangles = surfaces.triangulated(faces(bundle))
    return {"points": _floats(points), "triangles": _wholes(triangles), "color": COLORS[0], "opacity": 1.0}


def _camera(seen: View, cloud: np.ndarray, zoom: float = 1.0) -> dict[str, Any]:
    """Where the eye is, and how far what it sees reaches across and upright, over the distance."""
    place, focus = eye(seen, cloud, ASPECT)
    back = (place - focus) / np.linalg.norm(place - focus)
    right = np.cross(seen.up, back) / np.linalg.norm(np.cross(seen.up, back))
    local = (cloud - place) @ np.array([right, np.cross(back, right), -back]).T
    reach = np.abs(local[:, :2] / local[:, 2:]).max(axis=0) / zoom
    return {"eye": place.tolist(), "focus": focus.tolist(), "up": seen.up.tolist(), "reach": reach.tolist()}


def _floats(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _wholes(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<u4").tobytes()).decode()


def _scaled(values: np.ndarray) -> dict[str, Any]:
    """Numbers as 16 bits of their largest: three digits are more than a picture shows."""
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    data = np.round(values / largest * 32767).astype("<i2")
    return {"data": base64.b64encode(data.tobytes()).decode(), "largest": largest}
