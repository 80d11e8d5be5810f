"""``flexclear cache``: tells what is kept and whether it is whole, and removes nothing that is shown or needed."""

import os
import shutil
from pathlib import Path

import pytest

import flexclear as fc
from flexclear.artifacts.disk import encode_with_digest
from flexclear.artifacts.store import Record, Store
from flexclear.commands import cache, why
from flexclear.commands.__main__ import main
from flexclear.dynamics.compile import files
from flexclear.system import machine
from tests.stages.conftest import Command


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: Path) -> Store:
    monkeypatch.setenv("FLEXCLEAR_KERNELS", str(tmp_path / "kernels"))
    return Store(fresh)


def put(store: Store, letter: str, stage: str = "simulate", **facts: str) -> Record:
    made = store.put(stage, letter * 32, {"nc": letter.encode() * 1000}, {"parameter c": letter, **facts})
    os.utime(store.path(stage, letter * 32, "json"), (0.0, 0.0))
    return made


def test_damage_is_reported_and_removed(store: Store, command: Command):
    for letter in "abc":
        store.show(put(store, letter), f"runs/{letter}", {}, "simulate")
    assert "3 artifacts, 0 faults" in command("cache", "check").out
    store.path("simulate", "a" * 32, "nc").write_bytes(b"b" * 1000)
    path = store.path("simulate", "b" * 32, "json")
    path.write_bytes(path.read_bytes().replace(b'"b"', b'"d"'))
    reported = command("cache", "check", code=4)
    assert f"{'a' * 32}.nc is corrupt" in reported.out
    assert f"{'b' * 32}.json is damaged or is not a record" in reported.out
    assert "never used" in reported.err
    os.utime(store.path("simulate", "b" * 32, "nc"), (0.0, 0.0))
    command("cache", "prune")
    assert sorted(p.name[0] for p in (store.root / "cache" / "simulate").glob("*")) == ["c", "c"]
    command("cache", "check")


def test_what_is_no_record_is_not_taken_for_a_damaged_one(store: Store, command: Command):
    """Memos of commands, and files of artifacts that end alike."""
    made = store.put("figures", "a" * 32, {"index.json": b"{}"}, {})
    memo = store.root / "cache" / "code.json"
    memo.write_bytes(encode_with_digest({}))
    assert "1 artifacts, 0 faults, 0 files" in command("cache", "check").out
    command("cache", "prune")
    assert store.fault(made) is None
    assert memo.is_file()


def test_pruning_keeps_what_is_shown_what_that_was_made_from_and_what_is_young(
    store: Store, command: Command, monkeypatch: pytest.MonkeyPatch
):
    below = put(store, "a")
    store.show(put(store, "b", **{"input run": below.digest}), "runs/x", {}, "post")
    put(store, "c")
    store.put("simulate", "d" * 32, {"nc": b"young"}, {})
    left = store.path("simulate", "e" * 32, "nc")
    left.write_bytes(b"its record was never written")
    os.utime(left, (0.0, 0.0))
    assert "removed 1 artifacts and 1 files without a record" in command("cache", "prune").out
    assert sorted(p.name[0] for p in (store.root / "cache" / "simulate").glob("*.nc")) == ["a", "b", "d"]
    monkeypatch.setattr(cache, "DAYS", 0.0)
    command("cache", "prune")
    assert sorted(p.name[0] for p in (store.root / "cache" / "simulate").glob("*.nc")) == ["a", "b"]


def test_points_of_sweeps_are_looked_at_as_well(store: Store, command: Command):
    """All batches of a family that a sweep shows stay, with the bundle that they were run with; others grow old."""
    bundle, other = put(store, "a", "bundle"), put(store, "b", "bundle")
    for letter, family, one in (("c", "x", bundle), ("d", "x", bundle), ("e", "y", other)):
        put(store, letter, f"sweep/{family}", **{"input rod": one.digest})
    store.show_families("sweeps/clearance", {"sweep/y": {}})
    store.show_families("sweeps/clearance", {"sweep/x": {"input rod": bundle.digest}})
    assert "sweep             3 artifacts" in command("cache", "size").out
    command("cache", "prune")
    assert sorted(path.name[0] for path in (store.root / "cache").rglob("*.nc")) == ["a", "c", "d"]
    assert "3 artifacts, 0 faults" in command("cache", "check").out
    store.path("sweep/x", "d" * 32, "nc").write_bytes(b"e" * 1000)
    assert f"sweep/x/{'d' * 32}.nc is corrupt" in command("cache", "check", code=4).out


def test_the_inputs_of_an_artifact_are_reported(store: Store, command: Command):
    store.show(put(store, "a"), "runs/x", {"nc": "run.nc"}, "simulate")
    for what in (str(store.root / "runs" / "x" / "run.nc"), "aaaa"):
        reported = command("cache", "explain", what).out
        assert f"simulate {'a' * 32}" in reported
        assert "parameter c: a" in reported
    command("cache", "explain", "b", code=2)
    assert "simulate          1 artifacts" in command("cache", "size").out


