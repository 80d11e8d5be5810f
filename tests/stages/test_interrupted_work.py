"""What is interrupted goes on where it was and gives the same, to the last bit; what it leaves is no result."""

from __future__ import annotations

import os
import pkgutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numba import config

from flexclear import dynamics
from flexclear.artifacts.store import Store
from flexclear.dynamics import analyses
from flexclear.dynamics import memory as m
from flexclear.dynamics.run import pieces, trajectory
from flexclear.dynamics.run.evaluation import engine as engines
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.post.overview import comparison
from flexclear.post.single_run.series import derive
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, StoppedError
from flexclear.system.progress import silent
from flexclear.workflow import cores, journal, schedule, stopping
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.task import Task
from tests.analytic.integrator_scenes import double_pendulum, engine_with
from tests.analytic.mechanism_runs import TREE

#: evaluations between two looks, so few that a short run has many
SLICE = 30


class KilledError(BaseException):
    """Nothing is written any more."""


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is looked at often, and its state is written each time; soon it is so long that its code is specialised."""
    monkeypatch.setattr(trajectory, "SLICE", SLICE)
    monkeypatch.setattr(engines, "LONG", 5 * SLICE)
    monkeypatch.setattr(journal, "WRITING_INTERVAL", -1.0)
    monkeypatch.setattr(journal, "WRITING_FRACTION", np.inf)
    monkeypatch.setattr(os, "fsync", lambda file: None)  # a busy disk takes its time


def interrupted(
    work: Callable[[], Any], folder: Path, monkeypatch: pytest.MonkeyPatch, looks_each: int = 4
) -> tuple[Any, int]:
    """The result of work that is killed again and again after some looks, and how often it was."""
    kills, looks = 0, 0
    proper = stopping.check_stop

    def look(*arguments: Any) -> None:
        nonlocal looks
        looks += 1
        if looks % looks_each == 0:
            raise KilledError
        proper(*arguments)

    monkeypatch.setattr(stopping, "check_stop", look)
    while True:
        try:
            with journal.keep_journal(folder, "key") as kept:
                found = work()
        except KilledError:
            kills += 1
            assert kills < 2000, "work does not get on"
        else:
            assert list(folder.glob("key.*.part"))
            kept.remove()
            assert not list(folder.iterdir())
            monkeypatch.setattr(stopping, "check_stop", proper)
            return found, kills


def check(name: str, **changes: Any) -> Scene:
    return edited(load_scene(TREE / "scenes" / "checks" / f"{name}.toml"), changes)


#: scenes whose ensemble or sections are interrupted
ENSEMBLE = check("bounce", ensemble={"members": 4})
SECTIONS = check(
    "driven_pendulum", sections={"transient": 2, "periods": 20, "exponent_periods": 20}, **{"solver.rtol": 1e-10}
)


@cache
def whole(of: str) -> xr.Dataset:
    """Of work that nobody interrupts, with one thread."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cores, "count_cores", lambda: 1)
        return WORK[of]()


WORK: dict[str, Callable[[], xr.Dataset]] = {
    "ensemble": lambda: analyses.ensemble(ENSEMBLE, {}, silent),
    "sections": lambda: analyses.sections(SECTIONS, {}, silent),
}


def smooth(solver: dict[str, Any]) -> Scene:
    """Two hinges, at a tolerance that gives some hundred evaluations or more."""
    return Scene.model_validate({**double_pendulum(), "solver": {"rtol": 1e-9, **solver}})


#: five closure rows of six, and others of them from 1.2 s on: code is made for both choices
CHANGING = {"time.end": 1.4, "solver.rtol": 1e-8}


@pytest.mark.usefixtures("often")
def test_what_an_engine_has_met_before_changes_no_bit() -> None:
    """Sections and sweeps run again and again on one engine, and an earlier attempt may have done the first of them."""
    engine = engine_with(check("bricard", **CHANGING))
    start = consistent_start(engine)
    once, again = (trajectory.integrate(engine, start, silent) for _ in range(2))
    assert len(engine.specialised.rows) == 2 or config.DISABLE_JIT
    assert np.array_equal(once.rows, again.rows)


def test_an_engine_that_remembers_another_evaluates_for_the_same_closure_rows() -> None:
    first, other = (engine_with(check("bricard", **CHANGING)) for _ in range(2))
    state = trajectory.integrate(first, consistent_start(first), silent).state[-1]
    assert not np.array_equal(first.selected, other.selected)
    pieces.remember(other, pieces.memory(first))
    time = float(first.control[m.TIME])
    assert all(engine.attempt(state, time) for engine in (first, other))
    assert np.array_equal(first.slope, other.slope)


# some 140 looks at each member: three are finished before the work is killed
@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("of, threads, looks", [("ensemble", 1, 450), ("ensemble", 3, 450), ("sections", 1, 300)])
def test_killed_work_goes_on_to_the_same_bits(
    of: str, threads: int, looks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed with so many threads at work; what nobody kills has one."""
    expected = whole(of)
    monkeypatch.setattr(cores, "count_cores", lambda: threads)
    monkeypatch.setattr(cores, "_others_idle", True)
    found, kills = interrupted(WORK[of], tmp_path, monkeypatch, looks)
    assert kills >= 1
    assert found.identical(expected)


@pytest.mark.parametrize(
    "of, part, calls",
    [
        ("sections", "_Tape._motion", 9),
        ("sections", "conform", 1),
        ("ensemble", "conform", 1),
    ],
)
def test_work_that_fails_between_its_parts_goes_on_to_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of: str, part: str, calls: int
) -> None:
    """Where a period is being added to the tape, and where all is there and the dataset is made."""
    expected, left = whole(of), [calls]
    place = f"flexclear.dynamics.record.{of}.{part}"
    proper = pkgutil.resolve_name(place)

    def failing(*arguments: Any, **more: Any) -> Any:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        return proper(*arguments, **more)

    monkeypatch.setattr(place, failing)
    with pytest.raises(KeyboardInterrupt), journal.keep_journal(tmp_path, "key"):
        WORK[of]()
    assert list(tmp_path.glob("*.part"))
    with journal.keep_journal(tmp_path, "key"):
        assert WORK[of]().identical(expected)


@pytest.mark.usefixtures("often")
def test_what_is_left_of_a_member_is_not_used_when_a_bit_of_it_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cores, "count_cores", lambda: 1)
    with journal.keep_journal(tmp_path, "key"):
        WORK["ensemble"]()
    parts = sorted(tmp_path.glob("*.part"))
    assert len(parts) == 4
    for path in parts:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
    with journal.keep_journal(tmp_path, "key") as kept:
        assert all(kept.find(path.name.split(".")[1]) is None for path in parts)
        assert WORK["ensemble"]().identical(whole("ensemble"))


@pytest.mark.usefixtures("often")
def test_a_run_that_is_asked_to_stop_leaves_what_there_is_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = smooth({"integrator": "dop853"})
    whole = dynamics.simulate(scene, {}, silent)
    monkeypatch.setattr(stopping, "_why", "")

    def progress(fraction: float | None, text: str) -> None:
        if fraction is not None and fraction > 0.3:
            stopping.request_stop("the time is over")

    with pytest.raises(StoppedError) as caught:
        dynamics.simulate(scene, {}, progress)
    monkeypatch.setattr(stopping, "_why", "")
    assert caught.value.exit_code == 4
    assert caught.value.partial is not None
    left = caught.value.partial.to_xarray()
    assert left.attrs["complete"] == 0
    assert left.attrs["stopped_at"] == left.time[-1] < whole.time[-1]
    assert left.position.identical(whole.position[: left.sizes["time"]])
    with pytest.raises(InputError, match=r"not complete: it was stopped at t = 0\.\d+ s \(the time is over\)"):
        derive(left)
    with pytest.raises(InputError, match="not complete"):
        comparison.assemble({"whole": whole, "left": left}, {}, [])


def test_what_a_part_of_the_work_leaves_is_not_taken_for_what_there_is_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of an ensemble that is stopped: the motion of a member, which is no dataset."""

    def stopped(*arguments: Any) -> None:
        raise StoppedError("the time is over")

    monkeypatch.setattr(schedule, "execute", stopped)
    task = Task("ensemble", "bounce", "nothing:run", {}, "runs/bounce")
    failed = schedule.attempt_task(task, {}, Store(tmp_path), Sources(tmp_path), silent)
    assert isinstance(failed, schedule.Failure)
    assert failed.exit_code == 4
    assert failed.message == ("bounce ensemble: the time is over; run it again: finished parts are not computed again")
    assert not list(tmp_path.iterdir())


def test_work_on_another_processor_is_not_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its numbers differ in their last bits."""
    engine = engine_with(smooth({"integrator": "dop853"}))
    here = pieces.digest(engine)
    assert pieces.digest(engine) == here
    monkeypatch.setattr(pieces, "processor", lambda: "another")
    assert pieces.digest(engine) != here
