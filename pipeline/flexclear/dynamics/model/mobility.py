"""Mobility, rank and redundancy of a mechanism, and refusals of mechanisms that cannot move as requested.

All of it follows from the directions in which the joints leave the links free: the closures' Jacobian in any basis of
them. Nearby poses show whether a loss of rank belongs to the mechanism (a planar loop in space) or to the pose alone.
Motions that no mass resists are refused here, too: a rod without inertia about its axis that is free to spin, a point
mass on a ball joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.assembly import with_starts
from flexclear.dynamics.model.closing import LEAST_GYRATION, close
from flexclear.dynamics.model.constraints import constraints
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.rates import Rates, motions, natural_wrenches, rates
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.system.errors import InputError

#: nearby poses: displacements, in radians and fractions of the mechanism's size; how many are tried, and how many are
#: enough; fraction of the displacement that must remain when the loops are closed
NEARBY, POSE_TRIES, ENOUGH_POSES, LEFT = (0.03, 0.01), 24, 2, 0.1
#: least fraction of a self-stress at which a joint's reaction counts as undetermined
CARRIES = 1e-6
#: condition numbers above this count as infinite
INFINITE = 1e15
#: a motion has no mass when its inertia is below this fraction of what bodies with their largest moment of inertia
#: about all axes would have
WEIGHTLESS = 1e-14


@dataclass(frozen=True)
class Mobility:
    """Counts of a mechanism at its start; coordinates: free ones of the tree.

    rank: number of independent closure rows among `rows`; at nearby poses where the start is singular.
    redundant_joints: joints whose reaction the equations of motion of rigid bodies do not determine.
    singular_start: a sentence that describes a singular start pose; empty otherwise.
    """

    coordinates: int
    rows: int
    rank: int
    redundant_joints: frozenset[str]
    singular_start: str = ""

    @property
    def mobility(self) -> int:
        """Degrees of freedom, without prescribed ones."""
        return self.coordinates - self.rank

    @property
    def redundant(self) -> int:
        """Closure rows that follow from the others."""
        return self.rows - self.rank

    @property
    def start_refusal(self) -> str:
        """The sentence of `singular_start` with remedies."""
        return (
            f"{self.singular_start}: give its bodies velocities of one branch, choose the branch by [start] branch if "
            "drives or forces move the mechanism, or start it in another pose of its path"
        )

    def text(self) -> str:
        """Return mobility and redundancy as a sentence for the user."""
        more = f"; conditions of closed loops that repeat others: {self.redundant}" if self.redundant else ""
        return f"free motions in addition to the drives: {self.mobility}{more}"


def analyse(model: Model) -> Mobility:
    """Return the mobility of an assembled mechanism.

    Raises InputError for a mechanism that cannot move at all, drives that contradict each other and motions that no
    mass resists.
    """
    poses, singular = [link.start for link in model.links], ""
    here = rates(model, poses)
    regular = _regular_poses(model, here) if here.rank < len(here.J) else None
    if regular is not None:
        poses, singular = regular, _singular_start(model, here)
        here = rates(model, poses)
    mobility = Mobility(model.nv, len(here.J), here.rank, _self_stressed(model, here, poses), singular)
    _refuse_locked(model, mobility, here)
    _refuse_contradiction(model, here)
    if here.rank < model.nv and model.mechanism.all_rigid:
        _refuse_weightless(model, poses, here.free)
    return mobility


def _regular_poses(model: Model, here: Rates) -> list[Placement] | None:
    """Return nearby poses in which the closures have a higher rank than at the start; None without these.

    In a redundant mechanism all nearby poses have the rank of the start.  From a singular pose a random displacement
    need not lead onto a branch of the motion: it may not close, or close at the start again, which is no evidence.
    """
    if here.rank == model.nv or model.mechanism.has_paths or not model.mechanism.all_rigid:
        return None
    joints, start = constraints(model.mechanism), [link.start for link in model.links]
    random = np.random.default_rng(0)
    left, stayed, evidence = [(here.rank, start)], [(here.rank, start)], 0
    for k in range(POSE_TRIES):
        direction = random.normal(size=here.free.shape[1])
        motion = here.free @ (direction / np.linalg.norm(direction))
        motion *= NEARBY[k % 2] / max(1.0, float(np.linalg.norm(motion)))
        closed = close(model.mechanism, joints, _poses_after_motion(model, start, motion))
        if closed is None:
            continue
        there = [link.start for link in with_starts(model.mechanism, closed).links]
        away = _distance(start, there, model.length) > LEFT * NEARBY[k % 2]
        (left if away else stayed).append((rates(model, there).rank, there))
        evidence += away
        if evidence == ENOUGH_POSES:
            break
    rank, poses = max(left if evidence else stayed, key=lambda pose: pose[0])
    return poses if rank > here.rank else None


def _distance(one: Sequence[Placement], other: Sequence[Placement], length: float) -> float:
    """Return the largest motion of a link, as the sum of displacement over the mechanism's size and rotation [rad]."""
    ways = [np.linalg.norm(a.p - b.p) / length + np.linalg.norm(a.R - b.R) for a, b in zip(one, other, strict=True)]
    return float(max(ways))


