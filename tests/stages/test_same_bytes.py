"""Equal inputs give equal bytes, whoever loaded NumPy first and with however many threads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

FIRST = """
import numpy, scipy.linalg
from flexclear.stages.run import graphs, workplace
(graph,) = graphs(["checks/clamped_rod"])
done = workplace().bring(list(graph.bundle.values()), jobs=1)
print(*(done.records[id(task)].digest for task in graph.bundle.values()))
"""


def digest(root: Path, folder: Path, threads: int) -> str:
    done = subprocess.run(
        [sys.executable, "-c", FIRST],
        cwd=root,
        env={**os.environ, "FLEXCLEAR_RESULTS": str(folder), "OPENBLAS_NUM_THREADS": str(threads)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_threads_of_a_numpy_that_was_loaded_before_change_no_byte(root: Path, tmp_path: Path) -> None:
    """Two threads add up products of matrices in another order than one."""
    assert digest(root, tmp_path / "one", 1) == digest(root, tmp_path / "two", 2)
