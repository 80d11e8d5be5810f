"""Python in processes of its own, and copies of the sources that are to be edited."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from flexclear.workflow.fingerprint import TREE, Sources

ROOT = Path(__file__).parent.parent
#: folders of the program and of what stands on it
PACKAGES = ("pipeline", "papers", "stages")


def python(
    *arguments: str | Path, cwd: Path = ROOT, succeeds: bool = True, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, with the sources there; unless it may fail, raise an error with its messages where it
    fails."""
    command, own = [sys.executable, *map(str, arguments)], {"PYTHONPATH": str(cwd / "pipeline")}
    environment = os.environ | own | environment
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert not succeeds or done.returncode == 0, done.stderr[-2000:]
    return done


def printed(code: str, *arguments: str | Path, **options: str) -> str:
    """What code prints in a process of its own."""
    return python("-c", code, *arguments, **options).stdout


def copied(folder: Path, *more: str) -> Path:
    """A folder with a copy of the program's sources, and of more folders of the project.

    Its results begin with the digest of each source: to parse all of them takes longer than most of what is tested.
    """
    for name in (*PACKAGES, *more):
        ignored = shutil.ignore_patterns("*.pyc.*")  # half written
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    memo = folder / "results" / "cache" / "code.json"
    memo.parent.mkdir(parents=True)
    memo.write_bytes(_digests())
    return folder


@cache
def _digests() -> bytes:
    """The memo of digests of all packages, as commands leave it."""
    with TemporaryDirectory() as folder:
        memo = Path(folder) / "code.json"
        Sources(TREE, memo).code(["flexclear", "papers"])
        return memo.read_bytes()
