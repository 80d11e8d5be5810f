r"""The same mechanism in maximal coordinates: the dense system that minimal coordinates are measured against.

Unknowns are the accelerations of every moving link (6 each, rigidly joined bodies merged into one), the modal
accelerations, and one multiplier per row of every joint, drives included:

.. math:: \begin{pmatrix} M & J^T \\ J & 0 \end{pmatrix} \begin{pmatrix} \dot v \\ -\lambda \end{pmatrix}
          = \begin{pmatrix} f \\ \gamma \end{pmatrix}

A rigid body fixed to a flexible one is merged too: it moves with the twist of the frame that it is fixed to. Clearance
joints are forces and have no rows.  The system is assembled at the scene's start, at rest and undeformed, where f = 0
without loads and gamma holds the accelerations of the drives alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from benchmarks.mechanisms import joint_laws
from flexclear.pipeline.core.numerics.rotations import skew
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.model.merge import (
    Frame,
    Group,
    Placement,
    frames_of,
    merge,
    rigid_inertia,
    start_places,
)

#: rows of a joint: directions of relative translation and of relative rotation that it stops, axes of its first frame
ROWS = {
    "spherical": ((0, 1, 2), ()),
    "revolute": ((0, 1, 2), (0, 1)),
    "prismatic": ((0, 1), (0, 1, 2)),
    "fixed": ((0, 1, 2), (0, 1, 2)),
    "clearance-spherical": ((), ()),
}
#: what a drive prescribes of its joint: (translations, rotations) along z of the first frame
DRIVEN = {"prismatic": ((2,), ()), "revolute": ((), (2,))}


@dataclass(frozen=True)
class Count:
    """Where the number of unknowns comes from."""

    links: int
    modes: int
    joint_rows: int
    drive_rows: int

    @property
    def unknowns(self) -> int:
        """Order of the dense system."""
        return 6 * self.links + self.modes + self.joint_rows + self.drive_rows

    def derivation(self) -> str:
        """The sum in words."""
        modes = f" + {self.modes} modes" if self.modes else ""
        rows = f"{self.joint_rows} joint rows + {self.drive_rows} drive rows"
        return f"6 x {self.links} links{modes} + {rows} = {self.unknowns}"


@dataclass(frozen=True)
class Maximal:
    """The dense system at the start. first: unknown of each group's velocity (v, omega of its host frame)."""

    matrix: np.ndarray
    right_side: np.ndarray
    count: Count
    first: dict[int, int]
    group_of: dict[str, int]


@dataclass(frozen=True)
class _Assembly:
    scene: Scene
    bundles: Mapping[str, xr.Dataset]
    frames: dict[str, Frame]
    groups: list[Group]
    group_of: dict[str, int]
    starts: list[Placement]
    carriers: dict[int, str]  # rigid group -> frame of the flexible body that it is fixed to
    first: dict[int, int]
    size: int

    def world(self, frame: Frame) -> Placement:
        """Place of a frame at the start."""
        i = self.group_of[frame.body]
        return self.starts[i].of(self.groups[i].places[frame.body]).of(frame.place)

    def twist(self, i: int, point: np.ndarray, frame: str | None) -> np.ndarray:
        """(velocity of a point, angular velocity) of group i per unknown velocity, shape (6, size), world axes."""
        if i == 0:
            return np.zeros((6, self.size))
        if i in self.carriers:
            carrier = self.carriers[i]
            at = self.world(self.frames[carrier]).p
            carried = self.twist(self.group_of[self.frames[carrier].body], at, carrier)
            return _shift(point - at) @ carried
        rigid = np.zeros((6, self.size))
        rigid[:, self.first[i] : self.first[i] + 6] = np.eye(6)
        result = _shift(point - self.starts[i].p) @ rigid
        if self.groups[i].flexible and frame is not None:
            name = self.groups[i].host
            shapes = self.bundles[name].sel(frame=frame.partition(".")[2])
            first, R = self.first[i] + 6, self.starts[i].R
            here = slice(first, first + shapes.sizes["mode"])
            result[:3, here] += R @ shapes["frame_translation_shape"].values
            result[3:, here] += R @ shapes["frame_rotation_shape"].values
        return result


