"""The store: atomic, checked, deterministic, and honest about full disks."""

import errno
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts import disk, netcdf
from flexclear.artifacts.disk import publish
from flexclear.artifacts.labelled import label_dataset
from flexclear.artifacts.store import Record, Store, write_dataset
from flexclear.commands.new import write
from flexclear.system.errors import ResourceError
from tests.processes import printed
from tests.stages.conftest import Command

KEY = "k" * 32


def dataset(rows: int = 50) -> xr.Dataset:
    """Numbers that do not compress, text, an integer, a scalar and attributes."""
    rng = np.random.default_rng(1)
    return xr.Dataset(
        {
            "position": (("time", "body"), rng.standard_normal((rows, 3)), {"units": "m"}),
            "count": (("body",), np.arange(3)),
            "mass": ((), 2.5),
            "empty": (("event",), np.zeros(0)),
        },
        coords={"time": ("time", np.arange(rows) * 1e-4, {"units": "s"}), "body": ["a", "rod1", "platform"]},
        attrs={"scene": "tiny", "evaluations": 12},
    )


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def store(tmp_path: Path, said: list[str]) -> Store:
    return Store(tmp_path / "results", say=said.append)


def put(store: Store) -> Record:
    return store.put("simulate", KEY, {"nc": dataset(), "vtu": b"mesh"}, {"parameter c": "1"})


def test_what_is_stored_comes_back_exactly(store: Store):
    record = put(store)
    assert store.find("simulate", KEY) == record
    assert store.load(record).identical(dataset())


def test_equal_datasets_give_equal_bytes(tmp_path: Path):
    """In another process, so that nothing of this one can be shared: no times, names or random seeds."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path;"
        "from test_store import dataset, write_dataset; print(write_dataset(Path(sys.argv[2]), dataset()))"
    )
    here = str(Path(__file__).parent)
    seeds = {"one.nc": "1", "two.nc": "2"}
    one, two = (printed(code, here, tmp_path / name, PYTHONHASHSEED=seed) for name, seed in seeds.items())
    assert one == two
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert write_dataset(tmp_path / "three.nc", dataset(51)) != one.strip()


def test_every_flipped_bit_is_detected(store: Store, said: list[str]):
    record = put(store)
    path = store.path("simulate", KEY, "nc")
    whole = path.read_bytes()
    for place in range(0, len(whole), len(whole) // 37):
        broken = bytearray(whole)
        broken[place] ^= 0x10
        path.write_bytes(bytes(broken))
        assert store.find("simulate", KEY) is None
        with pytest.raises(ResourceError):
            store.load(record)
    assert "corrupt" in said[0]
    assert "results/cache/simulate" in said[0]
    assert len(said[0].splitlines()) == 1
    path.write_bytes(whole)
    assert store.find("simulate", KEY) == record


def test_a_command_reports_a_damaged_file_once(tmp_path: Path, fresh: Path, command: Command):
    """Two runs in two processes: each is looked for before it is waiting, and again before it begins."""
    one = write("pendulum", tmp_path)[0]
    other = one.with_name("heavy.toml")
    other.write_text(one.read_text().replace('mass = "1 kg"', 'mass = "2 kg"'))
    command("run", one, other, "--jobs", "1", "-q")
    for stored in (fresh / "cache" / "simulate").glob("*.nc"):
        stored.chmod(0o644)
        stored.write_bytes(stored.read_bytes()[:-1] + b"?")
    reported = command("run", one, other, "--jobs", "2", "-q").err
    assert reported.count("is corrupt") == reported.count("it will be computed again") == 2


@pytest.mark.parametrize("file", ["nc", "vtu", "json"])
def test_a_truncated_or_missing_file_makes_the_artifact_absent(store: Store, file: str):
    put(store)
    path = store.path("simulate", KEY, file)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert store.find("simulate", KEY) is None
    path.unlink()
    assert store.find("simulate", KEY) is None


def test_without_a_record_there_is_no_artifact(store: Store):
    """A process killed between the data and the record has left valid-looking data."""
    put(store)
    store.path("simulate", KEY, "json").unlink()
    assert store.find("simulate", KEY) is None
    assert store.find("simulate", "0" * 32) is None


def test_a_failed_read_back_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The disk returns something else than was written: the new file must not take the name."""
    path = tmp_path / "a.bin"
    publish(path, b"old")
    monkeypatch.setattr(Path, "read_bytes", lambda self: b"not what was written")
    with pytest.raises(OSError, match="cannot be read back"):
        publish(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.bin"]


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """A limit on the size of files answers a write as a full disk does: with an error from the system."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("kind, limit", [("nc", 0), ("nc", 300_000), ("png", 5_000)])
def test_a_full_disk_is_reported_and_leaves_nothing(tmp_path: Path, kind: str, limit: int):
    content = dataset(20_000) if kind == "nc" else bytes(1_000_000)
    with pytest.raises(ResourceError, match="disk is full") as caught, largest_file(limit):
        Store(tmp_path / "results").put("simulate", KEY, {kind: content}, {})
    assert caught.value.exit_code == 4
    assert [path for path in (tmp_path / "results").rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("compressed", [1 << 26, 0])
def test_the_library_reports_every_byte_that_it_cannot_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compressed: int
):
    """What it writes is not read back: wherever a disk ends, it raises an error."""
    monkeypatch.setattr(netcdf, "COMPRESSED", compressed)
    data, drawn = label_dataset(dataset(3_000)), Random(1)
    netcdf.write(tmp_path / "whole.nc", data)
    size = (tmp_path / "whole.nc").stat().st_size
    for limit in {0, 1, 100, size - 1, size - 2, size - 100, size - 4096, *(drawn.randrange(size) for _ in range(40))}:
        with pytest.raises((OSError, RuntimeError)), largest_file(limit):
            netcdf.write(tmp_path / f"{limit}.nc", data)
    with largest_file(size):
        netcdf.write(tmp_path / "again.nc", data)
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()


def test_a_disk_that_takes_no_more_when_it_is_forced_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Network disks may tell only then that they are full; the file is forced by a thread next to its digest."""
    path = tmp_path / "a.nc"
    digest = write_dataset(path, dataset(9))

    def full(handle: int) -> None:
        raise OSError(errno.EDQUOT, "Disk quota exceeded")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ResourceError, match="the disk is full"), disk.disk_limits(tmp_path):
        write_dataset(path, dataset(10))
    assert os.listdir(tmp_path) == ["a.nc"]
    assert disk.digest_of(path) == digest


