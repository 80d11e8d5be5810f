r"""What play in joints and bending of bodies do to the pose of a mechanism, to first order about its ideal motion.

Joints and drives hold the links: a small opening e of what they demand moves them by x with

.. math:: G\,x = -e, \qquad x = -G^{+} e

where G holds the rates of all joints' residuals. Of what is asked for, s x, only the adjoint solution
:math:`\lambda^T = s G^{+}` is needed, which is one solve for all openings of all joints: the reactions of the joints to
a unit load there. Clearance lets two places part by up to its radius (and the depth to
which the joint's force presses them), in any direction: its bound is the largest singular value of the map from there
to the body that is asked for. A body that bends under the forces of its joints opens the joints at its ends by what its
ends move, which is known. Both hold where joints and drives leave the body asked for no freedom; elsewhere masses
decide, and there is no bound (infinite).

Source: the closure equations of `pipeline.dynamics.model.closing`, differentiated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from flexclear.pipeline.core.registry import lookup
from flexclear.pipeline.core.scene.clearance import Clearance
from flexclear.pipeline.core.scene.parts import RigidBody
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.wanted import Quantity
from flexclear.pipeline.dynamics.effects import CONTACTS, NORMAL_LAWS
from flexclear.pipeline.dynamics.model.closing import misfit
from flexclear.pipeline.dynamics.model.constraints import Constraint, constraints, demands
from flexclear.pipeline.dynamics.model.merge import Placement
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.record.motion import Motions
from flexclear.pipeline.dynamics.record.wrenches import joint_wrenches
from flexclear.pipeline.dynamics.run.run import Run

#: the motion is looked at so often
LOOKS = 32
#: squared singular values of the joints' rates far below this share of the largest are zero, and what is shown may be
#: free by this: where a pose comes within some 3e-4 of a singular one there is no bound
RANK, FREE = 1e-13, 1e-6
#: the force that presses a joint with clearance together is at least so many times the ideal one when it has been open
KNOCK = 10.0
#: quantities that the pose decides
OF_POSE = ("position", "orientation")


@dataclass(frozen=True)
class Bounds:
    """Largest influences over the motion, in SI: by joint with clearance and by flexible body, of each quantity.

    clearance: bounds.  bending: of the quasi-static response, without vibration.  load: largest force of each joint
    with clearance in the ideal motion [N].
    """

    clearance: Mapping[str, Mapping[str, float]]
    bending: Mapping[str, Mapping[str, float]]
    load: Mapping[str, float]


def bounds(full: Scene, run: Run, bundles: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> Bounds:
    """Bounds for the effects of a scene from the run of its ideal twin.

    bundles: reduced flexible bodies of the full scene.  Of `chosen` those that the pose decides are bounded.
    """
    model, seen = run.model, run.observed
    motions = Motions(model, seen)
    loose = [name for name in full.contacts() if name in model.scene.joint]
    asked = [q for q in chosen if q.kind in OF_POSE and q.owner in model.mechanism.link_of]
    loads = joint_wrenches(
        motions, [name for name, joint in model.scene.joint.items() if _touches(joint, full)] + loose
    )
    load = {name: float(np.linalg.norm(loads[name][1], axis=1).max()) for name in loose}
    rows = np.unique(np.linspace(0, len(seen.state) - 1, LOOKS).astype(int))
    clearance = {name: {q.name: 0.0 for q in asked} for name in loose}
    bending = {name: {q.name: 0.0 for q in asked} for name in bundles}
    joints = constraints(model.mechanism)
    whole = not model.scene.gear and len(joints) == _joined(model)
    for row in rows if asked else ():
        poses = [Placement(frame["origin"], frame["axes"]) for frame in seen.links[row]]
        lever = lever_of(model, joints, poses)
        for q in asked:
            shown = _shown(model, poses, q)
            adjoint = lever.adjoint(shown)
            if not whole or adjoint.free > FREE:
                for found in (*clearance.values(), *bending.values()):
                    found[q.name] = np.inf
                continue
            for name in loose:
                reach = lever.clearance(name, adjoint.rows) * _play(full.contacts()[name], load[name])
                clearance[name][q.name] = max(clearance[name][q.name], reach)
            for name, bundle in bundles.items():
                moved = _bent(model, motions, row, poses, lever, name, bundle, loads, adjoint, q)
                bending[name][q.name] = max(bending[name][q.name], moved)
    return Bounds(clearance, bending, load)


def _touches(joint: object, full: Scene) -> bool:
    """Whether a joint holds a body that is flexible in the full scene."""
    return any(frame.partition(".")[0] in full.flexible() for frame in joint.between)  # type: ignore[attr-defined]


def _joined(model: Model) -> int:
    """Joints between links, of which all must be known."""
    tree = sum(link.branch.edge is not None and not link.massless for link in model.mechanism.links)
    return tree + len(model.mechanism.closures)


def _play(joint: Clearance, force: float) -> float:
    """How far the places may part [m]: the clearance, and how deep a force presses the surfaces."""
    law = lookup(NORMAL_LAWS, joint.normal.law, where="[normal]")
    exponent = law.exponent if joint.normal.exponent is None else joint.normal.exponent
    stiffness = lookup(CONTACTS, joint.type, where="[joint]").stiffness(joint, exponent)
    return float(joint.clearance + (KNOCK * force / stiffness) ** (1.0 / exponent))


@dataclass(frozen=True)
class Lever:
    """How openings of the joints move the links, in one pose.

    gradient: rates of all joints' residuals, (rows, 6 (links - 1)).  normal: of the least-squares solution, factored.
    joints: of each joint, where its demands begin.  axes: wrenches of each joint's demands and driven coordinates.
    length: by which openings are told as shares.
    """

    gradient: sparse.csc_array
    normal: SuperLU
    joints: Mapping[str, tuple[Constraint, slice]]
    length: float
    axes: Mapping[str, np.ndarray]

    def adjoint(self, shown: np.ndarray) -> Adjoint:
        """The adjoint solution of what is shown, (3, 6 (links - 1)): what unit loads on it do in the joints."""
        dual = self.normal.solve(np.ascontiguousarray(shown.T))
        rows = self.gradient @ dual
        return Adjoint(-rows.T, float(np.abs(shown - (self.gradient.T @ rows).T).max(initial=0.0)))

    def clearance(self, name: str, rows: np.ndarray) -> float:
        """Largest motion of what an adjoint solution tells of, per metre that the places of a joint part."""
        constraint, mine = self.joints[name]
        count = 2 if constraint.edge.kind == "revolute" else 3
        first = rows[:, mine][:, :count] / self.length
        return float(np.linalg.svd(first, compute_uv=False).max(initial=0.0))


@dataclass(frozen=True)
class Adjoint:
    """rows: motion of what is shown per opening, (3, rows).  free: by how much joints and drives leave it free."""

    rows: np.ndarray
    free: float


def lever_of(model: Model, joints: Sequence[Constraint], poses: Sequence[Placement]) -> Lever:
    """The joints' rates in a pose of all links, and what solves with them."""
    G = sparse.csc_array(misfit(model.mechanism, list(joints), poses).gradient())
    normal = (G.T @ G).tocsc()
    least = RANK * float(normal.diagonal().max(initial=1.0))
    factored = splu(normal + least * sparse.eye_array(normal.shape[0], format="csc"))
    where, axes, row = {}, {}, 0
    for joint in joints:
        wrench = _wrenches(joint, poses)
        where[joint.name], axes[joint.name] = (joint, slice(row, row + len(wrench))), wrench
        row += len(wrench)
    return Lever(G, factored, where, model.mechanism.length, axes)


def _wrenches(joint: Constraint, poses: Sequence[Placement]) -> np.ndarray:
    """Wrenches of all rows that a joint has in `misfit`: its demands, then its driven coordinates."""
    from flexclear.pipeline.dynamics.model.constraints import prescribed

    A, B = joint.frames(poses)
    found = demands(joint.edge.kind, A, B)[1]
    return np.vstack([found, prescribed(joint.edge.kind, A, B, joint.values)[1]]) if joint.values else found


def _shown(model: Model, poses: Sequence[Placement], q: Quantity) -> np.ndarray:
    """Motion of a body, (3, 6 (links - 1)): of its centre of mass [m], or its turn [rad]."""
    i = model.mechanism.link_of[q.owner]
    found = np.zeros((3, 6 * (len(poses) - 1)))
    if i == 0:
        return found
    turn, shift = slice(6 * i - 6, 6 * i - 3), slice(6 * i - 3, 6 * i)
    if q.kind == "orientation":
        found[:, turn] = np.eye(3)
        return found
    link, body = model.mechanism.links[i], model.scene.body[q.owner]
    centre = poses[i].of(Placement(link.inertia.com if link.inertia is not None else np.zeros(3))).p
    com = np.array(body.com) if isinstance(body, RigidBody) else np.zeros(3)
    arm = poses[i].of(link.places[q.owner].of(Placement(com))).p - centre
    found[:, shift] = model.mechanism.length * np.eye(3)
    found[:, turn] = -np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    return found


