"""Python in processes of its own, and copies of the sources that are to be edited."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: folders of the program; `flexclear` leads to the others by links
PACKAGES = ("flexclear", "papers", "pipeline", "stages")


def python(
    *arguments: str | Path, cwd: Path = ROOT, succeeds: bool = True, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder; unless told otherwise, fail with its messages where it fails."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, check=False)
    assert not succeeds or done.returncode == 0, done.stderr[-2000:]
    return done


def printed(code: str, *arguments: str | Path, **options: str) -> str:
    """What code prints in a process of its own."""
    return python("-c", code, *arguments, **options).stdout


def copied(folder: Path, *more: str) -> Path:
    """A folder with a copy of the program's sources, and of more folders of the project."""
    for name in (*PACKAGES, *more):
        ignored = shutil.ignore_patterns("*.pyc.*")  # half written
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder
