"""One file with all that is needed to repeat a scene's run: its files, versions and log; and the repetition."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

from flexclear.artifacts.disk import digest_of, disk_limits, publish
from flexclear.artifacts.paths import DATA, TREE, kernel_root, results_root
from flexclear.scene.load import is_file, table_with_changes
from flexclear.scene.toml_files import read_toml
from flexclear.stages import meshing, scenes
from flexclear.stages.sweeps.sweep_points import source_digest
from flexclear.system.errors import FlexclearError, InputError
from flexclear.system.external_files import companion_files, require_file
from flexclear.system.version import version
from flexclear.workflow.fingerprint import library_version

#: entries of the file: facts, log; the scene's files are below the folder
FACTS, LOG, FILES = "facts.json", "log.txt", "files"
#: largest size of the unpacked file [bytes], and length of a stored log [characters]
LARGEST_UNPACKED, LONGEST_LOG = 1 << 30, 200_000
#: variables of the environment that change results, or where they are stored
VARIABLES = ("FLEXCLEAR_", "NUMBA_", "OPENBLAS_", "OMP_", "MKL_")


def make(name: str, settings: Sequence[str], libraries: Sequence[str], target: Path | None) -> tuple[Path, list[Path]]:
    """Run a scene and write all about it into one file (zip); return its path, and the files that are left out.

    The file holds no path of this machine: its paths are relative, and words replace folders in the log.  Raises
    InputError for a scene that does not exist.
    """
    scene = scenes.find_scene(name).resolve()
    if not scene.is_file():
        raise InputError(name, "there is no such file")
    files, left_out = _files_of_scene(scene, settings)
    try:
        top = Path(os.path.commonpath([path.parent for path in files]))
    except ValueError:
        raise InputError(name, "has files on several drives", "copy them to one drive") from None
    for path in files:
        if not path.relative_to(top).as_posix().isprintable():
            raise InputError(str(path), "has a name that other systems cannot read", "rename it")
    done, digest = _run(scene, settings, os.environ)
    hidden = _hidden_words(top)
    facts = {
        "scene": scene.relative_to(top).as_posix(),
        "settings": [_replace_hidden(text, hidden) for text in settings],
        "exit_code": done.returncode,
        "run": digest,
        "flexclear": version(),
        "sources": source_digest(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "libraries": {library: library_version(library) for library in libraries},
        "environment": {
            k: _replace_hidden(v, hidden) for k, v in sorted(os.environ.items()) if k.startswith(VARIABLES)
        },
    }
    content = {FACTS: json.dumps(facts, indent=1, sort_keys=True).encode()}
    content[LOG] = _replace_hidden(done.stdout + done.stderr, hidden)[-LONGEST_LOG:].encode()
    for path, ours in sorted(files.items()):
        content[f"{FILES}/{path.relative_to(top).as_posix()}"] = _text(path, files) if ours else path.read_bytes()
    path = target or Path(f"{scene.stem}.repeat.zip")
    with disk_limits(path.resolve().parent):
        publish(path.resolve(), _zip_files(content))
    return path, left_out


def repeat(path: Path, libraries: Sequence[str]) -> tuple[bool, str]:
    """Run the scene in a file of `make` in a separate folder; return True when its exit code is the same, and a report.

    Raises InputError for a file of another kind.
    """
    with tempfile.TemporaryDirectory(prefix="flexclear_repeat_") as name:
        folder = Path(name).resolve()
        facts, log = _unpack(path, folder)
        environment = {**os.environ, "FLEXCLEAR_RESULTS": str(folder / "results")}
        done, digest = _run(folder / FILES / facts["scene"], facts["settings"], environment)
        output = _replace_hidden(done.stdout + done.stderr, _hidden_words(folder / FILES))[-LONGEST_LOG:]
    differences = [f"the run ended with exit code {done.returncode} here, with {facts['exit_code']} there"]
    if digest and facts.get("run"):
        differences += [
            f"the run is {'the same to the last bit' if digest == facts['run'] else 'not the same to the last bit'}"
        ]
    here = {**{library: library_version(library) for library in libraries}, "python": platform.python_version()}
    recorded = {**facts["libraries"], "python": facts["python"]}
    differences += [f"{k} is {here[k]} here, {v} there" for k, v in sorted(recorded.items()) if here.get(k, v) != v]
    # 5: last lines of each log that are shown
    ending = [text.strip().splitlines()[-5:] for text in (log, output)]
    differences += [
        f"{where}: {line}" for where, lines in zip(("there", "here"), ending, strict=True) for line in lines
    ]
    return done.returncode == facts["exit_code"], "\n".join(differences)


def _files_of_scene(scene: Path, settings: Sequence[str]) -> tuple[dict[Path, bool], list[Path]]:
    """Return all files of a scene, with True for scenes and recipes (texts of ours), and the files to leave out.

    Left out are files outside of the scene's folder and of this program's own scenes and meshes: they may be private,
    and a scene of someone else may name them.  Errors in a file are skipped: the bundle exists to report them.
    """
    texts, others = [scene], list[Path]()
    for path in texts:  # the list grows by the scenes that these extend
        with contextlib.suppress(FlexclearError):
            extended = path.parent / str(read_toml(path).get("extends", path.name))
            if is_file(extended) and extended.resolve() not in texts:
                texts.append(extended.resolve())
    recipes: list[Path] = []
    for changed in (settings, ()):
        with contextlib.suppress(FlexclearError):
            table = table_with_changes(scene, scenes.overrides(changed))
            recipes += _files_under_key(table, "mesh")
            others += _files_under_key(table, "file")
    for path in recipes:
        with contextlib.suppress(FlexclearError):
            others += meshing.named_files(read_toml(path), path.parent)
    for path in list(others):
        with contextlib.suppress(FlexclearError):
            others.extend(companion_files(path))
    opened = dict.fromkeys((path.resolve() for path in others if is_file(path)), False)
    opened |= dict.fromkeys((path.resolve() for path in texts + recipes if is_file(path)), True)
    folders = (scene.parent, *((DATA / name).resolve() for name in ("scenes", "meshes")))
    near = {path: ours for path, ours in opened.items() if any(path.is_relative_to(folder) for folder in folders)}
    return near, sorted(opened.keys() - near.keys())


def _files_under_key(node: object, key: str) -> list[Path]:
    """Return the files that a scene's table names under a key, at any depth."""
    if isinstance(node, dict):
        own = [Path(node[key])] if isinstance(node.get(key), str) else []
        return own + _files_under_key(list(node.values()), key)
    return [path for item in node for path in _files_under_key(item, key)] if isinstance(node, list) else []