def test_what_a_killed_process_left_is_swept_and_never_read(store: Store):
    folder = store.path("simulate", KEY, "nc").parent
    folder.mkdir(parents=True)
    left = folder / f".{KEY}.4711.0badcafe.tmp"
    left.write_bytes(b"half a dataset")
    other = folder / f".{'o' * 32}.4711.0badcafe.tmp"
    other.write_bytes(b"another key, perhaps being written right now")
    assert store.find("simulate", KEY) is None
    with store.lock("simulate", KEY):
        assert not left.exists()
    assert other.exists()


def test_the_lock_holds_between_processes(store: Store):
    code = (
        "import sys; from pathlib import Path; from flexclear.artifacts.store import Store\n"
        "with Store(Path(sys.argv[1])).lock('simulate', sys.argv[2], lambda: print('waiting', flush=True)):\n"
        "    print('mine', flush=True)"
    )
    with store.lock("simulate", KEY):
        command = [sys.executable, "-c", code, str(store.root), KEY]
        other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2])
        assert other.stdout is not None
        assert other.stdout.readline() == "waiting\n"
    with other:
        assert other.stdout.read() == "mine\n"
    assert other.returncode == 0


def test_shown_files_follow_the_current_artifact(store: Store):
    first = put(store)
    store.show(first, "runs/tiny", {"nc": "run.nc"}, "simulate")
    shown = store.root / "runs" / "tiny" / "run.nc"
    assert shown.read_bytes() == store.path("simulate", KEY, "nc").read_bytes()
    second = store.put("simulate", "l" * 32, {"nc": dataset(9)}, {"parameter c": "2"})
    store.show(second, "runs/tiny", {"nc": "run.nc"}, "simulate")
    assert store.load(second).equals(xr.load_dataset(shown, decode_times=False))
    last = store.last_shown("runs/tiny", "simulate")
    assert last is not None
    assert (last.key, dict(last.facts)) == ("l" * 32, {"parameter c": "2"})
    assert not list(store.root.rglob("*.tmp"))


def test_what_is_shown_shares_no_bytes_with_the_cache(store: Store, said: list[str]):
    """It is read-only; whoever edits it all the same damages nothing, and finds the edit again."""
    record = put(store)
    store.show(record, "runs/tiny", {"nc": "run.nc"}, "simulate")
    shown, kept = store.root / "runs" / "tiny" / "run.nc", store.path("simulate", KEY, "nc")
    assert not shown.samefile(kept)
    assert shown.stat().st_mode & 0o777 == 0o444
    before = shown.stat().st_ino
    store.show(record, "runs/tiny", {"nc": "run.nc"}, "simulate")
    assert shown.stat().st_ino == before  # what is there is not copied again
    shown.chmod(0o644)
    with shown.open("ab") as file:
        file.write(b"edited")
    assert store.find("simulate", KEY) == record
    store.show(record, "runs/tiny", {"nc": "run.nc"}, "simulate")
    assert shown.read_bytes() == kept.read_bytes()
    assert shown.with_name("run.edited.nc").read_bytes() == kept.read_bytes() + b"edited"
    (reported,) = said
    assert "run.nc was edited; the edited file is now run.edited.nc" in reported