def assemble(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Maximal:
    """The dense system of a scene at its start, which must be at rest and without loads."""
    a = _prepare(scene, bundles)
    mass = sum((_mass(a, i) for i in range(1, len(a.groups))), np.zeros((a.size, a.size)))
    blocks, gammas, joint_rows = [np.zeros((0, a.size))], list[float](), 0
    drives = joint_laws(scene)
    for joint in scene.joint.values():
        if joint.type == "fixed" and _same_link(a, joint.between):
            continue
        rows = _rows(a, joint.between, *ROWS[joint.type])
        blocks.append(rows)
        gammas += [0.0] * len(rows)
        joint_rows += len(rows)
    for name, law in drives.items():
        blocks.append(_rows(a, scene.joint[name].between, *DRIVEN[scene.joint[name].type]))
        gammas.append(law.value(scene.time.start, 2))
    J = np.concatenate(blocks)
    n = a.size + len(J)
    matrix, right = np.zeros((n, n)), np.zeros(n)
    matrix[: a.size, : a.size], matrix[a.size :, : a.size], matrix[: a.size, a.size :] = mass, J, J.T
    right[a.size :] = gammas
    links = len(a.first)
    return Maximal(matrix, right, Count(links, a.size - 6 * links, joint_rows, len(drives)), a.first, a.group_of)


def _prepare(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> _Assembly:
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    carriers = {}
    for joint in scene.joint.values():
        ends = [(group_of[frames[f].body], f) for f in joint.between]
        if joint.type == "fixed" and groups[ends[0][0]].flexible != groups[ends[1][0]].flexible:
            (_, carrier), (carried, _) = ends if groups[ends[0][0]].flexible else ends[::-1]
            carriers[carried] = carrier
    first, size = {}, 0
    for i, group in enumerate(groups):
        if i and i not in carriers:
            first[i] = size
            size += 6 + (bundles[group.host].sizes["mode"] if group.flexible else 0)
    starts = start_places(scene, groups, group_of, frames)
    return _Assembly(scene, bundles, frames, groups, group_of, starts, carriers, first, size)


def _shift(arm: np.ndarray) -> np.ndarray:
    """Twist (v, omega) at a point `arm` away from the one where it is given, shape (6, 6)."""
    result = np.eye(6)
    result[:3, 3:] = -skew(arm)
    return result


def _same_link(a: _Assembly, between: tuple[str, str]) -> bool:
    i, j = (a.group_of[a.frames[f].body] for f in between)
    return i == j or i in a.carriers or j in a.carriers


def _mass(a: _Assembly, i: int) -> np.ndarray:
    """Share of group i in the mass matrix."""
    R, p = a.starts[i].R, a.starts[i].p
    if not a.groups[i].flexible:
        mass, com, inertia = rigid_inertia(a.scene, a.groups[i].places)
        T = a.twist(i, p + R @ com, None)
        block = np.zeros((6, 6))
        block[:3, :3], block[3:, 3:] = mass * np.eye(3), R @ inertia @ R.T
        return T.T @ block @ T
    result, b = np.zeros((a.size, a.size)), a.bundles[a.groups[i].host]
    modes = b.sizes["mode"]
    body = np.zeros((6 + modes, 6 + modes))
    second, moment = b["second_moment"].values, b["position_mode_moment"].values
    body[:3, :3] = float(b["mass"]) * np.eye(3)
    body[3:6, :3] = R @ skew(b["first_moment"].values) @ R.T
    body[3:6, 3:6] = R @ (np.trace(second) * np.eye(3) - second) @ R.T
    body[6:, :3] = (R @ b["modal_first_moment"].values).T
    # int rho X x S_j, component a: sum of eps_abc X_b S_cj
    spin = np.array([moment[k - 2, k - 1] - moment[k - 1, k - 2] for k in range(3)])
    body[6:, 3:6] = (R @ spin).T
    body[6:, 6:] = b["modal_mass"].values
    here = slice(a.first[i], a.first[i] + 6 + modes)
    result[here, here] = np.tril(body) + np.tril(body, -1).T
    return result


def _rows(
    a: _Assembly, between: tuple[str, str], translations: tuple[int, ...], rotations: tuple[int, ...]
) -> np.ndarray:
    """Rows of the velocity constraints of one joint."""
    F, G = (a.frames[name] for name in between)
    here, there = a.world(F), a.world(G)
    i, j = a.group_of[F.body], a.group_of[G.body]
    first = _shift(there.p - here.p) @ a.twist(i, here.p, between[0])
    relative = a.twist(j, there.p, between[1]) - first
    axes = here.R.T
    return np.concatenate([axes[list(translations)] @ relative[:3], axes[list(rotations)] @ relative[3:]])
