"""Who runs the points of a sweep does not matter, nor who dies meanwhile, nor whether all fit into memory."""

import logging
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.artifacts.points import Point
from flexclear.commands.__main__ import main
from flexclear.stages.sweeps import sweep_engine, sweep_large, sweep_plan
from flexclear.stages.workplace import open_workplace
from flexclear.study import sweep
from flexclear.system.errors import InputError, ResourceError
from tests.stages.conftest import PATIENCE, Command
from tests.stages.sweeps import begun, flexclear, pendulum


def test_bytes_are_the_same_whoever_runs_the_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command):
    path = pendulum(tmp_path, 30)
    for count in (1, 2):
        monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / f"results{count}"))
        said = command("sweep", path, f"--jobs={count}", f"--out={tmp_path / f'{count}.nc'}").out
        assert "30 points, 0 refused" in said
    assert (tmp_path / "1.nc").read_bytes() == (tmp_path / "2.nc").read_bytes()


def test_a_killed_sweep_goes_on_with_what_it_has_not(root: Path, tmp_path: Path, fresh: Path, asked: list[str]):
    path = pendulum(tmp_path, 400)
    process = flexclear("sweep", str(path), "--jobs=1", cwd=root, results=fresh)
    begun(process, fresh)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    plan = sweep_plan.prepare(sweep_plan.plan(*sweep.read(path), str(path)), open_workplace())
    stored = {key for family in plan.families for key in family.find(open_workplace().store, plan.recorded)}
    assert main(["sweep", str(path), "--jobs=1"]) == 0
    assert stored
    assert set(asked) == {job.key for job in plan.jobs} - stored
    assert len(asked) < 400
    asked.clear()
    assert main(["sweep", str(path), "--jobs=1"]) == 0
    assert asked == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_sweep_leaves_what_is_finished_and_says_so(root: Path, tmp_path: Path, number: signal.Signals):
    """SIGTERM too, as of a cluster's scheduler: it used to end the command with leaked semaphores of its workers."""
    results = tmp_path / "results"
    process = flexclear("sweep", str(pendulum(tmp_path, 20_000)), "--jobs=2", cwd=root, results=results)
    begun(process, results)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, err
    assert "leaked" not in err
    with xr.open_dataset(results / "sweeps" / "lengths" / "sweep.nc") as left:
        assert left.attrs["complete"] == 0
        done = left["status"].values == 0
        assert 0 < done.sum() < 20_000
        assert (left["status"].values[~done] == 2).all()
        assert np.isfinite(left["bob.velocity.largest"].values[done]).all()
        assert np.isnan(left["bob.velocity.largest"].values[~done]).all()


