"""Mobility, rank and redundancy of a mechanism, and refusals of mechanisms that cannot move as asked.

All of it follows from the directions in which the joints leave the links free: the closures'
Jacobian in any basis of them.  Whether a loss of rank belongs to the mechanism (a planar loop in
space) or to the pose alone is seen from poses nearby.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.algebra import rotation_vector_to_matrix
from pipeline.core.errors import InputError
from pipeline.dynamics import memory as m
from pipeline.dynamics.model import weightless
from pipeline.dynamics.model.assembly import close, settled
from pipeline.dynamics.model.constraints import constraints, demands, freedoms, outboard_place
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.tree import PATH
from pipeline.dynamics.model.wiring import closure_route

#: singular values below this share of the largest are zero: poses fit to 1e-11, curvature brings that to 1e-9
ZERO = 1e-7
#: displacements, in radians and shares of the mechanism's size, of the poses nearby
NEARBY = (0.03, 0.01)
#: share of a self-stress that a joint must carry for its reaction to count as undetermined
CARRIES = 1e-6


@dataclass(frozen=True)
class Mobility:
    """Counts of a system at its start. coordinates: free ones of the tree.

    rank: independent closure rows of `rows`; those of poses nearby where the start is singular.
    redundant_joints: joints whose reaction the equations of motion of rigid bodies do not determine.
    singular_start: of a start in a singular pose, where it is and why it cannot go on by itself, in words.
    """

    coordinates: int
    rows: int
    rank: int
    redundant_joints: frozenset[str]
    singular_start: str = ""

    @property
    def mobility(self) -> int:
        """Degrees of freedom, prescribed ones not counted."""
        return self.coordinates - self.rank

    @property
    def redundant(self) -> int:
        """Closure rows that follow from the others."""
        return self.rows - self.rank

    @property
    def start_refusal(self) -> str:
        """The same with what helps."""
        return (
            f"{self.singular_start}: give its bodies the velocities of one of these, choose one by [start] branch if "
            "drives or forces move it, or start it in another pose of its path"
        )

    def text(self) -> str:
        """In words, for the user."""
        return f"mobility {self.mobility}, {self.redundant} redundant"


def analyse(model: Model) -> Mobility:
    """Mobility of an assembled system.

    Raises InputError for a mechanism that cannot move at all, drives that contradict each other and motions that no
    mass resists.
    """
    poses, singular = [link.start for link in model.mechanism.links], ""
    J, known = jacobians(model, poses)
    rank = _rank(J)
    regular = _regular_poses(model, J, rank) if rank < len(J) else None
    if regular is not None:
        poses, singular = regular, _singular_start(model, J, rank)
        J, known = jacobians(model, poses)
        rank = _rank(J)
    found = Mobility(model.numbering.nv, len(J), rank, _undetermined(model, J, rank, poses), singular)
    _refuse_locked(model, found)
    _refuse_contradiction(model, J, known, rank)
    weightless.refuse(model, poses, _columns(model, poses), J, rank)
    return found


def jacobians(model: Model, poses: Sequence[Placement]) -> tuple[np.ndarray, np.ndarray]:
    """Closure rows against the free motions of the tree, (rows, nv), and against the driven ones, (rows, drives).

    Scaled by the mechanism's size; each joint's motions in an orthonormal basis.
    """
    numbering, L = model.numbering, model.mechanism.length
    twists = _columns(model, poses)
    J = np.zeros((model.arrays.size(m.N_CLOSURE_ROWS), numbering.nv + numbering.known))
    row = 0
    for line, k in zip(model.arrays.table(m.CLOSURES), model.closure_order, strict=True):
        wrenches = _scaled_wrenches(model.mechanism.closures[k][0].kind, _sites(model, poses, k), L)
        for coordinate, column, sign in closure_route(numbering, int(line["site_a"]), int(line["site_b"])):
            J[row : row + len(wrenches), coordinate] += sign * wrenches @ twists[column]
        row += len(wrenches)
    return J[:, : numbering.nv], J[:, numbering.nv :]


def _sites(model: Model, poses: Sequence[Placement], k: int) -> tuple[Placement, Placement]:
    _, a, b = model.mechanism.closures[k]
    return poses[a.link].of(a.place), poses[b.link].of(b.place)


def _scaled_wrenches(kind: str, frames: tuple[Placement, Placement], L: float) -> np.ndarray:
    """Wrenches of a closure that give dimensionless rows with twists in units of L."""
    _, wrenches = demands(kind, *frames)
    force = np.any(wrenches[:, 3:] != 0.0, axis=1)
    scaled = wrenches.copy()
    scaled[force, :3] /= L
    return scaled


def _columns(model: Model, poses: Sequence[Placement]) -> np.ndarray:
    """Twist of every column of the layout, shape (columns, 6); velocities in units of the size per second."""
    numbering, L = model.numbering, model.mechanism.length
    twists = np.zeros((numbering.columns, 6))
    for i, link in enumerate(model.mechanism.links):
        if link.inboard is None:
            continue
        F = poses[link.inboard.link].of(link.inboard.place)
        basis = freedoms(link.kind, F, poses[i].of(outboard_place(model.mechanism, link)), L)
        twists[numbering.c0[i] : numbering.c0[i] + len(basis)] = basis
    for site, frame, first in numbering.ports:
        on = numbering.sites[site].link
        twists[first : first + numbering.modes[on]] = _shape_twists(model, on, frame, poses[on])
    return twists


def _shape_twists(model: Model, link: int, frame: str, pose: Placement) -> np.ndarray:
    """Twists of a frame of a flexible link per mode, relative to its inboard frame, undeformed; (modes, 6)."""
    branch = model.mechanism.links[link].branch
    own = None if branch.edge is None else (branch.edge.frame_a if branch.reverse else branch.edge.frame_b)
    twists = _frame_twists(model, link, frame, pose)
    return twists if own is None else twists - _frame_twists(model, link, own, pose)


def _frame_twists(model: Model, link: int, frame: str, pose: Placement) -> np.ndarray:
    bundle = model.mechanism.bundles[str(model.mechanism.links[link].flexible)]
    k = list(bundle["frame"].values).index(frame.partition(".")[2])
    turning = (pose.R @ bundle["frame_rotation_shape"].values[k]).T
    moving = (pose.R @ bundle["frame_translation_shape"].values[k]).T
    p = pose.of(Placement(bundle["frame_position"].values[k])).p
    L = model.mechanism.length
    # per modal coordinate of the mechanism's size: sqrt(kg) m
    return L * np.hstack([turning, (moving + np.cross(p, turning)) / L])


def _rank(J: np.ndarray) -> int:
    if not J.size:
        return 0
    values = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(values > ZERO * values[0]))


def _regular_poses(model: Model, J: np.ndarray, rank: int) -> list[Placement] | None:
    """Poses nearby in which the closures have a higher rank than at the start, if there are any."""
    flexible = any(link.flexible for link in model.mechanism.links)
    paths = any(link.branch.edge is not None and link.branch.edge.kind == PATH for link in model.mechanism.links)
    if rank == model.numbering.nv or flexible or paths:
        return None
    joints = constraints(model.mechanism)
    poses = [link.start for link in model.mechanism.links]
    free = np.linalg.svd(J)[2][rank:]
    random = np.random.default_rng(0)
    for size in NEARBY:
        motion = random.normal(size=len(free)) @ free
        start = _displaced(model, poses, size * motion / np.linalg.norm(motion))
        closed = close(model.mechanism, joints, start)
        if closed is None:
            continue
        there = [link.start for link in settled(model.mechanism, closed).links]
        if _rank(jacobians(model, there)[0]) > rank:
            return there
    return None


def _singular_start(model: Model, J: np.ndarray, rank: int) -> str:
    """What is said of a start in a singular pose."""
    names = {model.mechanism.closures[k][0].name: None for k in model.closure_order}
    values = np.linalg.svd(J, compute_uv=False)
    ratio = values[0] / max(values[min(rank, len(values) - 1)], 1e-16 * values[0])
    return (
        f"at t = {model.scene.time.start:.6g} s: the mechanism starts in a singular pose, where its "
        f"loops (closed at joints {', '.join(names)}) can go on in several ways (condition number {ratio:.3g})"
    )


def _displaced(model: Model, poses: Sequence[Placement], motion: np.ndarray) -> list[Placement]:
    """Poses after a small motion of the tree's free coordinates."""
    numbering, L = model.numbering, model.mechanism.length
    twists, moved = _columns(model, poses), [poses[0]]
    for i in range(1, len(poses)):
        route = [(c, col) for c, col in numbering.joint_route(i) if c < numbering.nv]
        twist = sum((motion[c] * twists[col] for c, col in route), np.zeros(6))
        turn = rotation_vector_to_matrix(twist[:3])
        moved.append(Placement(turn @ poses[i].p + L * twist[3:], turn @ poses[i].R))
    return moved


