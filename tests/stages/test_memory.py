"""Many runs in one process, as in a notebook, do not make it grow."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
def test_two_hundred_runs_take_no_more_memory_than_fifty(tmp_path: Path, root: Path) -> None:
    """A dataset of such a run has 0.5 MB; to keep one of each run would be 75 MB. Measured: 2 MB."""
    done = subprocess.run(
        [sys.executable, "-c", RUNS],
        cwd=root,
        env={**os.environ, "FLEXCLEAR_RESULTS": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) < 25e6
