"""One evaluation against Pinocchio's `constraintDynamics` and MuJoCo's `mj_forward`, on the same rigid loops.

The model is the leaning N-four-bar of `growth`, in the same state in all three programs; the uprights' accelerations
are compared. Open chains of 5 to 300 hinged links are compared with Pinocchio's `aba`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from benchmarks.families.growth import four_bars, hinged
from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import Mechanism, State, evaluation_time
from benchmarks.page import Columns, short, spread, table
from benchmarks.timing import interleaved, once, slope
from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import integrate
from flexclear.system.progress import silent

LOOPS = (5, 20)
LINKS = (5, 10, 20, 40, 80, 150, 300)
#: evaluations per round for one loop, and rounds
EVALUATIONS, ROUNDS = 10_000, 15


def cases() -> list[Case]:
    """Return as cases each number of loops with each program, and each number of links of an open chain."""
    closed = [Case(f"{name}, {loops} loops", (name, loops)) for loops in LOOPS for name in PEERS]
    return closed + [Case(f"{name}, {links} links", (name, links)) for links in LINKS for name in CHAINS]


def _of_chain(name: str, links: int) -> Record:
    """Return the times of an evaluation of an open chain, and the number of evaluations of its run."""
    peer, mine = CHAINS[name](links), Mechanism(name, hinged(links), {})
    engine, straight = mine.general_engine(), mine.engine()
    start, order = consistent_start(engine), [hinge.start for hinge in engine.model.numbering.coordinates[1:]]
    integrate(engine, start, silent)
    evaluations, y, nq = int(engine.n[m.EVALUATIONS]), start.copy(), engine.model.nq
    y[: nq + engine.model.nv] = 0.0
    for k, (angle, rate) in enumerate(zip(*bent(links), strict=True)):
        y[engine.model.numbering.positions[k + 1].start], y[nq + order[k]] = angle, rate
    state = State(engine.start, np.zeros(0), np.zeros(0), y)
    ours, theirs = closure_rows.evaluate(engine, y, state.t)[engine.model.speeds][order], peer.hinges()
    repeat = max(EVALUATIONS // links, 10)
    return {
        "by": name,
        "links": links,
        "apart": float(np.abs(theirs - ours).max() / np.abs(theirs).max()),
        "evaluations": evaluations,
        **_times(peer, engine, straight, state, repeat),
    }


def _times(peer: Peer, engine: Engine, straight: Engine, state: State, repeat: int) -> Record:
    """Return the times of one evaluation by peer, kernels and, where it exists, specialised code, with their ratios."""
    tasks = {"theirs": partial(peer.time, repeat), "ours": partial(evaluation_time, engine, state, repeat)}
    if straight.specialised.addresses.get(straight.selected.tobytes(), 1):
        tasks["straight"] = partial(evaluation_time, straight, state, repeat)
    times = interleaved(tasks, ROUNDS)
    return {
        **{label: found.record("us") for label, found in times.items()},
        "ratio": times["theirs"].over(times["ours"]),
        "straight_ratio": times["theirs"].over(times["straight"]) if "straight" in times else None,
    }


def _record(name: str, loops: int) -> Record:
    peer, mine = PEERS[name](loops), Mechanism(name, four_bars(loops, LEAN), {})
    engine = mine.general_engine()
    state = State(engine.start, np.zeros(0), np.zeros(0), consistent_start(engine))
    links, numbering = engine.model.links, engine.model.numbering
    uprights = [numbering.coordinates[i][0] for i, link in enumerate(links) if i and link.kind == "revolute"]
    ours = np.sort(closure_rows.evaluate(engine, state.y, state.t)[engine.model.speeds][uprights])
    times = _times(peer, engine, mine.engine(), state, max(EVALUATIONS // loops, 10))
    difference = np.abs(np.sort(peer.hinges()) - ours).max() / np.abs(ours).max()
    return {
        "by": name,
        "loops": loops,
        "apart": float(difference),
        "versions": {package: version(package) for package in ("pin", "mujoco")},
        **times,
    }


def show(records: list[Record]) -> str:
    """Return the table of closed loops with the programs' versions, and that of open chains with the growth."""
    parts = []
    if loops := [r for r in records if "loops" in r]:
        versions = loops[-1]["versions"]
        parts += [table(loops, _columns("loops")), f"Pinocchio {versions['pin']}, MuJoCo {versions['mujoco']}."]
    if chains := [r for r in records if "links" in r]:
        parts.append(table(chains, _columns("links")))
    if len(chains) > 1:
        exponent = slope([r["links"] for r in chains], [r["ours"]["us"] for r in chains])
        parts.append(f"Time grows as the number of links to the power {exponent:.2f}.")
    return "\n\n".join(parts)


