"""Maintenance of the cache: its contents, their integrity, and artifacts that are no longer needed."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flexclear.artifacts.disk import digest_of, sha256
from flexclear.artifacts.store import FAMILY, PARTIAL, Record, Store, read_record
from flexclear.system import platforms

#: suffixes of files next to artifacts that belong to none
NO_ARTIFACT = (".json", ".lock", ".part", ".tmp")
DAY = 86400.0


@dataclass(frozen=True, slots=True)
class Artifact:
    """A readable record, the size of its files and of itself [bytes], and the time since it was written [s]."""

    record: Record
    size: int
    age: float


@dataclass(frozen=True, slots=True)
class Inventory:
    """Contents of a store. damaged: sentences. unreadable: records. orphans: files that no record names."""

    artifacts: tuple[Artifact, ...]
    damaged: tuple[str, ...]
    unreadable: tuple[Path, ...]
    orphans: tuple[Path, ...]


def inventory(store: Store, *, whole: bool) -> Inventory:
    """List all contents of the cache folder; with `whole` compare every file with its digest."""
    artifacts, damaged, unreadable, known = [], [], [], set()
    for path in _records(store):
        record = read_record(path)
        if record is None or store.path(record.stage, record.key, "json") != path:
            unreadable.append(path)
            continue
        files = [path, *(store.path(record.stage, record.key, name) for name in record.files)]
        known |= set(files)
        fault = store.fault(record) if whole else None
        if fault is not None:
            damaged.append(fault)
        statuses = [file.stat() for file in files if file.is_file()]
        artifacts.append(Artifact(record, sum(s.st_size for s in statuses), time.time() - path.stat().st_mtime))
    damaged += [f"{store.shorten_path(path)} is damaged or is not a record" for path in unreadable]
    return Inventory(tuple(artifacts), tuple(damaged), tuple(unreadable), tuple(_orphans(store, known)))


def list_prunable(store: Store, listed: Inventory, older: float) -> list[Artifact]:
    """Return artifacts that no folder of results shows, and that were written more than `older` seconds ago.

    Inputs of shown artifacts stay as well: without them they would be computed again. A sweep shows its families, all
    of whose points stay, since the sweep continues with them.
    """
    made = {artifact.record.digest: artifact.record for artifact in listed.artifacts}
    in_use, waiting = set(), list(_shown_records(store))
    while waiting:
        record = waiting.pop()
        if (record.stage, record.key) not in in_use:
            in_use.add((record.stage, record.key))
            above = (digest for fact, digest in record.facts.items() if fact.startswith("input "))
            waiting += [made[digest] for digest in above if digest in made]
    of_sweeps = {stage for stage, key in in_use if key == FAMILY}
    candidates = [a for a in listed.artifacts if a.age > older and a.record.stage not in of_sweeps]
    return [a for a in candidates if (a.record.stage, a.record.key) not in in_use]


def remove(store: Store, artifact: Artifact) -> None:
    """Remove an artifact, its record first, so that at no moment a record names files that are gone."""
    record = artifact.record
    with store.lock(record.stage, record.key):
        for name in ("json", *record.files):
            remove_file(store.path(record.stage, record.key, name))


def remove_file(path: Path) -> None:
    """Remove a file; a folder of its name is renamed."""
    platforms.set_aside(path)
    path.unlink(missing_ok=True)


def shown_faults(store: Store, below: Path) -> list[str]:
    """Return sentences on the files in a folder of results that differ from the artifacts shown there.

    A shown file has the content of one of the artifacts whose records are in its folder's ``.facts``.
    """
    faults = []
    for facts in sorted(below.rglob(".facts")):
        records = [r for path in facts.glob("*.json") if (r := read_record(path)) is not None]
        known = {digest for record in records for digest in record.files.values()}
        names = {name for record in records for name in record.files}
        for path in sorted(facts.parent.iterdir()) if known else ():
            whole = path.suffix == ".nc" and not path.stem.endswith((PARTIAL, ".edited"))
            if (whole or path.name in names) and path.is_file() and sha256(path.read_bytes()) not in known:
                faults.append(f"{store.shorten_path(path)} differs from its artifact; the next command restores it")
    return faults


def find_record(store: Store, what: str) -> Record | None:
    """Return the record with a key, or a unique beginning of a key, or of a shown file; None without a match."""
    path = Path(what)
    if path.is_file():
        for facts in (path.parent / ".facts").glob("*.json"):
            record = read_record(facts)
            if record is not None and any(
                _is_same_file(path, store.path(record.stage, record.key, f)) for f in record.files
            ):
                return record
    records = [path for path in _records(store) if path.stem.startswith(what)]
    return read_record(records[0]) if len(records) == 1 else None


def _is_same_file(path: Path, other: Path) -> bool:
    try:
        return digest_of(path) == digest_of(other)
    except OSError:
        return False


def _records(store: Store) -> list[Path]:
    """Return the paths of the records of all stages; stages of sweeps have a folder for each family.

    The memo of a whole command lies next to the stages, and a file of an artifact may be called ``<key>.index.json``.
    """
    cache = store.root / "cache"
    return sorted(path for path in cache.rglob("*.json") if path.parent != cache and "." not in path.stem)


def _shown_records(store: Store) -> Iterator[Record]:
    for folder, _, names in os.walk(store.root):
        if Path(folder).name == ".facts":
            records = (read_record(Path(folder, name)) for name in names if name.endswith(".json"))
            yield from (record for record in records if record is not None)


def _orphans(store: Store, known: set[Path]) -> Iterator[Path]:
    """Yield files of artifacts without a record, as of a process that died; young files may be about to get one."""
    for path in sorted((store.root / "cache").rglob("*")):
        ours = path.is_file() and path not in known and not path.name.endswith(NO_ARTIFACT)
        # 3600.0: time for which a file of an artifact may lack its record [s]
        if ours and time.time() - path.stat().st_mtime > 3600.0:
            yield path
