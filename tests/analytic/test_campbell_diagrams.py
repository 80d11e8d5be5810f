"""Campbell diagrams of rotors against closed forms: whirls in fixed axes, branches, critical speeds, stability."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from flexclear.commands.__main__ import main
from flexclear.commands.frequencies import speeds
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.linear.campbell import campbell
from tests.analytic.mechanism_runs import TREE
from tests.analytic.test_unbalanced_rotors import ACROSS, ALONG, MASS, MIXED, SIDE, SLOPE, axes, damped, rotor


def whirls(speed: float) -> np.ndarray:
    """The overhung rotor's four whirls, backward ones negative, ascending [rad/s]; Genta (2005), sec. 2.6."""
    K, M = np.array([[SIDE, -MIXED], [-MIXED, SLOPE]]), np.diag([MASS, ACROSS])
    gyroscopic = np.diag([0.0, ALONG * speed])
    lower = np.hstack([-np.linalg.solve(M, K), 1j * np.linalg.solve(M, gyroscopic)])
    return np.sort(np.linalg.eigvals(np.vstack([np.eye(2, 4, 2), lower])).imag)


@pytest.mark.parametrize("unbalance, turn", [(0.0, "upright"), (1e-6, "oblique")])
def test_an_overhung_rotor_has_the_whirls_and_the_critical_speed_of_its_equations(unbalance: float, turn: str) -> None:
    at = [0.0, 60.0, 120.0, 140.0, 200.0, 400.0]
    made = campbell(rotor(20.0, unbalance, axes(turn)), {}, silent, at)
    kinds = made.whirl.values
    assert sorted(kinds) == ["", "", "backward", "backward", "forward", "forward"]
    branches = 2.0 * np.pi * made.whirl_frequency.values[:, kinds != ""]
    known = np.array([whirls(speed) for speed in at])
    # every branch keeps its place in the ascending order: whirls of this rotor never cross
    order = np.argsort(branches[-1])
    # differences of forces reach 1e-9, and the least whirl is a tenth of the fastest
    assert branches[:, order] == pytest.approx(known, rel=1e-6)
    assert np.all(made.growth.values == 0.0)
    turning = np.linalg.eigvals(
        np.linalg.solve(np.diag([MASS, ACROSS - ALONG]), [[SIDE, -MIXED], [-MIXED, SLOPE]])
    ).real
    critical = np.sqrt(turning[turning > 0.0])
    # interpolated on a straight line between 120 and 140 rad/s
    assert made.critical_speed.values[np.isfinite(made.critical_speed.values)] == pytest.approx(critical, rel=2e-3)


def test_a_jeffcott_rotor_whirls_at_one_frequency_at_all_speeds() -> None:
    """No gyroscopic moment: sqrt(k/m) forward and backward, and damping that drives it above that speed."""
    at, natural = [100.0, 200.0, 300.0], np.sqrt(SIDE / MASS)
    made = campbell(damped(rotor(20.0), 20.0), {}, silent, at)
    first = np.abs(2.0 * np.pi * made.whirl_frequency.values)
    slowest = np.nanargmin(np.where(made.whirl.values == "forward", first[0], np.nan))
    # damping of 1.4 % moves the frequency by its square
    assert first[:, slowest] == pytest.approx(natural, rel=5e-4)
    assert made.critical_speed.values[slowest] == pytest.approx(natural, rel=1e-3)
    assert (made.growth.values > 0.0).tolist() == [False, False, True]


def test_speeds_are_first_last_and_step_in_one_unit() -> None:
    assert speeds("0:500rpm:50") == pytest.approx(np.arange(0.0, 501.0, 50.0) * np.pi / 30.0)
    assert speeds("10:30:10") == pytest.approx([10.0, 20.0, 30.0])
    for wrong in ("500", "0:500rpm", "0:500kg:50", "0:500:-50", "500:0:50", "0:1e9:1"):
        with pytest.raises(InputError, match="--speeds"):
            speeds(wrong)


def test_the_command_prints_a_table_and_writes_dataset_and_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / "campbell.nc", tmp_path / "campbell.png"]
    out = [word for file in files for word in ("--out", str(file))]
    assert main(["frequencies", "checks/overhung_rotor", "--speeds", "0:100:50", *out]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[3:6]] == ["0", "50", "100"]
    assert any(line.startswith("critical speed of branch") for line in lines)
    with xr.open_dataset(files[0]) as kept:
        assert kept.speed.values.tolist() == [0.0, 50.0, 100.0]
    assert files[1].read_bytes().startswith(b"\x89PNG")


def test_options_of_a_diagram_need_its_speeds(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["frequencies", "checks/overhung_rotor", "--out", "campbell.png"]) == 2
    assert "add --speeds" in capsys.readouterr().err
    assert main(["frequencies", "checks/overhung_rotor", "--speeds", "0:100:50", "--drive", "motor"]) == 2
    assert "there is no such drive" in capsys.readouterr().err


def test_branches_pass_a_critical_speed_that_has_no_steady_motion() -> None:
    """A millimetre of unbalance; at 129 rad/s nothing small is steady."""
    at = [100.0, 110.0, 128.9, 140.0, 150.0]
    made = campbell(rotor(20.0, 1e-3, axes("oblique")), {}, silent, at)
    there = np.isfinite(made.growth.values)
    assert there[[0, 1, 3, 4]].all()
    kinds = made.whirl.values
    branches = 2.0 * np.pi * made.whirl_frequency.values[:, kinds != ""]
    known = np.array([whirls(speed) for speed in at])
    # a deflection of 7 e at 140 rad/s enters in second order, and m e^2 is 1.5e-4 of I_t
    assert np.sort(branches[[0, 4]], axis=1) == pytest.approx(known[[0, 4]], rel=5e-3)


@pytest.mark.parametrize("speed", [0.0, 100.0, 300.0])
def test_the_program_of_the_docs_finds_the_whirls_of_its_closed_form(speed: float) -> None:
    example = runpy.run_path(str(TREE / "docs" / "examples" / "campbell.py"))
    # the shaft's own mass, 1.6e-5 of the disc's, of which a quarter counts, is not in the closed form; the least whirl
    # is found as a difference of numbers ten times as large
    assert_allclose(example["found_whirls"](speed), example["whirls"](speed), rtol=2e-4)
