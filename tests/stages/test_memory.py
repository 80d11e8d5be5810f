"""What a process keeps of memory: many runs, as in a notebook, do not make it grow; a command is not given it anew."""

from pathlib import Path

import pytest

from tests.processes import printed

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
