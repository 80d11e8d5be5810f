"""Equal inputs give equal bytes, whoever loaded NumPy first and with however many threads."""

from __future__ import annotations

from pathlib import Path

from tests.processes import printed, python

FIRST = """
import numpy, scipy.linalg
from flexclear.commands.scenes import graphs, open_workplace
(graph,) = graphs(["checks/clamped_rod"])
done = open_workplace().bring(list(graph.bundle.values()), jobs=1)
print(*(done.records[task].digest for task in graph.bundle.values()))
"""

#: threads that BLAS has in a task: of a NumPy that this program loads, then where somebody has set another number
AFTER = """
from flexclear.pipeline.core.system import threads
import numpy
from threadpoolctl import threadpool_info, threadpool_limits
count = lambda: {library["num_threads"] for library in threadpool_info()}
print(count())
threadpool_limits(2)
with threads.one():
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


#: docstrings of a module, a class and a compiled kernel, which become references, titles and meanings of keys
DOCSTRINGS = """
from importlib import import_module
from flexclear.pipeline.core.scene.citations import docstring
places = [("integrate.dop853", ""), ("contact.normal.hertz", ""), ("contact.law", "Hysteresis")]
for module, name in places:
    thing = import_module(f"flexclear.pipeline.dynamics.{module}")
    print(" ".join((docstring(getattr(thing, name) if name else thing) or "").split()))
"""


def test_python_without_docstrings_gives_the_same_references() -> None:
    """`PYTHONOPTIMIZE=2` strips docstrings; runs had no references then, under the same key."""
    said = [python(*options, "-c", DOCSTRINGS).stdout for options in ([], ["-OO"])]
    assert "Source" in said[0]
    assert said[0] == said[1]
