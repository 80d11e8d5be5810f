"""What other systems lack: modules and functions of POSIX, consoles that know all characters."""

from __future__ import annotations

import ast
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import flexclear as fc
from flexclear.commands.__main__ import COMMANDS, main
from flexclear.system import platforms
from flexclear.system.errors import InputError
from tests.architecture import windows_rules as rules
from tests.processes import copied, python

#: what of `os` and `signal` is not on Windows, or means something else there
ELSEWHERE = (*rules.MODULES, *rules.FUNCTIONS, "SIGKILL", "link", "kill")
#: the one module of each tree that may ask for them
ONES = ("pipeline/flexclear/system/platforms.py", "benchmarks/processes.py")


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    own = {"FLEXCLEAR_RESULTS": str(folder / "results_of_test"), "NUMBA_DISABLE_JIT": "1"}
    return python(*arguments, cwd=folder, succeeds=False, **(own | environment))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copied(tmp_path_factory.mktemp("checkout"), "scenes", "meshes")


@pytest.fixture(scope="module")
def windows(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """A command in that checkout, and all processes of it, as far as can be under the rules of Windows."""
    hooks = tmp_path_factory.mktemp("hooks")
    shutil.copy(rules.__file__, hooks / "sitecustomize.py")

    def command(*arguments: str) -> str:
        paths = os.pathsep.join([str(hooks), str(checkout / "pipeline")])
        done = run(checkout, "-m", "flexclear", *arguments, PYTHONPATH=paths)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return command


def test_one_module_asks_for_what_only_some_systems_have(root: Path) -> None:
    found = []
    for path in _sources(root, "benchmarks"):
        place = path.relative_to(root).as_posix()
        if place in ONES:
            continue
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in ("os", "signal")
            ):
                names.append(node.attr)
            found += [f"{place}: {name}" for name in names if name in ELSEWHERE]
    assert found == []


def _sources(root: Path, *more: str) -> list[Path]:
    folders = ("papers", "pipeline", "stages", *more)
    return [path for name in folders for path in sorted((root / name).rglob("*.py"))]


