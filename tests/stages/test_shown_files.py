"""What is shown below results/runs: bit rot is found, and a folder in the place of a file blocks nothing."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import flexclear as fc
from flexclear.commands.__main__ import main

SCENE = "checks/pendulum"


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return tmp_path / "results"


@pytest.fixture
def shown(results: Path) -> Path:
    assert main(["run", SCENE, "-q", "--jobs", "1"]) == 0
    return results / "runs" / SCENE / "run.nc"


def rot(path: Path) -> None:
    """One byte changed, size and time as before."""
    status = path.stat()
    path.chmod(0o644)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    path.chmod(0o444)


def test_bit_rot_in_a_shown_file_is_found_and_run_shows_it_again(shown: Path, capsys: pytest.CaptureFixture[str]):
    good = shown.read_bytes()
    assert main(["cache", "check"]) == 0
    rot(shown)
    capsys.readouterr()
    assert main(["cache", "check"]) == 4
    assert "run.nc differs from what was shown" in capsys.readouterr().out
    with pytest.raises(fc.ResourceError, match="flexclear run checks/pendulum"):
        fc.open(SCENE)
    assert main(["run", SCENE, "-q", "--jobs", "1"]) == 0
    assert shown.read_bytes() == good
    assert "run" in fc.open(SCENE)


@pytest.mark.parametrize("kind", ["shown", "artifact", "record", "lock"])
def test_a_folder_in_the_place_of_a_file_is_renamed(shown: Path, results: Path, kind: str):
    artifact = next((results / "cache" / "simulate").glob("*.nc"))
    places = {"shown": shown, "artifact": artifact}
    places |= {"record": artifact.with_suffix(".json"), "lock": artifact.with_suffix(".lock")}
    place, good = places[kind], shown.read_bytes()
    place.unlink(missing_ok=True)
    place.mkdir()
    (place / "somebody's").write_text("kept")
    if kind == "lock":
        artifact.with_suffix(".json").unlink()
    assert main(["run", SCENE, "-q", "--jobs", "1"]) == 0
    assert shown.read_bytes() == good
    assert [path.read_text() for path in results.rglob("somebody's")] == ["kept"]
    assert main(["cache", "prune"]) == 0
