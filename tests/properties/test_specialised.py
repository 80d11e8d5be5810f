"""Straight code for one topology computes what its calls do, with any numbers, and is made again for no number."""

from ctypes import CFUNCTYPE, c_void_p
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from llvmlite import ir

from flexclear import dynamics
from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import compiler_process, files, functions, machine_code, sources
from flexclear.dynamics.mechanics.of_topology import program_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.run.evaluation import closure_rows, specialised_code
from flexclear.dynamics.run.evaluation import engine as engines
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of
from flexclear.dynamics.run.trajectory import integrate
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.dynamics.specialise import program as tracing
from flexclear.dynamics.specialise.code import Emitter, Program
from flexclear.dynamics.specialise.symbols import new_tape, repeat
from flexclear.dynamics.specialise.tape import FLOAT, Symbol, UnsuitedError
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.load import edited, load_scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE
from tests.properties import tapes
from tests.properties.articulated_chains import evaluated

CHECKS = sorted((TREE / "scenes/checks").glob("*.toml"))
RIGID = [path for path in CHECKS if not load_scene(path).flexible()]
#: of the largest rate of a kind: sums are taken in another order, and a reciprocal stands for a quotient
ROUNDING = 1e-9


def apart(model: Model, one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two rates of the state, as share of the largest rate of the same kind."""
    nq, end, worst = model.nq, model.speeds.stop, 0.0
    for part in (slice(0, nq), slice(nq, end), slice(end, None)):
        size = np.abs(one[part]).max(initial=0.0)
        worst = max(worst, float(np.abs(one[part] - other[part]).max(initial=0.0)) / (size or 1.0))
    return worst


def test_what_would_be_too_long_is_refused() -> None:
    model = tabulate(build(load_scene(TREE / "scenes/checks/pendulum.toml"), {}))
    with pytest.raises(UnsuitedError, match="too long"):
        program_of(model.parts, topology_of(model.arrays, model.arrays.h), 10)


def read_by_steps(model: Model, h: np.ndarray) -> list[Any]:
    """Places in w of all that steps read of an evaluation besides its rates."""
    sizes = {m.TOUCH: len(model.contacts), m.LOAD_BENDS: model.arrays.size(m.N_LOAD_BENDS)}
    bearings = model.arrays.size(m.SIZES["n_bearings"])
    sizes |= {m.NAMED["bends"]: bearings}
    stretches = {table.at: table.size * rows for table, rows in sizes.items()}
    rows, kept = model.arrays.size(m.N_CLOSURE_ROWS), int(h[m.N_KEPT_ROWS])
    stretches |= {m.RESIDUAL: rows, m.RESIDUAL_RATE: rows, m.PIVOT: min(rows, 1)}
    diagonal, scales = h[m.ROOTS] + np.arange(kept), h[m.ROW_SCALE] + rows + np.arange(kept)
    loads = h[m.NAMED["bearing"].at] + m.NAMED["bearing"].load + m.NAMED["bearing"].size * np.arange(bearings)
    return [*(slice(h[place], h[place] + size) for place, size in stretches.items()), diagonal, scales, loads]


@pytest.mark.parametrize("path", RIGID, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_every_scene_is_evaluated_alike(path: Path) -> None:
    """All without a compiler: calls on numbers that store the record, and what those of steps wrote on a tape; contacts
    open and closed. What steps read."""
    model = tabulate(build(load_scene(path), {}))
    for closed in (0, 1):
        found = evaluated(model, speeds=1.0, closed=closed)
        h, w, n = found.h, found.w.copy(), found.n.copy()
        y, dy = int(h[m.Y]), int(h[m.SLOPES])
        places = read_by_steps(model, h)
        for place in (slice(dy, dy + model.ny), *places):
            w[place] = np.nan
        tape = program_of(model.parts, topology_of(model.arrays, h), 200_000)
        tapes.run(tape, h, {"f": model.arrays.f, "w": w, "n": n}, y, dy)
        assert (n[m.ABRIDGED], n[m.EVALUATION], found.report) == (1, m.OK, m.OK)
        assert apart(model, found.rates, w[dy : dy + model.ny]) < ROUNDING
        for read in places:
            room = ROUNDING * np.abs(found.w[read]).max(initial=1.0)
            assert w[read] == pytest.approx(found.w[read], rel=ROUNDING, abs=room)


def engine(integrator: str = "dop853") -> Engine:
    return engine_of(load_scene(TREE / "scenes/sps4/csj.toml", {"solver.integrator": integrator}), {}, silent)


@pytest.mark.parametrize("integrator", ["dop853", "exponential"])  # that reads more of some evaluations than the rates
def test_compiled_steps_evaluate_as_the_record_does(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Straight code of the steps, and the list that stores all, at states of a stroke with impacts."""
    monkeypatch.setattr(engines, "LONG", 0)
    one = engine(integrator)
    run = integrate(one, consistent_start(one), silent)
    assert one.h[m.RATES] != one.h[m.EVALUATE]
    for k in (0, len(run.rows) // 2):
        one.select_pieces_after(run.time[k])
        rates, before = [closure_rows.evaluate(one, run.state[k], run.time[k])], one.h[m.EVALUATE]
        assert not one.n[m.ABRIDGED]
        one.h[m.EVALUATE] = one.h[m.RATES]
        rates.append(closure_rows.evaluate(one, run.state[k], run.time[k]))
        one.h[m.EVALUATE] = before
        assert one.n[m.ABRIDGED]
        assert apart(one.model, *rates) < ROUNDING


def test_what_is_too_long_runs_a_list_and_is_differentiated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracing, "LONGEST_STRAIGHT", 10)
    monkeypatch.setattr(engines, "LONG", 0)
    monkeypatch.setattr(specialised_code, "_known", {})
    scene = edited(load_scene(TREE / "scenes/checks/pendulum.toml"), {"time.end": 0.01})
    with monkeypatch.context() as patch, TemporaryDirectory() as folder:
        patch.setenv("FLEXCLEAR_KERNELS", folder)
        patch.setattr(compiler_process, "is_useful", lambda: False)  # it would compile what this process refuses
        patch.setattr(files, "loaded", {})
        patch.setattr(functions, "loaded", files.loaded)
        one = engine_of(scene, {}, silent)
        assert integrate(one, consistent_start(one), silent).time[-1] == 0.01
        assert one.h[m.CALLS]
        made = sensitivities(scene, {}, silent, ["hinge.velocity.final"], ["load.gravity.acceleration.1"])
        # as long as it hangs still, its rate grows with gravity
        rate = made["hinge.velocity.final"].item() * -9.81
        assert rate == pytest.approx(float(dynamics.simulate(scene, {}, silent).joint_velocity[-1, 0]), rel=1e-3)


def test_other_closure_rows_are_solved_for_with_what_leaves_all() -> None:
    one = engine()
    one.specialised.worthwhile = True
    one.settle(silent)
    straight, kept = int(one.h[m.RATES]), one.selected.copy()
    assert straight != one.h[m.EVALUATE]
    fewer = kept.copy()
    fewer[-1] = False
    one.keep(fewer)
    one.connect()
    assert one.h[m.RATES] == one.h[m.EVALUATE]
    one.keep(kept)
    one.connect()
    assert one.h[m.RATES] == straight


@pytest.mark.parametrize("lanes", [1, 4])
def test_equal_topologies_give_equal_code(lanes: int) -> None:
    """The tape is written in one order, whatever the places of objects in memory are."""

    def where(builder: ir.IRBuilder, array: str) -> ir.AllocaInstr:
        return builder.alloca(ir.DoubleType() if array in "wf" else INT)

    def reported() -> str:
        model = tabulate(build(load_scene(TREE / "scenes/sps4/csj.toml"), {}))
        made, builder = program_of(model.parts, topology_of(model.arrays, model.arrays.h), 20_000), function()
        Emitter(builder, made, lambda array, place, lane: where(builder, array), lanes, exact=lanes > 1).emit()
        return str(builder.module)

    assert reported() == reported()


def test_friction_of_ideal_joints_is_in_what_steps_evaluate() -> None:
    parts = tabulate(build(load_scene(TREE / "scenes/checks/rubbing_slider_crank.toml"), {})).parts
    assert "joint_friction" in sources.source_of_steps(parts, ())


def test_a_magnitude_is_never_below_zero_and_may_be_below_more() -> None:
    tape = new_tape(100)
    x = tape.write(FLOAT, "load", "w", 0)
    assert (abs(x) < 0.0) is False
    assert (abs(x) < 0.0) is False
    assert all(isinstance(one, Symbol) for one in (abs(x) < 0.5, x < 0.0, abs(x) > 0.0))


def root(x: Any) -> tuple[Any, Any]:
    """The root of the second number from the first one on, by Newton's method, and the number of its turns."""

    def halve_error(state: Any) -> tuple[Any, Any]:
        before, turns = state
        after = 0.5 * (before + x[1] / before)
        return abs(after - before) > 1e-9 * before, (after, turns + 1.0)

    found: tuple[Any, Any] = repeat(halve_error, (x[0], 0.0))
    return found


@pytest.mark.parametrize("lanes", [1, 4])
def test_lanes_of_a_loop_turn_as_often_as_each_alone(lanes: int) -> None:
    """The first ends after one turn, the last after thirty."""
    states = np.array([[2.0, 4.0, np.nan], [1.0, 2.0, np.nan], [1.0, 1e6, np.nan], [1.0, 1e15, np.nan]])
    known = states.copy()
    for row in known:
        row[[0, 2]] = root(row)
    tape = new_tape(100)
    found = root([tape.write(FLOAT, "load", "w", index) for index in (0, 1)])
    made = Program(tape.block, [("w", index, value) for index, value in zip((0, 2), found, strict=True)])
    function = ir.Function(ir.Module("m"), ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer()]), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    where = lambda array, index, lane: builder.gep(function.args[0], [INT(3 * lane + index)])  # noqa: E731
    Emitter(builder, made, where, lanes, exact=True).emit()
    builder.ret_void()
    code = machine_code.load(machine_code.image_of_module("f", *machine_code.assemble(str(builder.module))))
    for k in range(0, len(states), lanes):
        CFUNCTYPE(None, c_void_p)(code.address)(states[k:].ctypes.data)
    assert states[:, 0] == pytest.approx(np.sqrt(states[:, 1]), rel=1e-15)
    assert np.array_equal(states, known)
    assert states[0, 2] == 1.0
    assert states[3, 2] > 25.0


INT = ir.IntType(64)


def function() -> ir.IRBuilder:
    made = ir.Function(ir.Module("m"), ir.FunctionType(ir.VoidType(), []), "f")
    return ir.IRBuilder(made.append_basic_block())
