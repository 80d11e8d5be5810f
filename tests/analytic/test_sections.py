"""Chaos: diagnostics on maps and flows of known nature, and sections of mechanisms with known periodic motion."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexclear as fc
from flexclear import dynamics
from flexclear.commands.__main__ import main
from flexclear.commands.sections import write_page
from flexclear.dynamics import analyses
from flexclear.post.sections import verdict
from flexclear.post.sections.verdict import derive, judge
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.properties.mechanisms import joint, rigid
from tests.properties.mechanisms import scene as small

N = 600


def logistic(r: float, n: int = N) -> tuple[np.ndarray, np.ndarray]:
    """States and logarithms of the derivative of x -> r x (1 - x), after 500 steps."""
    x, states, growth = 0.2345, [], []
    for k in range(500 + n):
        if k >= 500:
            states.append(x)
            growth.append(np.log(abs(r * (1.0 - 2.0 * x))))
        x = r * x * (1.0 - x)
    return np.array(states)[:, None], np.array(growth)


def circle(coupling: float, winding: float, n: int = N) -> tuple[np.ndarray, np.ndarray]:
    """The circle map as a point on a circle; its derivative's logarithm."""
    angle, states, growth = 0.1, [], []
    for _ in range(n):
        states.append([np.cos(angle), np.sin(angle)])
        growth.append(np.log(abs(1.0 - coupling * np.cos(angle))))
        angle += 2.0 * np.pi * winding - coupling * np.sin(angle)
    return np.array(states), np.array(growth)