def _undetermined(model: Model, J: np.ndarray, rank: int, poses: Sequence[Placement]) -> frozenset[str]:
    """Joints that carry part of a self-stress: reactions in balance with each other, without any load."""
    if rank == len(J):
        return frozenset()
    stress = np.linalg.svd(J.T)[2][rank:]  # (self-stresses, rows)
    mechanism, L = model.mechanism, model.mechanism.length
    carried = np.zeros((len(mechanism.links), 6, len(stress)))  # wrench that a link takes from its closures
    found, row = set(), 0
    for k in model.closure_order:
        edge, a, b = mechanism.closures[k]
        wrenches = _scaled_wrenches(edge.kind, _sites(model, poses, k), L)
        wrench = wrenches.T @ stress[:, row : row + len(wrenches)].T
        carried[a.link] -= wrench
        carried[b.link] += wrench
        if np.max(np.abs(wrench)) > CARRIES:
            found.add(edge.name)
        row += len(wrenches)
    for i in range(len(mechanism.links) - 1, 0, -1):
        branch = mechanism.links[i].branch
        carried[branch.parent] += carried[i]
        if branch.edge is not None and np.max(np.abs(carried[i])) > CARRIES:
            found.add(branch.edge.name)
    return frozenset(found)


def _refuse_locked(model: Model, found: Mobility) -> None:
    if found.mobility == 0 and model.numbering.known == 0:
        raise InputError(
            "[joint]",
            f"the mechanism is locked: {found.coordinates} free coordinates of its tree against {found.rank} "
            "independent closure rows leave it no motion",
            "remove a joint, choose one with more freedom, or drive one",
        )


