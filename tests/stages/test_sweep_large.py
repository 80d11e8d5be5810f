"""Datasets of sweeps that are larger than memory: on disk, in slabs, with the same values."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr

import flexclear as fc
from flexclear.commands.__main__ import main
from flexclear.pipeline.core.system.errors import ResourceError
from flexclear.stages.sweeps import sweep_large

SWEEP = """
scene = "checks/pendulum"
keep = ["bob.position.series", "bob.velocity.largest"]
set = { "time.end" = "0.5 s"LIMITS }
error = true
combine = "COMBINE"
vary."body.bob.com.0" = ["-0.5 m", "-0.7 m", "-1 m", "-1.6 m", "-2 m"]
vary."solver.evaluations" = [100000, 100, 100001, 100002, 100003]
"""


def _dataset(path: Path, limits: str, combine: str, *arguments: str) -> int:
    path.write_text(SWEEP.replace("LIMITS", f", {limits}" if limits else "").replace("COMBINE", combine))
    return main(["sweep", str(path), "--workers=1", *arguments])


@pytest.mark.parametrize("combine", ["grid", "list"])
def test_slabs_have_the_values_of_the_whole(
    combine: str, tmp_path: Path, fresh: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    pytest.importorskip("zarr")
    copy = tmp_path / "copy.zarr"
    assert _dataset(tmp_path / "small.toml", "", combine, f"--out={copy}") == 0
    monkeypatch.setattr(sweep_large, "SLAB", 1500)
    monkeypatch.setattr(sweep_large, "BATCHES", 1)
    assert _dataset(tmp_path / "large.toml", '"limits.memory" = "1 kB"', combine) == 0
    assert "sweep.zarr" in capsys.readouterr().out
    place = fresh / "sweeps" / "large" / "sweep.zarr"
    assert not (place.parent / "sweep.nc").exists()
    with xr.open_dataset(fresh / "sweeps" / "small" / "sweep.nc", decode_times=False) as whole:
        for found in (xr.open_zarr(path, chunks=None, consolidated=False) for path in (place, copy)):
            assert found.attrs["complete"] == 1
            for name in ("bob.position.series", "bob.velocity.largest.error", "status", "time", "body.bob.com.0"):
                assert found[name].load().equals(whole[name]), name
            assert found["reason"].values.tolist() == whole["reason"].values.tolist()
    assert _dataset(tmp_path / "large.toml", "", combine) == 0
    assert not place.exists()
    assert (place.parent / "sweep.nc").exists()


def test_what_fits_nowhere_is_refused_before_it_is_run(
    root: Path,
    tmp_path: Path,
    fresh: Path,
    asked: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.setattr(sweep_large, "find_spec", lambda name: None)
    assert _dataset(tmp_path / "large.toml", '"limits.memory" = "1 kB"', "grid") == 4
    assert "flexclear[zarr]" in capsys.readouterr().err
    assert _dataset(tmp_path / "small.toml", "", "grid", f"--out={tmp_path / 'x.zarr'}") == 2
    few = {"limits.memory": "1 kB"}
    with pytest.raises(ResourceError, match="keep less"):
        fc.sweep(root / "scenes/checks/pendulum.toml", {"body.bob.mass": [1.0, 2.0]}, ["bob.position.series"], set=few)
    monkeypatch.undo()
    assert asked == []
