"""Closing of loops: from poses of links to nearby ones in which all joints fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics.model.constraints import Constraint
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.mechanism import Link, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: residuals of the start above this fraction of the mechanism's size are an error of the scene, not rounding
WORST_GUESS = 0.05
#: residuals, in units of the mechanism's size, below which nothing is moved, and at which closing may end; with large
#: coordinates, so many roundings of these instead if that is more
CLOSED_EXACTLY, CLOSED_ENOUGH = 1e-13, 1e-11
#: least radius of gyration that a link counts with, as a fraction of the mechanism's size
LEAST_GYRATION = 0.01


@dataclass(frozen=True)
class Misfit:
    """Residuals of all joints: `values` scaled by the mechanism's size, shape (rows,).

    blocks: parts of their gradient with respect to the links' motions, (rows, columns), each with its first row and
    column; overlapping parts are added.
    """

    values: np.ndarray
    blocks: list[tuple[np.ndarray, int, int]]
    columns: int

    @property
    def worst(self) -> float:
        """Largest residual."""
        return float(np.max(np.abs(self.values), initial=0.0))

    def gradient(self) -> csr_array:
        """Return the gradient by the links' motions, (rows, columns); sparse, since a joint concerns two links."""
        from scipy.sparse import csr_array  # slow to import, and most scenes give poses that fit

        placed = [(np.indices(block.shape).reshape(2, -1), row, column) for block, row, column in self.blocks]
        places = [np.add(inside, [[row], [column]]) for inside, row, column in placed]
        entries = np.concatenate([*(block.ravel() for block, *_ in self.blocks), np.zeros(0)])
        rows, columns = np.concatenate([*places, np.zeros((2, 0), dtype=np.int64)], axis=1)
        return csr_array((entries, (rows, columns)), shape=(len(self.values), self.columns))


def close(
    mechanism: Mechanism,
    joints: list[Constraint],
    poses: Sequence[Placement],
    still: Collection[int] = (),
    within: float = 0.0,
) -> list[Placement] | None:
    """Return nearby poses, in the metric of the mass, in which all joints fit; None when the iteration finds none.

    still: links that are not moved.  within: largest residual with which joints fit, in units of the mechanism's size;
    by default that of rounding.

    Levenberg-Marquardt with the damping |r|, which converges quadratically also where joints impose a condition twice
    (Yamashita & Fukushima 2001, Computing Suppl. 15, 239-249).
    """
    here, grain = list(poses), _rounding_of_positions(mechanism)
    exact, closed = max(CLOSED_EXACTLY, 4.0 * grain), max(CLOSED_ENOUGH, 100.0 * grain)
    now = misfit(mechanism, joints, here)
    if now.worst <= exact:
        return here
    from scipy.sparse import diags_array, eye_array  # slow to import, as is the solver
    from scipy.sparse.linalg import spsolve

    mobility = diags_array(_mobilities(mechanism, here, still))
    damping = 1.0
    for _ in range(60):
        gradient = now.gradient()
        G = gradient @ mobility
        normal, rows = G @ gradient.T, len(now.values)
        # least damping, as a fraction of the mean of the normal matrix, which is singular for redundant joints
        scale = max(damping * float(np.linalg.norm(now.values)), 1e-15) * normal.trace() / rows
        step = -G.T @ spsolve((normal + scale * eye_array(rows)).tocsc(), now.values)
        there = displaced_poses(mechanism, here, step)
        then = misfit(mechanism, joints, there)
        if np.linalg.norm(then.values) < np.linalg.norm(now.values):
            here, now, damping = there, then, 0.1 * damping
        else:
            damping *= 10.0
        if now.worst <= exact or damping > 1e12:
            break
    return here if now.worst <= max(closed, within) else None


def _rounding_of_positions(mechanism: Mechanism) -> float:
    """Return the rounding of the largest coordinates of the scene, as a fraction of the mechanism's size."""
    reach = [mechanism.origin, *(link.start.p for link in mechanism.links)]
    reach += [frame.placement.p for frame in mechanism.frames.values()]
    return float(np.finfo(float).eps * np.max(np.abs(reach)) / mechanism.length)


