"""One file with all that is needed to repeat what a scene does: its files, versions, what was said. And the repeat."""

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

from flexclear.commands import scenes
from flexclear.pipeline.core.artifacts.disk import digest_of, disk_limits, publish
from flexclear.pipeline.core.artifacts.paths import TREE, kernel_root, results_root
from flexclear.pipeline.core.scene.load import is_file, overridden, read_toml
from flexclear.pipeline.core.system.errors import FlexclearError, InputError
from flexclear.pipeline.core.system.external_files import companions, require_file
from flexclear.pipeline.core.system.version import version
from flexclear.pipeline.core.workflow.fingerprint import library_version
from flexclear.stages import meshing
from flexclear.stages.sweeps.sweep_points import source_digest

#: entries of the file: what it is about, what was said; the scene's files are below the folder
FACTS, LOG, FILES = "facts.json", "log.txt", "files"
#: bytes that are unpacked at most, and characters of a log that are stored
LARGEST_UNPACKED, LONGEST_LOG = 1 << 30, 200_000
#: last lines of what was said that are shown of each
REPORTED = 5
#: variables of the environment that change what is computed, or where
VARIABLES = ("FLEXCLEAR_", "NUMBA_", "OPENBLAS_", "OMP_", "MKL_")
#: no date: equal content gives equal bytes
DATE = (1980, 1, 1, 0, 0, 0)


