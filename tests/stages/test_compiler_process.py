"""Generated files are compiled here and by a second process; whatever becomes of that one, all are there."""

from __future__ import annotations

import ctypes
import multiprocessing
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from flexclear.artifacts.paths import kernel_root
from flexclear.artifacts.store import Store
from flexclear.dynamics.compile import compiler_process, folder, functions
from flexclear.dynamics.compile.files import file_lock, is_compiled, load_file, load_files, loaded
from flexclear.workflow import cores, schedule
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.progress import Monitor
from flexclear.workflow.task import Task
from tests.stages.conftest import PATIENCE

SOURCE = """from numba import cfunc

from flexclear.dynamics.compile.files import compiles


@compiles(cfunc("int64(int64)"))
def add(x):
    return x + {k}
"""
#: holds the lock of a file, says so, and stays
HOLDER = """import sys, time
from pathlib import Path
from flexclear.dynamics.compile.files import file_lock
with file_lock(Path(sys.argv[1]), wait=True):
    print("held", flush=True)
    time.sleep(600.0)
"""


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Three small files, named apart from those of every other test since modules stay."""
    found = [tmp_path / f"generated_{tmp_path.name}_{k}.py" for k in range(3)]
    for k, path in enumerate(found):
        path.write_text(SOURCE.format(k=k))
    return found


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever machine this is."""
    monkeypatch.setattr(cores, "count_cores", lambda: 2)
    monkeypatch.setattr(cores, "_others_idle", None)


def nothing(path: Path) -> None:
    raise AssertionError(f"{path} was to be compiled elsewhere")


def results(files: list[Path]) -> list[int]:
    add = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)
    return [add(loaded[path.stem].address)(10) for path in files]


def test_what_a_thread_has_loaded_stays_where_it_is_when_another_loads_it_too(files: list[Path]) -> None:
    """It may be running; a run and its twin that are both handed over fetch the same."""
    load_files(files[:1], lambda _: None)
    first = loaded[files[0].stem]
    assert load_file(files[0], nothing)
    assert loaded[files[0].stem] is first


def test_a_second_process_leaves_the_code_on_disk(files: list[Path]) -> None:
    with compiler_process.second_process(files) as process:
        assert process is not None
        assert process.wait(timeout=PATIENCE) == 0
        assert all(is_compiled(path) for path in files)
        load_files(files, nothing)
    assert results(files) == [10, 11, 12]


def test_what_a_second_process_is_compiling_is_left_to_it(files: list[Path], root: Path) -> None:
    """And when it dies over it, or is killed, compiled here after all, last."""
    with held(files[0], root) as holder:
        assert not load_file(files[0], nothing)
        reported: list[Path] = []

        def tell(path: Path) -> None:
            reported.append(path)
            if path == files[0]:
                threading.Timer(0.2, holder.kill).start()

        load_files(files, tell)
    assert reported == [files[1], files[2], files[0]]
    assert results(files) == [10, 11, 12]


@contextmanager
def held(path: Path, root: Path) -> Iterator[subprocess.Popen[str]]:
    """Meanwhile another process is at a file, until it is killed."""
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], cwd=root, stdout=subprocess.PIPE, text=True) as at:
        assert at.stdout is not None
        assert at.stdout.readline() == "held\n"
        try:
            yield at
        finally:
            at.kill()


@pytest.mark.parametrize("command", ["raise SystemExit(1)", "import os; os.abort()"])
def test_a_second_process_that_fails_is_not_missed(
    files: list[Path], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setattr(compiler_process, "COMMAND", command)
    reported: list[Path] = []
    with compiler_process.second_process(files) as process:
        assert process is not None
        assert process.wait(timeout=PATIENCE) != 0
        load_files(files, reported.append)
    assert reported == files
    assert results(files) == [10, 11, 12]


def test_one_file_one_core_or_no_process_to_be_had_need_no_second_process(
    files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    with compiler_process.second_process(files[:1]) as process:
        assert process is None
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", str(files[0].parent / "not there"))
        with compiler_process.second_process(files) as process:
            assert process is None
    monkeypatch.setattr(cores, "count_cores", lambda: 1)
    assert not compiler_process.is_useful()


def test_an_interrupt_ends_the_second_process(files: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler_process, "COMMAND", "import time; time.sleep(600.0)")
    with pytest.raises(KeyboardInterrupt), compiler_process.second_process(files) as process:
        raise KeyboardInterrupt
    assert process is not None
    assert process.returncode is not None  # waited for, too: no zombie


def test_a_second_process_ends_with_its_parent(files: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where that was killed and could say nothing: its end of the pipe is closed then."""
    start = compiler_process.COMMAND.replace(
        "import work\nwork(sys.argv[2:])", "import _follow_parent\n_follow_parent()"
    )
    monkeypatch.setattr(compiler_process, "COMMAND", start)
    with compiler_process.second_process(files) as process:
        assert process is not None
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(timeout=PATIENCE) == 1


def test_there_is_one_second_process_for_a_folder(files: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler_process, "COMMAND", "import time; time.sleep(600.0)")
    with compiler_process.second_process(files) as first, compiler_process.second_process(files) as second:
        assert first is not None
        assert second is None
    with compiler_process.second_process(files) as third:
        assert third is not None


def test_workers_have_no_second_process() -> None:
    """Each core has a worker already, unless theirs is the only task that can run."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert not pool.submit(compiler_process.is_useful).result()
    assert compiler_process.is_useful()
    cores.set_idle(others_idle=False)
    assert not compiler_process.is_useful()
    cores.set_idle(others_idle=True)
    assert compiler_process.is_useful()


@pytest.mark.parametrize("scenes, idle", [(["tiny/stays"], True), (["tiny/stays", "tiny/contact"], False)])
def test_a_task_hears_whether_it_is_the_only_one(tmp_path: Path, root: Path, scenes: list[str], idle: bool) -> None:
    tasks = [Task("simulate", name, "flexclear.stages.simulation:run", {"scene": name}, "") for name in scenes]
    heard: list[bool] = []

    class Pool:
        def submit(self, *given: object) -> Future[None]:
            heard.append(bool(given[-1]))
            return Future()

    plan, common = schedule._Plan(tasks, tuple(tasks)), (Store(tmp_path), Sources(root / "pipeline"), Monitor())
    schedule._submit(plan, {}, Pool(), 4, *common)  # type: ignore[arg-type]
    assert heard == [idle] * len(scenes)


def test_code_that_cannot_be_stored_is_compiled_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("FLEXCLEAR_KERNELS", str(tmp_path / "file" / "kernels"))
    reported: list[str] = []
    path = functions._file(folder.writable(kernel_root(), reported.append), "test", SOURCE.format(k=3))
    assert "cannot be stored" in reported[0]
    with file_lock(path, wait=True):
        assert not load_file(path, nothing)
    assert load_file(path, lambda _: None)
    assert results([path]) == [13]
