"""What a machine cannot hold is refused before anything is computed, with exit code 4 and in words."""

import errno
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from flexclear.artifacts.paths import kernel_root
from flexclear.scene.limits import check_cells
from flexclear.scene.load import load_scene, with_numbers
from flexclear.stages import scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.structure.fe.exchange import files
from flexclear.system import machine
from flexclear.system.errors import InputError, ResourceError
from tests.stages.conftest import JOINT, SCENE, Command


def written(folder: Path, text: str) -> Path:
    path = folder / "limited.toml"
    path.write_text(text)
    return path


def test_a_run_that_memory_cannot_hold_is_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
):
    """It was simulated to the end before."""
    monkeypatch.setattr(machine, "available_memory", lambda: 10**9)
    path = written(tmp_path, SCENE.replace('"0.1 ms"', '"1 us"') + JOINT)
    begun = time.monotonic()
    reported = command("run", path, code=4).err
    # loading and estimating; a run of a million rows takes longer on any machine
    assert time.monotonic() - begun < 60.0
    assert "a run of 1e+06 rows takes about" in reported
    assert "of memory, more than the 800 MB allowed" in reported


def test_limits_of_the_scene_take_the_place_of_the_machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(machine, "available_memory", lambda: 0)
    path = written(tmp_path, SCENE + JOINT + '[limits]\nmemory = "1 GB"\ndisk = "1 GB"\n')
    simulation.check_run(load_scene(path), tmp_path)
    for key in ("memory", "disk"):
        with pytest.raises(ResourceError, match="more than the 10 kB allowed"):
            simulation.check_run(load_scene(path, {f"limits.{key}": "10 kB"}), tmp_path)
    with pytest.raises(InputError, match=r"expected a size such as '4 GB'"):
        load_scene(path, {"limits.memory": "4 stones"})


def test_rows_and_members_are_limits_that_a_scene_may_raise(tmp_path: Path, fresh: Path, command: Command):
    """What is asked for is right, but too much: exit code 4, as for parts, cells and modes."""
    path = written(tmp_path, SCENE + JOINT)
    for place, value, reported in (
        ("output.interval", "1e-12 s", "more than the 10000000 that limits.rows allows"),
        ("ensemble.members", 200_000, "[ensemble.members]: 200000 are more than the 100000 that limits.members allows"),
    ):
        assert reported in command("run", path, "--set", f"{place}={value!r}", code=4).err
        with pytest.raises(ResourceError, match=r"^.*limited.toml \["):
            load_scene(path, {place: value})
    limits = {"limits.rows": 10**15, "limits.members": 10**6}
    load_scene(path, limits | {"output.interval": "1e-12 s", "ensemble.members": 200_000})
    raised = load_scene(path, limits | {"output.interval": "1e-12 s"})
    for reported in ({}, {"limits": raised.limits.as_table()}):  # made again by a stage, which may not get them
        assert simulation.rebuild(simulation.params(raised) | reported).output.interval == 1e-12
    with pytest.raises(ResourceError, match=r"limits\.rows"):
        with_numbers(load_scene(path), {"output.interval": 1e-12})
    (tmp_path / "many.toml").write_text(
        'scene = "limited.toml"\nkeep = ["bob.position.final"]\nmembers = 200_000\nvary."solver.rtol" = [1e-5, 1e-6]\n'
    )
    assert "[members]: 200000 are more than the 100000" in command("check", tmp_path / "many.toml", code=4).err


def test_limits_are_no_facts_and_reach_the_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    plain = load_scene(written(tmp_path, SCENE + JOINT))
    limited = load_scene(written(tmp_path, SCENE + JOINT + '[limits]\nmemory = "10 kB"\n'))
    assert simulation.params(plain) == simulation.params(limited)
    task = Graph(limited).simulate
    with pytest.raises(ResourceError, match="more than the 10 kB allowed"):
        simulation.run({**task.params, **task.context}, {}, lambda fraction, text: None)


@pytest.mark.parametrize("family", ["body", "joint"])
def test_more_parts_than_can_be_worked_on_are_refused_before_they_are_checked(tmp_path: Path, family: str):
    text = SCENE + JOINT + "".join(f"[{family}.x{k}]\n" for k in range(2001))
    begun = time.monotonic()
    with pytest.raises(ResourceError, match=rf"\[{family}\]: 200\d parts are more than the 2000") as caught:
        load_scene(written(tmp_path, text))
    assert caught.value.exit_code == 4
    assert time.monotonic() - begun < 60.0  # endless work takes minutes; reading the text takes 0.3 s here
    with pytest.raises(InputError):  # allowed, and then wrong
        load_scene(written(tmp_path, text.replace("[time]", "[limits]\nparts = 3000\n[time]")))


