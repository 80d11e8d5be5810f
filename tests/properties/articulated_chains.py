"""Chains and trees of rods, and their accelerations with either way of factoring the mass matrix, made in Python."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import sources
from flexclear.pipeline.dynamics.model import initial
from flexclear.pipeline.dynamics.model import model as modelling
from flexclear.pipeline.dynamics.model.arrays import WorkSpace
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import Model, tabulate
from flexclear.pipeline.dynamics.specialise.trace import Trace
from tests.properties.mechanisms import GRAVITY, Table, joint
from tests.properties.test_specialised import keep_independent

#: of a slender rod of 1 kg and 1 m along x; the first only keeps its spin regular
ROD = [1e-3, 1.0 / 12.0, 1.0 / 12.0]
#: z along y of the world: a plane chain
ACROSS = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}


class Evaluated(NamedTuple):
    """An evaluation. rates: of the state.  drives: forces of the drives.  report: n[EVALUATION]."""

    model: Model
    space: WorkSpace
    rates: np.ndarray
    drives: np.ndarray
    report: int


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


def tabulated(monkeypatch: pytest.MonkeyPatch, scene: Scene, articulated: bool) -> Model:
    """The model with a given way of factoring the mass matrix."""
    with monkeypatch.context() as patch:
        patch.setattr(modelling, "articulated", lambda numbering: articulated)
        return tabulate(build(scene, {}))


def right_hand_side(model: Model) -> Any:
    """The kernel of the right-hand side that is compiled for a model."""
    scope: dict[str, Any] = {}
    exec(sources.kernels(model.parts)["evaluate"].partition("@calls")[0], scope)
    return scope["right_hand_side"]


def evaluated(model: Model, speeds: float = 0.1, turns: float = 0.0, number: Any = float) -> Evaluated:
    """An evaluation off the start, contacts closed, without a compiler.

    speeds, turns: sizes of random changes of the speeds, and of the positions of a tree of hinges [rad].  number: type
    of the floats.
    """
    space, f, random = model.arrays.work_space(lambda _: m.Room(2, 0, 0)), model.arrays.f, np.random.default_rng(1)
    h, n, start = space.h, space.n, initial.start_state(model)
    y, dy = int(h[m.Y]), int(h[m.SLOPES])
    start[model.speeds] += speeds * random.normal(size=model.nv)
    if turns:
        start[: model.nq] += turns * random.normal(size=model.nq)
    w = space.w.astype(number)
    w[y : y + model.ny], n[n[m.MODE] :] = start, 1
    w[h[m.LATCHED] : h[m.LATCHED] + len(model.contacts)] = 0.1
    n[n[m.ACTIVE] : n[m.ACTIVE] + model.arrays.size(m.N_LAWS)] = model.arrays.table(m.LAWS)["piece0"]
    plain = (Trace(0) if number is float else Long(0)).plain(right_hand_side(model))

    def rates(h: Any, f: Any, w: Any, n: Any, y: int, dy: int) -> None:
        plain(h, f, w, n, number(0.1), y, dy)

    keep_independent(model, h, y, dy, w.copy(), n.copy(), rates)
    rates(h.tolist(), f.astype(number), w, n, y, dy)
    drives = w[h[m.DRIVE_FORCE] :][: model.arrays.size(m.N_DRIVES)]
    return Evaluated(model, space._replace(w=w), w[dy : dy + model.ny], drives, int(n[m.EVALUATION]))


class Long(Trace):
    """Kernels in extended precision, functions of NumPy included."""

    def _function(self, name: str) -> Any:
        return lambda *arguments: getattr(np, name)(*map(np.longdouble, arguments))
