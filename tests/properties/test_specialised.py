"""Straight code for one wiring computes what the kernels do, with any numbers, and is made again for no number."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from llvmlite import ir

from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import sources
from flexclear.pipeline.dynamics.model import initial, selection
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.mobility import analyse
from flexclear.pipeline.dynamics.model.model import Model, tabulate
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.specialised import specialise
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.run import engine_of
from flexclear.pipeline.dynamics.run.trajectory import integrate
from flexclear.pipeline.dynamics.specialise import straight as straight_code
from flexclear.pipeline.dynamics.specialise.code import Emitter
from flexclear.pipeline.dynamics.specialise.straight import program
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError
from flexclear.pipeline.dynamics.specialise.trace import Trace
from flexclear.pipeline.dynamics.specialise.wiring import wiring
from tests.analytic.mechanism_runs import TREE
from tests.properties import tapes

CHECKS = sorted((TREE / "scenes/checks").glob("*.toml"))
RIGID = [path for path in CHECKS if not load_scene(path).flexible()]
#: of the largest rate of a kind: sums are taken in another order, and a reciprocal stands for a quotient
ROUNDING = 1e-9


def rates_kernel(model: Model) -> Any:
    """The kernel that the straight code is made from."""
    scope: dict[str, Any] = {}
    exec(sources.specialised(model.parts, ()).partition("WIRING")[0], scope)
    return scope["rates"]


def keep_independent(model: Model, h: np.ndarray, y: int, dy: int, w: np.ndarray, n: np.ndarray, kernel: Any) -> None:
    """Solve for as many closure rows as are independent, where some follow from others."""
    mobility = analyse(model)
    if not mobility.redundant:
        return
    with suppress(ZeroDivisionError):  # by a pivot of dependent rows, after their Jacobian
        Trace(0).plain(kernel)(h.tolist(), model.arrays.f, w, n, y, dy)
    J = selection.dense(model, h, w[h[m.JACOBIAN] :][: h[m.JACOBIAN_SIZE]])
    kept, _ = selection.choose(J, np.ones(len(J)), mobility.rank)
    selection.write(model, h, kept)


def apart(model: Model, one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two rates of the state, as share of the largest rate of the same kind."""
    nq, end, worst = model.nq, model.speeds.stop, 0.0
    for part in (slice(0, nq), slice(nq, end), slice(end, None)):
        size = np.abs(one[part]).max(initial=0.0)
        worst = max(worst, float(np.abs(one[part] - other[part]).max(initial=0.0)) / (size or 1.0))
    return worst


def test_what_would_be_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model = tabulate(build(load_scene(TREE / "scenes/checks/pendulum.toml"), {}))
    monkeypatch.setattr(straight_code, "LONGEST", 10)
    with pytest.raises(UnsuitedError, match="too long"):
        program(rates_kernel(model), wiring(model.arrays, model.arrays.work_space(lambda _: m.Room(2, 0, 0)).h))


