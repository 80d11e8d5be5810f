r"""First-order effect of joint clearance on the pose of a mechanism, about its ideal motion.

Joints and drives hold the links: a small opening e of their constraints moves the links by x with

.. math:: G\,x = -e, \qquad x = -G^{+} e

where G holds the rates of all joints' residuals. For a watched quantity, s x, only the adjoint solution
:math:`\lambda^T = s G^{+}` is needed, which is one solve for all openings of all joints: the reactions of the joints to
a unit load on it. Clearance lets two points separate by up to its radius (and the depth to
which the joint's force presses them), in any direction: its bound is the largest singular value of the map from there
to the watched body. That holds where joints and drives leave that body no freedom; elsewhere masses
decide, and no bound exists (infinite). A bending body opens the joints by the motion of its ends (`openings`); the
consequences are in `response`.

Source: the closure equations of `dynamics.model.closing`, differentiated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag
from scipy.sparse.linalg import SuperLU, splu

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.model.closing import displaced_poses, misfit
from flexclear.dynamics.model.constraints import Constraint, constraints
from flexclear.dynamics.model.contacts import resolve_law
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import (
    FrameWrench,
    Wrench,
    connected_bodies,
    joint_wrenches,
    on_frames,
    path_wrenches,
)
from flexclear.dynamics.run.run import Run
from flexclear.numerics.rotations import cross, rotation_vector_to_matrix, skew
from flexclear.scene.loose_joints import Clearance, ClearancePrismatic, Pin
from flexclear.scene.parts import RigidBody
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene

#: squared singular values of the joints' rates far below this fraction of the largest are zero, and a watched quantity
#: with up to this freedom counts as held: within some 3e-4 of a singular pose no bound exists
SQUARED_RANK, FREE = 1e-13, 1e-6
#: largest rotation, and displacement in units of the mechanism's size, at which second order is evaluated: the fourth
#: is a millionth of it then, and rounding 1e-10
FINITE = 1e-3
#: quantities that follow from the pose
OF_POSE = ("position", "orientation")


def bound_effects(full: Scene, run: Run, chosen: Sequence[Quantity]) -> Mapping[str, Mapping[str, float]]:
    """Return the largest effects of a scene's clearances over its motion, in SI, by joint, of each quantity.

    run: of its ideal mechanism.  Only those of `chosen` that follow from the pose are bounded.
    """
    model, seen = run.model, run.observed
    loose = [name for name in full.contacts() if name in model.scene.joint]
    asked = [q for q in chosen if q.kind in OF_POSE and q.owner in model.mechanism.link_of]
    loads = joint_wrenches(Motions(model, seen), loose)
    load = {name: float(np.linalg.norm(loads[name][1], axis=1).max()) for name in loose}
    # number of poses of the motion at which bounds are computed
    rows = np.unique(np.linspace(0, len(seen.state) - 1, 32).astype(int))
    clearance = {name: {q.name: 0.0 for q in asked} for name in loose}
    joints = constraints(model.mechanism)
    whole = knows_all_joints(model)
    for row in rows if asked else ():
        poses = [Placement(frame["origin"], frame["axes"]) for frame in seen.links[row]]
        lever = opening_map(model, joints, poses)
        for q in asked:
            adjoint, free = lever.adjoint(body_motion(model, poses, q.owner, turning=q.kind == "orientation"))
            if not whole or free > FREE:
                for bound in clearance.values():
                    bound[q.name] = np.inf
                continue
            for name in loose:
                reach = lever.clearance(name, adjoint, full.contacts()[name]) * _separation(
                    full.contacts()[name], load[name]
                )
                clearance[name][q.name] = max(clearance[name][q.name], reach)
    return clearance


def knows_all_joints(model: Model) -> bool:
    """Return True when this module knows all constraints between links; it does not know gears, for instance."""
    tree = sum(link.branch.edge is not None and not link.massless for link in model.mechanism.links)
    return not model.scene.gear and len(constraints(model.mechanism)) == tree + len(model.mechanism.closures)


def _separation(joint: Clearance, force: float) -> float:
    """Return how far the points may separate [m]: the clearance, and the penetration under a force."""
    first = next(iter(joint.pairs.values())).contact
    law = resolve_law(first, 1.0, "[normal]")  # the depth at rest does not depend on the mass
    # assumed force on a joint with clearance after separation, as a multiple of the ideal force
    return joint.clearance + law.depth(10.0 * force)


@dataclass(frozen=True)
class OpeningMap:
    """Map from openings of the joints to motions of the links, in one pose.

    gradient: rates of all joints' residuals, (rows, 6 (links - 1)).  normal: factored normal equations.
    joints: of each joint, its range of rows, and the wrenches of its constraints and driven coordinates, in units of
    the residuals.  length: unit of the openings [m].
    """

    gradient: sparse.csc_array
    normal: SuperLU
    joints: Mapping[str, tuple[Constraint, slice, np.ndarray]]
    length: float

    def adjoint(self, watched: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the adjoint solution of `watched`, (3, 6 (links - 1)): the joints' reactions to unit loads on it.

        It is the motion of `watched` per opening, (3, rows); also return the freedom that joints and drives leave it.
        """
        dual = self.normal.solve(np.ascontiguousarray(watched.T))
        rows = self.gradient @ dual
        return -rows.T, float(np.abs(watched - (self.gradient.T @ rows).T).max(initial=0.0))

    def clearance(self, name: str, rows: np.ndarray, joint: Clearance) -> float:
        """Return the largest motion that an adjoint solution gives per metre of separation of a joint's points."""
        constraint, range_of_rows, _ = self.joints[name]
        count = {"revolute": 2, "cylindrical": 2, "slot": 1}.get(constraint.edge.kind, 3)
        own = rows[:, range_of_rows]
        if isinstance(joint, ClearancePrismatic):
            # displacements along x and y, then turns about z, x and y; a slider that tilts is displaced that much less
            arms = np.array([self.length, self.length, *(0.5 * size for size in joint.arms)])
            x, y, about_z, about_x, about_y = np.linalg.norm(own[:, :5] / arms, axis=0)
            wider = (joint.side_clearance or 0.0) / joint.clearance
            return float(max(x, about_y, about_z if wider else 0.0) + wider * max(y, about_x))
        first = own[:, :count] / self.length
        loose = float(np.linalg.svd(first, compute_uv=False).max(initial=0.0))
        if isinstance(joint, Pin) and joint.held is None:
            turns = len(joint_type(constraint.edge.kind).TRANSLATIONS)  # first row of the tilt
            tilt = np.linalg.svd(own[:, turns : turns + 2] * 2.0 / joint.length, compute_uv=False).max(initial=0.0)
            axial = getattr(joint, "axial_clearance", 0.0) / joint.clearance
            return max(loose, float(tilt)) + axial * float(np.linalg.norm(own[:, 2] / self.length))
        return loose


