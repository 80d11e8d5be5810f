"""Unbalanced rotors at steady speed, their poses and stability, and Campbell diagrams, against closed forms."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from benchmarks.hard_scenes import ACROSS, ALONG, ARM, MASS, MIXED, SIDE, SLOPE, deflection, rotor
from flexclear.commands.__main__ import main
from flexclear.commands.frequencies import parse_speeds
from flexclear.dynamics import analyses
from flexclear.dynamics.linear.campbell import campbell
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, frequencies
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid, scene

#: no turn, and two about axes that are parallel to none of the world's
TURNS = {"upright": (0.0, 0.0, 0.0), "oblique": (0.7, -1.9, 0.4), "over": (2.0, 1.0, -2.0)}


def axes(turn: str) -> dict[str, list[float]]:
    R = rotation_vector_to_matrix(np.array(TURNS[turn]))
    return {"z": R[:, 2].tolist(), "x": R[:, 0].tolist()}


def damped(scene: Scene, damping: float) -> Scene:
    """The rotor on a shaft that is damped sideways [N s/m] and couples no slope with a deflection."""
    shaft = {"damping": [damping, damping, 0, 0, 0, 0], "stiffness": [SIDE, SIDE, 1e8, 1e6, 1e6, 1e6]}
    return edited(scene, {f"load.shaft.{name}": value for name, value in shaft.items()})


def steady(scene: Scene) -> xr.Dataset:
    return analyses.frequencies(scene, {}, silent, moving=True)


@pytest.mark.parametrize(
    "speed, size, turn",
    [
        (20.0, 1.0, "over"),
        (125.0, 1e-3, "oblique"),
        (150.0, 1.0, "upright"),
        (150.0, 1e3, "oblique"),
        (600.0, 1.0, "over"),
    ],
)
def test_an_unbalanced_disc_turns_where_its_equations_say(speed: float, size: float, turn: str) -> None:
    unbalance = 1e-5
    found = steady(rotor(speed, unbalance, axes(turn), size))
    x = deflection(speed)
    # the deflection, 1e-4 of the arm at most, enters in second order
    R = rotation_vector_to_matrix(np.array(TURNS[turn]))
    place = R.T @ found.frame_position.sel(frame="disc.o").values - [0.0, 0.0, ARM * size]
    assert place[0] == pytest.approx(x * unbalance * size, rel=1e-3)
    assert np.abs(place[1]) < 1e-3 * abs(place[0])
    assert found.attrs["growth"] == 0.0


@pytest.mark.parametrize(
    "unbalance, turn", [(0.0, "oblique"), (1e-9, "over"), (1e-6, "upright"), (1e-6, "oblique"), (1e-3, "over")]
)
def test_neither_direction_nor_unbalance_makes_a_rotor_unsteady(unbalance: float, turn: str) -> None:
    """Nor does it change the frequencies, but for the unbalance's own inertia: m e^2 is 1.5e-4 of I_t at 1 mm."""
    found = steady(rotor(20.0, unbalance, axes(turn)))
    upright = steady(rotor(20.0))
    assert found.frequency.values == pytest.approx(upright.frequency.values, rel=2e-4 if unbalance > 1e-4 else 1e-8)


def test_weight_across_an_axle_is_unsteady_still() -> None:
    weight = {**GRAVITY["gravity"], "acceleration": [0.0, 0.0, -1e-4]}
    with pytest.raises(SolverError, match="not steady"):
        steady(edited(rotor(20.0, 1e-6, axes("oblique")), {"load.weight": weight}))


@pytest.mark.parametrize("speed, turn", [(200.0, "upright"), (300.0, "oblique")])
def test_damping_in_the_shaft_makes_the_forward_whirl_grow_above_the_critical_speed(speed: float, turn: str) -> None:
    """In turning axes m (r'' + 2 i Omega r' - Omega^2 r) + c r' + k r = 0; Genta (2005), sec. 2.5.2."""
    damping = 20.0
    roots = np.roots([MASS, 2j * MASS * speed + damping, SIDE - MASS * speed**2])
    growth = float(max(roots.real))
    assert (growth > 0.0) == (speed > np.sqrt(SIDE / MASS))
    # differences of forces to 1e-9, frequencies up to 1e4 rad/s
    found = steady(damped(rotor(speed, 1e-6, axes(turn)), damping))
    assert found.attrs["growth"] == pytest.approx(max(growth, 0.0), rel=1e-4)