@pytest.mark.parametrize("path", RIGID, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_every_scene_is_evaluated_alike(path: Path) -> None:
    """Both without a compiler: kernels on numbers, and what they wrote on the tape; contacts open and closed."""
    model = tabulate(build(load_scene(path), {}))
    space, f = model.arrays.work_space(lambda _: m.Room(2, 0, 0)), model.arrays.f
    h, y, dy = space.h, int(space.h[m.Y]), int(space.h[m.SLOPES])
    kernel, start = rates_kernel(model), initial.start_state(model)
    space.w[y : y + model.ny] = start
    keep_independent(model, h, y, dy, space.w.copy(), space.n.copy(), kernel)
    made = program(kernel, wiring(model.arrays, h))
    start[model.speeds] += 0.1 * np.random.default_rng(1).normal(size=model.nv)
    for closed in (0, 1):
        ways = []
        for straight in (False, True):
            w, n = space.w.copy(), space.n.copy()
            n[n[m.MODE] :], w[y : y + model.ny] = closed, start
            w[h[m.LATCHED] : h[m.LATCHED] + len(model.contacts)] = 0.1
            if straight:
                tapes.run(made, h, {"f": f, "w": w, "n": n}, y, dy)
            else:
                Trace(0).plain(kernel)(h.tolist(), f, w, n, y, dy)
            ways.append((w[dy : dy + model.ny], w[h[m.TOUCH.place] :][: m.TOUCH.size * len(model.contacts)]))
            assert n[m.EVALUATION] == m.OK
            assert n[m.ABRIDGED] == straight
        assert apart(model, ways[0][0], ways[1][0]) < ROUNDING
        assert ways[1][1] == pytest.approx(ways[0][1], rel=ROUNDING, abs=ROUNDING * np.abs(ways[0][1]).max(initial=1.0))


@cache
def engine(integrator: str = "dop853") -> Engine:
    return engine_of(load_scene(TREE / "scenes/sps4/csj.toml", {"solver.integrator": integrator}), {}, silent)


@pytest.mark.parametrize("integrator", ["dop853", "exponential"])  # that reads more of some evaluations than the rates
def test_compiled_code_runs_as_the_kernels_do(integrator: str) -> None:
    """A stroke with impacts, as exactly as its own tolerance tells, with equal events."""
    one = engine(integrator)
    kernels = integrate(one, consistent_start(one), silent)
    specialise(one)
    assert one.h[m.RATES] != one.h[m.EVALUATE]
    straight = integrate(one, consistent_start(one), silent)
    assert straight.events["kind"].tolist() == kernels.events["kind"].tolist()
    # before the first impact, whose instants differ by rounding; each of those that follow magnifies it
    first = float(kernels.events["time"][0]) - 1e-9
    before = [run.state[run.time <= first][:, : one.model.nq] for run in (kernels, straight)]
    assert np.abs(before[0] - before[1]).max() < 1e-9
    for k in (0, len(kernels.rows) // 2):
        y = kernels.state[k]
        one.select_pieces_after(kernels.time[k])
        generic = closure_rows.evaluate(one, y, kernels.time[k])
        one.h[m.EVALUATE], before_it = one.h[m.RATES], one.h[m.EVALUATE]
        found = closure_rows.evaluate(one, y, kernels.time[k])
        one.h[m.EVALUATE] = before_it
        assert apart(one.model, generic, found) < ROUNDING


def test_other_closure_rows_are_solved_for_by_the_kernels() -> None:
    one = engine()
    specialise(one)
    straight, kept = int(one.h[m.RATES]), one.selected.copy()
    fewer = kept.copy()
    fewer[-1] = False
    one.keep(fewer)
    assert one.h[m.RATES] == one.h[m.EVALUATE]
    one.keep(kept)
    assert one.h[m.RATES] == straight


def source(scene: Scene) -> str:
    model = tabulate(build(scene, {}))
    return sources.specialised(model.parts, wiring(model.arrays, model.arrays.h))


@pytest.mark.parametrize(
    "place, value",
    [("joint.A1.clearance", 2e-4), ("body.platform.mass", 3.0), ("load.gravity.acceleration", [0, 1, 2])],
)
def test_no_number_is_in_the_code(place: str, value: Any) -> None:
    scene = load_scene(TREE / "scenes/sps4/csj.toml")
    known = place.split(".")[1] in getattr(scene, place.split(".")[0])
    assert not known or source(edited(scene, {place: value})) == source(scene)


def test_laws_of_time_and_integrators_are_not_in_the_code() -> None:
    scene = load_scene(TREE / "scenes/sps4/csj.toml")
    law = {"type": "spline", "time": [0.0, 0.05, 0.1, 0.18], "value": [0.0, 0.01, 0.02, 0.0]}
    drive = next(iter(scene.drive))
    other = edited(scene, {f"drive.{drive}.law": law, "solver.integrator": "radau", "time.end": 0.1})
    assert source(other) == source(scene)
    assert source(load_scene(TREE / "scenes/sps4/ideal.toml")) != source(scene)


@pytest.mark.parametrize("lanes", [1, 4])
def test_equal_wirings_give_equal_code(lanes: int) -> None:
    """The tape is written in one order, whatever the places of objects in memory are."""

    def where(builder: ir.IRBuilder, array: str) -> ir.AllocaInstr:
        return builder.alloca(ir.DoubleType() if array in "wf" else INT)

    def told() -> str:
        model = tabulate(build(load_scene(TREE / "scenes/sps4/csj.toml"), {}))
        made, builder = program(rates_kernel(model), wiring(model.arrays, model.arrays.h)), function()
        Emitter(builder, made, lambda array, place, lane: where(builder, array), lanes, exact=lanes > 1).emit()
        return str(builder.module)

    assert told() == told()


INT = ir.IntType(64)


def function() -> ir.IRBuilder:
    made = ir.Function(ir.Module("m"), ir.FunctionType(ir.VoidType(), []), "f")
    return ir.IRBuilder(made.append_basic_block())