def _columns(what: str) -> Columns:
    """Return the columns over numbers of loops or links; links add a run's evaluations."""
    cost: Columns = {"evaluations in 0.2 s": lambda r: str(r["evaluations"])} if what == "links" else {}
    return {
        "program": lambda r: r["by"],
        what: lambda r: str(r[what]),
        "theirs [us]": lambda r: spread(r["theirs"], "us", 1),
        "straight code [us]": lambda r: spread(r["straight"], "us", 2) if "straight" in r else "",
        "ratio": lambda r: f"{r['straight_ratio']:.1f}" if "straight" in r else "",
        "list of calls [us]": lambda r: spread(r["ours"], "us", 2),
        "ratio ": lambda r: f"{r['ratio']:.1f}",
        "accelerations differ by": lambda r: short(r["apart"]),
        **cost,
    }


#: moments of inertia of each rod about its centre [kg m^2], its axis being z; mass and length are 1
THIN = np.diag([1.0 / 12.0, 1.0 / 12.0, 1e-4])
#: axes of a joining rod, which lies along x
R_BAR = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
#: angle and angular velocity of the uprights, about y [rad, rad/s]
LEAN, SPEED, GRAVITY = 0.5, 1.0, -9.81
#: rotation of a joining rod relative to its upright, quaternion (w, x, y, z), and its rate, in its own axes
TURN = np.array([np.cos(0.5 * LEAN), *(-np.sin(0.5 * LEAN) * R_BAR[1])])
TURN_RATE = -SPEED * R_BAR[1]


@dataclass(frozen=True)
class Peer:
    """Another program's model in the same state.

    evaluate: makes one evaluation.  hinges: returns the angular accelerations of the uprights [rad/s^2].
    """

    evaluate: Callable[[], object]
    hinges: Callable[[], np.ndarray]

    def time(self, repeat: int) -> float:
        """Return the processor time of an evaluation [s]; each evaluation is a call from Python."""
        evaluate = self.evaluate

        def calls() -> None:
            for _ in range(repeat):
                evaluate()

        return once(calls) / repeat


def pinocchio(loops: int) -> Peer:
    """Return a model for `constraintDynamics`, with joints added depth-first and a point constraint for each loop."""
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
    """Return a model for `mj_forward` with a soft `connect` constraint for each loop; no contacts, one thread."""
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
    """Return a model for `aba`: an open chain of hinged links (`families.growth.hinged`), bent and moving."""
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
    """Return angles and rates of the hinges of a chain in its state [rad, rad/s]."""
    number = np.arange(links)
    return 0.3 * np.sin(number), 0.5 * np.cos(number)


#: programs for open chains, by name; then those for loops
CHAINS: dict[str, Callable[[int], Peer]] = {"Pinocchio, aba": pinocchio_chain}
PEERS: dict[str, Callable[[int], Peer]] = {
    "Pinocchio, constraintDynamics": pinocchio,
    "MuJoCo, mj_forward": mujoco,
}


FAMILY = Family(
    what="one evaluation against Pinocchio and MuJoCo",
    takes="3 min",
    page="benchmarks.md",
    cases=cases,
    measure=each(lambda case: [(_of_chain if case.of[0] in CHAINS else _record)(*case.of)]),
    show=show,
    needs=("pinocchio", "peers"),
)
