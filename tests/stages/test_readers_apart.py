"""Files of others are read by a child: whatever they do to it is refused in words, and harms nothing else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flexclear.pipeline.core import system
from flexclear.pipeline.core.errors import InputError, ResourceError
from flexclear.pipeline.core.external_files import isolated, mesh, wire
from flexclear.pipeline.core.external_files.isolated import Limits, UnreadableError
from flexclear.pipeline.core.workflow import file_dependencies
from flexclear.pipeline.post.render import shape_files
from tests.stages import bad_readers

#: enough for what a reader here needs; on the clock much more than that, since machines are shared
SMALL = Limits(memory=300e6, seconds=1.0, patience=60.0)
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux alone")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.dat"
    path.write_bytes(b"content")
    return path


def test_numbers_and_texts_come_back_as_they_are(file: Path) -> None:
    found = isolated.read(bad_readers.doubled, file)
    assert found["bytes"].tobytes() == b"content"
    assert found["more"][:4] == [None, True, 1.5, "text"]
    np.testing.assert_array_equal(found["more"][4]["a"], np.eye(2, dtype=bool))


@pytest.mark.parametrize(
    "reader, arguments, words",
    [
        (bad_readers.crashes, (), r"broke down \(Segmentation fault"),
        (bad_readers.ends, (), r"broke down \(exit code 7"),
        (bad_readers.turns, (), "more than 1 s of the processor"),
        pytest.param(bad_readers.grows, (10**8,), "more than 300 MB of memory", marks=LINUX),
        (bad_readers.answers_much, (5 * 10**7,), "no message, or has more than 300 MB|more than 300 MB of memory"),
        (bad_readers.writes, (), "File too large|EFBIG"),
        (bad_readers.babbles, (), "no message|more than 60 s|more than 1 s"),
        (bad_readers.gives_objects, (), "an array of object"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_what_a_file_does_to_its_reader_is_told(
    file: Path, reader: object, arguments: tuple[object, ...], words: str
) -> None:
    assert callable(reader)
    with pytest.raises(UnreadableError, match=words):
        isolated.read(reader, file, *arguments, limits=SMALL)
    assert not (file.with_name("made").exists() and file.with_name("made").read_bytes())
    # the next file is read as if nothing had been
    assert isolated.read(bad_readers.doubled, file)["bytes"].tobytes() == b"content"


def test_a_folder_that_cannot_be_listed_may_hold_files(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(path: Path) -> object:
        raise PermissionError(path)

    monkeypatch.setattr(Path, "iterdir", closed)
    assert isolated.read(bad_readers.doubled, file)["bytes"].tobytes() == b"content"


def test_a_reader_that_waits_is_given_up(file: Path) -> None:
    with pytest.raises(UnreadableError, match=r"more than 0\.5 s"):
        isolated.read(bad_readers.sleeps, file, limits=Limits(300e6, 1.0, patience=0.5))


def test_one_child_reads_all_files_of_a_command(file: Path) -> None:
    assert len({isolated.read(bad_readers.number, file) for _ in range(3)} - {os.getpid()}) == 1


@pytest.mark.parametrize(
    "head", [b"{", b"[" * 100_000, b'{"array": ["O", [1]]}', b'{"array": ["<f8", [-1]]}', b'{"a": 1, "b": 2}']
)
def test_what_is_no_message_is_refused(head: bytes, tmp_path: Path) -> None:
    (tmp_path / "m").write_bytes(len(head).to_bytes(8, "little") + head)
    with (tmp_path / "m").open("rb") as file, pytest.raises((ValueError, EOFError)):
        wire.receive(file, 1e6)


def test_a_surface_that_unpacks_without_end_is_refused(tmp_path: Path) -> None:
    """In the words of the file that names it, as any mistake of a user."""
    path = tmp_path / "a.vtu"
    path.write_text("<VTKFile type='UnstructuredGrid'>" + "<a>" * 200_000)
    with pytest.raises(InputError, match="no surface that can be drawn") as caught:
        shape_files.read(path, 1.0)
    assert caught.value.exit_code == 2


def test_what_the_child_opens_counts(tmp_path: Path) -> None:
    """Also companions that only the reader knows; a file that it found in another state than this process is told."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 1 1\nv 0 0 1\nf 1 2 3\n")
    with file_dependencies.watched(tmp_path) as read:
        mesh.read(tmp_path / "a.obj")
    assert read == file_dependencies.digests(["a.obj"], tmp_path)
    with file_dependencies.watched(tmp_path):
        (tmp_path / "a.obj").read_bytes()
        with pytest.raises(ResourceError, match="changed while it was read"):
            file_dependencies.add({"a.obj": "another digest"}, tmp_path)


COMMAND = """
import sys
from pathlib import Path
from flexclear.pipeline.core.external_files import isolated
from tests.stages import bad_readers
print(isolated.read(bad_readers.number, Path(sys.argv[1])), flush=True)
isolated.read(bad_readers.turns, Path(sys.argv[1]))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals")
def test_the_child_ends_with_its_parent_whatever_it_does(file: Path, root: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, str(file)],
        stdout=subprocess.PIPE,
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        time.sleep(0.2)  # by then it turns
        assert system.alive(child)
        parent.kill()
    end = time.monotonic() + 20.0  # where the system sends no signal it is looked for each second
    while system.alive(child) and time.monotonic() < end:
        time.sleep(0.05)
    assert not system.alive(child)
