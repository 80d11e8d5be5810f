"""A run and its perturbed run are stepped concurrently where a processor is free, with the same results as in turn."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.artifacts import quantities
from flexclear.artifacts.quantities import LASTING
from flexclear.dynamics.run import progress_rate, trajectory
from flexclear.dynamics.run import run as integration
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon import horizon
from flexclear.dynamics.run.horizon.horizon import Pair, PerturbedRun
from flexclear.dynamics.run.progress_rate import DearError, affordable
from flexclear.dynamics.run.run import engine_of, follow
from flexclear.dynamics.run.trajectory import Followed, Stop
from flexclear.dynamics.single_run import SingleRun
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError, StoppedError
from flexclear.system.progress import Progress, silent
from flexclear.workflow import cores, stopping
from tests.analytic.mechanism_runs import TREE

#: nobody waits longer for a thread that does what it should [s]
PATIENCE = 60.0


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> None:
    processors(monkeypatch, 2)


@pytest.fixture
def parting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Motions diverge before half of the slider-crank's run is over, and are compared some hundred times."""
    for name in ("SEPARATED", "DIVERGED"):
        monkeypatch.setattr(quantities, name, 1e-6)
    monkeypatch.setattr(horizon, "SEPARATED", 1e-6)
    monkeypatch.setattr(trajectory, "SLICE", 100)


