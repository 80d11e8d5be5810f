r"""Scenes of rigid bodies in maximal coordinates, read with nothing of the program.

A scene file as plain numbers, read with nothing of the program: TOML, units, poses.

Mechanisms of rigid bodies in maximal coordinates: a second derivation for any scene of rigid bodies.

Every body has its own centre c, quaternion q, velocity v and angular velocity (world axes). Joints are rows,
built of two kinds: the offset of two points along an axis of the first body, and the product of two axes.

.. math:: \begin{pmatrix} M & J^T \\ J & 0 \end{pmatrix} \begin{pmatrix} \dot v \\ -\lambda \end{pmatrix}
          = \begin{pmatrix} f \\ -\dot J v \end{pmatrix}

solved densely; nothing holds the rows but that they start satisfied, which suffices for milliseconds. Rows that
follow from others at the start, as those of planar loops in space do, are left out.
"""

import math
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.ideal_motion import exponential

Array = np.ndarray
UNITS = {
    "": 1.0, "m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "kg": 1.0, "g": 1e-3, "s": 1.0, "ms": 1e-3, "us": 1e-6,
    "rad": 1.0, "deg": math.pi / 180.0, "rad/s": 1.0, "rpm": math.pi / 30.0, "m/s": 1.0, "mm/s": 1e-3,
    "m/s^2": 1.0, "mm/s^2": 1e-3, "Pa": 1.0, "GPa": 1e9, "kg mm^2": 1e-6, "kg m^2": 1.0,
}  # fmt: skip


@dataclass(frozen=True)
class Frame:
    """On body number `body` (-1: the ground): origin from the centre of mass (from the world's), axes as columns."""

    body: int
    place: Array
    axes: Array


@dataclass(frozen=True)
class Body:
    """Mass [kg], inertia about the centre of mass in its own axes, and its start."""

    mass: float
    inertia: Array
    centre: Array
    axes: Array
    velocity: Array
    omega: Array


def si(value: Any) -> Any:
    """A number, or an array of them, in SI units."""
    if isinstance(value, (list, tuple)):
        return np.array([si(v) for v in value])
    if isinstance(value, str):
        number, unit = re.fullmatch(r"([-+0-9.eE]+)\s*(.*)", value.strip()).groups()  # type: ignore[union-attr]
        return float(number) * UNITS[unit]
    return float(value)


def pose(table: dict[str, Any]) -> tuple[Array, Array]:
    """Origin and axes (columns) of a frame."""
    axes = exponential(si(table.get("rotation_vector", [0.0, 0.0, 0.0])))
    if "axes" in table:
        x, z = (si(table["axes"][k]) / np.linalg.norm(si(table["axes"][k])) for k in "xz")
        axes = np.column_stack([x, np.cross(z, x), z])
    return si(table.get("position", [0.0, 0.0, 0.0])), axes


def read(path: Path) -> dict[str, Any]:
    """The tables of a scene without `extends`."""
    return tomllib.loads(path.read_text())


def bodies(scene: dict[str, Any]) -> tuple[list[Body], dict[str, Frame]]:
    """Moving bodies in their order, and all frames by name."""
    found: list[Body] = []
    frames: dict[str, Frame] = {}
    for name, table in scene["body"].items():
        fixed = table["type"] == "ground"
        centre = si(table.get("com", [0.0, 0.0, 0.0]))
        for frame, place in table.get("frames", {}).items():
            origin, axes = pose(place)
            frames[f"{name}.{frame}"] = Frame(-1 if fixed else len(found), origin - centre, axes)
        if not fixed:
            origin, axes = pose(table["pose"])
            inertia = si(table["inertia"])
            rest = [0.0, 0.0, 0.0]
            motion = [si(table.get(key, rest)) for key in ("velocity", "angular_velocity")]
            matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
            found.append(Body(si(table["mass"]), matrix, origin + axes @ centre, axes, *motion))
    return found, frames


#: numbers of the state per body: centre, quaternion, velocity, angular velocity
SIZE = 13
#: rows of each joint: axes of the first body along which points stay together, pairs of axes that stay perpendicular
ROWS: dict[str, tuple[tuple[int, ...], tuple[tuple[int, int], ...]]] = {
    "spherical": ((0, 1, 2), ()),
    "revolute": ((0, 1, 2), ((0, 2), (1, 2))),
    "cylindrical": ((0, 1), ((0, 2), (1, 2))),
    "universal": ((0, 1, 2), ((0, 1),)),
    "prismatic": ((0, 1), ((0, 1), (0, 2), (1, 2))),
    "planar": ((2,), ((0, 2), (1, 2))),
    "clearance-revolute": ((2,), ((0, 2), (1, 2))),
    "clearance-spherical": ((), ()),
}


