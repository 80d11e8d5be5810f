"""Python in processes of its own, and copies of the sources that are to be edited."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from flexclear.workflow.fingerprint import Sources

ROOT = Path(__file__).parent.parent
#: folders of the program; `flexclear` leads to the others by links
PACKAGES = ("flexclear", "papers", "pipeline", "stages")


def python(
    *arguments: str | Path, cwd: Path = ROOT, succeeds: bool = True, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder; unless it may fail, raise an error with its messages where it fails."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, check=False)
    assert not succeeds or done.returncode == 0, done.stderr[-2000:]
    return done


def printed(code: str, *arguments: str | Path, **options: str) -> str:
    """What code prints in a process of its own."""
    return python("-c", code, *arguments, **options).stdout


def copied(folder: Path, *more: str) -> Path:
    """A folder with a copy of the program's sources, and of more folders of the project.

    Its results begin with what each source imports: to parse all of them takes longer than most of what is tested.
    """
    for name in (*PACKAGES, *more):
        ignored = shutil.ignore_patterns("*.pyc.*")  # half written
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    memo = folder / "results" / "cache" / "imports.json"
    memo.parent.mkdir(parents=True)
    memo.write_bytes(_imports())
    return folder


@cache
def _imports() -> bytes:
    """The memo of imports of all stages, as commands leave it."""
    stages = sorted((ROOT / "stages").rglob("*.py"))
    names = [".".join(("flexclear", *path.relative_to(ROOT).with_suffix("").parts)) for path in stages]
    with TemporaryDirectory() as folder:
        memo = Path(folder) / "imports.json"
        Sources(ROOT, memo).closure([name.removesuffix(".__init__") for name in names])
        return memo.read_bytes()
