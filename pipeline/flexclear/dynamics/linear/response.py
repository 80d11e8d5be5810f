r"""Estimated effect of flexible bodies along the ideal motion: on positions, rates and the forces of joints.

Small motions are those of the links, x, and of the bodies' elastic coordinates, q, that keep all joints closed
(`clearance_response`):

.. math:: G x + B q = 0, \qquad M\,(\ddot x, \ddot q) + K q = f(t), \qquad M = \sum_b J_b^T M_b J_b

with the forces f of joints, loads, inertia and gravity on deformations in the ideal motion, and the mass of the moving
links. The vibrations are those of the assembled mechanism. From rest, each of their coordinates is quasi-static plus a
vibration about it, whose amplitude is the spectrum of the ideal motion's loads at that frequency (Duhamel's integral,
undamped). Rates are those of the vibrations; joint forces follow from accelerations, by the joint's adjoint solution.

A soft rod between two ball joints bends without any motion of a platform at first order, but its length between them
changes with the square of the bending. So these squares count as well for positions and rates, each vibration by
itself, with the links' motions that close the joints at second order. The forces of joints do work on these openings,
which changes the frequencies: where it does by much, as near a buckling load, the response is unknown.

Each evaluation holds the pose fixed, so several poses of the motion are examined. The result sums all amplitudes. It is
an estimate, no bound: docs/plan.md compares it with runs.

Source: Craig and Kurdila, *Fundamentals of Structural Dynamics*, ch. 5 and 11.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.linear import clearance_response
from flexclear.dynamics.model.constraints import constraints
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import joint_wrenches
from flexclear.dynamics.run.evaluation.observation import observe
from flexclear.dynamics.run.run import Run
from flexclear.scene.parts import RigidBody
from flexclear.scene.quantity import Quantity

#: kinds of quantities by their dependence on elastic coordinates, rates or accelerations
POSITIONS, RATES, FORCES = ("position", "orientation"), ("velocity", "angular_velocity"), ("force",)
TURNS = ("orientation", "angular_velocity")
#: singular values below this fraction of the largest count as zero; squared frequencies below this fraction belong to
#: free motions
FOLLOWED, NO_STIFFNESS = 1e-9, 1e-12
#: least force on an excited vibration, as a fraction of the largest that loads of this size could have; loads along a
#: rod leave 2e-14 across the rod
EXCITED = 1e-10


@dataclass(frozen=True)
class Response:
    """Response of all flexible bodies together. first: lowest frequency of the assembled mechanism [Hz].

    excited: lowest frequency of a vibration that the motion's loads excite [Hz], NaN where they excite none.
    amplification: largest ratio of this vibration's coordinate to its quasi-static value.
    influence: estimated largest effect on each quantity [SI]; infinite where unknown.
    """

    first: float
    excited: float
    amplification: float
    influence: Mapping[str, float]


def response(
    run: Run,
    bundles: Mapping[str, Labelled],
    chosen: Sequence[Quantity],
) -> Response:
    """Return the response of flexible bodies to the ideal motion of their mechanism, the run of its rigid version."""
    model, time = run.model, run.trajectory.time
    motions = Motions(model, run.observed)
    unknown = Response(np.nan, np.nan, np.nan, {q.name: np.inf for q in chosen})
    if not bundles or not clearance_response.knows_all_joints(model):
        return unknown
    once = np.concatenate([[True], np.diff(time) > 0.0])  # a break of a drive may be recorded from both sides
    forces, time = _modal_forces(motions, bundles)[once], time[once]
    # accelerations may jump at breaks of the laws: those after each follow the recorded ones, at the same time
    at = np.flatnonzero(np.isin(time, run.engine.breaks[1:-1]))
    if len(at):
        after = observe(run.engine, run.trajectory.rows[once][at], after=True)
        forces = np.insert(forces, at + 1, _modal_forces(Motions(model, after), bundles), axis=0)
        time = np.insert(time, at + 1, time[at])
    joints, responses = constraints(model.mechanism), list[Response]()
    loads = joint_wrenches(motions, [joint.name for joint in joints])
    # number of poses at which the vibrations are computed
    for row in np.unique(np.linspace(0, len(once) - 1, 8).astype(int)):
        poses = [Placement(frame["origin"], frame["axes"]) for frame in motions.seen.links[row]]
        assembled = _elastic_mechanism(model, clearance_response.opening_map(model, joints, poses), poses, bundles)
        if assembled is None:
            return unknown
        multipliers = clearance_response.multipliers(motions, assembled.lever, loads, row)
        responses.append(_response_in_pose(assembled, bundles, forces, time, chosen, multipliers))
    worst = {q.name: max(r.influence[q.name] for r in responses) for q in chosen}
    responding = [r for r in responses if np.isfinite(r.excited)]
    excited = min((r.excited for r in responding), default=np.nan)
    return Response(
        min(r.first for r in responses), excited, max((r.amplification for r in responding), default=np.nan), worst
    )


def _modal_forces(motions: Motions, bundles: Mapping[str, Labelled]) -> np.ndarray:
    """Return the forces on the elastic coordinates of all bodies, shape (rows, modes) [N]."""
    joints = motions.model.scene.joint.items()
    held = [name for name, joint in joints if any(end.partition(".")[0] in bundles for end in joint.between)]
    loads = joint_wrenches(motions, held)
    return np.hstack([clearance_response.modal_forces(motions, n, b, loads) for n, b in bundles.items()])


@dataclass(frozen=True)
class _Assembled:
    """The elastic mechanism in a pose, with its small motions in terms of link motions and elastic coordinates, (x, q).

    omega: frequencies, ascending [rad/s].  modes: (x, q) of each, M-orthonormal, shape (6 (links - 1) + n, modes).
    free: motions without stiffness, likewise.  own: motion of bodies relative to their link, per q.  momenta: of all
    bodies, as wrenches on the links, per (x, q).
    """

    model: Model
    poses: Sequence[Placement]
    lever: clearance_response.OpeningMap
    omega: np.ndarray
    modes: np.ndarray
    free: np.ndarray
    own: Mapping[str, tuple[np.ndarray, np.ndarray]]
    momenta: np.ndarray

    def moved(self, body: str, *, turning: bool) -> np.ndarray:
        """Return the motion of a body per (x, q), shape (3, 6 (links - 1) + n)."""
        rigid = clearance_response.body_motion(self.model, self.poses, body, turning=turning)
        return np.hstack([rigid, self.own[body][0 if turning else 1]])


def _elastic_mechanism(
    model: Model, lever: clearance_response.OpeningMap, poses: Sequence[Placement], bundles: Mapping[str, Labelled]
) -> _Assembled | None:
    """Return the elastic mechanism in a pose; None without any vibration."""
    first = np.concatenate([[0], np.cumsum([int(b.sizes["mode"]) for b in bundles.values()])])
    opened = np.zeros((lever.gradient.shape[0], first[-1]))
    own = {name: (np.zeros((3, first[-1])), np.zeros((3, first[-1]))) for name in model.scene.body}
    for k, (name, bundle) in enumerate(bundles.items()):
        columns = slice(first[k], first[k + 1])
        opened[:, columns], carried = clearance_response.openings(model, poses, lever, name, bundle)
        for body in own.keys() & carried.keys() - {name}:
            own[body][0][:, columns], own[body][1][:, columns] = carried[body]
    Z = scipy.linalg.null_space(np.hstack([lever.gradient.toarray(), opened]), rcond=FOLLOWED)
    M, momenta = _mass(model, poses, bundles, first, own)
    K = scipy.linalg.block_diag(*(b["modal_stiffness"].values for b in bundles.values()))
    inner = Z[-first[-1] :]
    try:
        squares, shapes = scipy.linalg.eigh(inner.T @ K @ inner, Z.T @ M @ Z)
    except np.linalg.LinAlgError:
        return None
    firm = squares > NO_STIFFNESS * squares.max(initial=0.0)
    if not firm.any():
        return None
    modes = Z @ shapes
    return _Assembled(model, poses, lever, np.sqrt(squares[firm]), modes[:, firm], modes[:, ~firm], own, momenta)


def _mass(
    model: Model,
    poses: Sequence[Placement],
    bundles: Mapping[str, Labelled],
    first: np.ndarray,
    own: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray]:
    """Return mass of links and elastic coordinates, (x, q) by (x, q), and momenta of all as wrenches on the links."""
    m = 6 * (len(poses) - 1)
    M, momenta = np.zeros((m + first[-1], m + first[-1])), np.zeros((m, m + first[-1]))
    for name, body in model.scene.body.items():
        if not isinstance(body, RigidBody):
            continue
        placement = poses[model.mechanism.link_of[name]].of(
            model.mechanism.links[model.mechanism.link_of[name]].placements[name]
        )
        inertia = placement.R @ np.array(body.inertia) @ placement.R.T
        rigid = [clearance_response.body_motion(model, poses, name, turning=turning) for turning in (True, False)]
        turn, shift = (np.hstack(parts) for parts in zip(rigid, own[name], strict=True))
        spin, push = inertia @ turn, body.mass * shift
        M += turn.T @ spin + shift.T @ push
        if name in bundles:
            k = list(bundles).index(name)
            columns = slice(m + first[k], m + first[k + 1])
            push_q, spin_q = _momenta(bundles[name], placement, clearance_response.centre(model, poses, name))
            across = turn.T @ spin_q + shift.T @ push_q
            M[:, columns] += across
            M[columns, :] += across.T
            M[columns, columns] += bundles[name]["modal_mass"].values
            spin[:, columns] += spin_q
            push[:, columns] += push_q
        momenta += rigid[0].T @ spin + rigid[1].T @ push
    return 0.5 * (M + M.T), momenta


def _momenta(bundle: Labelled, placement: Placement, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return momentum of a body's deformation, and its moment about a point, per rate of q, world axes, (3, mode)."""
    push = placement.R @ bundle["modal_first_moment"].values
    P = bundle["position_mode_moment"].values
    about_frame = placement.R @ np.stack([P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]])
    return push, about_frame + np.cross(placement.p - centre, push, axisa=0, axisb=0).T