@pytest.mark.parametrize("speed, unbalance", [(40.0, 1e-3), (100.0, 1e-3), (100.0, 1e-6)])
def test_a_flexible_shaft_holds_its_unbalanced_disc_above_the_critical_speed_too(
    speed: float, unbalance: float
) -> None:
    """The overhung rotor of the checks, about an oblique axis; deflection as of `deflection`."""
    overrides = (
        ("drive.axle.law.coefficients", (0.0, speed)),
        ("body.disc.com", (unbalance, 0.0, 0.0)),
        ("body.disc.pose", None),
        ("body.ground.frames.axle", {"axis": (1.0, 2.0, 3.0)}),
    )
    found = frequencies.__wrapped__("checks/overhung_rotor", overrides, moving=True)
    K = 200e9 * np.pi * 0.01**4 / 4.0 / 0.5**3 * np.array([[12.0, -3.0], [-3.0, 1.0]])
    x = np.linalg.solve(K - speed**2 * np.diag([10.0, -0.1]), [10.0 * speed**2 * unbalance, 0.0])[0]
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    place = found.frame_position.sel(frame="disc.centre").values
    away = place - axis * (axis @ place)
    # the shaft's own mass is 1.6e-5 of the disc's, and its linear modes shorten nothing
    assert np.linalg.norm(away) == pytest.approx(abs(x), rel=1e-3)
    assert found.attrs["growth"] == 0.0


@pytest.mark.parametrize("speed, unbalance", [(100.0, 3e-4), (100.0, 1e-3), (100.0, 1e-2), (150.0, 3e-3)])
def test_no_motion_of_an_undamped_rotor_grows_by_rounding(speed: float, unbalance: float) -> None:
    """Its centrifugal and elastic forces balance: rounding of both remains in the forces per speed, 2e-6 1/s of it."""
    overrides = (("drive.axle.law.coefficients", (0.0, speed)), ("body.disc.com", (unbalance, 0.0, 0.0)))
    assert frequencies.__wrapped__("checks/overhung_rotor", overrides, moving=True).attrs["growth"] == 0.0


@pytest.mark.parametrize("across", [0.0, 0.5 * SIDE])
def test_a_seal_with_cross_coupling_drives_a_forward_whirl(across: float) -> None:
    """Between ground and disc: m l^2 + c l + k = i kc of z = x + iy in fixed axes; in turning ones l - i Omega."""
    speed, damping = 70.0, 30.0
    seal: Table = {"type": "bushing", "between": ["ground.seal", "disc.o"], "symmetric": False}
    matrix = np.zeros((6, 6))
    matrix[0, 1], matrix[1, 0] = across, -across
    seal |= {"stiffness": matrix.tolist(), "damping": [damping, damping, 0.0, 0.0, 0.0, 0.0]}
    place = {"position": [0.0, 0.0, ARM]}
    found = steady(edited(damped(rotor(speed), 0.0), {"body.ground.frames.seal": place, "load.seal": seal}))
    value = -found.decay_rate.values + 2j * np.pi * found.frequency.values
    for root in np.roots([MASS, damping, SIDE - 1j * across]):
        turning = root - 1j * speed
        known = turning if turning.imag > 0.0 else turning.conjugate()
        assert np.abs(value - known).min() < 1e-9 * abs(root)
    growth = max(0.0, *np.roots([MASS, damping, SIDE - 1j * across]).real)
    assert found.attrs["growth"] == pytest.approx(growth, rel=1e-9)
    assert (growth > 0.0) == (across > 0.0)


def test_a_rotor_on_a_bushing_alone_is_refused_with_its_remedy() -> None:
    alone = edited(rotor(20.0, 1e-6), {"joint.float": None})
    with pytest.raises(SolverError, match=r'disc has no joint.*type `free`.*between = \["hub.s", "disc.o"\]'):
        steady(alone)


@pytest.mark.parametrize("speed", [4.0, 12.0])
def test_an_arm_that_turns_fast_rises_to_its_stable_angle(speed: float) -> None:
    """A point on a hinged arm l: at rest below, above sqrt(g/l) at cos(angle) = g/(l Omega^2); Goldstein, ch. 2."""
    length, inertia = 0.4, 1e-6
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "hub": rigid(1.0, 1.0, {"o": {}, "h": {"axes": {"z": [0.0, 1.0, 0.0], "x": [0.0, 0.0, -1.0]}}}),
        "bob": rigid(1.0, inertia, {"h": {"position": [-length, 0.0, 0.0]}, "tip": {}}),
    }
    table = scene(
        bodies,
        {"axle": joint("revolute", "ground.o", "hub.o"), "hinge": joint("revolute", "hub.h", "bob.h")},
        load=GRAVITY,
        start={"joint": {"hinge": {"position": 0.1}}},
        drive={"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, speed]}}},
    )
    found = steady(Scene.model_validate(table))
    height = -found.frame_position.sel(frame="bob.tip", axis="z").item() / length
    # the bob's own inertia is 6e-6 of m l^2
    assert height == pytest.approx(min(1.0, 9.81 / (length * speed**2)), rel=1e-5)
    assert found.attrs["growth"] == 0.0


# Campbell diagrams: whirls in fixed axes, branches, critical speeds --------------------------------------------------


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
    assert parse_speeds("0:500rpm:50") == pytest.approx(np.arange(0.0, 501.0, 50.0) * np.pi / 30.0)
    assert parse_speeds("10:30:10") == pytest.approx([10.0, 20.0, 30.0])
    for wrong in ("500", "0:500rpm", "0:500kg:50", "0:500:-50", "500:0:50", "0:1e9:1"):
        with pytest.raises(InputError, match="--speeds"):
            parse_speeds(wrong)


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
    assert "unknown drive" in capsys.readouterr().err


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