def test_cells_are_counted_from_the_recipe():
    limits = load_scene(Path("scenes/checks/pendulum.toml")).limits
    for shape, elements in (
        ({"cells": [100, 100, 100]}, None),
        ({"cells": {"along": 10**6, "across": 1}}, 1),
        ({}, 10**6),
    ):
        with pytest.raises(ResourceError, match=r"1e\+06 cells are more than the 500000"):
            check_cells(shape, elements, limits, Path("r.toml"))
    with pytest.raises(ResourceError, match=r"1e\+300 cells"):
        check_cells({}, 10**400, limits, Path("r.toml"))
    check_cells({"cells": [10, 10, 10]}, None, limits, Path("r.toml"))
    check_cells("nonsense", "nonsense", limits, Path("r.toml"))


def test_files_are_judged_by_their_headers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A small file may hold much: an archive of zeros, a header that promises a matrix."""
    monkeypatch.setattr(machine, "available_memory", lambda: 10**6)
    np.savez_compressed(tmp_path / "zeros.npz", node=np.zeros(10**6))
    assert (tmp_path / "zeros.npz").stat().st_size < 10**5
    with pytest.raises(ResourceError, match=r"'zeros.npz' unpacked takes about 32 MB"):
        files.read_npz(tmp_path / "zeros.npz", "recipe")
    (tmp_path / "a.mtx").write_text("%%MatrixMarket matrix coordinate real general\n9 9 100000000\n1 1 1.0\n")
    with pytest.raises(ResourceError, match=r"'a.mtx' takes about 9.6 GB"):
        files._matrix(tmp_path / "a.mtx", "recipe")


def test_damaged_matrices_are_refused_in_words(tmp_path: Path):
    """Flipped bits and cuts anywhere: zip, zlib and NumPy each complain in their own way."""
    rng = np.random.default_rng(5)
    np.savez_compressed(tmp_path / "a.npz", node=np.arange(30), stiffness_row=rng.integers(0, 30, 30))
    text = "%%MatrixMarket matrix coordinate real general\n3 3 2\n1 1 1.0\n3 2 2.0\n"
    (tmp_path / "a.mtx").write_text(text)
    for reader, path in ((files.read_npz, tmp_path / "a.npz"), (files._matrix, tmp_path / "a.mtx")):
        whole = path.read_bytes()
        for _ in range(150):
            place = int(rng.integers(len(whole)))
            broken = bytearray(whole)
            broken[place] ^= 1 << int(rng.integers(8))
            path.write_bytes(bytes(broken) if rng.random() < 0.7 else whole[:place])
            try:
                reader(path, "recipe")
            except (InputError, ResourceError) as error:
                assert len(str(error)) < 4000  # noqa: PT017 - many bits of a text matrix are as good as others
        path.write_bytes(whole)
    assert zipfile.is_zipfile(tmp_path / "a.npz")


def test_the_estimate_of_a_row_is_what_a_run_takes(root: Path):
    """Measured: 344 bytes a row of checks/pendulum, 6792 of sps4/ideal; the factors cover the rest within two."""
    for name, measured in (("checks/pendulum", 344), ("sps4/ideal", 6792)):
        estimate = simulation.row(load_scene(root / "scenes" / f"{name}.toml"))
        # an estimate: what matters is its order of size
        assert 0.5 * measured < estimate < 2.0 * measured


def test_a_page_for_which_the_disk_has_no_room_is_named_by_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The page that was there stays whole."""

    def full(path: Path, content: bytes) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(scenes, "publish", full)
    (tmp_path / "page.md").write_text("old")
    with pytest.raises(ResourceError, match=f"cannot write below {tmp_path}: the disk is full"):
        scenes.write_page(tmp_path / "page.md", "new", {})
    assert (tmp_path / "page.md").read_text() == "old"


#: a figure of a run, in this process
DRAWN = """
from flexclear.stages.scenes import graphs, open_workplace
(graph,) = graphs(["checks/pendulum"])
print([failure.message for failure in open_workplace().bring([graph.overview], jobs=1).failures])
"""


def test_figures_need_no_home_folder(root: Path, tmp_path: Path) -> None:
    """Libraries that draw write caches of their own elsewhere then, as in containers; these are no inputs."""
    (tmp_path / "file").touch()
    removed = ("MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in removed}
    environment |= {"HOME": str(tmp_path / "file" / "home"), "FLEXCLEAR_RESULTS": str(tmp_path / "results")}
    environment |= {"FLEXCLEAR_KERNELS": str(kernel_root())}
    command = [sys.executable, "-c", DRAWN]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "[]\n", done.stderr
    assert list((tmp_path / "results").glob("cache/*/*.json"))
