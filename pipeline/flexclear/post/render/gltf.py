"""A run as a glTF 2.0 file: bodies on their tracks, flexible ones with a morph target for each mode.

VTK's own export has neither animations nor morph targets, so that it would lose the motion.

Source: Khronos Group (2021), glTF 2.0 Specification, sec. 3.7.2 (meshes), 3.11 (animations), 5.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.post.body_shape import fields_of, format_frequency, linear_fields
from flexclear.post.render.layout import part_pose, pose
from flexclear.post.render.mechanism import COLORS, Flexible, Mechanism, points_at_rest, skin
from flexclear.post.render.surfaces import Surface

FLOAT, WHOLE, ARRAY, INDICES = 5126, 5125, 34962, 34963
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class _File:
    """The file under construction: its description, and its binary part."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.document: dict[str, list[Any]] = {
            n: [] for n in ("bufferViews", "accessors", "meshes", "materials", "nodes")
        }
        self.animations: list[dict[str, Any]] = []

    def array(self, values: np.ndarray, kind: int = FLOAT, target: int | None = None) -> int:
        """Add values of shape (n,) or (n, components) and return the number of their accessor."""
        data = np.ascontiguousarray(values, dtype="<f4" if kind == FLOAT else "<u4")
        flat = data.reshape(len(data), -1)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": data.nbytes}
        self.document["bufferViews"].append(view | ({"target": target} if target else {}))
        self.binary += data.tobytes()
        bounds = {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()} if len(flat) else {}
        accessor = {"bufferView": len(self.document["bufferViews"]) - 1, "componentType": kind, "count": len(flat)}
        self.document["accessors"].append(accessor | {"type": TYPES[flat.shape[1]], **bounds})
        return len(self.document["accessors"]) - 1

    def node(self, name: str, shape: Surface, color: str, opacity: float, fields: np.ndarray | None = None) -> int:
        """Add a node with this surface, and morph targets where fields are given, and return its number."""
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {
                "baseColorFactor": [*_linear_colour(color), opacity],
                "metallicFactor": 0.1,
                "roughnessFactor": 0.6,
            }
        }
        self.document["materials"].append(material | ({"alphaMode": "BLEND"} if opacity < 1.0 else {}))
        primitive: dict[str, Any] = {
            "attributes": {
                "POSITION": self.array(shape.points, target=ARRAY),
                "NORMAL": self.array(shape.normals, target=ARRAY),
            },
            "indices": self.array(shape.triangles.ravel(), WHOLE, INDICES),
            "material": len(self.document["materials"]) - 1,
        }
        mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
        if fields is not None:
            primitive["targets"] = [{"POSITION": self.array(field, target=ARRAY)} for field in fields]
            mesh["weights"] = [0.0] * len(fields)
        self.document["meshes"].append(mesh)
        self.document["nodes"].append({"name": name, "mesh": len(self.document["meshes"]) - 1})
        return len(self.document["nodes"]) - 1

    def begin(self, name: str) -> None:
        """Begin a new animation; later calls of `move` belong to it."""
        self.animations.append({"name": name, "channels": [], "samplers": []})

    def move(self, node: int, path: str, times: int, values: np.ndarray) -> None:
        """Add the motion of a node to the current animation."""
        samplers, channels = self.animations[-1]["samplers"], self.animations[-1]["channels"]
        samplers.append({"input": times, "output": self.array(values), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    def bytes(self, title: str) -> bytes:
        """Return the file, as GLB."""
        # the world's z is up here, y in glTF
        self.document["nodes"].append(
            {
                "name": title,
                "children": list(range(len(self.document["nodes"]))),
                "rotation": [-(0.5**0.5), 0, 0, 0.5**0.5],
            }
        )
        message = {
            "asset": {"version": "2.0", "generator": "flexclear"},
            "scene": 0,
            "scenes": [{"name": title, "nodes": [len(self.document["nodes"]) - 1]}],
            "buffers": [{"byteLength": len(self.binary)}],
            "animations": self.animations,
            **self.document,
        }
        text = json.dumps(message, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def modes(name: str, bundle: xr.Dataset, scale: np.ndarray) -> bytes:
    """Return a GLB file of a body with an animation of each mode, drawn so many times larger, shape (mode,)."""
    file = _File()
    points, own = fields_of(bundle)
    count, fields = len(own), own * scale[:, None, None]
    node = file.node(name, skin(bundle, points), COLORS[0], 1.0, fields)
    phase = np.linspace(0.0, 2.0 * np.pi, 25)
    times = file.array(phase / (2.0 * np.pi))
    for k, frequency in enumerate(bundle["frequency"].values):
        file.begin(f"mode {k + 1}: {format_frequency(float(frequency))}")
        file.move(node, "weights", times, np.outer(np.sin(phase), np.eye(count)[k]).ravel())
    return file.bytes(name)


def motion(drawn: Mechanism, steps: np.ndarray, slower: float) -> bytes:
    """Return a GLB file with the run at these outputs, played so many times slower than it is."""
    run, file = drawn.run, _File()
    time = slower * (run["time"].values[steps] - run["time"].values[steps[0]])
    times = file.array(time)
    file.begin("run")
    bodies = [str(name) for name in run["body"].values]
    for part in drawn.parts:
        name = "ground" if part.owner is None else bodies[part.owner]
        node = file.node(name, part.surface, part.color, part.opacity)
        if part.owner is not None:
            _follow(file, node, times, np.array([part_pose(run, part, int(step)) for step in steps]))
    for body in drawn.flexible:
        node, weights = _add_flexible_body(
            file, body, bodies[body.index], run["modal_coordinate"].values[steps][:, body.columns]
        )
        _follow(file, node, times, np.array([pose(run, body.index, int(step)) for step in steps]))
        file.move(node, "weights", times, weights.ravel())
    return file.bytes(str(run.attrs.get("title", run.attrs.get("scene", "flexclear"))))


def _add_flexible_body(file: _File, body: Flexible, name: str, q: np.ndarray) -> tuple[int, np.ndarray]:
    # targets as large as the run's displacements, weights within one: viewers expect that
    largest = np.maximum(np.abs(q).max(axis=0), 1e-30)
    fields = body.scale * largest[:, None, None] * linear_fields(body.bundle)
    node = file.node(name, skin(body.bundle, points_at_rest(body.bundle)), body.color or COLORS[0], 1.0, fields)
    return node, q / largest


def _follow(file: _File, node: int, times: int, matrices: np.ndarray) -> None:
    file.move(node, "translation", times, matrices[:, :3, 3])
    stretch = np.linalg.norm(matrices[:, :3, :3], axis=1)
    if not np.allclose(stretch, 1.0):
        file.move(node, "scale", times, stretch)
    quaternions = np.array(
        [matrix_to_quaternion(matrix[:3, :3] / s) for matrix, s in zip(matrices, stretch, strict=True)]
    )
    for k in range(1, len(quaternions)):  # the shorter rotation from each to the next
        if quaternions[k] @ quaternions[k - 1] < 0.0:
            quaternions[k] = -quaternions[k]
    file.move(node, "rotation", times, quaternions[:, [1, 2, 3, 0]])


def _linear_colour(color: str) -> list[float]:
    """Return a colour of the screen as the linear one of glTF."""
    return [(int(color[k : k + 2], 16) / 255.0) ** 2.2 for k in (1, 3, 5)]