def misfit(mechanism: Mechanism, joints: list[Constraint], poses: Sequence[Placement]) -> Misfit:
    """Return the residuals of all joints and driven coordinates.

    Motions, per link but the ground: its small rotation about its centre of mass, and the centre's displacement in
    units of the mechanism's size.
    """
    L = mechanism.length
    values, blocks, row = [], list[tuple[np.ndarray, int, int]](), 0
    centres = [pose.of(Placement(_centre(link))).p for link, pose in zip(mechanism.links, poses, strict=True)]
    for joint in joints:
        demanded = joint.demands(poses, joint.values).natural(L)
        values.append(demanded.residuals)
        for link, sign in ((joint.link_a, -1.0), (joint.link_b, 1.0)):
            if link:  # the ground does not move
                blocks.append((sign * demanded.about(centres[link], L), row, 6 * (link - 1)))
        row += len(demanded.residuals)
    return Misfit(np.concatenate([*values, np.zeros(0)]), blocks, 6 * (len(mechanism.links) - 1))


def _centre(link: Link) -> np.ndarray:
    return link.undeformed.com if link.undeformed is not None else np.zeros(3)


def _mobilities(mechanism: Mechanism, poses: Sequence[Placement], still: Collection[int]) -> np.ndarray:
    """Return the inverse of mass and least principal moment of inertia per motion, shape (6 (links - 1),)."""
    L, result = mechanism.length, []
    largest = max((link.mass for link in mechanism.links[1:]), default=1.0)
    for i, link in enumerate(mechanism.links[1:], start=1):
        if link.undeformed is None or i in still:
            result += [0.0] * 6
            continue
        moment = float(np.linalg.eigvalsh(link.undeformed.moments)[0])
        mass = max(link.mass, LEAST_GYRATION**2 * largest)  # a link without mass moves easily
        result += [largest / max(moment / L**2, mass * LEAST_GYRATION**2)] * 3 + [largest / mass] * 3
    return np.array(result)


def displaced_poses(mechanism: Mechanism, poses: Sequence[Placement], step: np.ndarray) -> list[Placement]:
    """Return the poses after motions of the links, shape (6 (links - 1),), as in `misfit`."""
    moved = [poses[0]]
    for i, link in enumerate(mechanism.links[1:], start=1):
        turn, shift = step[6 * i - 6 : 6 * i - 3], mechanism.length * step[6 * i - 3 : 6 * i]
        centre = poses[i].of(Placement(_centre(link))).p
        R = rotation_vector_to_matrix(turn) @ poses[i].R
        moved.append(Placement(centre + shift - R @ _centre(link), R))
    return moved


def ill_fitting(mechanism: Mechanism, joints: Sequence[Constraint], poses: Sequence[Placement]) -> InputError | None:
    """Return the error of the first joint whose frames are far from fitting, or None."""
    for joint in joints:
        demanded = joint.demands(poses)
        gap, turned = (
            float(np.max(np.abs(demanded.residuals[mine]), initial=0.0))
            for mine in (~demanded.turning, demanded.turning)
        )
        a, b = joint.edge.frame_a, joint.edge.frame_b
        if gap > WORST_GUESS * mechanism.length:
            # gap [m] above which a length may have been given in mm without a unit
            return InputError(
                f"[joint.{joint.name}.between]",
                f"'{a}' and '{b}' start at a distance of {gap:.3g} m, where a {joint.edge.kind} joint connects "
                f"them (limit {WORST_GUESS:.0%} of the mechanism's size, {mechanism.length:.3g} m)",
                "correct the poses of the bodies, or the frames"
                + ("; bare numbers are in metres" if gap >= 1.0 else ""),
            )
        if turned > WORST_GUESS:
            return InputError(
                f"[joint.{joint.name}.between]",
                f"axes of '{a}' and '{b}' start {np.degrees(np.arcsin(min(turned, 1.0))):.3g} deg from the "
                f"axes that a {joint.edge.kind} joint needs (limit {np.degrees(np.arcsin(WORST_GUESS)):.2g} deg)",
                "correct the orientations of the bodies, or of the frames",
            )
    return None


def opposite(joints: Sequence[Constraint], poses: Sequence[Placement]) -> InputError | None:
    """Return the error of the first axes that a joint keeps parallel but that point in opposite directions, or None."""
    for joint in joints:
        A, B = joint.frames(poses)
        pairs = joint_type(joint.edge.kind).ROTATIONS
        for k in range(3):
            others = {other for axis, other in pairs if axis == k} | {axis for axis, other in pairs if other == k}
            # least cosine of the angle between axes that a joint keeps parallel
            if len(others - {k}) == 2 and A.R[:, k] @ B.R[:, k] < 0.5:
                return InputError(
                    f"[joint.{joint.name}.between]",
                    f"the {'xyz'[k]} axes of '{joint.edge.frame_a}' and '{joint.edge.frame_b}', which a "
                    f"{joint.edge.kind} joint makes parallel, point in opposite directions",
                    "turn one of the frames",
                )
    return None