def _response_in_pose(
    assembled: _Assembled,
    bundles: Mapping[str, Labelled],
    forces: np.ndarray,
    time: np.ndarray,
    chosen: Sequence[Quantity],
    multipliers: np.ndarray,
) -> Response:
    """Return the response with the vibrations of one pose; multipliers: of all joints in it."""
    omega = assembled.omega
    f = forces @ assembled.modes[-forces.shape[1] :]
    still = f / omega**2
    amplitude = vibration(f, omega, time)
    rate = _slopes(still, time)
    most, fastest = np.abs(still) + amplitude, np.abs(rate) + amplitude * omega
    largest = most.max(axis=0, initial=np.finfo(float).tiny)
    moves = assembled.modes * largest
    curved = clearance_response.curvature(assembled.model, assembled.poses, assembled.lever, bundles, moves)
    # largest change of the square of a frequency by the forces of joints, as a fraction, up to which vibrations are
    # known: rods near their buckling load vibrate otherwise, and grow with forces that change in time
    buckling = bool((2.0 * np.abs(multipliers @ curved) > 0.2 * (omega * largest) ** 2).any())
    influence = {}
    for q in chosen:
        if buckling:
            influence[q.name] = np.inf
        elif q.kind in (*POSITIONS, *RATES) and q.owner in assembled.model.mechanism.link_of:
            moved = assembled.moved(q.owner, turning=q.kind in TURNS)
            if np.abs(moved @ assembled.free).max(initial=0.0) > FOLLOWED * np.abs(moved @ assembled.modes).max():
                influence[q.name] = np.inf  # masses decide its effect along a freedom of its own
                continue
            per_vibration = moved @ assembled.modes
            size = np.linalg.norm(per_vibration, axis=0)
            rigid = clearance_response.body_motion(assembled.model, assembled.poses, q.owner, turning=q.kind in TURNS)
            square = np.linalg.norm(assembled.lever.adjoint(rigid)[0] @ curved, axis=0)
            if q.kind in POSITIONS:
                sizes = (
                    np.linalg.norm(still @ per_vibration.T, axis=1) + amplitude @ size + (most / largest) ** 2 @ square
                )
            else:
                sizes = np.linalg.norm(rate @ per_vibration.T, axis=1) + amplitude @ (size * omega)
                sizes += 2.0 * (most / largest * fastest / largest) @ square
            influence[q.name] = float(sizes.max())
        elif q.kind in FORCES and q.owner in assembled.lever.joints:
            size = np.linalg.norm(_reaction(assembled, q.owner), axis=0)
            influence[q.name] = float((amplitude @ (size * omega**2)).max())
        else:
            influence[q.name] = np.inf
    excitation = first_excited(forces, assembled.modes[-forces.shape[1] :])
    if excitation is None:
        return Response(float(omega[0] / (2.0 * np.pi)), np.nan, np.nan, influence)
    reached = (np.abs(still) + amplitude)[:, excitation].max() / np.abs(still[:, excitation]).max()
    first, excited = (float(omega[k] / (2.0 * np.pi)) for k in (0, excitation))
    return Response(first, excited, float(reached), influence)


