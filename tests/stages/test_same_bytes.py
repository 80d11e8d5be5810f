"""Equal inputs give equal bytes, whoever loaded NumPy first and with however many threads."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.processes import printed, python

FIRST = """
import numpy, scipy.linalg
from flexclear.stages.scenes import graphs, open_workplace
(graph,) = graphs(["checks/clamped_rod"])
done = open_workplace().bring(list(graph.bundle.values()), jobs=1)
print(*(done.records[task].digest for task in graph.bundle.values()))
"""

#: threads that BLAS has in a task: of a NumPy that this program loads, then where somebody has set another number
AFTER = """
from flexclear.system import threads
import numpy
from threadpoolctl import threadpool_info, threadpool_limits
count = lambda: {library["num_threads"] for library in threadpool_info()}
print(count())
threadpool_limits(2)
with threads.limit_to_one():
    print(count())
"""


def digest(folder: Path, threads: int) -> str:
    done = python("-c", FIRST, FLEXCLEAR_RESULTS=str(folder), OPENBLAS_NUM_THREADS=str(threads))
    return done.stdout


def test_threads_of_a_numpy_that_was_loaded_before_change_no_byte(tmp_path: Path) -> None:
    """Two threads add up products of matrices in another order than one."""
    assert digest(tmp_path / "one", 1) == digest(tmp_path / "two", 2)


def test_a_task_has_one_thread_whoever_has_set_more() -> None:
    assert printed(AFTER, OPENBLAS_NUM_THREADS="2").splitlines() == ["{1}", "{1}"]


REFERENCES = """
import flexclear as fc
from flexclear.dynamics.effects.citations import references
print(references(fc.load_scene("scenes/checks/bounce.toml")))
"""


def test_python_without_docstrings_gives_the_same_references() -> None:
    """`PYTHONOPTIMIZE=2` strips docstrings; runs had no references then, under the same key."""
    said = [python(*options, "-c", REFERENCES).stdout for options in ([], ["-OO"])]
    assert "Lankarani" in said[0]
    assert said[0] == said[1]


# What a process keeps of memory: many runs do not make it grow; a command is not given it anew ------------------------


#: by how much the memory of the process grows [bytes], once it has all that it keeps
RUNS = """import os, sys
import flexclear as fc

def pages():
    return int(open("/proc/self/statm").read().split()[1])

for k in range(200):
    fc.run(fc.load_scene("scenes/checks/bounce.toml", override={"output.interval": f"{1000 + k} us"}))
    if k == 49:
        before = pages()
print((pages() - before) * os.sysconf("SC_PAGE_SIZE"))
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not tell a process's memory so")
def test_two_hundred_runs_take_no_more_memory_than_fifty(tmp_path: Path) -> None:
    """A dataset of such a run has 0.5 MB; to keep one of each run would be 75 MB. Measured: 2 MB."""
    assert int(printed(RUNS, FLEXCLEAR_RESULTS=str(tmp_path))) < 25e6


def test_a_command_looks_for_no_garbage_at_its_end() -> None:
    """Handlers of the end are called last first: this one after the command's own, which sets all objects aside."""
    code = (
        "import atexit, gc; atexit.register(lambda: print(gc.get_freeze_count())); import flexclear.commands.__main__"
    )
    reported = (
        f"{code}; flexclear.commands.__main__.main()"  # ends when it has said the version, and has set nothing aside
    )
    assert int(printed(reported, "--version").split()[-1]) > 1000  # objects; there are tens of thousands
    # in somebody else's process nothing is changed
    assert int(printed(code)) == 0