def opening_map(model: Model, joints: Sequence[Constraint], poses: Sequence[Placement]) -> OpeningMap:
    """Return the joints' rates in a pose of all links, with their factored normal equations."""
    G = sparse.csc_array(misfit(model.mechanism, list(joints), poses).gradient())
    normal = (G.T @ G).tocsc()
    least = SQUARED_RANK * float(normal.diagonal().max(initial=1.0))
    factored = splu(normal + least * sparse.eye_array(normal.shape[0], format="csc"))
    where, row, length = {}, 0, model.mechanism.length
    for joint in joints:
        wrenches = joint.demands(poses, joint.values).natural(length).about(np.zeros(3))
        where[joint.name] = joint, slice(row, row + len(wrenches)), wrenches
        row += len(wrenches)
    return OpeningMap(G, factored, where, length)


def body_motion(model: Model, poses: Sequence[Placement], body: str, *, turning: bool) -> np.ndarray:
    """Return the motion of a body, (3, 6 (links - 1)): of its centre of mass [m], or its rotation [rad]."""
    i = model.mechanism.link_of[body]
    matrix = np.zeros((3, 6 * (len(poses) - 1)))
    if i == 0:
        return matrix
    turn, shift = slice(6 * i - 6, 6 * i - 3), slice(6 * i - 3, 6 * i)
    if turning:
        matrix[:, turn] = np.eye(3)
        return matrix
    link = model.mechanism.links[i]
    middle = poses[i].of(Placement(link.inertia.com if link.inertia is not None else np.zeros(3))).p
    arm = centre(model, poses, body) - middle
    matrix[:, shift] = model.mechanism.length * np.eye(3)
    matrix[:, turn] = -np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    return matrix


def centre(model: Model, poses: Sequence[Placement], body: str) -> np.ndarray:
    """Return the position of a body's centre of mass."""
    i, part = model.mechanism.link_of[body], model.scene.body[body]
    com = np.array(part.com) if isinstance(part, RigidBody) else np.zeros(3)
    return np.asarray(poses[i].of(model.mechanism.links[i].placements[body].of(Placement(com))).p)


