"""What the benchmarks compare with must itself be right: the dense system, the peer's model, the chain of four-bars."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks import errors, log, page, processes, timing
from benchmarks.errors import SAMPLING, Error, Samples
from benchmarks.exudyn_model import METHODS, Outcome, holds_at_zero, joint_laws, polynomials, solve
from benchmarks.families import exudyn, growth, runs, siconos
from benchmarks.family import Case
from benchmarks.mechanisms import (
    Mechanism,
    damped,
    evaluation_time,
    mechanism,
    states,
    trajectory,
    without_clearance,
    without_friction,
)
from flexclear import dynamics
from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.reference import sps4
from tests.reference.ideal_motion import ideal

UNKNOWNS = {"ideal": 116, "csj": 113, "far_cb": 129, "far_csj_cb": 126}


def scene(root: Path, name: str) -> Scene:
    return load_scene(root / "scenes" / "sps4" / f"{name}.toml")


@pytest.mark.parametrize("name", UNKNOWNS)
def test_the_dense_system_has_the_unknowns_that_its_derivation_says(name: str):
    here = mechanism(name)
    unknowns, words = runs.maximal_unknowns(here.scene, here.bundles)
    assert unknowns == UNKNOWNS[name]
    if name == "csj":
        # ten links of six; four prismatic joints of five rows, four spherical B and C of three, A2..A4, Z; four drives
        assert words == "6 x 10 links + 49 joint rows + 4 drive rows = 113"
    assert runs.dgesv_time(10) > 0.0


def _at(law: Pieces, order: int, t: float) -> float:
    starts, falling = polynomials(law, order)
    k = int(np.searchsorted(starts, t, side="right")) - 1
    return float(np.polyval(falling[k], t - starts[k]))


def test_drive_laws_are_the_paper_s_steps(root: Path):
    laws = joint_laws(scene(root, "ideal"))
    s, T, h = 0.3, 0.09, 0.06
    for t, sign in ((s * T, 1.0), (T + s * T, -1.0)):
        value, rate, second = (_at(laws["P1"], k, t) for k in range(3))
        # eq. (29): h (3 s^2 - 2 s^3) and its derivatives
        assert value == pytest.approx((0.0 if sign > 0 else h) + sign * h * (3 * s**2 - 2 * s**3), rel=1e-13)
        assert rate == pytest.approx(sign * 6 * h * s * (1 - s) / T, rel=1e-12)
        assert second == pytest.approx(sign * 6 * h * (1 - 2 * s) / T**2, rel=1e-12)
    assert holds_at_zero(laws["P3"])
    assert not holds_at_zero(laws["P1"])


def test_a_ratio_is_that_of_neighbours():
    """A machine that becomes twice as slow half way does not change how two tasks compare."""
    fast, slow = timing.Times((1.0, 1.0, 2.0, 2.0, 2.0)), timing.Times((3.0, 3.0, 6.0, 6.0, 6.0))
    assert slow.over(fast) == 3.0
    assert timing.Times((1.0, 2.0, 3.0, 4.0, 5.0)).spread == pytest.approx(1.0 / 3.0)
    assert timing.slope([5, 10, 20], [1.0, 2.0, 4.0]) == pytest.approx(1.0)


def test_tasks_take_turns_and_the_first_round_does_not_count():
    calls: list[str] = []

    def task(name: str) -> float:
        calls.append(name)
        return float(len(calls))

    times = timing.interleaved({"a": lambda: task("a"), "b": lambda: task("b")}, rounds=2)
    assert "".join(calls) == "ababab"
    assert times["a"].seconds == (3.0, 5.0)


def test_errors_are_taken_up_to_the_horizon_and_between_equal_times():
    time = SAMPLING * np.arange(11)
    still, moved = np.zeros((11, 3)), np.outer(time, [3.0, 0.0, 4.0])
    reference = errors.Reference(Samples(time, still, still + 2.0), 5 * SAMPLING)
    error = reference.error(Samples(time, moved, still + 2.0 + 10 * moved))
    assert error.position == pytest.approx(5 * 5 * SAMPLING)
    assert error.relative == pytest.approx(250 * SAMPLING / np.sqrt(12.0))
    with pytest.raises(ValueError, match="same times"):
        reference.error(Samples(time + 0.3 * SAMPLING, moved, still))


def test_samples_that_come_late_are_compared_at_their_own_times(root: Path):
    """A code that cuts its steps is charged with its errors alone, not with how far things moved until its samples."""
    here = Mechanism("ideal", scene(root, "ideal"), {})
    reference = errors.converged(here, "platform", here.scene.time.end)
    assert reference.at is not None
    late = np.append(0.0, np.arange(1, 180) * SAMPLING + 3e-4)
    known = reference.at(late)
    assert np.array_equal(known.time, late)
    # our reference is at a tolerance of 1e-13, the closed form's roots at rounding; 0.3 ms are 0.1 mm here
    assert max(platform_motion(known)) < 1e-9
    wrong = Samples(late, known.position + np.array([0.0, 0.0, 1e-6]), known.velocity)
    assert reference.error(wrong).position == pytest.approx(1e-6, rel=1e-6)


def test_runs_count_that_no_other_beats():
    """Of (time, error, error): in clearly less time and no worse in either error."""
    runs = [(1.0, 1.0, 1.0), (0.5, 1.0, 2.0), (0.5, 1.0, 1.0), (0.95 * 0.5, 0.5, 0.5), (3.0, 0.1, 0.1), (4.0, 0.1, 0.2)]
    assert exudyn.front(runs) == [1, 2, 3, 4]


def test_the_peer_s_crash_is_the_outcome_of_a_setting(monkeypatch: pytest.MonkeyPatch):
    """A process that dies is replaced; what a used one dies of is asked once more of a fresh one."""
    begun: list[list[float]] = []

    class Process:
        def __init__(self, work: object, limit: int) -> None:
            begun.append([])

        def ask(self, parameters: tuple[object, ...]) -> Outcome:
            step = float(str(parameters[3]))
            begun[-1].append(step)
            if step == 1.0 or (step == 2.0 and len(begun[-1]) > 1):
                raise processes.LostError("its process died (SIGSEGV)")
            if step == 3.0:
                raise processes.LostError("did not end within 120 s of processor time", 120.0)
            return Outcome(step, None if step == 4.0 else Samples(*np.zeros((3, 1))), "no way" if step == 4.0 else "")

        def dismiss(self) -> None:
            pass

    monkeypatch.setattr(exudyn, "Worker", Process)
    peer = exudyn.Peer(Mechanism("none", growth.four_bars(1), {}), "bar0")
    reported = [peer.run("any", step, SAMPLING).failure for step in (5.0, 1.0, 5.0, 2.0, 5.0, 3.0, 4.0, 5.0)]
    died, late = "its process died (SIGSEGV)", "did not end within 120 s of processor time"
    assert reported == ["", died, "", "", "", late, "no way", ""]
    assert begun == [[5.0, 1.0], [1.0], [5.0, 2.0], [2.0, 5.0, 3.0], [4.0], [5.0]]


def test_equal_error_means_worse_in_neither_quantity():
    assert Error(1.0, 1.0, 1.0).within(Error(1.0, 2.0, 1.0))
    assert not Error(1.5, 1.0, 1.0).within(Error(1.0, 2.0, 1.0))


def test_evaluations_in_contact_are_of_states_that_press():
    """What is timed as contact has a normal force, what is timed as free has none."""
    engine = mechanism("csj").engine()
    for label, state in states(engine, trajectory(engine)).items():
        assert evaluation_time(engine, state, 1) > 0.0
        force = engine.table(m.TOUCH)["normal_force"][0]
        assert (force > 0.0) == (label == "in contact")


def test_the_chain_of_four_bars_moves_like_the_benchmark_problem():
    """IFToMM benchmark A02, N = 2, at 0.1 s: an independent solution for its one angle (0.1019174629455971 rad)."""
    run = dynamics.simulate(growth.four_bars(2), {}, silent).isel(time=-1)
    top = run.frame_position.sel(frame="upright0.top").values
    # default tolerance 1e-10 per step, a handful of steps
    assert np.allclose(top, [0.10174111556844023, 0.0, 0.994810909370665], rtol=0.0, atol=1e-8)


def test_effects_are_taken_away_as_parts(root: Path):
    full = scene(root, "far_csj_cb")
    assert without_clearance(full).contacts() == {}
    assert without_friction(full).joint["A1"].friction is None  # type: ignore[union-attr]
    assert damped(full, 0.05).flexible()["rod1"].damping == 0.05
    assert full.joint["A1"].friction is not None  # type: ignore[union-attr]


def platform_motion(samples: Samples) -> tuple[float, float]:
    """Largest deviations of height [m] and speed [m/s] from the ideal motion."""
    exact = ideal(sps4.LAYOUT, samples.time, np.where(samples.time < 0.09, 1, -1))
    z, v = np.array([m.height for m in exact]), np.array([m.speed for m in exact])
    return float(np.max(np.abs(samples.position[:, 2] - z))), float(np.max(np.abs(samples.velocity[:, 2] - v)))


def test_the_peer_s_model_of_the_ideal_mechanism_converges_to_its_motion(root: Path):
    pytest.importorskip("exudyn")
    here = Mechanism("ideal", scene(root, "ideal"), {})
    found = []
    for step in (1e-3, 5e-4):
        samples = solve(here, "platform", next(iter(METHODS)), step, SAMPLING).samples
        assert samples is not None
        found.append(platform_motion(samples))
    # the trapezoidal rule: 4.7e-6 m and 1e-5 m/s at the first step, a quarter of it at half the step
    assert found[0][0] < 5e-5
    assert found[0][1] < 1e-4
    assert np.allclose(np.divide(found[0], found[1]), 4.0, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in exudyn.FAMILY.cases() if c.name in ("far_cb", "csj without friction")])
def test_the_peer_converges_to_our_run(case: Case):
    """Flexible rod, and normal contact: independent codes, one solution."""
    pytest.importorskip("exudyn")
    here = exudyn.edited(case)
    reference = errors.converged(here, "platform", here.scene.time.end)
    found = []
    for step in (1e-4, 5e-6):
        samples = solve(here, "platform", next(iter(METHODS)), step, SAMPLING).samples
        assert samples is not None
        found.append(reference.error(samples))
    # 0.5 m/s at most; impacts that no step ends on leave the method of second order with about the first: a twentieth,
    # which where impacts fall between steps scatters by a factor of four (steps of 1e-5 s are worse than of 2e-5 s)
    assert found[1].relative < 5e-3
    assert found[1].velocity < 0.2 * found[0].velocity
    assert found[1].position < 0.2 * found[0].position


def test_the_peer_s_model_refuses_what_it_would_leave_out():
    pytest.importorskip("exudyn")
    with pytest.raises(ValueError, match="no loads"):
        solve(Mechanism("chain", growth.four_bars(1), {}), "bar0", next(iter(METHODS)), 1e-3, SAMPLING)


def test_the_logged_runs_of_the_peer_are_points_of_cost_studies():
    found = exudyn.points(page.records(log.latest(log.FOLDER / "exudyn.jsonl")))
    assert {"sps4/csj", "sps4/variants/far_csj_cb_damped"} <= found.keys()
    for track in found["sps4/csj"]:
        # in SI: some 10 um and some mm/s at the longest step
        assert 1e-8 < track["error"]["platform.position"][0] < 1e-4
        assert 1e-4 < track["error"]["platform.velocity"][0] < 1e-1


def compiled_functions(source: str, library: Path) -> Callable[..., np.ndarray]:
    """Return a function that calls the functions of Siconos in a C source by name."""
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    functions, numbers = ctypes.CDLL(str(library)), ctypes.POINTER(ctypes.c_double)

    def called(name: str, q: np.ndarray, length: int, rows: int = 2) -> np.ndarray:
        result = np.zeros(length)
        given = [np.ascontiguousarray(q).ctypes.data_as(numbers), ctypes.c_uint(rows), result.ctypes.data_as(numbers)]
        getattr(functions, name)(ctypes.c_uint(len(q)), *given, ctypes.c_uint(0), None)
        return result

    return called


def test_the_corners_that_siconos_sees_are_those_of_the_slider(tmp_path: Path) -> None:
    """Gaps at a tilted pose by hand, and their slopes by differences of 1e-6 rad."""
    called = compiled_functions(siconos.slider(0.0).source(), tmp_path / "functions.so")
    q, step = np.array([0.4, -0.19, 0.02]), 1e-6 * np.eye(3)
    for k, (x, side) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)]):
        up = 0.153 * np.sin(0.4) + 0.306 * np.sin(-0.19) + x * 0.05 * np.sin(0.02) + side * 0.025 * np.cos(0.02)
        assert called(f"gap{k}", q, 2)[0] == pytest.approx(0.026 - side * up, rel=1e-13)
        differences = [(called(f"gap{k}", q + d, 2) - called(f"gap{k}", q - d, 2)) / 2e-6 for d in step]
        assert called(f"slope{k}", q, 6).reshape(3, 2) == pytest.approx(np.array(differences), abs=1e-8)


def test_the_pins_that_siconos_sees_are_those_of_the_four_bar(tmp_path: Path) -> None:
    """Places of pins by complex numbers, and their slopes by differences of 1e-6."""
    called = compiled_functions(siconos.four_bar().source(), tmp_path / "functions.so")
    q, step = np.array([0.1, 0.21, 0.1, 0.7, 0.31, 0.1, 1.4]), 1e-6 * np.eye(7)
    crank, coupler, rocker = (np.exp(1j * q[k]) for k in (0, 3, 6))
    middle, other = complex(q[1], q[2]), complex(q[4], q[5])
    ways = 0.1 * crank - (middle - 0.15 * coupler), middle + 0.15 * coupler - (other + 0.1 * rocker)
    for k, way in enumerate([*ways, 0.3 - (other - 0.1 * rocker)]):
        assert called(f"gap{k}", q, 1, 1)[0] == pytest.approx(2e-4 - abs(way), rel=1e-12)
        differences = [(called(f"gap{k}", q + d, 1, 1) - called(f"gap{k}", q - d, 1, 1))[0] / 2e-6 for d in step]
        assert called(f"slope{k}", q, 7, 1) == pytest.approx(np.array(differences), abs=1e-7)


def test_without_siconos_there_are_no_records(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEXCLEAR_SICONOS", "/nowhere/python3")
    assert siconos.measure(siconos.FAMILY.cases()[0]) == []
