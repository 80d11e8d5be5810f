"""Workers are started once for a command, and end with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from flexclear.artifacts.paths import TREE
from flexclear.artifacts.store import Store
from flexclear.system.errors import ResourceError
from flexclear.workflow import cores, stopping, workers
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.progress import Monitor
from flexclear.workflow.schedule import bring_up_to_date
from flexclear.workflow.task import Task
from tests.processes import python


def one(width: int = 1) -> int:
    """Number of the process that does something for a team of that width."""
    with workers.worker_team(width) as team, workers.report_lost_worker():
        return int(team.pool.submit(os.getpid).result())


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def fail() -> None:
    with pytest.raises(KeyError), workers.worker_team(1):
        raise KeyError


def stop() -> None:
    with stopping.stop_after(-1.0, "time is over"), workers.worker_team(1):
        assert stopping.stop_reason()


def test_a_command_starts_its_workers_once() -> None:
    """Also where a later part of it wants as many as there are cores."""
    with workers.keep_workers():
        first = one()
        assert one(cores.count_cores()) == first
        assert alive(first)
    assert not alive(first)


def test_outside_of_a_command_they_end_with_the_call() -> None:
    assert not alive(one())


@pytest.mark.parametrize("end", [fail, stop])
def test_workers_of_failed_or_stopped_work_are_not_reused(end: Callable[[], None]) -> None:
    with workers.keep_workers():
        first = one()
        end()
        wait_until(lambda: not running(first))
        assert one() != first


def test_what_failed_in_a_worker_is_the_task_that_was_asked_for(tmp_path: Path) -> None:
    """Whoever asks for pictures, and can do without them, looks which of its tasks failed; a worker has copies."""
    # without the run that it is of, it cannot be done
    tasks = [Task("post", scene, "flexclear.stages.derived_series:run", {"of": scene}, "") for scene in ("a", "b")]
    outcome = bring_up_to_date(tasks, Store(tmp_path), Sources(TREE), Monitor(), 2)
    assert {failure.task for failure in outcome.failures} == {task for task in tasks}


BROKEN = """
import sys
from flexclear.commands import __main__, schema
def command(options):
    raise BrokenPipeError(32, "Broken pipe")
if sys.argv[1] == "helper":
    schema.run_command = command
sys.exit(__main__.main(["schema"]))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems do not say who reads")
@pytest.mark.parametrize("whose, code, words", [("helper", 4, "a helper process was killed"), ("reader", 141, "")])
def test_a_broken_pipe_is_that_of_the_output_or_of_a_helper(root: Path, whose: str, code: int, words: str) -> None:
    """A helper that was killed while it started ended commands with exit code 141, without a word."""
    command = [sys.executable, "-c", BROKEN, whose]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=root, **pipes) as process:
        if whose == "reader":
            process.stdout.close()
        said = process.stderr.read()
        assert process.wait() == code
    assert words in said
    assert "Traceback" not in said


UNGUARDED = """
from flexclear.stages.workplace import open_workplace
from flexclear.workflow.task import Task
tasks = [Task("post", scene, "flexclear.stages.derived_series:run", {"of": scene}, "") for scene in "ab"]
open_workplace().bring(tasks, 2)
"""


def test_a_script_without_a_guard_is_told_to_have_one(root: Path, tmp_path: Path) -> None:
    """Python runs it again in each process that it starts; each of these calls refuses to start more."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED, encoding="utf-8")
    own = {"PYTHONPATH": str(root / "pipeline"), "FLEXCLEAR_RESULTS": str(tmp_path / "results")}
    done = python(script, cwd=tmp_path, succeeds=False, **own)
    assert done.returncode == 1
    assert "put its calls below `if __name__ == '__main__':`" in done.stderr
    assert "does the calling script lack `if __name__ == '__main__':`?" in done.stderr


def test_a_worker_that_is_killed_between_two_calls_is_one_sentence() -> None:
    """As by the system where memory is full; before, a traceback or an end without a word."""
    with workers.keep_workers():
        worker = one()
        os.kill(worker, signal.SIGKILL)
        wait_until(lambda: not running(worker))
        with pytest.raises(ResourceError, match="a helper process was killed"), workers.report_lost_worker():
            often()
    assert one() != worker


def often() -> None:
    """The pool notices a moment later that a worker is gone."""
    for _ in range(100):
        one()
        time.sleep(0.05)


def running(process: int) -> bool:
    """Whether it is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)


def chatty(count: int) -> int:
    """More reports than a pipe holds."""
    for k in range(count):
        workers.report("task", k / count, "x" * 100)
    return count


def stopped_reason(_: int) -> str:
    """Why a worker is to stop, once it is."""
    end = time.monotonic() + 60.0
    while not stopping.stop_reason() and time.monotonic() < end:
        time.sleep(0.01)
    return stopping.stop_reason()


def test_a_stop_reaches_workers_to_which_sigterm_was_sent_and_does_not_wait_for_killed_ones() -> None:
    """As `timeout` and services send it, to all processes of a command."""
    with workers.worker_team(2) as team, workers.report_lost_worker():
        futures = [team.pool.submit(stopped_reason, k) for k in range(2)]
        busy = list(team.pool._processes)
        while any(not future.running() for future in futures):
            time.sleep(0.01)
        time.sleep(3.0)  # workers import this module
        for process in busy:
            os.kill(process, signal.SIGTERM)
        team.channel.request_stop("enough")
        assert [future.result(60.0) for future in futures] == ["enough"] * 2
    with workers.worker_team(1) as team:
        killed = team.pool.submit(os.getpid).result()
        os.kill(killed, signal.SIGKILL)
        while alive(killed):
            time.sleep(0.01)
        requesting = threading.Thread(target=team.channel.request_stop, args=("enough",), daemon=True)
        requesting.start()
        requesting.join(60.0)
        assert not requesting.is_alive()


def test_many_reports_arrive_in_their_order() -> None:
    """Whoever writes waits while the queue is full, and goes on when the parent reads."""
    with workers.worker_team(1) as team:
        future, news = team.pool.submit(chatty, 3000), []
        while not future.done() or not team.channel.reports.empty():
            news += team.channel.take_reports()
        assert future.result() == len(news) == 3000
    assert [fraction for _, fraction, _ in news] == [k / 3000 for k in range(3000)]