def _singular_start(model: Model, here: Rates) -> str:
    """Return a sentence that describes a start in a singular pose."""
    names = {closure.name: None for closure in model.closures}
    values = here.values
    ratio = values[0] / max(values[min(here.rank, len(values) - 1)], values[0] / INFINITE, 1.0 / INFINITE)
    return (
        f"at t = {model.scene.time.start:.6g} s: the mechanism starts in a singular pose, where its "
        f"loops (closed at joints {', '.join(names)}) can continue in several ways (condition number {ratio:.3g})"
    )


def _poses_after_motion(model: Model, poses: Sequence[Placement], motion: np.ndarray) -> list[Placement]:
    """Return the poses after a small motion of the tree's free coordinates."""
    twists = _link_motions(model, poses) @ motion
    turns, shifts = map(rotation_vector_to_matrix, twists[:, :3]), model.length * twists[:, 3:]
    return [Placement(R @ pose.p + p, R @ pose.R) for pose, R, p in zip(poses, turns, shifts, strict=True)]


def _link_motions(model: Model, poses: Sequence[Placement]) -> np.ndarray:
    """Return the twists of all links about the origin per free coordinate, with lengths in the mechanism's size.

    Shape (links, 6, nv).
    """
    twists = motions(model, poses).twists / ([1.0] * 3 + [model.length] * 3)
    moved = np.zeros((len(model.links), 6, model.nv))
    for i in range(1, len(moved)):
        for coordinate, column in model.numbering.joint_route(i):
            if coordinate < model.nv:
                moved[i, :, coordinate] = twists[column]
    return moved


def _self_stressed(model: Model, here: Rates, poses: Sequence[Placement]) -> frozenset[str]:
    """Return the joints that carry part of a self-stress: reactions in balance with each other, without any load."""
    if here.rank == len(here.J):
        return frozenset()
    mechanism, L = model.mechanism, model.length
    self_stresses = here.self_stresses / np.max(np.abs(here.self_stresses), axis=1, keepdims=True)
    carried = np.zeros((len(mechanism.links), 6, len(self_stresses)))  # wrench that a link takes from its closures
    joints, row = set[str](), 0
    for closure in model.closures:
        stress = self_stresses[:, row : row + len(closure.rows)]
        for a, b, acting in natural_wrenches(closure, poses, L):
            wrench = acting.about(np.zeros(3), L).T @ stress.T
            carried[a.link] -= wrench
            carried[b.link] += wrench
        if not isinstance(closure, Coupling) and np.max(np.abs(stress), initial=0.0) > CARRIES:
            joints.add(closure.name)
        row += len(closure.rows)
    for i in range(len(mechanism.links) - 1, 0, -1):
        branch = mechanism.links[i].branch
        carried[branch.parent] += carried[i]
        if branch.edge is not None and np.max(np.abs(carried[i])) > CARRIES:
            joints.add(branch.edge.name)
    return frozenset(joints)


def _refuse_locked(model: Model, mobility: Mobility, here: Rates) -> None:
    if mobility.mobility > 0 or model.drives:
        return
    least = float(np.min(here.values[: here.rank], initial=1.0))
    # rows of a locked mechanism below this size may come from misaligned joints
    hardly = (
        f"; one of these rows has only {least:.1g} of its natural size, as for joints with nearly aligned axes"
        if least < 1e-3
        else ""
    )
    raise InputError(
        "[joint]",
        f"the mechanism is locked: {mobility.rank} independent closure rows constrain all "
        f"{mobility.coordinates} free coordinates of its tree{hardly}",
        "write frames and poses with more digits, or use a joint with more freedom"
        if hardly
        else "remove a joint, choose one with more freedom, or drive one",
    )