@pytest.fixture(scope="module")
def duffing() -> tuple[np.ndarray, np.ndarray]:
    """Ueda's oscillator x'' + 0.05 x' + x^3 = 7.5 cos t, strobed, with the growth of its tangent per period."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        x, v, a, b = y
        return [v, -0.05 * v - x**3 + 7.5 * np.cos(t), b, -3.0 * x**2 * a - 0.05 * b]

    y, states, growth = np.array([2.5, 0.0, 1.0, 0.0]), [], []
    for k in range(1040):
        y = solve_ivp(slope, (0.0, 2.0 * np.pi), y, method="DOP853", rtol=1e-8, atol=1e-10).y[:, -1]
        size = np.linalg.norm(y[2:])
        y[2:] /= size
        if k >= 40:
            states.append(y[:2].copy())
            growth.append(np.log(size))
    return np.array(states), np.array(growth)


def test_the_logistic_map_at_four_is_chaotic_with_exponent_log_two() -> None:
    states, growth = logistic(4.0)
    found = judge(states, growth, 1.0, 1.0)
    assert found.kind == "chaotic"
    assert found.numbers["exponent_low"] < np.log(2.0) < found.numbers["exponent_high"]
    # the standard deviation of one logarithm is pi / sqrt(12) = 0.91, of 600 correlated ones below 0.04
    assert found.numbers["exponent"] == pytest.approx(np.log(2.0), abs=0.12)


@pytest.mark.parametrize("r, after", [(2.9, 1), (3.2, 2), (3.5, 4)])
def test_the_logistic_map_doubles_its_period_before_that(r: float, after: int) -> None:
    states, growth = logistic(r)
    found = judge(states, growth, 1.0, 1.0)
    assert (found.kind, found.numbers["returns_after"]) == ("periodic", after)
    assert found.numbers["exponent_high"] < 0.0


def test_its_approach_to_the_fixed_point_contracts_by_the_derivative_there() -> None:
    x, states = 0.3, []
    for _ in range(60):
        states.append([x])
        x = 2.8 * x * (1.0 - x)
    # derivative at the fixed point 1 - 1/r: 2 - r; the first steps are not linear yet
    assert verdict.contraction(np.array(states)[5:]) == pytest.approx(0.8, rel=0.02)


def test_the_circle_map_below_its_critical_coupling_is_quasi_periodic() -> None:
    found = judge(*circle(0.3, 0.5 * (np.sqrt(5.0) - 1.0)), 1.0, 1.0)
    assert found.kind == "quasi-periodic"
    assert found.numbers["zero_one"] < 0.1


def test_the_forced_duffing_oscillator_has_its_published_exponent(duffing: tuple[np.ndarray, np.ndarray]) -> None:
    states, growth = duffing
    found = judge(states, growth, 2.0 * np.pi, 3.0)
    assert found.kind == "chaotic"
    # Sprott (2003), Chaos and Time-Series Analysis, table A.5: 0.1034; 1000 periods leave two percent
    assert found.numbers["exponent"] == pytest.approx(0.1034, rel=0.05)


def test_a_damped_linear_oscillator_is_periodic_and_contracts_at_its_decay() -> None:
    decay, frequency, period = 0.1, 1.7, 1.0
    k = np.arange(300)
    turn = np.exp(-decay * period * k) * np.exp(1j * frequency * period * k)
    states = np.stack([3.0 + turn.real, turn.imag], axis=1)
    found = judge(states, np.full(200, -decay * period), period, 1.0)
    assert (found.kind, found.numbers["returns_after"]) == ("periodic", 1)
    assert found.numbers["exponent"] == pytest.approx(-decay)
    assert found.numbers["contraction"] == pytest.approx(np.exp(-decay * period), rel=1e-3)


def test_too_few_periods_are_undecided() -> None:
    states, growth = logistic(3.569946, 40)  # at the end of the cascade: neither periodic nor chaotic
    assert judge(states, growth, 1.0, 1.0).kind == "undecided"


def test_white_noise_is_no_quasi_periodic_motion() -> None:
    noise = np.random.default_rng(3).normal(size=(N, 2))
    found = judge(noise, np.zeros(200), 1.0, 1.0)
    assert found.kind == "undecided"
    assert found.numbers["few_lines"] < 0.5


# Sections of mechanisms ----------------------------------------------------------------------------------------------

#: of the driven pendulum in scenes/checks, from its tangent equations by SciPy's DOP853 over 2000 periods
CHAOTIC = 0.112


@pytest.fixture(scope="module")
def pendulum() -> Scene:
    return fc.load_scene("scenes/checks/driven_pendulum.toml")


def with_torque(scene: Scene, amplitude: float, **sections: object) -> Scene:
    """Under another torque, which makes the motion regular when it is small."""
    change = {"load.torque.force.amplitude": amplitude} | {f"sections.{name}": v for name, v in sections.items()}
    return edited(scene, change)


def test_a_pendulum_that_is_driven_hard_is_chaotic_with_the_exponent_of_its_tangent_equations(pendulum: Scene) -> None:
    found = analyses.sections(edited(pendulum, {"sections.exponent_periods": 200}), {}, silent)
    verdict = derive(found)
    assert verdict.attrs["verdict"] == "chaotic"
    assert float(verdict.exponent_low) < CHAOTIC < float(verdict.exponent_high)
    # batches of 2000 periods differ by 8 %
    assert float(verdict.exponent) == pytest.approx(CHAOTIC, rel=0.3)


def test_a_pendulum_that_is_driven_gently_is_periodic_and_forgets_its_start_at_its_damping(
    pendulum: Scene, tmp_path: Path
) -> None:
    # small swings: exp(-t / 4) whatever the phase, so that the torque's period leaves exp(-T / 4)
    gentle = with_torque(pendulum, 1e-3, transient=0, periods=30, exponent_periods=30)
    found = analyses.sections(gentle, {}, silent)
    verdict = derive(found)
    period = float(found.attrs["period"])
    assert verdict.attrs["verdict"] == "periodic"
    assert int(verdict.returns_after) == 1
    # a neighbour's distance swings about its decay: in 30 periods by no more than twofold over all of 283 s
    assert float(verdict.exponent) == pytest.approx(-0.25, abs=2.0 * np.log(4.0) / (30 * period))
    # a page of verdicts has it for programs too
    write_page({"checks/pendulum": verdict}, {"checks/pendulum": found}, {}, tmp_path / "chaos.md")
    with (tmp_path / "chaos/verdicts.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["scene"], row["verdict"], row["periods"]) == ("checks/pendulum", "periodic", "30")
    # three digits are written
    assert float(row["exponent"]) == pytest.approx(float(verdict.exponent), rel=5e-3)
    assert "| `checks/pendulum` | periodic |" in (tmp_path / "chaos.md").read_text()


def test_sections_are_states_of_the_run_whose_laws_are_written_out(pendulum: Scene) -> None:
    # a harmonic torque goes on by itself: five periods in one run are five periods one by one
    period = pendulum.time.end
    one_by_one = analyses.sections(with_torque(pendulum, 1.5, transient=0, periods=20, exponent_periods=20), {}, silent)
    run = dynamics.simulate(edited(pendulum, {"time.end": 5.0 * period, "output.interval": period}), {}, silent)
    strobed = run.sel(time=period * np.arange(1, 5), method="nearest")
    # neighbours part by exp(0.112 x 47 s) = 200 of a tolerance of 1e-10, and both runs err
    for name in ("position", "velocity", "quaternion"):
        a, b = one_by_one[name].values[1:5], strobed[name].values
        sign = np.sign((a * b).sum(axis=-1, keepdims=True)) if name == "quaternion" else 1.0
        assert np.abs(a - b * sign).max() < 1e-5


def test_forces_by_expressions_are_repeated_like_laws(pendulum: Scene) -> None:
    """The damper as an expression without t, and the torque as one with it, are those of the scene."""
    short = with_torque(pendulum, 1.5, transient=0, periods=20, exponent_periods=20)
    written = {"type": "joint-expression", "joint": "pin"}
    damper = written | {"force": "-c * pin.velocity", "values": {"c": "0.5 N m s/rad"}}
    torque = written | {"force": "A * cos(w * t)", "values": {"A": "1.5 N m", "w": f"{2.0 / 3.0!r} rad/s"}}
    known = analyses.sections(short, {}, silent)
    for change in ({"load.friction": damper}, {"load.friction": damper, "load.torque": torque}):
        found = analyses.sections(edited(short, change), {}, silent)
        for name in ("position", "velocity"):
            # neighbours part by exp(0.112 x 47 s) = 200 of a tolerance of 1e-10 in five periods
            assert np.abs(found[name].values[:5] - known[name].values[:5]).max() < 1e-5


@pytest.mark.parametrize(
    "force, said",
    [
        ("A * cos(0.5 * w * t)", r"load\.torque\.force.*depends on t and does not repeat after a period"),
        ("A * pin.position * t / 1 s / 1 rad", "depends on t and does not repeat"),
        ("-A * max(0, t / 1 s - 3)^1.5 * cos(pin.position)", "depends on t and does not repeat"),
    ],
)
def test_an_expression_that_does_not_repeat_is_refused(pendulum: Scene, force: str, said: str) -> None:
    values = {name: value for name, value in {"A": "1.5 N m", "w": f"{2.0 / 3.0!r} rad/s"}.items() if name in force}
    torque = {"type": "joint-expression", "joint": "pin", "force": force, "values": values}
    with pytest.raises(InputError, match=said):
        analyses.sections(edited(pendulum, {"load.torque": torque}), {}, silent)


def test_an_expression_of_a_driven_angle_has_its_full_turns() -> None:
    """A crank that turns once in a period: its sine repeats, the angle itself does not."""
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "crank": rigid(1.0, 0.1, {"o": {}, "end": {"position": [0.1, 0.0, 0.0]}}),
        "bob": rigid(1.0, 0.1, {"o": {}}, com=[0.0, -0.1, 0.0]),
    }
    joints = {"pin": joint("revolute", "ground.o", "crank.o"), "swing": joint("revolute", "crank.end", "bob.o")}
    law = {"type": "polynomial", "coefficients": [0.2, 2.0 * np.pi]}
    table = small(bodies, joints, end=1.0, rtol=1e-6, drive={"motor": {"joint": "pin", "law": law}})
    table["sections"] = {"transient": 0, "periods": 20, "exponent_periods": 20}
    brake = {"type": "joint-expression", "joint": "swing"}
    repeating = brake | {"force": "1 N m * sin(pin.position)"}
    found = analyses.sections(Scene.model_validate(table | {"load": {"brake": repeating}}), {}, silent)
    assert found.sizes["section"] == 20
    winding = brake | {"force": "1 N m * pin.position / 1 rad"}
    with pytest.raises(InputError, match="reads a driven angle and does not repeat"):
        analyses.sections(Scene.model_validate(table | {"load": {"brake": winding}}), {}, silent)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"sections.period": "5 s"}, "does not repeat after a period of 5 s"),
        ({"sections.period": "20 s"}, "longer than the run"),
        ({"sections.phase": "20 s"}, "not within the period"),
        ({"sections.bodies": ["bog"]}, "there is no body 'bog'"),
    ],
)
def test_what_cannot_be_looked_at_is_refused(pendulum: Scene, change: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        analyses.sections(edited(pendulum, change), {}, silent)


def test_a_motion_that_no_law_repeats_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sections", "scenes/checks/pendulum.toml", "--set", "sections.periods=20"]) == 2
    assert "neither a drive nor a load has a law of time" in capsys.readouterr().err


def test_the_repeated_stroke_with_clearance_and_rigid_rods_settles_on_one_period() -> None:
    scene = fc.load_scene("scenes/sps4/variants/first_csj.toml")
    short = edited(scene, {"sections.transient": 2, "sections.periods": 20, "sections.exponent_periods": 20})
    found = analyses.sections(short, {}, silent)
    verdict = derive(found)
    assert int(verdict.returns_after) == 1
    # of runs of the written-out stroke: 0.59 a stroke
    assert float(verdict.contraction) == pytest.approx(0.59, abs=0.06)
