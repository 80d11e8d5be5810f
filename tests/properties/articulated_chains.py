"""Chains and trees of rods, and their accelerations, made in Python."""

import json
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.oscillation import oscillate
from flexclear.dynamics.equations.prescribed_motion import make_laws, nothing
from flexclear.dynamics.mechanics.of_topology import list_of
from flexclear.dynamics.model import initial, selection
from flexclear.dynamics.model.arrays import WorkSpace, _work_lengths
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.mobility import analyse
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.specialise import dual
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import GRAVITY, Table, joint

#: of a slender rod of 1 kg and 1 m along x; the first only keeps its spin regular
ROD = [1e-3, 1.0 / 12.0, 1.0 / 12.0]
#: z along y of the world: a plane chain
ACROSS = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}


class Evaluated(NamedTuple):
    """An evaluation, with what `matrices` reads of an engine.

    rates: of the state.  drives: forces of the drives.  report: n[EVALUATION].  lengths: of what is in w.
    """

    model: Model
    space: WorkSpace
    rates: np.ndarray
    drives: np.ndarray
    report: int
    lengths: dict[int, int]

    @property
    def h(self) -> np.ndarray:
        return self.space.h

    @property
    def w(self) -> np.ndarray:
        return self.space.w

    @property
    def n(self) -> np.ndarray:
        return self.space.n

    def stretch(self, index: int) -> np.ndarray:
        return self.w[self.h[index] :][: self.lengths[index]]

    view = stretch

    def table(self, table: Any) -> np.ndarray:
        return m.named(table, self.stretch(table.at))


def rods(
    count: int,
    kinds: tuple[str, ...] = ("revolute",),
    children: int = 1,
    *,
    plane: bool = False,
    driven: tuple[int, ...] = (),
    **more: Any,
) -> Table:
    """A scene of rods of 1 m and 1 kg along x, each of which carries so many others; joints in any direction.

    kinds: of joints, in turn.  driven: rods whose joints have a drive.
    """
    random = np.random.default_rng(0)
    body: Table = {"ground": {"type": "ground", "frames": {}}}
    joints: Table = {}
    ends: dict[int, np.ndarray] = {-1: np.zeros(3)}
    for k in range(count):
        above = (k - 1) // children if k else -1
        z = random.normal(size=3)
        axes = ACROSS if plane else {"z": z.tolist(), "x": np.cross(z, random.normal(size=3)).tolist()}
        carrier = "ground" if above < 0 else f"rod{above}"
        body[carrier]["frames"][f"end{k}"] = {"position": [0.0 if above < 0 else 0.5, 0.0, 0.0], "axes": axes}
        body[f"rod{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": ROD,
            "pose": {"position": (ends[above] + [0.5, 0.0, 0.0]).tolist()},
            "frames": {"foot": {"position": [-0.5, 0.0, 0.0], "axes": axes}},
        }
        joints[f"joint{k}"] = joint(kinds[k % len(kinds)], f"{carrier}.end{k}", f"rod{k}.foot")
        ends[k] = ends[above] + [1.0, 0.0, 0.0]
    law = {"type": "polynomial", "coefficients": [0.0, 0.3, 0.2]}
    return {
        "title": "rods",
        "body": body,
        "joint": joints,
        "drive": {f"drive{k}": {"joint": f"joint{k}", "law": law} for k in driven},
        "load": GRAVITY,
        "time": {"end": 0.2},
        "output": {"interval": 0.02},
        **more,
    }


#: of a flexible rod of 0.3 m with frames at its ends and in its middle
MESH, LENGTH = str(TREE / "meshes/checks/crank_rod.toml"), 0.3
#: frames of a rod and where they are in it; those behind the first carry others, in turn
PLACES = {"crank": 0.0, "slider": LENGTH, "middle": 0.5 * LENGTH}


