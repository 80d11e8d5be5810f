"""Compiled kernels: loaded only if every byte is as it was written, from a folder in which nobody else writes."""

import ctypes
import os
import time
from pathlib import Path

import pytest

from flexclear.artifacts.disk import encode_with_digest, publish
from flexclear.artifacts.paths import kernel_root, results_root
from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import files, folder, machine_code
from flexclear.dynamics.compile.files import file_lock, is_compiled, load_files, loaded
from flexclear.dynamics.routines import calls, store
from flexclear.system.errors import InputError

#: a constant that a flipped bit of the code would change
SOURCE = """from numba import cfunc

from flexclear.dynamics.compile.files import compiles


@compiles(cfunc("float64(float64)"))
def scaled(x):
    return 0.123456789 * x
"""


@pytest.fixture
def kernel(tmp_path: Path) -> Path:
    """A generated file whose code is on disk; named apart from those of every other test."""
    path = tmp_path / f"flexclear_{tmp_path.name}.py"
    path.write_text(SOURCE)
    assert used(path)
    return path


def used(path: Path) -> bool:
    """Load it as a new process would, and use it; whether it had to be compiled."""
    loaded.pop(path.stem, None)
    reported: list[Path] = []
    load_files([path], reported.append)
    scaled = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(loaded[path.stem].address)
    assert scaled(2.0) == 2.0 * 0.123456789
    assert is_compiled(path)
    return bool(reported)


def parts(path: Path) -> list[Path]:
    return [found for found in (path.with_suffix(".sum"), path.with_suffix(files.CODE)) if found.is_file()]


def test_what_is_whole_is_fetched(kernel: Path) -> None:
    assert {part.suffix for part in parts(kernel)} == {".sum", ".code"}
    assert not used(kernel)
    assert not list(kernel.parent.rglob("*.pyc"))  # bytecode would be taken without a look at what it holds
    assert not list(kernel.parent.rglob("*.lock"))


def test_every_flipped_bit_and_every_cut_is_detected_before_anything_is_loaded(kernel: Path) -> None:
    """Also in the file of digests itself; then it is compiled again, and whole."""
    for k in range(3):
        for name in (part.name for part in parts(kernel)):
            part = next(found for found in parts(kernel) if found.name == name)
            whole = part.read_bytes()
            place = (2 * k + 1) * len(whole) // 6
            broken = [whole[:place] + bytes([whole[place] ^ 1 << k]) + whole[place + 1 :], whole[:place], b""]
            part.write_bytes(broken[k] if k else broken[0])
            assert not is_compiled(kernel)
            assert used(kernel)
            assert not used(kernel)


@pytest.mark.parametrize(
    "content",
    [
        b"neither names nor code",
        b'{"name": "scaled", "foreign": ["a_function_that_nobody_has"]}\n',
        b'{"name": "scaled", "foreign": []}\nno object file',
    ],
)
def test_what_cannot_be_loaded_is_compiled_again(kernel: Path, content: bytes) -> None:
    """Its digest is right: it was written so, by whatever mistake; or it was interrupted; or its source is another."""
    kernel.with_suffix(files.CODE).write_bytes(content)
    publish(kernel.with_suffix(".sum"), encode_with_digest(files._digests(kernel)))
    assert is_compiled(kernel)
    assert used(kernel)
    assert not used(kernel)
    kernel.with_suffix(".sum").unlink()  # it is written last
    assert used(kernel)
    kernel.write_text(SOURCE + "\n# another text\n")
    assert used(kernel)


@pytest.mark.parametrize(
    "before, after", [(b'"name": "', b'"name": "x'), (b'"foreign": []', b'"foreign": ["a_function_that_nobody_has"]')]
)
def test_code_of_other_names_is_not_loaded(kernel: Path, before: bytes, after: bytes) -> None:
    """LLVM would end the process over a function that it does not find."""
    content = kernel.with_suffix(files.CODE).read_bytes()
    with pytest.raises(ValueError, match=r"no function|is not known"):
        machine_code.load(content.replace(before, after, 1))


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777])
def test_a_folder_that_others_can_write_is_refused(tmp_path: Path, mode: int) -> None:
    """To load what lies there would run their code."""
    made = folder.writable(tmp_path / "kernels", lambda _: None)
    made.chmod(mode)
    with pytest.raises(InputError, match=r"others can write to .*\n.*chmod go-w") as caught:
        folder.writable(tmp_path / "kernels", lambda _: None)
    assert caught.value.exit_code == 2
    made.chmod(0o755)
    assert folder.writable(tmp_path / "kernels", lambda _: None) == made


def test_a_folder_that_others_could_replace_is_refused(tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    with pytest.raises(InputError, match="others can write to"):
        folder.writable(tmp_path / "open" / "kernels", lambda _: None)
    (tmp_path / "open").chmod(0o1777)  # as /tmp: only owners rename
    folder.writable(tmp_path / "open" / "kernels", lambda _: None)


def test_results_hold_no_code(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A results folder that somebody sent is read, never run; two projects of a user share their kernels."""
    monkeypatch.delenv("FLEXCLEAR_KERNELS", raising=False)
    found = set()
    for name in ("one", "two"):
        monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / name))
        assert not kernel_root().is_relative_to(results_root())
        found.add(kernel_root())
    assert len(found) == 1


def test_what_nobody_uses_is_pruned(kernel: Path) -> None:
    """By its last use, then by size; never what another process is compiling."""
    assert folder.prune(kernel.parent) == 0
    month = time.time() - 30 * 86400.0
    os.utime(kernel.with_suffix(".sum"), (month, month))
    with file_lock(kernel, wait=True):
        assert folder.prune(kernel.parent, unused=86400.0) == 0
    assert is_compiled(kernel)
    assert not used(kernel)  # and that is noted
    assert folder.prune(kernel.parent, unused=86400.0) == 0
    assert folder.prune(kernel.parent, largest=1) == 1
    assert not parts(kernel)[1:]
    assert not kernel.exists()


def test_the_interpreter_belongs_to_the_header_that_it_reads() -> None:
    """The declarations of effects move the header's entries, without a change of the interpreter's own source."""
    names = []
    for place in (m.CALLS, m.CALLS + 1):
        names.append(store._table(calls.CallList(), place)["names"])
    assert names[0] != names[1]
