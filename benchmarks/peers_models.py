"""The N-four-bar of `families.growth` as models of Pinocchio and of MuJoCo, and what one evaluation costs there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.timing import once

#: moments of inertia of each rod about its centre [kg m^2], its axis being z; mass and length are 1
THIN = np.diag([1.0 / 12.0, 1.0 / 12.0, 1e-4])
#: axes of a joining rod, which lies along x
R_BAR = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
#: angle and angular velocity of the uprights, about y [rad, rad/s]
LEAN, SPEED, GRAVITY = 0.5, 1.0, -9.81
#: rotation of a joining rod against its upright, quaternion (w, x, y, z), and its rate, in its own axes
TURN = np.array([np.cos(0.5 * LEAN), *(-np.sin(0.5 * LEAN) * R_BAR[1])])
TURN_RATE = -SPEED * R_BAR[1]


@dataclass(frozen=True)
class Peer:
    """Another program's model in the same state.

    evaluate: one evaluation.  hinges: angular accelerations of the uprights after one [rad/s^2].
    """

    evaluate: Callable[[], object]
    hinges: Callable[[], np.ndarray]

    def time(self, repeat: int) -> float:
        """Processor time of an evaluation [s], a call from Python each."""
        evaluate = self.evaluate

        def calls() -> None:
            for _ in range(repeat):
                evaluate()

        return once(calls) / repeat


def pinocchio(loops: int) -> Peer:
    """`constraintDynamics` with a point constraint for each loop; joints are added depth-first, as it needs them."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear[:] = 0.0, 0.0, GRAVITY
    up, foot = pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])), pin.SE3.Identity()
    rod = pin.Inertia(1.0, np.array([0.0, 0.0, 0.5]), THIN)
    uprights, bars = list[int](), list[int]()
    for k in range(loops + 1):
        place = pin.SE3(np.eye(3), np.array([float(k), 0.0, 0.0]))
        uprights.append(model.addJoint(0, pin.JointModelRY(), place, f"P{k}"))
        model.appendBodyToJoint(uprights[k], rod, foot)
        if k < loops:
            left = pin.SE3(R_BAR, up.translation)
            bars.append(model.addJoint(uprights[k], pin.JointModelSpherical(), left, f"L{k}"))
            model.appendBodyToJoint(bars[k], rod, foot)
    point, kind = pin.ReferenceFrame.LOCAL, pin.ContactType.CONTACT_3D
    closures, closed = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for k in range(loops):
        closures.append(pin.RigidConstraintModel(kind, model, bars[k], up, uprights[k + 1], up, point))
        closed.append(closures[k].createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, closures, closed)
    q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    hinges = [model.idx_vs[joint] for joint in uprights]
    q[[model.idx_qs[joint] for joint in uprights]], v[hinges] = LEAN, SPEED
    for joint in bars:
        first, rate = model.idx_qs[joint], model.idx_vs[joint]
        q[first : first + 4], v[rate : rate + 3] = np.roll(TURN, -1), TURN_RATE

    def evaluate(run: Any = pin.constraintDynamics) -> object:
        return run(model, data, q, v, tau, closures, closed)

    return Peer(evaluate, lambda: np.asarray(evaluate())[hinges])


def mujoco(loops: int) -> Peer:
    """`mj_forward` with a `connect` constraint for each loop, which MuJoCo keeps softly; no contacts, one thread."""
    import mujoco as mj

    inertia = " ".join(str(entry) for entry in np.diag(THIN))
    rod = f'<inertial pos="0 0 0.5" mass="1" diaginertia="{inertia}"/>'
    bodies, ties = "", ""
    for k in range(loops + 1):
        bar = f'<body name="bar{k}" pos="0 0 1" xyaxes="0 0 -1 0 1 0"><joint name="L{k}" type="ball"/>{rod}</body>'
        hinge = f'<joint name="P{k}" type="hinge" axis="0 1 0"/>'
        bodies += f'<body name="upright{k}" pos="{k} 0 0">{hinge}{rod}{bar if k < loops else ""}</body>'
        ties += f'<connect body1="bar{k}" body2="upright{k + 1}" anchor="0 0 1"/>' if k < loops else ""
    flags = '<flag contact="disable" energy="disable"/>'
    model = mj.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 {GRAVITY}">{flags}</option>'
        f"<worldbody>{bodies}</worldbody><equality>{ties}</equality></mujoco>"
    )
    data = mj.MjData(model)
    hinges = [model.joint(f"P{k}").dofadr[0] for k in range(loops + 1)]
    data.qpos[[model.joint(f"P{k}").qposadr[0] for k in range(loops + 1)]], data.qvel[hinges] = LEAN, SPEED
    for k in range(loops):
        first, rate = model.joint(f"L{k}").qposadr[0], model.joint(f"L{k}").dofadr[0]
        data.qpos[first : first + 4], data.qvel[rate : rate + 3] = TURN, TURN_RATE
    mj.mj_forward(model, data)

    def evaluate(run: Any = mj.mj_forward) -> None:
        run(model, data)

    return Peer(evaluate, lambda: data.qacc[hinges].copy())


def pinocchio_chain(links: int) -> Peer:
    """`aba` of an open chain of hinged links (`families.growth.hinged`), bent and moving."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear[:] = 0.0, 0.0, GRAVITY
    rod = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag(np.diag(THIN)[::-1]))
    joint = 0
    for k in range(links):
        place = pin.SE3(np.eye(3), np.array([1.0 if k else 0.0, 0.0, 0.0]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"J{k}")
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    data, tau, (q, v) = model.createData(), np.zeros(links), bent(links)

    def evaluate() -> object:
        return pin.aba(model, data, q, v, tau)

    return Peer(evaluate, lambda: np.asarray(evaluate()).copy())


def bent(links: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates of the hinges of a chain in its state [rad, rad/s]."""
    number = np.arange(links)
    return 0.3 * np.sin(number), 0.5 * np.cos(number)


#: of open chains, by name
CHAINS: dict[str, Callable[[int], Peer]] = {"Pinocchio, aba": pinocchio_chain}
PEERS: dict[str, Callable[[int], Peer]] = {
    "Pinocchio, constraintDynamics": pinocchio,
    "MuJoCo, mj_forward": mujoco,
}