def test_all_text_is_read_and_written_as_utf_8(root: Path) -> None:
    """Windows takes the console's code page for it otherwise, and ends lines with two characters."""
    found = []
    for path in _sources(root, "benchmarks"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            requested = _asked(node)
            if requested:
                found += [f"{path.relative_to(root)}:{node.lineno} {name}" for name in requested]
    # a distribution's own reader knows its encoding
    assert [place for place in found if "fingerprint.py" not in place] == []


def _asked(node: ast.AST) -> set[str]:
    """What a call that opens text has to say and does not."""
    if not isinstance(node, ast.Call):
        return set()
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    given = {keyword.arg for keyword in node.keywords}
    if None in given:
        return set()
    if name in ("read_text", "write_text"):
        return {"encoding", *(["newline"] if name == "write_text" else [])} - given
    of_path = isinstance(node.func, ast.Attribute)
    owner_of = getattr(node.func.value, "id", "") if of_path else ""
    if name != "open" or owner_of in ("os", "xr", "fc", "zipfile", "webbrowser"):
        return set()
    modes = [keyword.value for keyword in node.keywords if keyword.arg == "mode"] + node.args[0 if of_path else 1 :][:1]
    mode = modes[0].value if modes and isinstance(modes[0], ast.Constant) else "r"
    return set() if "b" in str(mode) else {"encoding", *(["newline"] if set(str(mode)) & set("wax") else [])} - given


def test_workers_are_made_without_fork(root: Path) -> None:
    """Windows has none, and on macOS what the system's libraries hold does not outlive it."""
    found = []
    for path in _sources(root):
        text = path.read_text(encoding="utf-8")
        pools = re.findall(r"ProcessPoolExecutor\(.+|multiprocessing\.(?:Pool|Process|Manager|Queue|set_start)", text)
        found += [f"{path.name}: {call}" for call in pools if "mp_context" not in call]
        found += [path.name for method in re.findall(r"get_context\((.*)\)", text) if method != '"spawn"']
    assert found == []


def test_the_pipeline_runs_under_the_rules_of_windows(windows: Callable[..., str], checkout: Path) -> None:
    windows("run", "checks/pendulum", "checks/spring_pendulum")  # in two workers, which have the same rules
    shown = checkout / "results_of_test" / "runs" / "checks" / "pendulum" / "run.nc"
    before = shown.read_bytes()
    assert windows("why", "checks/pendulum").count("fresh") == 2
    shown.chmod(0o644)
    shown.write_bytes(b"edited")
    windows("run", "checks/pendulum")
    assert shown.read_bytes() == before
    assert shown.with_name("run.edited.nc").read_bytes() == b"edited"
    left = [path for path in shown.parents[3].rglob("*") if path.suffix in (".tmp", ".lock", ".part")]
    assert left == []


def test_a_console_of_an_old_code_page_shows_what_it_can(root: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('title = "a"\ntime.end = "1 Ωs→"\n', encoding="utf-8")
    done = run(root, "-m", "flexclear", "check", str(tmp_path / "a.toml"), PYTHONIOENCODING="cp1252", PYTHONUTF8="0")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "\\u2192" in done.stderr + done.stdout


def test_a_running_process_is_alive_and_one_that_ended_is_not() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        assert platforms.is_alive(process.pid)
        process.communicate(b"\n")
    assert not platforms.is_alive(process.pid)


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A file that somebody else has open for as many attempts as the list says."""
    left, replace, unlink = [0], os.replace, os.unlink

    def refusing(change: Callable[..., None]) -> Callable[..., None]:
        def tried(*paths: Path) -> None:
            if left[0]:
                left[0] -= 1
                raise PermissionError(13, "Permission denied")
            change(*paths)

        return tried

    monkeypatch.setattr(os, "replace", refusing(replace))
    monkeypatch.setattr(os, "unlink", refusing(unlink))
    return left


def test_a_file_that_is_open_elsewhere_is_waited_for(tmp_path: Path, held: list[int]) -> None:
    new, old = tmp_path / "new", tmp_path / "old"
    new.write_bytes(b"new")
    old.write_bytes(b"old")
    held[0] = 3
    platforms.replace(new, old)
    assert old.read_bytes() == b"new"
    held[0] = 3
    platforms.remove(old)
    assert not old.exists()


def test_a_file_that_stays_open_elsewhere_is_named(
    tmp_path: Path, held: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platforms, "WAIT_FOR_FILE", 0.0)
    new, old = tmp_path / "new", tmp_path / "run.nc"
    new.write_bytes(b"new")
    old.write_bytes(b"old")
    held[0] = 1000
    with pytest.raises(PermissionError, match=r"run\.nc is protected, or open in another program"):
        platforms.replace(new, old)
    assert old.read_bytes() == b"old"


@pytest.mark.parametrize("page", ["cp1252", "cp437", "ascii"])
def test_a_console_of_any_code_page_shows_the_help_of_all_commands(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    said = io.BytesIO()
    for verb in COMMANDS:
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(said, encoding=page, write_through=True))
        with pytest.raises(SystemExit) as ended:
            main([verb, "--help"])
        assert ended.value.code == 0
        sys.stdout.detach()
    assert said.getvalue().count(b"usage: ") == len(COMMANDS)


def test_names_of_many_bytes_are_refused_before_files_are_called_by_them(root: Path) -> None:
    with pytest.raises(InputError, match="200 bytes in UTF-8 at most"):
        renamed(root, {"rod": "\u5b57" * 67})
    renamed(root, {"rod": "\u5b57" * 66})


def renamed(root: Path, names: dict[str, str]) -> fc.Scene:
    """The scene of one clamped rod with copies of the rod under these names."""
    scene = fc.load_scene(root / "scenes" / "checks" / "clamped_rod.toml")
    table = scene.model_dump(mode="json", exclude_none=True)
    rod = table["body"].pop("rod")
    return fc.load_scene({**table, "body": {**table["body"], **dict.fromkeys(names.values(), rod)}, "joint": {}})


def test_a_path_written_as_on_windows_is_refused_with_how_to_write_it(tmp_path: Path) -> None:
    for text in ('body.a.mesh = "..\\meshes\\rod.toml"', 'body.a.mesh = "C:\\users\\rod.toml"'):
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=r"a\.toml, line 1: .*\n  hint: write / between folders"):
            fc.load_scene(tmp_path / "a.toml")
    with pytest.raises(InputError, match="hint: write / between folders"):
        fc.load_scene("meshes\\rod.toml")