def bending(
    references: tuple[Table | None, ...],
    kinds: tuple[str, ...] = ("revolute",),
    angles: tuple[float, ...] = (0.0,),
    children: int = 1,
    *,
    closed: str = "",
    driven: tuple[int, ...] = (),
    friction: Table | None = None,
    stiffening: bool = False,
    **more: Any,
) -> Table:
    """A scene of rods at some angles in a plane, each of which carries so many others.

    references: modes of each rod, None of a rigid one.  kinds: of joints, angles: of rods to x [rad], in turn.  closed:
    the kind of joint by which the last rod is held at its end, too.  driven: rods whose joints have a drive.
    """
    body: Table = {"ground": {"type": "ground", "frames": {"base": {}}}}
    joints: Table = {}
    starts: list[np.ndarray] = []
    turns = [angles[k % len(angles)] for k in range(len(references))]
    for k, modes in enumerate(references):
        above, (port, place) = (
            (k - 1) // children if k else -1,
            list(PLACES.items())[1 + (k - 1) % children if k else 0],
        )
        along = [np.array([np.cos(turns[i]), np.sin(turns[i]), 0.0]) for i in (above, k)]
        starts.append(starts[above] + place * along[0] if k else np.zeros(3))
        pose = {"position": starts[k].tolist(), "axes": {"z": [0.0, 0.0, 1.0], "x": along[1].tolist()}}
        if modes is None:
            frames = {name: {"position": [at, 0.0, 0.0]} for name, at in PLACES.items()}
            body[f"rod{k}"] = {
                "type": "rigid",
                "mass": 0.15,
                "com": [0.14, 0.01, -0.02],
                "frames": frames,
                "pose": pose,
            }
            body[f"rod{k}"]["inertia"] = [2e-4, 1.2e-3, 1.1e-3]
        else:
            body[f"rod{k}"] = {"type": "flexible", "mesh": MESH, "modes": modes, "pose": pose}
            if stiffening:
                body[f"rod{k}"]["stiffening"] = {}
        extra = {"friction": friction} if friction else {}
        carrier = f"rod{above}.{port}" if k else "ground.base"
        joints[f"joint{k}"] = joint(kinds[k % len(kinds)], carrier, f"rod{k}.crank", **extra)
    if closed:
        body["ground"]["frames"]["far"] = {"position": (starts[-1] + LENGTH * along[1]).tolist()}
        joints["closing"] = joint(closed, f"rod{len(references) - 1}.slider", "ground.far")
    laws = [{"type": "polynomial", "coefficients": [b - a, 0.3, 0.2]} for a, b in pairwise([0.0, *turns])]
    return {
        "title": "bending rods",
        "body": body,
        "joint": joints,
        "drive": {f"drive{k}": {"joint": f"joint{k}", "law": laws[k]} for k in driven},
        "load": {"gravity": {"type": "gravity", "acceleration": [2.0, -9.81, 1.0]}},
        "time": {"end": 0.05},
        "output": {"interval": 0.01},
        **more,
    }


@cache
def _bundle(modes: str, stiffening: bool) -> xr.Dataset:
    """The reduced flexible rod, made once for as many rods as have such modes."""
    table = bending((json.loads(modes),), stiffening=stiffening)
    return bundles(Scene.model_validate(table))["rod0"]


def reduced(scene: Scene) -> dict[str, xr.Dataset]:
    """The flexible bodies of a scene of `bending`."""
    return {
        name: _bundle(body.modes.model_dump_json(exclude_none=True), body.stiffening is not None)
        for name, body in scene.flexible().items()
    }


def tabulated(scene: Scene) -> Model:
    """The model of a scene of `rods` or `bending`."""
    return tabulate(build(scene, reduced(scene)))