def processors(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr(cores, "count_cores", lambda: count)
    monkeypatch.setattr(cores, "_others_idle", True)


def check(name: str, **changes: Any) -> Scene:
    return edited(load_scene(TREE / "scenes" / "checks" / f"{name}.toml"), changes)


def alone(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> xr.Dataset:
    """The run whose twin comes after it."""
    processors(monkeypatch, 1)
    found = dynamics.simulate(scene, {}, silent)
    processors(monkeypatch, 2)
    return found


def test_without_a_horizon_the_run_is_integrated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same run to the last bit, without what only the perturbed run gives."""
    whole = alone(check("bounce", **{"output.interval": 0.05}), monkeypatch)
    monkeypatch.setattr(Pair, "perturbed_run", lambda *_: pytest.fail("a second run"))
    once = dynamics.simulate(check("bounce", **{"output.interval": 0.05, "output.horizon": False}), {}, silent)
    dropped = {"horizon", "separation", "separation_time"}
    assert set(whole.variables) - set(once.variables) == dropped
    assert once.equals(whole.drop_vars(dropped))


@pytest.mark.usefixtures("parting")
@pytest.mark.parametrize("ends", [(0.2,), (0.1, 0.4), (2.0,)])
def test_a_run_that_is_looked_at_on_its_way_is_the_same(ends: tuple[float, ...]) -> None:
    """To the last bit, whether it pauses or not; what is seen on the way is its beginning."""
    scene = check("clearance_slider_crank")
    at_once = dynamics.simulate(scene, {}, silent)
    parts, span = SingleRun(scene, {}, silent), scene.time.end - scene.time.start
    for end in ends:
        seen = parts.until(scene.time.start + end * span).to_xarray()
        assert "horizon" not in seen
        assert (float(seen["time"][-1]) < scene.time.end) is (end < 1.0)
        assert float(seen["time"][-1]) >= scene.time.start + min(end, 1.0) * span
        xr.testing.assert_equal(seen["position"], at_once["position"].isel(time=slice(seen.sizes["time"])))
    xr.testing.assert_identical(parts.whole().to_xarray(), at_once)


def test_a_run_with_the_engine_of_another_tolerance_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, and without an engine made anew."""
    loose, tight = (check("clearance_slider_crank", **{"solver.rtol": rtol, "time.end": 0.02}) for rtol in (1e-4, 1e-6))
    before, alone = SingleRun(loose, {}, silent), SingleRun(tight, {}, silent).whole()
    before.whole()
    monkeypatch.setattr(integration, "prepare", lambda *_: pytest.fail("an engine made anew"))
    again = SingleRun(tight, {}, silent, known=before.engine).whole()
    xr.testing.assert_identical(again.to_xarray(), alone.to_xarray())


@pytest.mark.usefixtures("parting", "two")
def test_the_twin_of_a_run_that_is_given_up_does_not_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Too dear a run is noticed after its trial."""
    monkeypatch.setattr(progress_rate, "AFFORDABLE", 500)
    monkeypatch.setattr(progress_rate, "EARLIEST", 200)
    begun = list[str]()
    monkeypatch.setattr(horizon, "moved_start", lambda *_: begun.append("twin"))
    scene = check("clearance_slider_crank", **{"solver.by_need": True})
    with pytest.raises(DearError):
        SingleRun(scene, {}, silent, affordable(scene)).whole()
    assert not begun


@pytest.mark.usefixtures("parting")
def test_whichever_is_ahead_the_bits_are_those_of_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody, the run, and the twin."""
    scene = check("clearance_slider_crank")
    expected = alone(scene, monkeypatch)
    assert float(expected.horizon) < 0.5 * scene.time.end
    hear, enough = Pair.store_rows, Pair._enough

    def late_run(self: Pair, rows: np.ndarray) -> bool:
        time.sleep(3e-3)  # the twin takes a tenth of that between two looks
        return hear(self, rows)

    def late_twin(self: Pair, twin: Any, alive: Progress) -> bool:
        assert self._ended.wait(PATIENCE)
        return enough(self, twin, alive)

    for late in ({}, {"_enough": late_twin}, {"store_rows": late_run}):
        with monkeypatch.context() as patch:
            for name, slow in late.items():
                patch.setattr(Pair, name, slow)
            assert dynamics.simulate(scene, {}, silent).identical(expected)


@pytest.mark.usefixtures("parting", "two")
def test_a_perturbed_run_that_has_separated_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even where it is ahead of the run, whose largest velocity tells what is visible: then it waits."""
    rows: list[float] = []
    enough = Pair._enough

    def noted(self: Pair, twin: Any, alive: Progress) -> bool:
        rows.append(float(twin.rows[-1, 0]))
        return enough(self, twin, alive)

    monkeypatch.setattr(Pair, "_enough", noted)
    scene = check("clearance_slider_crank")
    run = dynamics.simulate(scene, {}, silent)
    end, shown = float(run.horizon), run.separation_time.values
    assert 0.0 < end < rows[-1] < 0.8 * scene.time.end
    # the record of it ends where the separation has lasted, wherever the perturbed run was stopped
    assert shown[-1] <= end + 1.2 * LASTING * scene.time.end
    assert np.all(np.diff(shown) > 0.0)
    assert np.all(run.separation.values[shown >= end] > quantities.SEPARATED)


@pytest.mark.usefixtures("two")
def test_a_run_and_its_twin_that_are_both_handed_over_are_the_same_side_by_side(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A rolling ball: dop853 hands over to radau at 1000 evaluations, in a contact.  Only one thread tells of it."""
    monkeypatch.setattr(progress_rate, "TRIAL", 1000)
    monkeypatch.setattr(progress_rate, "HOPELESS", 1100)
    monkeypatch.setattr(trajectory, "SLICE", 100)
    scene, reported = check("socket_rolling", **{"time.end": 3e-3}), set[int]()
    expected = alone(scene, monkeypatch)
    assert expected.attrs["method"] == "radau"
    found = dynamics.simulate(scene, {}, lambda fraction, text: reported.add(threading.get_ident()))
    assert found.identical(expected)
    assert reported == {threading.get_ident()}


def test_of_a_twin_that_cannot_be_run_the_run_is_believed_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: Any) -> np.ndarray:
        raise SolverError("no neighbour")

    scene = check("bounce")
    expected = alone(scene, monkeypatch)
    monkeypatch.setattr(horizon, "perturbed_start", refused)
    for count in (1, 2):
        processors(monkeypatch, count)
        found = dynamics.simulate(scene, {}, silent)
        assert (float(found.horizon), found.sizes["separation_time"]) == (scene.time.start, 1)
        assert found.position.identical(expected.position)


@pytest.mark.usefixtures("parting")
def test_a_perturbed_run_that_fails_after_its_separation_gives_the_same_horizon() -> None:
    """However far it was followed: next to a slower run it may come to where it fails, after the run it does not."""
    engine = engine_of(check("clearance_slider_crank"), {}, silent)
    start = consistent_start(engine)

    def twin(until: float) -> PerturbedRun:
        def steps(mine: Engine, y: np.ndarray, stop: Stop, outputs: np.ndarray) -> Followed:
            def failing(rows: np.ndarray) -> bool:
                enough = stop(rows)
                if rows[-1, 0] > until:
                    raise SolverError("it gives up")
                return enough and until > engine.end  # as if the run were not there yet

            return follow(mine, y, silent, lambda name: mine, None, failing, outputs)

        pair = Pair(engine)
        pair.run(lambda *reported: follow(engine, start, silent, lambda name: engine, None, *reported))
        return pair.perturbed_run(start, steps, silent)

    whole = twin(2.0 * engine.end)
    late, early = twin(whole.time[-1] + 0.2 * engine.end), twin(0.5 * whole.horizon)
    assert late.horizon == whole.horizon > engine.start
    assert np.array_equal(late.separation, whole.separation)
    assert (early.horizon, len(early.time)) == (engine.start, 1)


@pytest.mark.usefixtures("two")
def test_a_run_that_fails_does_not_wait_for_its_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both would take minutes."""
    monkeypatch.setattr(trajectory, "SLICE", 100)
    calls, threads, began = 0, threading.active_count(), time.monotonic()

    def progress(fraction: float | None, text: str) -> None:
        nonlocal calls
        calls += 1
        if calls > 20:
            raise SolverError("the run gives up")

    with pytest.raises(SolverError, match="the run gives up"):
        dynamics.simulate(check("socket_swing", **{"time.end": 100.0}), {}, progress)
    assert threading.active_count() == threads
    assert time.monotonic() - began < PATIENCE


@pytest.mark.usefixtures("two")
def test_a_twin_does_not_wait_for_a_run_that_never_began() -> None:
    """Ctrl-C may come at any moment, also when the thread is there and the run is not."""
    engine = engine_of(check("bounce"), {}, silent)
    pair, start, began = Pair(engine), consistent_start(engine), time.monotonic()
    came = threading.Event()

    def steps(mine: Engine, y: np.ndarray, stop: Stop, outputs: np.ndarray) -> Followed:
        came.set()
        raise SolverError("its end")

    def interrupted() -> None:
        with cores.run_in_thread(lambda alive: pair.perturbed_run(start, steps, alive)):
            assert came.wait(PATIENCE)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < PATIENCE


@pytest.mark.usefixtures("two")
def test_where_no_thread_is_to_be_had_the_work_is_done_when_its_result_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", none)
    with cores.run_in_thread(lambda alive: threading.get_ident()) as result:
        assert result() == threading.get_ident()


@pytest.mark.parametrize("stopped", ["run", "twin"])
def test_both_are_stopped_in_good_order(stopped: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked to stop while the run goes on, or its twin alone: what there is of the run is returned."""
    monkeypatch.setattr(trajectory, "SLICE", 100)
    monkeypatch.setattr(stopping, "_why", "")
    scene = check("bounce", **{"output.interval": 0.05})
    whole = alone(scene, monkeypatch)

    def progress(fraction: float | None, text: str) -> None:
        if fraction is not None and fraction > 0.3 and stopped == "run":
            stopping.request_stop("the time is over")

    def late_twin(self: Pair, twin: Any, alive: Progress) -> bool:
        assert self._ended.wait(PATIENCE)
        stopping.request_stop("the time is over")
        return False

    with monkeypatch.context() as patch:
        if stopped == "twin":
            patch.setattr(Pair, "_enough", late_twin)
        with pytest.raises(StoppedError) as caught:
            dynamics.simulate(scene, {}, progress)
    stopping._why = ""
    assert caught.value.partial is not None
    left = caught.value.partial.to_xarray()
    assert left.attrs["complete"] == 0
    assert left.position.identical(whole.position[: left.sizes["time"]])
    assert (left.sizes["time"] == whole.sizes["time"]) is (stopped == "twin")


def test_rows_for_comparisons_alone_are_not_in_the_dataset() -> None:
    """Ten outputs in the whole run, and comparisons between them."""
    scene = check("bounce", **{"output.interval": 0.1})
    engine = engine_of(scene, {}, silent)
    run, pair = dynamics.simulate(scene, {}, silent), Pair(engine)
    assert run.sizes["separation_time"] >= len(pair.added) >= 0.9 * horizon.SAMPLES
    assert not np.isin(run.time.values, pair.added).any()
    assert np.isin(engine.output_times(0.1), run.time.values).all()


def test_concurrent_work_ends_with_its_block(monkeypatch: pytest.MonkeyPatch) -> None:
    processors(monkeypatch, 2)
    ended = threading.Event()

    def work(alive: Progress) -> None:
        try:
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until:
                alive(None, "")
        finally:
            ended.set()

    began = time.monotonic()
    with pytest.raises(KeyError), cores.run_in_thread(work):
        raise KeyError
    assert ended.is_set()
    assert time.monotonic() - began < 0.5 * PATIENCE


def test_workers_of_another_program_take_no_second_processor() -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert not pool.submit(cores.has_free_processor).result()


@pytest.mark.parametrize("count", [1, 2])
def test_what_concurrent_work_raises_reaches_its_caller(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    processors(monkeypatch, count)

    def work(alive: Progress) -> int:
        raise KeyError("work")

    def threads(alive: Progress) -> int:
        return threading.get_ident()

    with pytest.raises(KeyError, match="work"), cores.run_in_thread(work) as result:
        result()
    with cores.run_in_thread(threads) as result:
        assert (result() == threading.get_ident()) is (count == 1)
