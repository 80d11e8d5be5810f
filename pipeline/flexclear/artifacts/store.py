"""The cache on disk: artifacts by content key, written atomically, checked at every read.

An artifact is one or more files ``cache/<stage>/<key>.<file>`` and, written last, its record ``<key>.json`` with the
SHA-256 digest of each file and the facts behind the key. Files without a record are no artifact, so a process killed at
any moment leaves nothing that could be taken for one. A file that differs from its digest counts as absent.
"""

from __future__ import annotations

import contextlib
import errno
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.artifacts.disk import (
    commit_file,
    copy,
    digest_of,
    disk_limits,
    encode_with_digest,
    hold_lock,
    is_copy,
    publish,
    read_checked,
    read_whole,
    remove_leftovers,
    sha256,
    temporary_name,
)
from flexclear.system import platforms
from flexclear.system.errors import ResourceError, terminal_text

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import LabelledArrays

    Product = Mapping[str, xr.Dataset | LabelledArrays | bytes]

#: part of a stage (those of sweeps have subfolders), key or file name of an artifact: it cannot lead to another folder
_PART = re.compile(r"[^./\\\0][^/\\\0]{0,200}")
#: the file of an artifact that other stages read
MAIN = "nc"
#: key of a record that stands for all artifacts of a stage, such as the batches of a sweep's points
FAMILY = "family"
#: attributes of the main file that the record repeats, so that commands report them without opening the file
REPORTED = ("warnings", "accuracy_verdict")
#: note next to shown results that are not of the scene's current state
OUTDATED = "OUTDATED.txt"
#: inserted before the suffix in the file name of an incomplete run
PARTIAL = ".partial"
OUTDATED_TEXT = "Results in this folder are outdated: updating them failed.\n\n"


@dataclass(frozen=True, slots=True)
class Record:
    """The record of a stored artifact: SHA-256 digest of each file by name, and the facts of its key.

    said: attributes of the main file that a command reports to its user (`REPORTED`). computed_by: the processor and
    its settings, not part of the key (`machine.instruction_set`).
    """

    stage: str
    key: str
    files: Mapping[str, str]
    facts: Mapping[str, str]
    said: Mapping[str, str] = field(default_factory=dict)
    computed_by: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Digest of the artifact's content: that of its main file, else of all its files."""
        return self.files.get(MAIN) or sha256(json.dumps(self.files, sort_keys=True).encode())

    def table(self) -> dict[str, object]:
        """Return the content of the record's file, which `read_record` reads."""
        content = {"files": self.files, "facts": self.facts, "said": self.said, "computed_by": self.computed_by}
        return {"stage": self.stage, "key": self.key, **{name: dict(texts) for name, texts in content.items()}}