def make(name: str, settings: Sequence[str], libraries: Sequence[str], target: Path | None) -> tuple[Path, list[Path]]:
    """Run a scene and write all about it into one file (zip); its path, and files that are left out.

    No path of this machine is in it: files are called by their paths relative to each other, folders in what was said
    by words.  Raises InputError for a scene that is not there.
    """
    scene = scenes.find_scene(name).resolve()
    if not scene.is_file():
        raise InputError(name, "there is no such file")
    files, left_out = _opened(scene, settings)
    try:
        top = Path(os.path.commonpath([path.parent for path in files]))
    except ValueError:
        raise InputError(name, "has files on several drives", "copy them to one") from None
    for path in files:
        if not path.relative_to(top).as_posix().isprintable():
            raise InputError(str(path), "has a name that other systems cannot read", "rename it")
    done, digest = _run(scene, settings, os.environ)
    hidden = _hidden(top)
    facts = {
        "scene": scene.relative_to(top).as_posix(),
        "settings": [_without(text, hidden) for text in settings],
        "exit_code": done.returncode,
        "run": digest,
        "flexclear": version(),
        "sources": source_digest(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "libraries": {library: library_version(library) for library in libraries},
        "environment": {k: _without(v, hidden) for k, v in sorted(os.environ.items()) if k.startswith(VARIABLES)},
    }
    content = {FACTS: json.dumps(facts, indent=1, sort_keys=True).encode()}
    content[LOG] = _without(done.stdout + done.stderr, hidden)[-LONGEST_LOG:].encode()
    for path, ours in sorted(files.items()):
        content[f"{FILES}/{path.relative_to(top).as_posix()}"] = _text(path, files) if ours else path.read_bytes()
    path = target or Path(f"{scene.stem}.repeat.zip")
    with disk_limits(path.resolve().parent):
        publish(path.resolve(), _packed(content))
    return path, left_out


def repeat(path: Path, libraries: Sequence[str]) -> tuple[bool, str]:
    """Run what a file of `make` holds, in a folder of its own; whether it ended as it did, and the message about that.

    Raises InputError for what is no such file.
    """
    with tempfile.TemporaryDirectory(prefix="flexclear_repeat_") as name:
        folder = Path(name).resolve()
        facts, log = _unpack(path, folder)
        environment = {**os.environ, "FLEXCLEAR_RESULTS": str(folder / "results")}
        done, digest = _run(folder / FILES / facts["scene"], facts["settings"], environment)
        said = _without(done.stdout + done.stderr, _hidden(folder / FILES))[-LONGEST_LOG:]
    differences = [f"here it ended with {done.returncode}, there with {facts['exit_code']}"]
    if digest and facts.get("run"):
        differences += [
            f"the run is {'the same to the last bit' if digest == facts['run'] else 'not the same to the last bit'}"
        ]
    now = {**{library: library_version(library) for library in libraries}, "python": platform.python_version()}
    then = {**facts["libraries"], "python": facts["python"]}
    differences += [f"{k} is {now[k]} here, {v} there" for k, v in sorted(then.items()) if now.get(k, v) != v]
    ending = [text.strip().splitlines()[-REPORTED:] for text in (log, said)]
    differences += [
        f"{where}: {line}" for where, lines in zip(("there", "here"), ending, strict=True) for line in lines
    ]
    return done.returncode == facts["exit_code"], "\n".join(differences)


def _opened(scene: Path, settings: Sequence[str]) -> tuple[dict[Path, bool], list[Path]]:
    """All that the scene opens, and whether it is a text of ours: a scene or recipe; what is left out.

    Left out is what meshes name outside of the folders of all else: it may be private, and only the mesh says so.  What
    is wrong is what the file is made for, so each is taken as far as it goes.
    """
    texts, others, within = [scene], list[Path](), list[Path]()
    for path in texts:  # grows by what these extend
        with contextlib.suppress(FlexclearError):
            extended = path.parent / str(read_toml(path).get("extends", path.name))
            if is_file(extended) and extended.resolve() not in texts:
                texts.append(extended.resolve())
    recipes: list[Path] = []
    for changed in (settings, ()):
        with contextlib.suppress(FlexclearError):
            table = overridden(scene, scenes.overrides(changed))
            recipes += _named(table, "mesh")
            others += _named(table, "file")
    for path in recipes:
        with contextlib.suppress(FlexclearError):
            others += meshing.named(read_toml(path), path.parent)
    for path in others:
        with contextlib.suppress(FlexclearError):
            within.extend(companions(path))
    ours, others, within = (
        [path.resolve() for path in part if is_file(path)] for part in (texts + recipes, others, within)
    )
    folders = {path.parent for path in (*ours, *others)}
    near = [path for path in within if any(path.is_relative_to(folder) for folder in folders)]
    return dict.fromkeys((*others, *near), False) | dict.fromkeys(ours, True), sorted({*within} - {*near})


def _named(node: object, key: str) -> list[Path]:
    """Files that a scene's table names by a key, at any depth."""
    if isinstance(node, dict):
        own = [Path(node[key])] if isinstance(node.get(key), str) else []
        return own + _named(list(node.values()), key)
    return [path for item in node for path in _named(item, key)] if isinstance(node, list) else []


def _run(
    scene: Path, settings: Sequence[str], environment: Mapping[str, str]
) -> tuple[subprocess.CompletedProcess[str], str]:
    """What running a scene says, and the sha256 of the dataset of the run, if there is one."""
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


def _hidden(top: Path) -> dict[str, str]:
    """Folders of this machine and the words for them, the longest first."""
    places = {str(top): ".", str(results_root()): "<results>", str(kernel_root()): "<kernels>"}
    places |= {str(TREE): "<flexclear>", sys.prefix: "<python>", sys.base_prefix: "<python>"}
    places |= {str(Path.home()): "~", tempfile.gettempdir(): "<temporary>"}
    return {where: places[where] for where in sorted(places, key=len, reverse=True) if len(where) > 1}


def _without(text: str, hidden: Mapping[str, str]) -> str:
    for where, word in hidden.items():
        text = text.replace(where, word)
    return text


def _text(path: Path, files: Iterable[Path]) -> bytes:
    """Content of a text of ours with the others' paths relative to it."""
    content = path.read_bytes()
    for other in files:
        relative = Path(os.path.relpath(other, path.parent)).as_posix()
        for text in _spellings(other):
            content = content.replace(os.fsencode(text), relative.encode())
    return content


def _spellings(path: PurePath) -> tuple[str, ...]:
    """How TOML may write a path: on Windows with two strokes in "...", with one in '...', or with /."""
    return json.dumps(str(path), ensure_ascii=False)[1:-1], str(path), path.as_posix()


def _packed(content: Mapping[str, bytes]) -> bytes:
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in content.items():
                archive.writestr(zipfile.ZipInfo(name, DATE), data, zipfile.ZIP_DEFLATED)
        file.seek(0)
        return file.read()


def _unpack(path: Path, folder: Path) -> tuple[dict[str, Any], str]:
    """Facts and log; the files are put into the folder, and nowhere else."""
    require_file(path, str(path))
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            names = [PurePosixPath(entry.filename) for entry in entries]
            strange = [n for n in names if n.is_absolute() or ".." in n.parts or "\\" in str(n) or ":" in str(n)]
            if strange or sum(entry.file_size for entry in entries) > LARGEST_UNPACKED:
                raise InputError(str(path), "holds names that lead out of it, or more than 1 GB", "do not open it")
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
        raise InputError(str(path), "is no file that `flexclear doctor --bundle SCENE` made") from None
