"""A command that left nothing to be done, known again: its artifacts are checked and shown, and no task is built.

Where all that tasks and their keys are made of is as it was then, building them anew gives the same keys. Content
decides that, as everywhere: of every source, of the folders that the command's data are in, of what says which
libraries are installed, and of each file that a task opened. So is it with what is checked: every file of every
artifact is compared with its digest.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.artifacts.disk import checked, publish, read_checked, read_whole, sha256
from flexclear.pipeline.core.artifacts.paths import DATA, TREE
from flexclear.pipeline.core.artifacts.store import Record, Store
from flexclear.pipeline.core.workflow import opened
from flexclear.pipeline.core.workflow.fingerprint import source_file
from flexclear.pipeline.core.workflow.task import Task, in_order

#: what holds the sources, and what holds the scenes and meshes of the project
FOLDERS = ("pipeline", "stages", "scenes", "meshes")
#: files in which libraries tell version and requirements
METADATA = ("METADATA", "PKG-INFO")


def state(told: Mapping[str, str]) -> dict[str, str]:
    """All that decides which tasks a command on the project's own scenes has, and their keys: kind and name -> value.

    told: what else does.
    """
    found = {f"told {name}": value for name, value in told.items()}
    found |= {"told python": sys.version, "told data": str(DATA), "told tree": str(TREE)}
    files = [str(path) for path in (TREE / "flexclear").glob("*.py")]
    for folder in FOLDERS:
        files += _files(f"{DATA}{os.sep}{folder}")
    libraries = _installed()
    found |= {f"file {name}": opened.digest(name) for name in files}
    found |= {f"library {path}": opened.digest(path) for path in libraries}
    return found | {"told order": os.pathsep.join(libraries)}


def _files(folder: str) -> list[str]:
    """All files below a folder but compiled ones."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != "__pycache__"]
        found += [f"{place}{os.sep}{name}" for name in names]
    return found


def _installed() -> list[str]:
    """Files that say which version a library is and what it requires, wherever Python looks, in the order in which it
    does; of this program itself no version is in any key."""
    found = []
    for place in sys.path:
        with contextlib.suppress(OSError):  # not every place is there
            for name in sorted(os.listdir(place or os.curdir)):
                if name.endswith((".dist-info", ".egg-info")) and not name.startswith("flexclear"):
                    found += [os.path.join(place, name, file) for file in METADATA]
    return found


def keep(
    memo: Path,
    before: Mapping[str, str],
    read: Mapping[str, str],
    tasks: list[Task],
    records: Mapping[int, Record],
    store: Store,
) -> None:
    """Remember that these tasks, built in a state, have these artifacts; nothing where that cannot be sure.

    read: digests of the files that were opened to build the tasks, by place relative to the sources.
    """
    whole = in_order(tasks)
    if not _covers(before, read) or any(_edited(records[id(task)], before) for task in whole):
        return
    with contextlib.suppress(OSError):  # it is not there any more, or nothing can be written
        publish(memo, checked(_table(before, whole, records, store)))


def _covers(before: Mapping[str, str], read: Mapping[str, str]) -> bool:
    """Whether files are in a state, as they were read: a scene may be edited to extend one that lies elsewhere."""
    files = {os.path.realpath(name[5:]): then for name, then in before.items() if name.startswith("file ")}
    return all(files.get(os.path.realpath(TREE / name)) == then for name, then in read.items())


def _edited(record: Record, before: Mapping[str, str]) -> bool:
    """Whether a source had another content when a key was made than in a state."""
    modules = {
        name.removeprefix("module "): value for name, value in record.facts.items() if name.startswith("module ")
    }
    return any(before.get(f"file {source_file(TREE, name)}") != value for name, value in modules.items())


def _table(before: Mapping[str, str], tasks: list[Task], records: Mapping[int, Record], store: Store) -> dict[str, Any]:
    """What `again` reads: the state, files that tasks opened, artifacts, and where each is shown under which names."""
    files: dict[str, str] = {}
    artifacts: dict[tuple[str, str], dict[str, Any]] = {}
    shown = []
    for task in tasks:
        record = records[id(task)]
        name = record.stage, record.key
        opens = {fact.removeprefix("file "): then for fact, then in record.facts.items() if fact.startswith("file ")}
        files |= {os.path.normpath(task.base / place): then for place, then in opens.items()}
        if name not in artifacts:
            digest = sha256(read_whole(store.path(*name, "json")))
            artifacts[name] = {"stage": name[0], "key": name[1], "record": digest, "files": dict(record.files)}
        shown.append([list(artifacts).index(name), task.folder, dict(task.names), task.label])
    return {"state": _digest(before), "files": files, "artifacts": list(artifacts.values()), "shown": shown}


def again(memo: Path, now: Mapping[str, str], store: Store) -> bool:
    """Whether all that `keep` remembers is so now, too, and every artifact whole; they are then shown in their places.

    A memo that is damaged, or not from here, is as good as none.
    """
    table = read_checked(memo)
    if table is None or table.get("state") != _digest(now):
        return False
    try:
        records = [_whole(artifact, store) for artifact in table["artifacts"]]
        same = all(opened.digest(name) == then for name, then in table["files"].items())
        shown = [(records[number], folder, names, label) for number, folder, names, label in table["shown"]]
        inside = all(
            _inside(*folder.split("/") if folder else (), *names.values(), label) for _, folder, names, label in shown
        )
    except (OSError, LookupError, TypeError, ValueError, AttributeError):
        return False
    if not same or not inside:
        return False
    store.sweep()
    for record, folder, names, label in shown:
        store.show(record, folder, names, label)
    return True


def _whole(told: Mapping[str, Any], store: Store) -> Record:
    """An artifact whose record and files are as they were; ValueError for others, OSError where a file is not there."""
    record = Record(told["stage"], told["key"], told["files"], {})
    if not _inside(*record.stage.split("/"), record.key, *record.files):
        raise ValueError("it leads to another folder")
    if sha256(read_whole(store.path(record.stage, record.key, "json"))) != told["record"]:
        raise ValueError("its record is another one")
    if store.fault(record) is not None:
        raise ValueError("it is damaged")
    return record


def _inside(*parts: str) -> bool:
    """Whether parts of a path stay in their folder: results may be somebody else's."""
    return all(part.strip(".") and not set(part) & set("/\\\0") for part in parts)


def _digest(facts: Mapping[str, str]) -> str:
    return sha256("\n".join(f"{name}\0{facts[name]}" for name in sorted(facts)).encode())
