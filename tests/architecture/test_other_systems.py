"""What other systems lack: modules and functions of POSIX, links in a checkout, consoles that know all characters."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flexclear.pipeline.core import system

#: what Windows does not have, of modules and of `os` and `signal`
MODULES = ("fcntl", "resource", "grp", "pwd", "termios")
FUNCTIONS = ("sched_getaffinity", "geteuid", "getuid", "setsid", "fork", "killpg", "sysconf", "getpgid")
#: the one module that may ask for them
ONE = "pipeline/core/system.py"

#: takes all of that away, then runs a command as `python -m flexclear` does
WITHOUT = f"""
import os, signal, sys
for name in {MODULES!r}:
    sys.modules[name] = None
for name in {FUNCTIONS!r}:
    delattr(os, name)
del signal.SIGKILL
from flexclear.stages.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    paths = {"PYTHONPATH": str(folder), "FLEXCLEAR_RESULTS": str(folder / "results_of_test")}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", **paths, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def without_links(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout as git makes it where it must not make links: they are small files that hold a path."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("pipeline", "stages", "scenes", "meshes"):
        shutil.copytree(root / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "flexclear").mkdir()
    for path in (root / "flexclear").iterdir():
        if path.is_symlink():
            (folder / "flexclear" / path.name).write_text(os.readlink(path))
        elif path.is_file():
            shutil.copy(path, folder / "flexclear")
    shutil.copy(root / "pyproject.toml", folder)
    return folder


def test_one_module_asks_for_what_only_some_systems_have(root: Path) -> None:
    found = []
    for path in (p for name in ("pipeline", "stages", "flexclear") for p in sorted((root / name).rglob("*.py"))):
        place = path.relative_to(root).as_posix()
        if place == ONE or place.startswith(("flexclear/pipeline", "flexclear/stages")):
            continue
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in ("os", "signal")
            ):
                names += [node.attr] if node.attr in (*FUNCTIONS, "SIGKILL", "link", "kill") else []
            found += [f"{place}: {name}" for name in names if name in (*MODULES, *FUNCTIONS, "SIGKILL", "link", "kill")]
    assert found == []


def test_all_text_is_read_and_written_as_utf_8(root: Path) -> None:
    """Windows takes the console's code page for it otherwise."""
    found = []
    for path in (p for name in ("pipeline", "stages") for p in sorted((root / name).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                given = {keyword.arg for keyword in node.keywords}
                if node.func.attr in ("read_text", "write_text") and not given & {"encoding", None}:
                    found.append(f"{path.relative_to(root)}:{node.lineno}")
    # a distribution's own reader knows its encoding
    assert [place for place in found if "fingerprint.py" not in place] == []


def test_the_pipeline_runs_without_posix_and_without_links(without_links: Path) -> None:
    done = run(without_links, "-c", WITHOUT, "run", "checks/pendulum", "checks/spring_pendulum")  # in two workers
    assert done.returncode == 0, done.stderr
    assert (without_links / "results_of_test" / "runs" / "checks" / "pendulum" / "run.nc").is_file()
    again = run(without_links, "-c", WITHOUT, "why", "checks/pendulum")
    assert again.stdout.count("fresh") == 2, again.stdout + again.stderr


def test_a_flexible_body_is_made_without_links(without_links: Path) -> None:
    done = run(without_links, "-m", "flexclear", "run", "checks/clamped_rod", "--to", "bundle")
    assert done.returncode == 0, done.stderr


def test_a_checkout_without_links_has_the_keys_of_one_with_links(root: Path, without_links: Path) -> None:
    """Nothing is run again because of where a source lies."""
    text = (
        "from flexclear.stages.run import graphs, workplace\n"
        "place = workplace()\n"
        "(graph,) = graphs(['checks/pendulum'])\n"
        "from flexclear.pipeline.core.workflow.execute import key_of\n"
        "print(key_of(graph.simulate, {}, place.store, place.sources))\n"
    )
    keys = {run(folder, "-c", text, FLEXCLEAR_RESULTS="/nonexistent").stdout for folder in (root, without_links)}
    assert len(keys) == 1
    assert len(keys.pop()) == 33


def test_a_console_of_an_old_code_page_shows_what_it_can(root: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('title = "a"\ntime.end = "1 Ωs→"\n', encoding="utf-8")
    done = run(root, "-m", "flexclear", "check", str(tmp_path / "a.toml"), PYTHONIOENCODING="cp1252", PYTHONUTF8="0")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "\\u2192" in done.stderr + done.stdout


def test_a_running_process_is_alive_and_one_that_ended_is_not() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        assert system.alive(process.pid)
        process.communicate(b"\n")
    assert not system.alive(process.pid)