def _bent(
    model: Model,
    motions: Motions,
    row: int,
    poses: Sequence[Placement],
    lever: Lever,
    name: str,
    bundle: xr.Dataset,
    loads: Mapping[str, tuple[np.ndarray, np.ndarray]],
    adjoint: Adjoint,
    q: Quantity,
) -> float:
    """How far what is shown moves when a body bends under the forces of its joints and its own inertia."""
    i = model.mechanism.link_of[name]
    place = poses[i].of(model.mechanism.links[i].places[name])
    shapes, turns = bundle["frame_translation_shape"].values, bundle["frame_rotation_shape"].values
    frames = [str(frame) for frame in bundle["frame"].values]
    forces = -bundle["modal_first_moment"].values.T @ (place.R.T @ _acceleration(motions, i, row))
    ports = _ports(model.scene, name)
    for joint, (frame, sign) in ports.items():
        k = frames.index(frame)
        moment, force = (sign * (place.R.T @ part[row]) for part in loads[joint])
        forces = forces + shapes[k].T @ force + turns[k].T @ moment
    q_modal = np.linalg.solve(bundle["modal_stiffness"].values, forces)
    opening = np.zeros(adjoint.rows.shape[1])
    carried = _carried(model.scene, name)
    own = np.zeros(3)
    for body, frame in carried.items():
        k = frames.index(frame)
        u, theta = place.R @ shapes[k] @ q_modal, place.R @ turns[k] @ q_modal
        at = place.of(Placement(bundle["frame_position"].values[k])).p
        twist = np.concatenate([theta, u - np.cross(theta, at)])
        if body == q.owner:
            own = theta if q.kind == "orientation" else u
        for joint_name, (constraint, rows) in lever.joints.items():
            wrench = lever.axes[joint_name]
            unit = np.where(np.any(wrench[:, 3:] != 0.0, axis=1), 1.0 / lever.length, 1.0)
            for end, sign in ((constraint.edge.frame_a, -1.0), (constraint.edge.frame_b, 1.0)):
                if _held_by(end, body, name, frame):
                    opening[rows] += sign * unit * (wrench @ twist)
    return float(np.linalg.norm(adjoint.rows @ opening + own))


def _acceleration(motions: Motions, link: int, row: int) -> np.ndarray:
    """Of a link's frame, less gravity [m/s^2], world axes."""
    found: np.ndarray = motions.links[link].a[row] - motions.model.gravity
    return found


def _ports(scene: Scene, name: str) -> dict[str, tuple[str, float]]:
    """The joints of a body: frame of the body, and the sign of the wrench that acts on it."""
    found = {}
    for joint, part in scene.joint.items():
        for end, sign in zip(part.between, (-1.0, 1.0), strict=True):
            body, _, frame = end.partition(".")
            if body == name:
                found[joint] = (frame, sign)
    return found


def _carried(scene: Scene, name: str) -> dict[str, str]:
    """Bodies fixed to a body, by its frame that carries them; the body itself by each frame with another joint."""
    fixed = [part.between for part in scene.joint.values() if part.type == "fixed"]
    found: dict[str, str] = {}
    open_ends = []
    for a, b in fixed:
        for here, there in ((a, b), (b, a)):
            if here.partition(".")[0] == name:
                found[there.partition(".")[0]] = here.partition(".")[2]
                open_ends.append(there.partition(".")[0])
    while open_ends:
        body = open_ends.pop()
        for a, b in fixed:
            for here, there in ((a, b), (b, a)):
                other = there.partition(".")[0]
                if here.partition(".")[0] == body and other not in found and other != name:
                    found[other] = found[body]
                    open_ends.append(other)
    own = [frame for joint, (frame, _) in _ports(scene, name).items() if scene.joint[joint].type != "fixed"]
    return found | {f"{name}.{frame}": frame for frame in own}


def _held_by(end: str, carried: str, name: str, frame: str) -> bool:
    """Whether a joint's frame moves with what is carried: a body, or one frame of the flexible body itself."""
    return end == f"{name}.{frame}" if carried == f"{name}.{frame}" else end.partition(".")[0] == carried
