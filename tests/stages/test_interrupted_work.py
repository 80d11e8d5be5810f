"""What is interrupted goes on where it was and gives the same, to the last bit; what it leaves is no result."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numba import config

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.artifacts.store import Store
from flexclear.pipeline.core.scene.integrators import INTEGRATORS
from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError, StoppedError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.core.workflow import cores, journal, schedule, stopping
from flexclear.pipeline.core.workflow.fingerprint import Sources
from flexclear.pipeline.core.workflow.task import Task
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run import pieces, progress_rate, trajectory
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.post import derive
from flexclear.pipeline.post.overview import comparison
from tests.analytic.integrator_scenes import double_pendulum, engine_with

#: evaluations between two looks, so few that a short run has many
SLICE = 30


class KilledError(BaseException):
    """Nothing is written any more."""


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is looked at often, and its state is written each time."""
    monkeypatch.setattr(trajectory, "SLICE", SLICE)
    monkeypatch.setattr(journal, "EVERY", -1.0)
    monkeypatch.setattr(journal, "FRACTION", np.inf)
    monkeypatch.setattr(os, "fsync", lambda file: None)  # a busy disk takes its time


def interrupted(
    work: Callable[[], Any], folder: Path, monkeypatch: pytest.MonkeyPatch, looks_each: int = 4
) -> tuple[Any, int]:
    """The result of work that is killed again and again after some looks, and how often it was."""
    kills, looks = 0, 0
    proper = trajectory._stop_when_asked

    def look(*arguments: Any) -> None:
        nonlocal looks
        looks += 1
        if looks % looks_each == 0:
            raise KilledError
        proper(*arguments)

    monkeypatch.setattr(trajectory, "_stop_when_asked", look)
    while True:
        try:
            with journal.storage(folder, "key") as kept:
                found = work()
        except KilledError:
            kills += 1
            assert kills < 2000, "work does not get on"
        else:
            assert list(folder.glob("key.*.part"))
            kept.remove()
            assert not list(folder.iterdir())
            monkeypatch.setattr(trajectory, "_stop_when_asked", proper)
            return found, kills


def require_same_bits(
    work: Callable[[], xr.Dataset], folder: Path, monkeypatch: pytest.MonkeyPatch, looks_each: int = 4, kills: int = 1
) -> None:
    """Work that is killed after some looks, so many times or more, gives what it gives otherwise."""
    whole = work()
    result, killed = interrupted(work, folder, monkeypatch, looks_each)
    assert killed >= kills
    assert result.identical(whole)


def check(root: Path, name: str, **changes: Any) -> Scene:
    return edited(load_scene(root / "scenes" / "checks" / f"{name}.toml"), changes)


def smooth(solver: dict[str, Any]) -> Scene:
    """Two hinges, and of adaptive methods a tolerance that gives some hundred evaluations or more."""
    rtol = 1e-5 if INTEGRATORS[solver["integrator"]].implicit else 1e-9
    return Scene.model_validate({**double_pendulum(), "solver": {"rtol": rtol, **solver}})


