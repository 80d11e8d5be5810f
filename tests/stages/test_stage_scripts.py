"""The scripts in stages/ run one stage each, on the files of the stage before, and say what goes in and comes out."""

import subprocess
from pathlib import Path

import pytest
import xarray as xr

from tests.processes import python

#: a clamped rod, which has all stages, with few modes and a short motion
SCENE = """extends = "{root}/scenes/checks/clamped_rod.toml"
set.body.rod.modes.count = 8
set.time.end = "0.2 ms"
"""
#: stage -> the dataset that it writes
WRITES = {"mesh": "mesh/rod.nc", "modes": "modes/rod.nc", "bundle": "bundle/rod.nc", "simulate": "run.nc"}
WRITES |= {"post": "post.nc"}


def run(root: Path, folder: Path, stage: str) -> subprocess.CompletedProcess[str]:
    script = root / "stages" / f"{stage}.py"
    own = {"FLEXCLEAR_RESULTS": "results", "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root / "pipeline")}
    return python(script, "rod.toml", cwd=folder, succeeds=False, **own)


def test_each_stage_runs_alone_on_the_files_of_the_one_before(root: Path, tmp_path: Path) -> None:
    (tmp_path / "rod.toml").write_text(SCENE.format(root=root))
    results, before = tmp_path / "results" / "runs" / "rod", ""
    for stage, file in WRITES.items():
        done = run(root, tmp_path, stage)
        assert done.returncode == 0, done.stderr
        assert f"reads  {before}" in done.stdout
        assert f"writes results/runs/rod/{file}\n" in done.stdout
        assert [path for path in WRITES.values() if (results / path).exists()][-1] == file  # nothing beyond is run
        before = f"results/runs/rod/{file}\n"
    with xr.open_dataset(results / "bundle" / "rod.nc") as bundle:
        assert f"rod: {float(bundle['mass']):.4g} kg in 8 modes" in run(root, tmp_path, "bundle").stdout


@pytest.mark.parametrize("stage, missing", [("bundle", "mesh"), ("simulate", "mesh"), ("post", "mesh")])
def test_a_stage_asks_for_the_one_before_and_does_not_run_it(
    root: Path, tmp_path: Path, stage: str, missing: str
) -> None:
    (tmp_path / "rod.toml").write_text(SCENE.format(root=root))
    done = run(root, tmp_path, stage)
    assert done.returncode == 2
    assert f"results/runs/rod/{WRITES[missing]}: is missing or out of date: never run" in done.stderr
    assert f"hint: make {missing} SCENE=rod.toml" in done.stderr
    assert not (tmp_path / "results" / "runs").exists()