def evaluated(
    model: Model,
    speeds: float = 0.1,
    turns: float = 0.0,
    number: Any = float,
    internal: float = 0.0,
    closed: np.ndarray | int = 1,
) -> Evaluated:
    """An evaluation off the start without a compiler.

    speeds, turns, internal: sizes of random changes of the speeds, of the positions of a tree [rad or m], and of the
    states of contacts and loads.  number: type of the floats.  closed: modes of the contacts.
    """
    space, f, random = model.arrays.work_space(m.Room(2, 0)), model.arrays.f, np.random.default_rng(1)
    h, n, start = space.h, space.n, initial.start_state(model)
    y, dy = int(h[m.Y]), int(h[m.SLOPES])
    start[model.speeds] += speeds * random.normal(size=model.nv)
    if turns:
        start[: model.nq] += turns * random.normal(size=model.nq)
    if internal:
        start[model.speeds.stop :] += internal * random.normal(size=model.ny - model.speeds.stop)
    for link, modes in model.numbering.modal_positions.items():  # a millimetre or so
        start[modes] = 1e-3 * model.links[link].mass ** 0.5 * random.normal(size=len(modes))
    w = space.w
    w[y : y + model.ny], n[n[m.MODE] : n[m.MODE] + len(model.contacts)] = start, closed
    w[h[m.LATCHED] : h[m.LATCHED] + len(model.contacts)] = 0.1
    n[n[m.ACTIVE] : n[m.ACTIVE] + model.arrays.size(m.N_LAWS)] = model.arrays.table(m.LAWS)["piece0"]
    harmonics = oscillate if model.parts.harmonics else nothing
    make_laws(harmonics)(h, f, w, n, 0.1)
    keep_independent(model, space, y, dy)
    space = space._replace(w=w.astype(number))
    by_routines(model, space, y, dy)
    drives = space.w[h[m.DRIVE_FORCE] :][: model.arrays.size(m.N_DRIVES)]
    lengths = _work_lengths(h, m.Room(2, 0))
    return Evaluated(model, space, space.w[dy : dy + model.ny], drives, int(n[m.EVALUATION]), lengths)


def by_routines(model: Model, space: WorkSpace, y: int, dy: int) -> None:
    """Evaluate a mechanism with all that the record has, in Python, on numbers of the work space's type."""
    f = model.arrays.f.astype(space.w.dtype)
    calls, n = Numbers(space.h, f, space.w, space.n, y, dy), space.n
    list_of(model.parts, topology_of(model.arrays, space.h), m.RECORD_CALLS, calls)
    n[[m.EVALUATION, m.ABRIDGED, m.STATE]] = calls.report, 0, y


def keep_independent(model: Model, space: WorkSpace, y: int, dy: int) -> None:
    """Solve for as many closure rows as are independent, where some follow from others."""
    mobility, (h, w, *_) = analyse(model), space
    if mobility.redundant:
        by_routines(model, space, y, dy)
        J = selection.dense_rows(model, h, w[h[m.JACOBIAN] :][: h[m.JACOBIAN_SIZE]])
        selection.write(model, h, selection.choose(J, np.ones(len(J)), mobility.rank)[0])


def known_accelerations(found: Evaluated) -> np.ndarray:
    """What the selected closure rows demand of J du, of free coordinates alone: minus the rates at which they open at
    constant speeds of these, by derivatives along the motion."""
    model, (h, w, n, *_), arrays = found.model, found.space, found.model.arrays
    y, dy, change = int(h[m.Y]), int(h[m.SLOPES]), np.zeros(len(found.w))
    change[y : y + model.nq] = found.rates[: model.nq]
    laws = m.named(m.LAW, w[h[m.LAW.at] :][: m.LAW.size * arrays.size(m.N_LAWS)])
    changed = m.named(m.LAW, change[h[m.LAW.at] :][: m.LAW.size * arrays.size(m.N_LAWS)])
    changed["value"], changed["rate"] = laws["rate"], laws["second_rate"]
    numbers = np.array(dual.seed_changes(w.astype(float), change[None, :]), dtype=object)
    calls = Numbers(h, arrays.f, numbers, n, y, dy)
    list_of(model.parts, topology_of(arrays, h), m.CALLS, calls)
    opening = numbers[h[m.RESIDUAL_RATE] :][: arrays.size(m.N_CLOSURE_ROWS)]
    return -dual.changes(opening, 1)[0][selection.selected_indices(model, h)]