def _refuse_contradiction(model: Model, here: Rates) -> None:
    """Raise InputError for moving drives that the loops couple: their laws would have to agree."""
    drives = [name for name, tied in zip(model.drives, here.dependent_drives, strict=True) if tied]
    moving = [name for name in drives if moves(model, name)]
    if not moving:
        return
    raise InputError(
        f"[drive.{moving[0].partition('.')[0]}]",
        f"the mechanism is over-driven: its loops couple the coordinates of {', '.join(drives)} to each other ("
        f"{model.nv} free coordinates, {here.rank} independent closure rows, {len(model.drives)} drives)",
        "remove a drive, or a joint",
    )


def moves(model: Model, name: str) -> bool:
    """Return True when the law of a drive is not constant."""
    first, count = model.arrays.table(m.LAWS)[model.drives.index(name)]
    pieces = slice(first, first + count)
    values = model.arrays.table(m.PIECES)["coefficients"][pieces]
    harmonics = model.arrays.table(m.PIECE_HARMONICS)["n_harmonics"][pieces]
    return bool(np.any(values[:, 1:] != 0.0) or np.ptp(values[:, 0]) > 0.0 or np.any(harmonics > 0))


def _refuse_weightless(model: Model, poses: Sequence[Placement], free: np.ndarray) -> None:
    """Raise InputError when rigid bodies can move without any of their masses moving.

    free: motions of the free coordinates with all closures closed, (nv, mobility).  Flexible bodies are left to the
    engine, whose mass matrix includes their modes.
    """
    nv, L, moved = model.nv, model.length, _link_motions(model, poses)
    moving, momenta, even = moved.copy(), np.zeros_like(moved), np.zeros_like(moved)
    for i, link in enumerate(model.links[1:], start=1):
        if link.inertia is not None:
            mass, com, inertia = link.inertia
            turning, R = moved[i, :3], poses[i].R
            moving[i, 3:] += np.cross(turning, poses[i].of(Placement(com)).p / L, axis=0)
            most = np.linalg.eigvalsh(inertia)[-1] / L**2 + mass * LEAST_GYRATION**2
            momenta[i, 3:] = even[i, 3:] = mass * moving[i, 3:]
            momenta[i, :3], even[i, :3] = (R @ inertia @ R.T / L**2) @ turning, most * turning
    ways = moving.reshape(-1, nv) @ free
    own, even = (ways.T @ (one.reshape(-1, nv) @ free) for one in (momenta, even))
    motion = _without_mass(own, even)
    if motion is not None:
        _refuse_motion(model, moved @ (free @ motion))


def _without_mass(own: np.ndarray, even: np.ndarray) -> np.ndarray | None:
    """Return a motion for which the mass matrix `own` vanishes against the mass matrix `even`, or None."""
    sizes = np.sqrt(even.diagonal())
    scaled = even / np.outer(sizes, sizes) if sizes.all() else np.zeros_like(even)
    if not np.linalg.eigvalsh(scaled)[0] > WEIGHTLESS:
        return None  # a singular pose moves massless links of a joint alone: the engine reports that
    # own v = value scaled v, by Cholesky's factor: scaled = L L^T, v = L^-T w (scipy.linalg is slow to import)
    back = np.linalg.inv(np.linalg.cholesky(scaled)).T
    values, vectors = np.linalg.eigh(back.T @ (own / np.outer(sizes, sizes)) @ back)
    return back @ vectors[:, 0] / sizes if values[0] <= WEIGHTLESS else None


def _refuse_motion(model: Model, twists: np.ndarray) -> None:
    """Raise InputError for a motion without mass; twists: of all links in this motion, (links, 6)."""
    sizes = np.abs(twists).max(axis=1)
    # least fraction of the largest motion at which a link takes part in a motion without mass
    links = [link for link, size in zip(model.links, sizes, strict=True) if size > 1e-3 * sizes.max()]
    names = sorted({name for link in links for name in link.placements})
    raise InputError(
        f"[body.{names[0]}.inertia]",
        f"the acceleration of {', '.join(names)} is undetermined: the joints allow a rotation about an axis "
        f"without inertia",
        "give it an inertia about every axis, or a joint that prevents this motion",
    )