def modal_forces(motions: Motions, name: str, bundle: Labelled, joints: Mapping[str, Wrench]) -> np.ndarray:
    r"""Return all forces on a body along its elastic coordinates in a rigid motion, shape (rows, mode) [N].

    joints: wrenches of its joints, from `joint_wrenches`.  Inertia and gravity act in its volume,
    :math:`-\int \rho\,S^T (a - g + A x)`, :math:`A = \tilde\alpha + \tilde\omega\tilde\omega`, at the points x of its
    own frame; on a motion of the body as a whole the sum is zero.
    """
    model = motions.model
    i = model.mechanism.link_of[name]
    place = model.mechanism.links[i].placements[name]
    own = motions.link(i).at(place.p, place.R)
    a, alpha, omega = (np.einsum("tji,tj->ti", own.R, x) for x in (own.a - model.gravity, own.alpha, own.omega))
    A = skew(alpha) + skew(omega) @ skew(omega)
    forces = -a @ bundle["modal_first_moment"].values
    forces -= np.einsum("tlk,klj->tj", A, bundle["position_mode_moment"].values)
    shapes, turns = bundle["frame_translation_shape"].values, bundle["frame_rotation_shape"].values
    frames = [str(frame) for frame in bundle["frame"].values]
    for frame, moment, force in _wrenches_at_frames(motions, name, joints):
        k = frames.index(frame.partition(".")[2])
        about = moment - cross(motions.positions([frame])[:, 0], force)
        turning, pushing = (np.einsum("tji,tj->ti", own.R, part) for part in (about, force))
        forces += pushing @ shapes[k] + turning @ turns[k]
    return np.asarray(forces)


def _wrenches_at_frames(motions: Motions, name: str, joints: Mapping[str, Wrench]) -> list[FrameWrench]:
    """Return the wrenches of joints, paths and loads on a body at its frames; moments about the mechanism's origin."""
    model, acting = motions.model, list[FrameWrench]()
    for joint, (frame, sign) in _ports(model.scene, name).items():
        moment, force = joints[joint]
        second = motions.positions([model.scene.joint[joint].between[1]])[:, 0]
        acting.append((f"{name}.{frame}", sign * (moment + cross(second, force)), sign * force))
    paths = [one for one in path_wrenches(model, motions.seen) if one[0].partition(".")[0] == name]
    return acting + paths + on_frames(model, motions.seen, name)