def cross(a: Array, b: Array) -> Array:
    """Product a x b of single vectors, faster than numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def axes_of(q: Array) -> Array:
    """Matrix of a quaternion w x y z of any length."""
    w, x, y, z = q / np.sqrt(q @ q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(R: Array) -> Array:
    """Quaternion w x y z of a matrix: the eigenvector of its symmetric 4 x 4 form (Bar-Itzhack 2000)."""
    K = np.empty((4, 4))
    K[0, 0] = np.trace(R)
    K[0, 1:] = K[1:, 0] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    return np.linalg.eigh(K)[1][:, -1]


@dataclass(frozen=True)
class Place:
    """A frame in motion: origin, axes, velocity of the origin, angular velocity, and the arm from the centre."""

    body: int
    origin: Array
    axes: Array
    velocity: Array
    omega: Array
    arm: Array

    def velocity_at(self, point: Array) -> Array:
        """Of the material point that is there."""
        return self.velocity + cross(self.omega, point - self.origin)


class LooseBodies:
    """The bodies, frames, rows and weight of a scene."""

    def __init__(self, scene: dict[str, Any]) -> None:
        self.bodies, self.frames = bodies(scene)
        weight = scene.get("load", {}).get("gravity")
        self.gravity = si(weight["acceleration"]) if weight else np.zeros(3)
        self.pairs = [tuple(self.frames[f] for f in j["between"]) for j in scene["joint"].values()]
        self.kinds = [j["type"] for j in scene["joint"].values()]
        self.kept = _independent(self.all_rows(self.start())[0])

    def start(self) -> Array:
        """The state as the scene gives it."""
        parts = [np.concatenate([b.centre, quaternion_of(b.axes), b.velocity, b.omega]) for b in self.bodies]
        return np.concatenate(parts)

    def place(self, y: Array, frame: Frame) -> Place:
        """A frame in a state."""
        if frame.body < 0:
            zero = np.zeros(3)
            return Place(-1, frame.place, frame.axes, zero, zero, zero)
        b = y[SIZE * frame.body : SIZE * frame.body + SIZE]
        R = axes_of(b[3:7])
        arm = R @ frame.place
        return Place(frame.body, b[:3] + arm, R @ frame.axes, b[7:10] + cross(b[10:], arm), b[10:], arm)

    def rates(self, y: Array, pushes: list[tuple[int, Array, Array]]) -> Array:
        """Rates of the state under forces (body, point, force) besides weight."""
        n = len(self.bodies)
        M, f, out = np.zeros((6 * n, 6 * n)), np.zeros(6 * n), np.zeros(SIZE * n)
        for i, body in enumerate(self.bodies):
            b, at = y[SIZE * i : SIZE * i + SIZE], 6 * i
            R, q, omega = axes_of(b[3:7]), b[3:7], b[10:]
            inertia = R @ body.inertia @ R.T
            M[at : at + 3, at : at + 3], M[at + 3 : at + 6, at + 3 : at + 6] = body.mass * np.eye(3), inertia
            f[at : at + 3], f[at + 3 : at + 6] = body.mass * self.gravity, -cross(omega, inertia @ omega)
            turning = np.concatenate([[-omega @ q[1:]], q[0] * omega + cross(omega, q[1:])])
            out[SIZE * i : SIZE * i + 7] = np.concatenate([b[7:10], 0.5 * turning])
        for i, point, force in pushes:
            if i >= 0:
                f[6 * i : 6 * i + 3] += force
                f[6 * i + 3 : 6 * i + 6] += cross(point - y[SIZE * i : SIZE * i + 3], force)
        J, gamma = self.rows(y)
        system = np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])
        found = np.linalg.solve(system, np.concatenate([f, gamma]))
        for i in range(n):
            out[SIZE * i + 7 : SIZE * i + 13] = found[6 * i : 6 * i + 6]
        return out

    def rows(self, y: Array) -> tuple[Array, Array]:
        """Jacobian of the rows that are kept, and what J v' must be."""
        J, gamma = self.all_rows(y)
        return J[self.kept], gamma[self.kept]

    def all_rows(self, y: Array) -> tuple[Array, Array]:
        """The same of all joints."""
        jacobian, gamma = [], []
        for kind, pair in zip(self.kinds, self.pairs, strict=True):
            a, b = (self.place(y, frame) for frame in pair)
            along, across = ROWS[kind]
            for row, value in [_point_row(a, b, k) for k in along] + [_axis_row(a, b, *kl) for kl in across]:
                full = np.zeros(6 * len(self.bodies))
                for body, part in zip((a.body, b.body), row, strict=True):
                    if body >= 0:
                        full[6 * body : 6 * body + 6] += part
                jacobian.append(full)
                gamma.append(value)
        return np.array(jacobian).reshape(-1, 6 * len(self.bodies)), np.array(gamma)


def _independent(J: Array) -> Array:
    """Numbers of rows that do not follow from those before (Gram and Schmidt)."""
    kept: list[int] = []
    basis = np.zeros((0, J.shape[1]))
    for k, row in enumerate(J):
        left = row / np.linalg.norm(row)
        for _ in range(2):
            left = left - basis.T @ (basis @ left)
        if np.linalg.norm(left) > 1e-6:
            kept.append(k)
            basis = np.vstack([basis, left / np.linalg.norm(left)])
    return np.array(kept, dtype=int)


def _point_row(a: Place, b: Place, k: int) -> tuple[tuple[Array, Array], float]:
    """Together: e . (p_b - p_a) = 0, e being axis k of a: parts for (v, omega) of a and b; the right side."""
    e, d, v = a.axes[:, k], b.origin - a.origin, b.velocity - a.velocity
    e_rate = cross(a.omega, e)
    centripetal = cross(b.omega, cross(b.omega, b.arm)) - cross(a.omega, cross(a.omega, a.arm))
    value = -(e @ centripetal + 2.0 * e_rate @ v + cross(a.omega, e_rate) @ d)
    of_a = np.concatenate([-e, -cross(a.arm, e) + cross(e, d)])
    return (of_a, np.concatenate([e, cross(b.arm, e)])), value


def _axis_row(a: Place, b: Place, k: int, m: int) -> tuple[tuple[Array, Array], float]:
    """Perpendicular: u . w = 0, axis k of a and axis m of b."""
    u, w = a.axes[:, k], b.axes[:, m]
    across, zero = cross(u, w), np.zeros(3)
    turning = cross(cross(a.omega, u), w) + cross(u, cross(b.omega, w))
    value = -(a.omega - b.omega) @ turning
    return (np.concatenate([zero, across]), np.concatenate([zero, -across])), value