def test_an_absent_scheduler_is_refused_in_words(tmp_path: Path, fresh: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["sweep", str(pendulum(tmp_path, 2)), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    said = capsys.readouterr().err
    assert "--scheduler tcp://127.0.0.1:9" in said
    assert "not installed" in said or "no scheduler answers" in said


class Mortal:
    """Stands for a pool of two processes that dies at its third and fourth task, or at all from the third one on."""

    def __init__(self, recovers: bool) -> None:
        self.recovers, self.given, self.renewed = recovers, 0, 0

    def submit(self, family: str, packed: bytes, points: list[dict[str, Any]], *_: Any) -> Future[Any]:
        self.given += 1
        future: Future[Any] = Future()
        if self.given in (3, 4) or (self.given > 4 and not self.recovers):
            future.set_exception(BrokenProcessPool())
        else:
            future.set_result(([Point({}, {}, {}, point["n"]) for point in points], 0.1 * len(points)))
        return future

    def renew(self) -> None:
        self.renewed += 1

    def run(self, reported: list[int]) -> None:
        jobs = [sweep_engine.Job(str(n), "family", {"n": n}) for n in range(40)]
        engine = sweep_engine.Engine(self.submit, lambda: 2, renew=self.renew)
        engine.run(jobs, {"family": b""}, lambda found, _: reported.extend(point.evaluations for _, point in found))


def test_points_that_are_lost_with_a_process_are_run_again():
    reported, pool = list[int](), Mortal(recovers=True)
    pool.run(reported)
    assert sorted(reported) == list(range(40))
    assert pool.renewed == 1


def test_a_process_that_dies_while_it_starts_is_renewed_as_well():
    """What was to be written to it is a broken pipe then, not a broken pool."""
    reported, pool = list[int](), Mortal(recovers=True)
    pool.given = 4  # its own deaths are over
    submit, refused = pool.submit, [BrokenPipeError(32, "Broken pipe")]

    def broken_once(*given: Any) -> Future[Any]:
        if pool.given == 6 and refused:
            raise refused.pop()
        return submit(*given)

    pool.submit = broken_once  # type: ignore[method-assign]
    pool.run(reported)
    assert sorted(reported) == list(range(40))
    assert pool.renewed == 1
    assert not refused


def test_processes_that_keep_dying_end_the_sweep_in_words():
    reported, pool = list[int](), Mortal(recovers=False)
    with pytest.raises(ResourceError, match="memory full"):
        pool.run(reported)
    assert reported
    assert pool.renewed == sweep_engine.MOST_LOSSES


def test_two_workers_finish_together():
    """Of batches as they are given out, each to the worker that is free first, one worker has hardly more than half.

    80 points of 36 ms are a sweep of three seconds: batches of half a second to its end would leave a worker idle for
    a sixth of the time.
    """
    busy, sizes = [0.0, 0.0], list[int]()

    def submit(family: str, packed: bytes, points: list[dict[str, Any]], *_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        busy[busy.index(min(busy))] += 0.036 * len(points)
        sizes.append(len(points))
        future.set_result(([Point({}, {}, {}, 0) for _ in points], 0.036 * len(points)))
        return future

    jobs = [sweep_engine.Job(str(n), "family", {}) for n in range(80)]
    sweep_engine.Engine(submit, lambda: 2).run(jobs, {"family": b""}, lambda *_: None)
    assert sum(sizes) == 80
    assert sum(busy) / max(busy) >= 1.9  # found 2.00; without the smaller ones at the end 1.86
    assert max(sizes) >= 10


class Cluster:
    """Stands for a client of Dask whose workers answer the opening check, one after the other call of it, as given."""

    def __init__(self, *answers: dict[str, object]) -> None:
        self.answers = list(answers)

    def nthreads(self) -> dict[str, int]:
        return dict.fromkeys(self.answers[0], 2)

    def run(self, *_: object, **__: object) -> dict[str, object]:
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def test_a_worker_that_dies_in_the_opening_check_is_not_one_that_lacks_this_program(monkeypatch: pytest.MonkeyPatch):
    fine = {"tcp://a": sweep_engine.source_digest()}
    assert sweep_engine._threads(Cluster({**fine, "tcp://b": OSError("Address removed.")}, fine), "there") == 2
    with pytest.raises(InputError, match="no workers"):
        sweep_engine._threads(Cluster({"tcp://b": OSError("Address removed.")}, {}), "there")
    with pytest.raises(InputError, match="tcp://b cannot import flexclear"):
        sweep_engine._threads(Cluster({**fine, "tcp://b": ModuleNotFoundError("flexclear")}), "there")
    monkeypatch.setattr(sweep_engine, "SCHEDULER_TIMEOUT", 0.3)
    with pytest.raises(ResourceError, match="tcp://b does not answer"):
        sweep_engine._threads(Cluster({**fine, "tcp://b": OSError("timed out")}), "there")


def test_libraries_of_a_cluster_log_nothing_meanwhile() -> None:
    """A lost scheduler gave 30 lines of traceback before the sentence about it."""
    logger = logging.getLogger("distributed.client")
    logger.setLevel(logging.WARNING)
    with sweep_engine._quiet("distributed"):
        assert not logger.isEnabledFor(logging.CRITICAL)
    assert logger.level == logging.WARNING


def _dask(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    """A scheduler or a worker of Dask on this machine."""
    environment = os.environ | {"PYTHONPATH": str(cwd), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "5"}
    command = [sys.executable, "-m", "dask", *arguments]
    return subprocess.Popen(command, cwd=cwd, env=environment, text=True, stderr=subprocess.DEVNULL)


def test_a_cluster_of_which_a_worker_is_killed_gives_the_same_bytes(root: Path, tmp_path: Path):
    pytest.importorskip("distributed")
    place, path = tmp_path / "scheduler.json", pendulum(tmp_path, 1500)
    target, local = tmp_path / "cluster.nc", tmp_path / "local.nc"
    worker = ("worker", f"--scheduler-file={place}", "--nthreads=1", "--no-nanny", "--no-dashboard")
    scheduler = ("scheduler", "--port=0", "--host=127.0.0.1", f"--scheduler-file={place}", "--no-dashboard")
    others = [_dask(*scheduler, cwd=root)]
    try:
        others += [_dask(*worker, cwd=root), _dask(*worker, cwd=root)]
        address = _address(place)
        arguments = ("sweep", str(path), f"--scheduler={address}", f"--out={target}")
        process = flexclear(*arguments, cwd=root, results=tmp_path / "results")
        begun(process, tmp_path / "results")
        assert process.poll() is None
        others[1].send_signal(signal.SIGKILL)
        others.append(_dask(*worker, cwd=root))
        _, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
    finally:
        for other in others:
            other.kill()
            other.wait()
    alone = flexclear("sweep", str(path), "--jobs=2", f"--out={local}", cwd=root, results=tmp_path / "local")
    _, err = alone.communicate(timeout=PATIENCE)
    assert alone.returncode == 0, err
    assert target.read_bytes() == local.read_bytes()


def _address(place: Path) -> str:
    """Of a scheduler that has two workers."""
    from distributed import Client

    end = time.monotonic() + PATIENCE
    while not place.exists():
        assert time.monotonic() < end
        time.sleep(0.05)
    with Client(scheduler_file=str(place), timeout=PATIENCE, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=PATIENCE)
        return str(client.scheduler.address)


# Datasets that are larger than memory: on disk, in slabs, with the same values --------------------------------------

SWEEP = """
scene = "checks/pendulum"
keep = ["bob.position.series", "bob.velocity.largest"]
set = { "time.end" = "0.5 s"LIMITS }
error = true
combine = "COMBINE"
vary."body.bob.com.0" = ["-0.5 m", "-0.7 m", "-1 m", "-1.6 m", "-2 m"]
vary."solver.evaluations" = [100000, 100, 100001, 100002, 100003]
"""


def _dataset(path: Path, limits: str, combine: str, *arguments: str) -> int:
    path.write_text(SWEEP.replace("LIMITS", f", {limits}" if limits else "").replace("COMBINE", combine))
    return main(["sweep", str(path), "--jobs=1", *arguments])


@pytest.mark.parametrize("combine", ["grid", "list"])
def test_slabs_have_the_values_of_the_whole(
    combine: str, tmp_path: Path, fresh: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    pytest.importorskip("zarr")
    copy = tmp_path / "copy.zarr"
    assert _dataset(tmp_path / "small.toml", "", combine, f"--out={copy}") == 0
    monkeypatch.setattr(sweep_large, "SLAB", 1500)
    monkeypatch.setattr(sweep_large, "BATCHES", 1)
    assert _dataset(tmp_path / "large.toml", '"limits.memory" = "1 kB"', combine) == 0
    assert "sweep.zarr" in capsys.readouterr().out
    place = fresh / "sweeps" / "large" / "sweep.zarr"
    assert not (place.parent / "sweep.nc").exists()
    with xr.open_dataset(fresh / "sweeps" / "small" / "sweep.nc", decode_times=False) as whole:
        for found in (xr.open_zarr(path, chunks=None, consolidated=False) for path in (place, copy)):
            assert found.attrs["complete"] == 1
            for name in ("bob.position.series", "bob.velocity.largest.error", "status", "time", "body.bob.com.0"):
                assert found[name].load().equals(whole[name]), name
            assert found["reason"].values.tolist() == whole["reason"].values.tolist()
    assert _dataset(tmp_path / "large.toml", "", combine) == 0
    assert not place.exists()
    assert (place.parent / "sweep.nc").exists()


def test_what_fits_nowhere_is_refused_before_it_is_run(
    root: Path,
    tmp_path: Path,
    fresh: Path,
    asked: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.setattr(sweep_large, "find_spec", lambda name: None)
    assert _dataset(tmp_path / "large.toml", '"limits.memory" = "1 kB"', "grid") == 4
    assert "flexclear[zarr]" in capsys.readouterr().err
    assert _dataset(tmp_path / "small.toml", "", "grid", f"--out={tmp_path / 'x.zarr'}") == 2
    few = {"limits.memory": "1 kB"}
    with pytest.raises(ResourceError, match="record fewer quantities"):
        fc.sweep(root / "scenes/checks/pendulum.toml", {"body.bob.mass": [1.0, 2.0]}, ["bob.position.series"], set=few)
    monkeypatch.undo()
    assert asked == []