def openings(
    model: Model, poses: Sequence[Placement], lever: OpeningMap, name: str, bundle: Labelled
) -> tuple[np.ndarray, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Return the openings of joints per elastic coordinate of a body, (rows, mode), and motions of bodies fixed to it.

    These are rotation and displacement of the centre of mass, world axes, shape (3, mode).
    """
    i = model.mechanism.link_of[name]
    placement = poses[i].of(model.mechanism.links[i].placements[name])
    frames = [str(frame) for frame in bundle["frame"].values]
    matrix, carried = np.zeros((lever.gradient.shape[0], bundle.sizes["mode"])), dict[str, tuple[Any, Any]]()
    for body, frame in _carrying_frames(model.scene, name).items():
        k = frames.index(frame)
        u = placement.R @ bundle["frame_translation_shape"].values[k]
        theta = placement.R @ bundle["frame_rotation_shape"].values[k]
        at = placement.of(Placement(bundle["frame_position"].values[k])).p
        if body in model.scene.body:
            arm = centre(model, poses, body) - at
            carried[body] = theta, u + np.cross(theta, arm, axisa=0, axisb=0).T
        twist = np.vstack([theta, u - np.cross(theta, at, axisa=0, axisb=0).T])
        for constraint, rows, wrenches in lever.joints.values():
            for end, sign in ((constraint.edge.frame_a, -1.0), (constraint.edge.frame_b, 1.0)):
                # a frame moves with the carried part: a body, or one frame of the flexible body itself
                if body in (end, end.partition(".")[0]):
                    matrix[rows] += sign * (wrenches @ twist)
    return matrix, carried


def curvature(
    model: Model, poses: Sequence[Placement], lever: OpeningMap, bundles: Mapping[str, Labelled], moves: np.ndarray
) -> np.ndarray:
    """Return the openings of joints at second order by motions that open none at first order, shape (rows, moves).

    moves: of links and elastic coordinates, (x, q), shape (n, moves), in their actual sizes: those far smaller than the
    largest count as zero.
    """
    m, length = 6 * (len(poses) - 1), model.mechanism.length
    ends = block_diag(*(_ends(bundle, length) for bundle in bundles.values())) @ moves[m:]
    size = np.abs(np.vstack([moves[:m], ends])).max(axis=0)
    joints, found = list[Constraint](), np.zeros((lever.gradient.shape[0], moves.shape[1]))
    for joint, *_ in lever.joints.values():  # driven coordinates have moved on from the start's
        now = joint.coordinates(poses)
        joints.append(replace(joint, values={k: now[joint.name, k] for k in joint.values}))

    def residuals(move: np.ndarray) -> np.ndarray:
        moved = displaced_poses(model.mechanism, poses, move[:m])
        return misfit(model.mechanism, _displace_joints(model, joints, bundles, move[m:]), moved).values

    closed = misfit(model.mechanism, joints, poses).values  # to the tolerance of the run
    # fraction of the largest motion below which the square of a motion, a thousandth of the largest square, is left out
    for k in np.flatnonzero(size > 0.03 * size.max()):
        step = moves[:, k] * (FINITE / size[k])
        found[:, k] = (0.5 * (residuals(step) + residuals(-step)) - closed) * (size[k] / FINITE) ** 2
    return found


def multipliers(motions: Motions, lever: OpeningMap, loads: Mapping[str, Wrench], row: int) -> np.ndarray:
    """Return the forces of joints and drives on their residuals at a row of the ideal motion, shape (rows,) [N or N m].

    loads: wrenches of all joints, from `joint_wrenches`.
    """
    found = np.zeros(lever.gradient.shape[0])
    for name, (_, rows, wrenches) in lever.joints.items():
        moment, force = (part[row] for part in loads[name])
        second = motions.positions([motions.model.scene.joint[name].between[1]])[row, 0]
        acting = np.concatenate([moment + np.cross(second, force), force])
        found[rows] = np.linalg.lstsq(wrenches.T, acting, rcond=None)[0]
    return found


def _ends(bundle: Labelled, length: float) -> np.ndarray:
    """Return rotations and displacements of a body's frames, in units of a length, per elastic coordinate."""
    shapes = bundle["frame_rotation_shape"].values, bundle["frame_translation_shape"].values / length
    return np.vstack([shape.reshape(-1, shape.shape[-1]) for shape in shapes])


def _displace_joints(
    model: Model, joints: Sequence[Constraint], bundles: Mapping[str, Labelled], q: np.ndarray
) -> list[Constraint]:
    """Return the joints with their frames displaced on their links by the elastic coordinates of all bodies."""
    bent, first = list(joints), 0
    for name, bundle in bundles.items():
        own, first = q[first : first + bundle.sizes["mode"]], first + bundle.sizes["mode"]
        place = model.mechanism.links[model.mechanism.link_of[name]].placements[name]
        frames = [str(frame) for frame in bundle["frame"].values]
        for body, frame in _carrying_frames(model.scene, name).items():
            k = frames.index(frame)
            at = place.of(Placement(bundle["frame_position"].values[k])).p
            R = rotation_vector_to_matrix(place.R @ bundle["frame_rotation_shape"].values[k] @ own)
            moved = Placement(at + place.R @ bundle["frame_translation_shape"].values[k] @ own - R @ at, R)
            for j, joint in enumerate(bent):
                if body in (joint.edge.frame_a, joint.edge.frame_a.partition(".")[0]):
                    bent[j] = joint = replace(joint, place_a=moved.of(joint.place_a))
                if body in (joint.edge.frame_b, joint.edge.frame_b.partition(".")[0]):
                    bent[j] = replace(joint, place_b=moved.of(joint.place_b))
    return bent


def _ports(scene: Scene, name: str) -> dict[str, tuple[str, float]]:
    """Return the joints of a body: frame of the body, and sign of the wrench on the body."""
    ports = {}
    for joint, part in scene.joint.items():
        for end, sign in zip(part.between, (-1.0, 1.0), strict=True):
            body, _, frame = end.partition(".")
            if body == name:
                ports[joint] = (frame, sign)
    return ports


def _carrying_frames(scene: Scene, name: str) -> dict[str, str]:
    """Return the frame that carries each body fixed to a body, and the body itself by each frame with another joint."""
    fixed = [part.between for part in scene.joint.values() if part.type == "fixed"]
    pairs = [(a.partition(".")[0], b.partition(".")[0]) for a, b in fixed]
    beyond, carriers = [pair for pair in pairs if name not in pair], dict[str, str]()
    for ends, pair in zip(fixed, pairs, strict=True):
        for near, far in ((0, 1), (1, 0)):
            if pair[near] == name:
                carriers |= dict.fromkeys(connected_bodies(pair[far], beyond), ends[near].partition(".")[2])
    own = [frame for joint, (frame, _) in _ports(scene, name).items() if scene.joint[joint].type != "fixed"]
    return carriers | {f"{name}.{frame}": frame for frame in own}