def _refuse_contradiction(model: Model, J: np.ndarray, known: np.ndarray, rank: int) -> None:
    """Drives that the loops tie to each other can follow their laws only if these happen to agree."""
    if not known.size or _rank(np.hstack([J, known])) == rank:
        return
    tied = _tied(J, known, rank)
    drives = [name for k, name in enumerate(model.mechanism.drives) if k in tied]
    moving = [name for name in drives if moves(model, name)]
    if not moving:
        return
    raise InputError(
        f"[drive.{moving[0].partition('.')[0]}]",
        f"the mechanism is over-driven: its loops tie the coordinates of {', '.join(drives)} to each other "
        f"({model.numbering.nv} free coordinates, {rank} independent closure rows, {model.numbering.known} drives)",
        "remove a drive, or a joint",
    )


def _tied(J: np.ndarray, known: np.ndarray, rank: int) -> set[int]:
    """Drives that appear in what the closures demand of drives alone."""
    left = np.linalg.svd(J.T)[2][rank:] @ known if len(J) > rank else np.zeros((0, known.shape[1]))
    return {k for k in range(known.shape[1]) if np.max(np.abs(left[:, k]), initial=0.0) > ZERO}


def moves(model: Model, name: str) -> bool:
    """Whether the law of a drive is not one value all along."""
    first, count = model.arrays.table(m.LAWS)[model.mechanism.drives.index(name)]
    pieces = slice(first, first + count)
    values = model.arrays.table(m.PIECES)["coefficients"][pieces]
    harmonics = model.arrays.table(m.PIECE_HARMONICS)["n_harmonics"][pieces]
    return bool(np.any(values[:, 1:] != 0.0) or np.ptp(values[:, 0]) > 0.0 or np.any(harmonics > 0))