def first_excited(forces: np.ndarray, shapes: np.ndarray) -> int | None:
    """Return the index of the first vibration that forces on elastic coordinates excite; None without any.

    forces: (rows, n).  shapes: (n, vibrations).  A vibration's force is a sum of n products. For one orthogonal to
    all forces, such as bending across the plane of a planar mechanism, only rounding of products and loads remains: no
    fraction of it has any meaning.  By Schwarz' inequality the sum is at most the product of both lengths, so that what
    is below `EXCITED` of that, over all rows, counts as zero.
    """
    size = float(np.linalg.norm(forces, axis=1).max(initial=0.0))
    most = np.abs(forces @ shapes).max(axis=0, initial=0.0)
    excited = np.flatnonzero(most > EXCITED * size * np.linalg.norm(shapes, axis=0))
    return int(excited[0]) if len(excited) else None


def vibration(f: np.ndarray, omega: np.ndarray, time: np.ndarray) -> np.ndarray:
    r"""Return amplitudes of the vibrations about the quasi-static motion, from rest, shape (rows, vibrations).

    f: forces per modal mass, (rows, vibrations), linear between the rows; two rows of one time are a jump.  The
    deviation :math:`d = \eta - f/\omega^2` vibrates freely between the rows, its rate jumps where the slope of f does,
    and it jumps by :math:`-\Delta f/\omega^2` itself.
    """
    still = f / omega**2
    steps, rises, slope = np.diff(time), np.diff(still, axis=0), _slopes(still, time)
    z = -still[0] + 1j * slope[0] / omega  # d + i times minus its rate over omega, in the turning frame
    amplitude = np.empty(still.shape)
    amplitude[0] = np.abs(z)
    for k, step in enumerate(steps):
        z = z * np.exp(1j * omega * step) if step else z - rises[k]
        z = z + 1j * (slope[k + 1] - slope[k]) / omega
        amplitude[k + 1] = np.abs(z)
    return amplitude


def _slopes(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the slope of a series, linear between its rows, after each row; after the last row, that before it."""
    steps = np.diff(time)[:, None]
    slope = np.divide(np.diff(values, axis=0), steps, out=np.zeros_like(values[1:]), where=steps > 0.0)
    slope = np.vstack([slope, slope[-1:]]) if len(slope) else np.zeros_like(values)
    jumps = np.flatnonzero(np.diff(time) == 0.0)
    slope[jumps] = slope[jumps + 1]
    return slope


def _reaction(assembled: _Assembled, joint: str) -> np.ndarray:
    """Return the force of a joint per acceleration of each vibration, (3, vibrations), from the momenta beyond it."""
    lever = assembled.lever
    multipliers = lever.gradient @ lever.normal.solve(assembled.momenta @ assembled.modes)
    _, rows, wrenches = lever.joints[joint]
    return np.asarray(wrenches[:, 3:].T @ multipliers[rows])