@dataclass(frozen=True, slots=True)
class Store:
    """Artifacts below `root` (the results folder). `say` prints one line about damaged files."""

    root: Path
    say: Callable[[str], None] = lambda text: None

    def path(self, stage: str, key: str, file: str) -> Path:
        """Return the path of an artifact's file, whether it exists or not."""
        return self.root / "cache" / stage / f"{key}.{file}"

    def find(self, stage: str, key: str) -> Record | None:
        """Return the record of an artifact after checking all its files; None when it is absent or damaged."""
        path = self.path(stage, key, "json")
        record = read_record(path)
        if record is None and not path.exists():
            return None
        fault = f"{self.shorten_path(path)} is damaged or is not a record" if record is None else self.fault(record)
        if fault is not None:
            self.say(f"{fault}; it will be computed again")
        return record if fault is None else None

    def fault(self, record: Record) -> str | None:
        """Return in words what is wrong with the files of a record; None when all are sound."""
        for name, digest in record.files.items():
            path = self.path(record.stage, record.key, name)
            try:
                actual = digest_of(path)
            except OSError:
                return f"{self.shorten_path(path)} is missing or is not a file"
            if actual != digest:
                return f"{self.shorten_path(path)} is corrupt (its content differs from its sha256)"
        return None

    def put(
        self,
        stage: str,
        key: str,
        product: Product,
        facts: Mapping[str, str],
        computed_by: Mapping[str, str] | None = None,
    ) -> Record:
        """Store an artifact; its record is written last and makes it valid.

        Raises ResourceError when the disk is full or read-only; no partly written file stays.
        """
        digests: dict[str, str] = {}
        folder = self.root / "cache" / stage
        with disk_limits(folder):
            folder.mkdir(parents=True, exist_ok=True)
            for name, content in sorted(product.items()):
                path = self.path(stage, key, name)
                digests[name] = publish(path, content) if isinstance(content, bytes) else _write_content(path, content)
            attributes = getattr(product.get(MAIN), "attrs", {})  # empty where the main file is no dataset
            reported = {name: str(attributes[name]) for name in REPORTED if attributes.get(name)}
            record = Record(stage, key, digests, dict(facts), reported, computed_by or {})
            publish(self.path(stage, key, "json"), encode_with_digest(record.table()))
        return record

    def load(self, record: Record) -> xr.Dataset:
        """Return the main file as a Dataset in memory."""
        return self.arrays(record).to_xarray()

    def arrays(self, record: Record) -> LabelledArrays:
        """Return the main file as arrays in memory; the bytes that are parsed are those that were checked."""
        from flexclear.artifacts import netcdf

        path = self.path(record.stage, record.key, MAIN)
        content = read_whole(path)
        if sha256(content) != record.files[MAIN]:
            raise ResourceError(f"{self.shorten_path(path)} changed while it was read; run again to rebuild it")
        try:
            return netcdf.read(content)
        except (OSError, ValueError, RuntimeError, TypeError) as error:  # the digest is right: it never was a dataset
            raise ResourceError(
                f"{self.shorten_path(path)} is not a dataset ({terminal_text(str(error))}); remove it"
            ) from None

    def show(self, record: Record, folder: str, names: Mapping[str, str], label: str) -> None:
        """Show the current artifact: read-only copies in `folder`, and its facts in ``folder/.facts``.

        An empty `folder` shows nothing. A shown file that somebody has edited is renamed, and the renaming is reported.
        """
        if not folder:
            return
        shown = {name: self.root / folder / names.get(name, name) for name in record.files}
        shown["json"] = self._facts(folder, label)
        with disk_limits(self.root / folder):
            for name, target in shown.items():
                source = self.path(record.stage, record.key, name)
                # bit rot changes neither size nor time, so the file that users read as data is compared by content
                if not is_copy(source, target) or (name == MAIN and digest_of(target) != record.files[name]):
                    self._set_edited_aside(target, name, folder, label)
                    copy(source, target)
            _partial(shown[MAIN] if MAIN in shown else self.root / folder / label).unlink(missing_ok=True)
            self._facts(folder, label, "failed").unlink(missing_ok=True)
            self._write_outdated_note(folder)

    def _set_edited_aside(self, target: Path, name: str, folder: str, label: str) -> None:
        """Rename a shown file that was edited, so that showing the artifact does not overwrite the edit."""
        last = self.last_shown(folder, label)
        platforms.set_aside(target)
        if not target.is_file() or target.is_symlink():
            return
        # a file without known digest is taken as the user's when it is writable: shown copies are read-only
        known = last.files.get(name) if last is not None else None
        if digest_of(target) != known if known else target.stat().st_mode & 0o222:
            aside = target.with_name(f"{target.stem}.edited{target.suffix}")
            platforms.replace(target, aside)
            self.say(
                f"{self.shorten_path(target)} was edited; the edited file is now {aside.name}, the result is restored"
            )

    def show_partial(self, dataset: xr.Dataset | LabelledArrays, folder: str, name: str) -> Path | None:
        """Write an incomplete run next to the shown files; return its path, or None where nothing is shown.

        The file is no artifact, and `show` removes it.
        """
        if not folder:
            return None
        path = _partial(self.root / folder / name)
        with disk_limits(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_dataset(path, dataset)
        return path

    def mark_outdated(self, folder: str, label: str, why: str) -> None:
        """Write a note next to the shown files that they are outdated, and why; `show` removes the note."""
        if not folder:
            return
        with disk_limits(self.root / folder):
            self._facts(folder, label).parent.mkdir(parents=True, exist_ok=True)
            publish(self._facts(folder, label, "failed"), encode_with_digest({"label": label, "why": why}))
            self._write_outdated_note(folder)

    def why_outdated(self, folder: str, label: str) -> str | None:
        """Return the reason that `mark_outdated` has noted; None without a note."""
        table = read_checked(self._facts(folder, label, "failed")) if folder else None
        return None if table is None else str(table.get("why"))

    def show_families(self, folder: str, families: Mapping[str, Mapping[str, str]]) -> None:
        """Write to ``folder/.facts`` which families a dataset shown there contains: stages with all their artifacts.

        families: facts of each stage.
        """
        paths = {self._facts(folder, stage.replace("/", ".")): (stage, facts) for stage, facts in families.items()}
        with disk_limits(self.root / folder):
            (self.root / folder / ".facts").mkdir(parents=True, exist_ok=True)
            for path, (stage, facts) in paths.items():
                publish(path, encode_with_digest(Record(stage, FAMILY, {}, dict(facts)).table()))
            for path in (self.root / folder / ".facts").glob("*.json"):
                if path not in paths:
                    path.unlink(missing_ok=True)

    def _write_outdated_note(self, folder: str) -> None:
        path = self.root / folder / OUTDATED
        notes = [read_checked(path_of_note) for path_of_note in sorted((path.parent / ".facts").glob("*.failed"))]
        lines = [f"{note.get('label')}: {note.get('why')}\n" for note in notes if note is not None]
        if lines:
            publish(path, (OUTDATED_TEXT + "".join(lines)).encode())
        else:
            path.unlink(missing_ok=True)

    def _facts(self, folder: str, label: str, suffix: str = "json") -> Path:
        return self.root / folder / ".facts" / f"{label.replace(' ', '.')}.{suffix}"

    def last_shown(self, folder: str, label: str) -> Record | None:
        """Return the record of the artifact shown last, whatever its key; its files are not checked."""
        if not folder:
            return None
        return read_record(self._facts(folder, label))

    @contextlib.contextmanager
    def lock(self, stage: str, key: str, waiting: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Hold the lock of an artifact, so that concurrent processes produce the artifact once.

        The holder removes temporary files that a killed predecessor left. The operating system drops the lock of a
        process that dies.
        """
        path = self.path(stage, key, "lock")
        with contextlib.ExitStack() as stack:
            with disk_limits(path.parent):
                path.parent.mkdir(parents=True, exist_ok=True)
                stack.enter_context(hold_lock(path, waiting=waiting))
            for leftover in path.parent.glob(f".{key}.*.tmp"):
                leftover.unlink(missing_ok=True)
            yield

    def remove_leftovers(self) -> None:
        """Remove the temporary files and locks that killed processes left anywhere."""
        remove_leftovers(self.root)

    def shorten_path(self, path: Path) -> str:
        """Return a path in the form in which messages name it."""
        return str(path.relative_to(self.root.parent))


def read_record(path: Path) -> Record | None:
    """Return the record in a file; None when the file is absent, damaged, or not understood."""
    try:
        table = read_checked(path) or {}
        named = (table.get(name, {}).items() for name in ("files", "facts", "said", "computed_by"))
        files, facts, *others = ({str(name): str(value) for name, value in texts} for texts in named)
        record = Record(str(table["stage"]), str(table["key"]), files, facts, *others)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    # a foreign record must not lead out of its folder, since pruning removes the files that records name
    inside = all(_PART.fullmatch(name) for name in (*record.stage.split("/"), record.key, *record.files))
    return record if inside and (record.files or record.key == FAMILY) else None


def _partial(shown: Path) -> Path:
    """Return the path of an incomplete run, next to the shown file of a complete one."""
    return shown.with_name(f"{shown.stem}{PARTIAL}{shown.suffix}")


def write_dataset(path: Path, dataset: xr.Dataset | LabelledArrays) -> str:
    """Write a dataset as NetCDF-4 atomically; return its SHA-256 digest.

    Equal datasets give equal bytes: no times or names of this machine.
    """
    digest = _write_content(path, dataset)
    platforms.sync_folder(path.parent)
    return digest


def _write_content(path: Path, dataset: xr.Dataset | LabelledArrays) -> str:
    """Write a dataset as `write_dataset` does, without forcing its name to the disk."""
    from flexclear.artifacts import netcdf  # here, since commands with nothing to compute write nothing
    from flexclear.artifacts.labelled import label_dataset

    data = label_dataset(dataset)
    with temporary_name(path) as scratch:
        try:
            netcdf.write(scratch, data)
        except (OSError, RuntimeError) as error:
            # the HDF5 library does not report that the disk is full; writing plain bytes raises that error
            scratch.write_bytes(bytes(data.nbytes + 2**20))
            raise OSError(errno.EIO, f"NetCDF: {error}", str(path)) from None
        return commit_file(scratch, path)
