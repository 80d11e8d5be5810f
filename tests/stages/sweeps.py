"""Sweeps of a pendulum's length, run by the command in a process of its own."""

import os
import subprocess
import sys
import time
from pathlib import Path

from tests.stages.conftest import PATIENCE, interruptible

PENDULUM = """
scene = "checks/pendulum"
keep = ["bob.velocity.largest", "bob.position.final"]
set = { "time.end" = "0.5 s" }
vary."body.bob.com.0" = { from = "-0.5 m", to = "-2 m", count = COUNT }
"""


def pendulum(folder: Path, count: int, name: str = "lengths") -> Path:
    """A sweep file over the length of the pendulum."""
    path = folder / f"{name}.toml"
    path.write_text(PENDULUM.replace("COUNT", str(count)))
    return path


def flexclear(*arguments: str, cwd: Path, results: Path) -> subprocess.Popen[str]:
    """The command in a process of its own."""
    environment = os.environ | {"FLEXCLEAR_RESULTS": str(results), "PYTHONPATH": str(cwd / "pipeline")}
    command = [sys.executable, "-m", "flexclear", *arguments]
    return subprocess.Popen(
        command,
        cwd=cwd,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=interruptible,
    )


def begun(process: subprocess.Popen[str], results: Path) -> None:
    """Wait until a batch is in the store."""
    end = time.monotonic() + PATIENCE
    while not list((results / "cache" / "sweep").glob("*/*.json")):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < end
        time.sleep(0.02)