ADAPTIVE = [name for name, traits in INTEGRATORS.items() if traits.estimates]
SOLVERS = [{"integrator": name, "step": 4e-3} for name in INTEGRATORS] + [{"integrator": name} for name in ADAPTIVE]


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: " ".join(map(str, solver.values())))
def test_a_killed_run_goes_on_to_the_same_bits_under_every_integrator(
    solver: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = smooth(solver)
    require_same_bits(lambda: dynamics.simulate(scene, {}, silent), tmp_path, monkeypatch)


#: scene -> a kill after so many looks, and changes of the scene
RUNS: dict[str, tuple[int, dict[str, Any]]] = {
    # contacts and the run's twin
    "bounce": (20, {}),
    "bounce, implicit": (200, {"solver.integrator": "radau"}),
    # runs at several tolerances, each with a twin
    "bounce, accurate": (60, {"accuracy": {"ball.position": "1e-4 m"}, "solver.rtol": 1e-7}),
    # controllers whose samples end steps
    "controllers": (2, {"solver.rtol": 1e-12}),
    # polynomials over singular poses, redundant closures
    "four_bars_2": (3, {"time.end": 2.0}),
}


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("name", RUNS)
def test_a_killed_run_goes_on_to_the_same_bits_whatever_it_has(
    name: str, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, changes = RUNS[name]
    scene = check(root, name.partition(",")[0], **changes)
    require_same_bits(lambda: dynamics.simulate(scene, {}, silent), tmp_path, monkeypatch, looks)


@pytest.mark.usefixtures("often")
def test_a_run_that_is_killed_before_and_after_it_was_handed_over_goes_on_to_the_same_bits(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rolling ball: dop853 hands over to radau at 1000 evaluations, in a contact; its twin does so, too."""
    monkeypatch.setattr(progress_rate, "TRIAL", 1000)
    monkeypatch.setattr(progress_rate, "HOPELESS", 1100)
    scene = check(root, "socket_rolling", **{"time.end": 3e-3})
    whole = dynamics.simulate(scene, {}, silent)
    assert (whole.attrs["method"], bool(whole.attrs["switched"])) == ("radau", True)
    # some 70 looks at each method, and as many at the twin
    found, kills = interrupted(lambda: dynamics.simulate(scene, {}, silent), tmp_path, monkeypatch, 9)
    assert kills >= 4
    assert found.identical(whole)


#: five closure rows of six, and others of them from 1.2 s on: code is made for both choices
CHANGING = {"time.end": 1.4, "solver.rtol": 1e-8}


@pytest.mark.usefixtures("often")
def test_a_killed_run_goes_on_with_the_straight_code_that_it_had(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = check(root, "bricard", **CHANGING)
    require_same_bits(lambda: dynamics.simulate(scene, {}, silent), tmp_path, monkeypatch, 3, kills=2)


@pytest.mark.usefixtures("often")
def test_what_an_engine_has_met_before_changes_no_bit(root: Path) -> None:
    """Sections and sweeps run again and again on one engine, and an earlier attempt may have done the first of them."""
    engine = engine_with(check(root, "bricard", **CHANGING))
    start = consistent_start(engine)
    once, again = (trajectory.integrate(engine, start, silent) for _ in range(2))
    assert len(engine.straight.rows) == 2 or config.DISABLE_JIT
    assert np.array_equal(once.rows, again.rows)


def test_an_engine_that_remembers_another_evaluates_for_the_same_closure_rows(root: Path) -> None:
    first, other = (engine_with(check(root, "bricard", **CHANGING)) for _ in range(2))
    state = trajectory.integrate(first, consistent_start(first), silent).state[-1]
    assert not np.array_equal(first.selected, other.selected)
    pieces.remember(other, pieces.memory(first))
    time = float(first.control[m.TIME])
    assert all(engine.attempt(state, time) for engine in (first, other))
    assert np.array_equal(first.slope, other.slope)


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("threads", [1, 3])
def test_a_killed_ensemble_goes_on_to_the_same_bits(
    threads: int, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed with so many threads at work; what nobody kills has one."""
    scene = check(root, "bounce", ensemble={"members": 4})
    monkeypatch.setattr(cores, "cores", lambda: 1)
    whole = dynamics.ensemble(scene, {}, silent)
    monkeypatch.setattr(cores, "cores", lambda: threads)
    monkeypatch.setattr(cores, "_others_idle", True)
    found, kills = interrupted(lambda: dynamics.ensemble(scene, {}, silent), tmp_path, monkeypatch)
    assert kills >= 3
    assert found.identical(whole)


@pytest.mark.usefixtures("often")
def test_killed_sections_go_on_to_the_same_bits(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sections = {"transient": 2, "periods": 20, "exponent_periods": 20}
    scene = check(root, "driven_pendulum", sections=sections, **{"solver.rtol": 1e-10})
    require_same_bits(lambda: dynamics.sections(scene, {}, silent), tmp_path, monkeypatch, 300)


@pytest.mark.usefixtures("often")
def test_times_that_are_measured_are_those_of_all_attempts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = smooth({"integrator": "dop853", "rtol": 1e-13})
    alone = dynamics.cost(scene, {}, silent)
    found, kills = interrupted(lambda: dynamics.cost(scene, {}, silent), tmp_path, monkeypatch)
    assert kills >= 1
    assert found.run.identical(alone.run)
    # ten times either way: what is measured here are milliseconds of a machine that is shared
    assert 0.1 < np.median(found.integration) / np.median(alone.integration) < 10.0


@pytest.mark.usefixtures("often")
def test_what_is_left_of_a_piece_is_not_used_when_a_bit_of_it_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = smooth({"integrator": "dop853"})
    whole = dynamics.simulate(scene, {}, silent)

    def damaged() -> xr.Dataset:
        for path in tmp_path.glob("*.part"):
            content = bytearray(path.read_bytes())
            content[len(content) // 2] ^= 1
            path.write_bytes(content)
        monkeypatch.setattr(trajectory, "SLICE", 2 * trajectory.SLICE)  # else it would never end
        return dynamics.simulate(scene, {}, silent)

    found, kills = interrupted(damaged, tmp_path, monkeypatch)
    assert kills >= 1
    assert found.identical(whole)


@pytest.mark.usefixtures("often")
def test_a_run_that_is_asked_to_stop_leaves_what_there_is_marked_and_goes_on_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = smooth({"integrator": "dop853"})
    whole = dynamics.simulate(scene, {}, silent)
    monkeypatch.setattr(stopping, "_why", "")

    def progress(fraction: float | None, text: str) -> None:
        if fraction is not None and fraction > 0.3:
            stopping.request("the time is over")

    with pytest.raises(StoppedError) as told, journal.storage(tmp_path, "key"):
        dynamics.simulate(scene, {}, progress)
    monkeypatch.setattr(stopping, "_why", "")
    assert told.value.exit_code == 4
    left = told.value.partial
    assert left.attrs["complete"] == 0
    assert left.attrs["stopped_at"] == left.time[-1] < whole.time[-1]
    assert left.position.identical(whole.position[: left.sizes["time"]])
    with pytest.raises(InputError, match=r"not complete: it was stopped at t = 0\.\d+ s \(the time is over\)"):
        derive(left)
    with pytest.raises(InputError, match="not complete"):
        comparison.assemble({"whole": whole, "left": left}, {}, [])
    with journal.storage(tmp_path, "key") as kept:
        assert dynamics.simulate(scene, {}, silent).identical(whole)
    assert kept.restored > 0.0


def test_what_a_part_of_the_work_leaves_is_not_taken_for_what_there_is_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of an ensemble that is stopped: the motion of a member, which is no dataset."""

    def stopped(*arguments: Any) -> None:
        raise StoppedError("the time is over", ("engine", "trajectory"))

    monkeypatch.setattr(schedule, "execute", stopped)
    task = Task("ensemble", "bounce", "nothing:run", {}, "runs/bounce")
    failed = schedule.attempt(task, {}, Store(tmp_path), Sources(tmp_path), silent)
    assert isinstance(failed, schedule.Failure)
    assert failed.exit_code == 4
    assert failed.message == "bounce ensemble: the time is over; run it again, and it continues from there"
    assert not list(tmp_path.iterdir())


def test_a_piece_is_written_in_time_whoever_else_is_written_more_often(tmp_path: Path) -> None:
    """A run and its twin look at the clock in turns: if what one has written counted for both, one might never be."""
    now, kept = 0.0, journal.Journal(tmp_path, "key", clock=lambda: now, _written=0.0)
    pieces_, state = [kept.name(digest) for digest in ("run", "twin")], journal.State({}, {}, np.zeros((1, 1)))
    written: dict[str, list[float]] = {name: [0.0] for name in pieces_}
    for now in np.arange(0.0, 200.0, 0.5):
        for name in pieces_ if now % 3.0 == 0.0 else pieces_[1:]:  # the run takes longer from look to look
            if kept.due(name):
                kept.write(name, state)
                written[name].append(now)
    for times in written.values():
        assert np.diff([*times, now]).max() <= journal.EVERY + 3.0
    kept.finish(pieces_[0], state)
    assert not kept._saved.keys() - pieces_[1:]


def test_work_on_another_processor_is_not_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its numbers differ in their last bits."""
    engine = engine_with(smooth({"integrator": "dop853"}))
    here = pieces.digest(engine)
    assert pieces.digest(engine) == here
    monkeypatch.setattr(pieces, "processor", lambda: "another")
    assert pieces.digest(engine) != here