def test_kernels_of_another_build_are_counted_and_are_no_damage(store: Store, command: Command):
    """Their sums name other files than source and code; one of this build whose code is another's is damaged."""
    folder = store.root.parent / "kernels" / "abc"
    folder.mkdir(parents=True)
    for name, ends in (("old", (".py", ".nbi")), ("bad", (".py", ".code"))):
        (folder / f"flexclear_{name}.py").write_text("")
        (folder / f"flexclear_{name}.sum").write_bytes(
            encode_with_digest({f"flexclear_{name}{end}": "1" for end in ends})
        )
    reported = command("cache", "check", code=4).out
    assert "2 compiled kernels, 1 unused of another build" in reported
    assert "flexclear_bad.py is damaged" in reported
    assert "flexclear_old.py is damaged" not in reported


def test_kernels_that_another_process_removes_meanwhile_are_no_damage(
    store: Store, command: Command, monkeypatch: pytest.MonkeyPatch
):
    folder = store.root.parent / "kernels" / "abc"
    folder.mkdir(parents=True)
    source, sums = folder / "flexclear_old.py", folder / "flexclear_old.sum"
    source.write_text("")
    sums.write_bytes(encode_with_digest({}))
    compiled = files.is_compiled

    def pruned(path: Path) -> bool:
        sums.unlink(missing_ok=True)
        return compiled(path)

    monkeypatch.setattr(files, "is_compiled", pruned)
    monkeypatch.setattr(files, "stored_by_another_build", lambda path: False)
    assert "0 faults" in command("cache", "check").out


def test_results_of_another_processor_are_reported_and_are_fresh():
    """Numbers differ by rounding under one key: the record names the instructions, `why` and `explain` report them."""
    here = machine.instruction_set()
    assert {"processor", "instructions"} <= here.keys()
    of_here, of_others = (
        Record("simulate", "a" * 32, {"nc": "b"}, {}, {}, facts)
        for facts in (here, {**here, "NUMBA_CPU_NAME": "generic"})
    )
    assert why.notes("simulate", of_here) == []
    (note,) = why.notes("simulate", of_others)
    assert note.endswith("numbers differ by rounding: NUMBA_CPU_NAME generic, here (none)")
    # records of before have none
    assert why.notes("simulate", Record("simulate", "a" * 32, {"nc": "b"}, {})) == []


# Files that are shown below results/runs ----------------------------------------------------------------------------

SCENE = "checks/pendulum"


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run."""
    made = tmp_path_factory.mktemp("made") / "results"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLEXCLEAR_RESULTS", str(made))
        assert main(["run", SCENE, "-q", "--jobs", "1"]) == 0
    return made


@pytest.fixture
def shown(pendulum: Path, fresh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The run, in a copy of its results, with no kernels: those of other tests come and go meanwhile."""
    monkeypatch.setenv("FLEXCLEAR_KERNELS", str(tmp_path / "kernels"))
    shutil.copytree(pendulum, fresh)
    return fresh / "runs" / SCENE / "run.nc"


def rot(path: Path) -> None:
    """One byte changed, size and time as before."""
    status = path.stat()
    path.chmod(0o644)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    path.chmod(0o444)


def test_the_record_of_a_run_names_its_processor(shown: Path, command: Command):
    said = command("cache", "explain", shown).out
    assert f"computed by processor: {machine.instruction_set()['processor']}" in said


def test_bit_rot_in_a_shown_file_is_detected_and_run_shows_it_again(shown: Path, command: Command):
    good = shown.read_bytes()
    command("cache", "check")
    rot(shown)
    assert "run.nc differs from its artifact" in command("cache", "check", code=4).out
    with pytest.raises(fc.ResourceError, match="flexclear run checks/pendulum"):
        fc.open(SCENE)
    command("run", SCENE, "-q", "--jobs", "1")
    assert shown.read_bytes() == good
    assert "run" in fc.open(SCENE)


@pytest.mark.parametrize("kind", ["shown", "artifact", "record", "lock"])
def test_a_folder_in_the_place_of_a_file_is_renamed(shown: Path, fresh: Path, command: Command, kind: str):
    artifact = next((fresh / "cache" / "simulate").glob("*.nc"))
    places = {"shown": shown, "artifact": artifact}
    places |= {"record": artifact.with_suffix(".json"), "lock": artifact.with_suffix(".lock")}
    place, good = places[kind], shown.read_bytes()
    place.unlink(missing_ok=True)
    place.mkdir()
    (place / "somebody's").write_text("kept")
    if kind == "lock":
        artifact.with_suffix(".json").unlink()
    command("run", SCENE, "-q", "--jobs", "1")
    assert shown.read_bytes() == good
    assert [path.read_text() for path in fresh.rglob("somebody's")] == ["kept"]
    command("cache", "prune")