def test_a_new_result_takes_the_place_of_the_last_one_without_a_word(store: Store, said: list[str]):
    store.show(put(store), "runs/tiny", {}, "simulate")
    store.show(store.put("simulate", "l" * 32, {"nc": dataset(9)}, {}), "runs/tiny", {}, "simulate")
    assert said == []
    assert sorted(os.listdir(store.root / "runs" / "tiny")) == [".facts", "nc", "vtu"]


@pytest.mark.parametrize("shown", [False, True])
def test_a_flipped_bit_in_a_record_makes_the_artifact_absent(store: Store, said: list[str], shown: bool):
    """Also one that leaves it readable: another fact, another digest. The same holds of the facts that are shown."""
    record = put(store)
    store.show(record, "runs/tiny", {}, "simulate")
    path = store.root / "runs/tiny/.facts/simulate.json" if shown else store.path("simulate", KEY, "json")
    path.chmod(0o644)
    whole = path.read_bytes()
    for place in range(0, len(whole), 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        found = store.last_shown("runs/tiny", "simulate") if shown else store.find("simulate", KEY)
        assert found is None or found == record  # white space says nothing
        line = f"results/cache/simulate/{KEY}.json is damaged or is not a record; it will be computed again"
        assert said == ([] if shown or found else [line])
        said.clear()
    path.write_bytes(whole)
    assert store.last_shown("runs/tiny", "simulate") == record


def test_a_folder_in_the_place_of_a_file_is_renamed_with_a_word(store: Store, capsys: pytest.CaptureFixture[str]):
    store.path("simulate", KEY, "nc").mkdir(parents=True)
    record = put(store)
    assert store.find("simulate", KEY) == record
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{KEY}.nc was a folder" in line
    assert f"the folder is now {KEY}.nc.folder1" in line


def test_what_the_dead_left_is_swept_and_what_is_held_stays(store: Store):
    put(store)
    folder = store.path("simulate", KEY, "nc").parent
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    names = {
        f".a.{disk._host()}-{dead.pid}.0badcafe.tmp": False,
        f".b.{disk._host()}-{os.getpid()}.0badcafe.tmp": True,
        f".c.0badcafe-{dead.pid}.0badcafe.tmp": True,  # of another machine, and young
        "d.lock": False,
        "notes.tmp": True,  # none of ours
    }
    for name in names:
        (folder / name).touch()
    with store.lock("simulate", "e" * 32):
        store.remove_leftovers()
        assert {name: (folder / name).exists() for name in names} == names
        assert (folder / f"{'e' * 32}.lock").exists()
    assert not (folder / f"{'e' * 32}.lock").exists()
    os.utime(folder / f".c.0badcafe-{dead.pid}.0badcafe.tmp", (0.0, 0.0))
    store.remove_leftovers()
    assert not (folder / f".c.0badcafe-{dead.pid}.0badcafe.tmp").exists()


@pytest.fixture
def forced(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Files and folders in the order in which they are forced to the disk."""
    found: list[Path] = []
    real = os.fsync

    def noted(handle: int) -> None:
        found.append(Path(os.readlink(f"/proc/self/fd/{handle}")))
        real(handle)

    monkeypatch.setattr(os, "fsync", noted)
    return found


def test_a_name_is_on_the_disk_before_it_is_relied_on(tmp_path: Path, forced: list[Path]):
    """The folder is forced to the disk after the file has got its name there."""
    publish(tmp_path / "a.bin", b"content")
    assert forced[0].suffix == ".tmp"
    assert forced[1:] == [tmp_path]


def test_names_of_an_artifact_are_forced_to_the_disk_once_after_its_record(store: Store, forced: list[Path]):
    """Each takes milliseconds of a disk, and an artifact is what has a record."""
    store.put("simulate", KEY, {"nc": dataset()}, {})
    folder = store.path("simulate", KEY, "nc").parent
    assert [path.parent for path in forced[:2]] == [folder, folder]
    assert forced[2:] == [folder]


def test_whoever_writes_into_what_was_just_stored_is_noticed(store: Store) -> None:
    """Also where sizes are equal: what is in memory is of the file that was written."""
    record = put(store)
    path = store.path("simulate", KEY, "nc")
    path.write_bytes(bytes(path.stat().st_size))
    os.utime(path, (1.0, 1.0))  # some clocks of disks are slower than this test
    with pytest.raises(ResourceError, match="changed while it was read"):
        store.load(record)