def _run(
    scene: Path, settings: Sequence[str], environment: Mapping[str, str]
) -> tuple[subprocess.CompletedProcess[str], str]:
    """Run a scene in a process; return that process, and the sha256 of the run's dataset, empty without one."""
    changes = [word for text in settings for word in ("--set", text)]
    with tempfile.TemporaryDirectory(prefix="flexclear_run_") as folder:
        dataset = Path(folder) / "run.nc"
        done = subprocess.run(
            [sys.executable, "-m", "flexclear", "run", str(scene), *changes, "--verbose", "--out", str(dataset)],
            cwd=scene.parent,
            env={
                **environment,
                "PYTHONPATH": os.pathsep.join([str(TREE), environment.get("PYTHONPATH", "")]),
                "PYTHONIOENCODING": "utf-8:backslashreplace",
            },
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            check=False,
        )
        return done, digest_of(dataset) if dataset.is_file() else ""


def _hidden_words(top: Path) -> dict[str, str]:
    """Return the folders of this machine and the words that replace them, the longest first."""
    places = {str(top): ".", str(results_root()): "<results>", str(kernel_root()): "<kernels>"}
    places |= {str(TREE): "<flexclear>", sys.prefix: "<python>", sys.base_prefix: "<python>"}
    places |= {str(Path.home()): "~", tempfile.gettempdir(): "<temporary>"}
    return {where: places[where] for where in sorted(places, key=len, reverse=True) if len(where) > 1}


def _replace_hidden(text: str, hidden: Mapping[str, str]) -> str:
    for where, word in hidden.items():
        text = text.replace(where, word)
    return text


def _text(path: Path, files: Iterable[Path]) -> bytes:
    """Return the content of a scene or recipe, with paths of the other files relative to it."""
    content = path.read_bytes()
    for other in files:
        relative = Path(os.path.relpath(other, path.parent)).as_posix()
        for text in _spellings(other):
            content = content.replace(os.fsencode(text), relative.encode())
    return content


def _spellings(path: PurePath) -> tuple[str, ...]:
    r"""Return the ways in which TOML may write a path: on Windows with \\ in "...", with \ in '...', or with /."""
    return json.dumps(str(path), ensure_ascii=False)[1:-1], str(path), path.as_posix()


def _zip_files(content: Mapping[str, bytes]) -> bytes:
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in content.items():
                # (1980, 1, 1, 0, 0, 0): no date: equal content gives equal bytes
                archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
        file.seek(0)
        return file.read()


def _unpack(path: Path, folder: Path) -> tuple[dict[str, Any], str]:
    """Return facts and log of a file, and unpack its other entries into the folder, and nowhere else."""
    require_file(path, str(path))
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            names = [PurePosixPath(entry.filename) for entry in entries]
            strange = [n for n in names if n.is_absolute() or ".." in n.parts or "\\" in str(n) or ":" in str(n)]
            if strange or sum(entry.file_size for entry in entries) > LARGEST_UNPACKED:
                raise InputError(str(path), "contains names that lead out of it, or more than 1 GB", "do not open it")
            facts, log = json.loads(archive.read(FACTS)), archive.read(LOG).decode(errors="replace")
            for entry, name in zip(entries, names, strict=True):
                if name.parts[0] == FILES and not entry.is_dir():
                    made = folder.joinpath(*name.parts)
                    made.parent.mkdir(parents=True, exist_ok=True)
                    made.write_bytes(archive.read(entry))
        if PurePosixPath(facts["scene"]).is_absolute() or ".." in PurePosixPath(facts["scene"]).parts:
            raise InputError(str(path), "names a scene outside of it", "do not open it")
        if not all(isinstance(text, str) for text in facts["settings"]) or not isinstance(facts["libraries"], dict):
            raise ValueError
        return {**facts, "exit_code": int(facts["exit_code"]), "python": str(facts["python"])}, log
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        raise InputError(str(path), "is not a file from `flexclear doctor --bundle SCENE`") from None
