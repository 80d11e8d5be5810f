"""The cache on disk: artifacts by content key, written atomically, checked whenever they are read.

An artifact is one or more files ``cache/<stage>/<key>.<file>`` and, written last, its record
``<key>.json`` with the sha256 of each file and the facts behind the key. Without a record there is
no artifact, so a process killed at any moment leaves nothing that could be taken for one. A file
that differs from its digest counts as absent.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.errors import ResourceError

if TYPE_CHECKING:
    import xarray as xr

    Product = Mapping[str, xr.Dataset | bytes]

#: the file of an artifact that other stages read
MAIN = "nc"
#: attributes of the main file that a command tells, without opening the file
TOLD = ("warnings", "accuracy_verdict")
#: what a full or limited disk answers
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True, slots=True)
class Record:
    """What is known of a stored artifact: sha256 of each file by its name, and the facts of its key.

    said: those of the main file's attributes that a command tells its user (`TOLD`).
    """

    stage: str
    key: str
    files: Mapping[str, str]
    facts: Mapping[str, str]
    said: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Content of the artifact in one digest: that of its main file, else of all its files."""
        return self.files.get(MAIN) or _sha256(json.dumps(self.files, sort_keys=True).encode())


@dataclass(frozen=True, slots=True)
class Store:
    """Artifacts below `root` (the results folder). `say` is told, in one line, what was found broken."""

    root: Path
    say: Callable[[str], None] = lambda text: None

    def path(self, stage: str, key: str, file: str) -> Path:
        """Where a file of an artifact is, or would be."""
        return self.root / "cache" / stage / f"{key}.{file}"

    def find(self, stage: str, key: str) -> Record | None:
        """The artifact, all its files checked; None when it is absent or broken."""
        record = read_record(self.path(stage, key, "json"))
        if record is None:
            return None
        fault = self.fault(record)
        if fault is not None:
            self.say(f"{fault}; it is made again")
        return record if fault is None else None

    def fault(self, record: Record) -> str | None:
        """What is wrong with the files of a record, in words; None when nothing is."""
        for name, digest in record.files.items():
            path = self.path(record.stage, record.key, name)
            try:
                found = _sha256(path.read_bytes())
            except OSError:
                return f"{self._shown(path)} is missing"
            if found != digest:
                return f"{self._shown(path)} is corrupt (its content differs from its sha256)"
        return None

    def put(self, stage: str, key: str, product: Product, facts: Mapping[str, str]) -> Record:
        """Store an artifact; the record goes last and makes it valid.

        Raises ResourceError when the disk is full or cannot be written; nothing half-written stays.
        """
        digests: dict[str, str] = {}
        folder = self.root / "cache" / stage
        with disk_limits(folder):
            folder.mkdir(parents=True, exist_ok=True)
            for name, content in sorted(product.items()):
                path = self.path(stage, key, name)
                digests[name] = publish(path, content) if isinstance(content, bytes) else write_dataset(path, content)
            said = {name: str(value) for name, value in _attributes(product).items() if name in TOLD and value}
            record = Record(stage, key, digests, dict(facts), said)
            text = json.dumps(asdict(record), indent=1, sort_keys=True, ensure_ascii=False)
            publish(self.path(stage, key, "json"), text.encode() + b"\n")
        return record

    def load(self, record: Record) -> xr.Dataset:
        """The main file as a Dataset in memory. The bytes that were checked are those that are parsed."""
        import xarray as xr

        path = self.path(record.stage, record.key, MAIN)
        content = path.read_bytes()
        if _sha256(content) != record.files[MAIN]:
            raise ResourceError(f"{self._shown(path)} changed while it was read; run again to rebuild it")
        return xr.load_dataset(content, engine="netcdf4", decode_times=False)

    def show(self, record: Record, folder: str, names: Mapping[str, str], label: str) -> None:
        """Make the current artifact visible: links in `folder`, and its facts in ``folder/.facts``.

        An empty `folder` shows nothing.
        """
        if not folder:
            return
        shown = {name: self.root / folder / names.get(name, name) for name in record.files}
        shown["json"] = self.root / folder / ".facts" / f"{label.replace(' ', '.')}.json"
        with disk_limits(self.root / folder):
            for name, target in shown.items():
                link(self.path(record.stage, record.key, name), target)

    def last(self, folder: str, label: str) -> Record | None:
        """The artifact that was shown last, whatever its key; its files are not checked."""
        if not folder:
            return None
        return read_record(self.root / folder / ".facts" / f"{label.replace(' ', '.')}.json")

    @contextlib.contextmanager
    def lock(self, stage: str, key: str, waiting: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Held by one process at a time, so that concurrent runs make an artifact once.

        Whoever holds it may remove what a killed predecessor left. The system drops the lock of a
        process that dies.
        """
        path = self.path(stage, key, "lock")
        with disk_limits(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = path.open("ab")
        with handle:
            if not _try_lock(handle.fileno()):
                waiting()
                fcntl.flock(handle, fcntl.LOCK_EX)
            for left in path.parent.glob(f".{key}.*.tmp"):
                left.unlink(missing_ok=True)
            yield

    def _shown(self, path: Path) -> str:
        return str(path.relative_to(self.root.parent))


def read_record(path: Path) -> Record | None:
    """The record in a file; None when there is none or it cannot be understood."""
    try:
        table = json.loads(path.read_bytes())
        said = dict(table.get("said", {}))
        return Record(str(table["stage"]), str(table["key"]), dict(table["files"]), dict(table["facts"]), said)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _attributes(product: Product) -> Mapping[str, object]:
    """Attributes of the main file; none where it is no dataset."""
    return getattr(product.get(MAIN), "attrs", {})


def publish(path: Path, content: bytes) -> str:
    """Write a file so that it is either there in full or not at all; returns its sha256."""
    with _temporary(path) as temporary:
        temporary.write_bytes(content)
        if temporary.read_bytes() != content:
            raise OSError(errno.EIO, "what was written does not read back", str(path))
        _settle(temporary, path)
    return _sha256(content)


def write_dataset(path: Path, dataset: xr.Dataset) -> str:
    """Write NetCDF-4 atomically, read back and compared before it takes its name; returns its sha256.

    Equal datasets give equal bytes: fixed compression, no times or names of this machine. Numeric
    arrays are compressed and carry fletcher32 sums, so that other programs notice damage too.
    """
    import xarray as xr

    packed = {"zlib": True, "complevel": 1, "shuffle": True, "fletcher32": True}
    encoding = {str(n): packed for n, v in dataset.variables.items() if v.ndim and v.size and v.dtype.kind in "fiu"}
    with _temporary(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # the HDF5 library has no or a wrong name for a full disk; plain bytes get the true reason
            temporary.write_bytes(bytes(dataset.nbytes + 2**20))
            raise OSError(errno.EIO, f"NetCDF: {error}", str(path)) from None
        content = temporary.read_bytes()
        if not xr.load_dataset(content, engine="netcdf4", decode_times=False).equals(dataset):
            raise OSError(errno.EIO, "what was written does not read back", str(path))
        _settle(temporary, path)
    return _sha256(content)


def link(source: Path, target: Path) -> None:
    """Let `target` show `source`: a hard link, or a copy where links are not possible. Atomic."""
    try:
        if target.samefile(source):
            return
    except OSError:
        target.parent.mkdir(parents=True, exist_ok=True)
    with _temporary(target) as temporary:
        try:
            os.link(source, temporary)
        except OSError as error:
            if error.errno in FULL:
                raise
            content = source.read_bytes()
            if target.is_file() and target.read_bytes() == content:
                return
            temporary.write_bytes(content)
        os.replace(temporary, target)


@contextlib.contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """A name beside `path` that no other process uses; gone afterwards, however it ends."""
    stem = path.name.partition(".")[0]
    temporary = path.with_name(f".{stem}.{os.getpid()}.{os.urandom(4).hex()}.tmp")
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _settle(temporary: Path, path: Path) -> None:
    """Force the bytes to the disk, then give the file its name."""
    with temporary.open("rb") as file:
        os.fsync(file.fileno())
    os.replace(temporary, path)


@contextlib.contextmanager
def disk_limits(folder: Path) -> Iterator[None]:
    """OSError on the way to disk, as a limit of the machine, in words."""
    try:
        yield
    except OSError as error:
        why = "the disk is full or a file size limit was reached" if error.errno in FULL else str(error.strerror)
        raise ResourceError(f"cannot write below {folder}: {why}; nothing half-written was left") from None


def _try_lock(descriptor: int) -> bool:
    """False when another process holds it. A file system without locks counts as free: unique
    temporary names and atomic replacement keep results right, work may then be done twice."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
