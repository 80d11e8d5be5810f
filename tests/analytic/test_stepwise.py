"""A motion in steps of one's own (`fc.simulation`): against whole runs, closed forms, and itself restored."""

import re
import runpy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import null_space

import flexclear as fc
from flexclear.dynamics import memory as m
from flexclear.dynamics.run import trajectory
from flexclear.dynamics.run.evaluation import engine
from flexclear.dynamics.run.progress_rate import Judge
from tests.processes import python

SLIDE: dict[str, Any] = {
    "title": "A slide",
    "time": {"end": "1 s"},
    "solver": {"rtol": 1e-9},
    "body": {
        "ground": {"type": "ground", "frames": {"A": {}}},
        "slide": {"type": "rigid", "mass": 2.0, "inertia": [0.01, 0.01, 0.01], "frames": {"O": {}}},
    },
    "joint": {"A": {"type": "prismatic", "between": ["ground.A", "slide.O"]}},
}


def slide(**parts: Any) -> Any:
    return fc.load_scene({**SLIDE, **parts})


def pushed(force: float) -> Any:
    return slide(load={"push": {"type": "joint-force", "joint": "A", "force": force}})


def check(root: Path, name: str, **changes: Any) -> Any:
    return fc.load_scene(root / f"scenes/checks/{name}.toml", override=changes)


# Steps ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, pieces, allowed",
    [
        ("controllers", 130, 1e-9),  # samples of a controller, some of them where a step ends
        ("stops", 37, 1e-8),  # bounces
        ("clearance_four_bar", 20, 1e-10),  # a closed loop with redundant rows, impacts with friction
        ("flexible_slider_crank", 20, 1e-9),
        ("rubbing_slider_crank", 20, 1e-8),  # steps that end at kinks of friction
    ],
)
def test_a_motion_in_steps_is_that_of_the_run(root: Path, name: str, pieces: int, allowed: float):
    """allowed: some hundred times what the scene's tolerance, 1e-8 to 1e-11 of lengths below a metre, leaves."""
    scene = check(root, name)
    run, duration = fc.run(scene), (scene.time.end - scene.time.start) / pieces
    with fc.simulation(scene) as sim:
        for _ in range(pieces):
            sim.advance(duration)
        assert sim.time == scene.time.end
        for body in run.body.values:
            for kind in ("position", "velocity"):
                expected = run[kind].sel(body=body)[-1].values
                assert sim.read(f"{body}.{kind}") == pytest.approx(
                    expected, abs=allowed * max(1.0, abs(expected).max())
                )
        energy = max(1.0, float(run.kinetic[-1]))
        assert sim.read("dissipated") == pytest.approx(float(run.dissipated[-1]), abs=1e3 * allowed * energy)


def test_a_restored_motion_with_impacts_repeats_to_the_last_bit(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Its steps use specialised code from some time on."""
    monkeypatch.setattr(trajectory, "SLICE", 100)
    monkeypatch.setattr(engine, "LONG", 500)
    scene, duration = check(root, "clearance_slider_crank"), 7e-4

    def follow(sim: Any) -> list[bytes]:
        states = []
        for k in range(12):
            sim.advance(duration)
            if k % 3 == 0:  # readings change nothing
                sim.read("pin.gap"), sim.equations()
            states.append(sim.state)
        return states

    with fc.simulation(scene) as sim:
        for _ in range(5):
            sim.advance(duration)
        here = sim.state
        first = follow(sim)
        assert sim.read("pin.contact_damping_loss") > 0.0
        sim.state = here
        assert sim.time == 5 * duration
        assert follow(sim) == first
        assert sim._engine.specialised.worthwhile
    (tmp_path / "here").write_bytes(here)
    program = f"""
import flexclear as fc
from flexclear.dynamics.run import trajectory
from flexclear.dynamics.run.evaluation import engine
from pathlib import Path
trajectory.SLICE, engine.LONG = 100, 500
with fc.simulation(fc.load_scene({str(scene.path)!r})) as sim:
    sim.state = Path("here").read_bytes()
    for _ in range(12):
        sim.advance({duration!r})
    Path("there").write_bytes(sim.state)
"""
    python("-c", program, cwd=tmp_path)
    assert (tmp_path / "there").read_bytes() == first[-1]


def test_another_method_continues_and_a_state_before_it_is_restored(root: Path):
    scene = check(root, "stops")
    with fc.simulation(scene) as sim:
        sim.advance(0.1)
        before, name = sim.state, sim._engine.model.scene.solver.integrator
        sim._judge = Judge(1, lambda engine, looks: "told to")
        sim._engine.n[m.BUDGET] = 0
        sim.advance(0.4)
        assert sim._engine.model.scene.solver.integrator != name
        sim.advance(0.5)
        run = fc.run(scene)
        # two methods at the scene's tolerance
        assert sim.read("A.position") == pytest.approx(float(run.joint_position.sel(coordinate="A")[-1]), abs=1e-7)
        sim.state = before
        assert (sim._engine.model.scene.solver.integrator, sim.time) == (name, 0.1)


# Inputs --------------------------------------------------------------------------------------------------------------


def test_an_input_is_the_scene_with_its_value():
    with fc.simulation(pushed(0.0)) as sim, fc.simulation(pushed(3.0)) as other:
        sim.inputs["load.push"] = "3 N"
        for one in (sim, other):
            one.advance(1.0)
        assert (dict(sim.inputs), sim.inputs.unit("load.push")) == ({"load.push.force": 3.0}, "N")
        assert sim.read("slide.position") == pytest.approx(other.read("slide.position"), abs=1e-15)
        assert sim.read("A.position") == pytest.approx(0.75, abs=1e-12)  # F t^2 / 2 m


def test_an_input_may_reach_its_value_by_a_cubic():
    """A force (1 - cos t) on a free mass: x = (t^2/2 - 1 + cos t) / m. The cubic is exact to h^4/384 of the force."""
    with fc.simulation(pushed(0.0)) as sim:
        for t in np.linspace(0.0, 1.0, 21)[1:]:
            sim.inputs["load.push"] = 1.0 - np.cos(t), np.sin(t)
            sim.advance(0.05)
        assert sim.read("A.position") == pytest.approx((0.5 - 1.0 + np.cos(1.0)) / 2.0, abs=2e-8)


def test_a_driven_motion_follows_its_input():
    scene = slide(time={"end": "2 s"}, drive={"d": {"joint": "A", "law": 0.0}})
    with fc.simulation(scene) as sim:
        for t in np.linspace(0.0, 1.0, 101)[1:]:
            sim.inputs["drive.d"] = np.sin(3.0 * t), 3.0 * np.cos(3.0 * t)
            sim.advance(0.01)
        assert sim.read("A.velocity") == pytest.approx(3.0 * np.cos(3.0), abs=1e-12)
        assert sim.read("drive_work") == pytest.approx(9.0 * (np.cos(3.0) ** 2), rel=1e-9)  # m v^2 / 2
        for _ in range(2):  # a number is gone to, then held
            sim.inputs["drive.d"] = "20 cm"
            sim.advance(0.01)
        assert (sim.read("A.position"), sim.read("A.velocity")) == (0.2, 0.0)


def test_a_controller_in_python_becomes_the_built_in_one():
    """Sampling delays by half a period: the error falls with the first power of it, here 1.00."""
    gains = {"proportional": 200.0, "integral": 300.0, "derivative": 8.0}
    pid = slide(load={"push": {"type": "pid", "joint": "A", "reference": 0.1, **gains}})
    exact, errors = float(fc.run(pid).joint_position[-1, 0]), []
    for count in (250, 500, 1000):
        with fc.simulation(pushed(0.0)) as sim:
            integral, period = 0.0, 1.0 / count
            for _ in range(count):
                error = 0.1 - sim.read("A.position")
                integral += period * error
                sim.inputs["load.push"] = 200.0 * error + 300.0 * integral - 8.0 * sim.read("A.velocity")
                sim.advance(period)
            errors.append(sim.read("A.position") - exact)
    assert [a / b for a, b in pairwise(errors)] == pytest.approx([2.0, 2.0], abs=0.1)
    with fc.simulation(pid) as sim:
        sim.inputs["load.push.reference"] = 0.2
        sim.advance(1.0)
        assert sim.read("A.position") == pytest.approx(2.0 * exact, rel=1e-7)  # linear, and at rest at the start


def test_the_example_balances_the_pole(root: Path):
    """The slowest poles are -2 1/s: after 8 s of the motion, 0.3 m at most, some 1e-6 are left."""
    cart, pole = runpy.run_path(str(root / "docs/examples/controller.py"))["balanced"]()
    assert abs(cart) < 1e-4
    assert abs(pole) < 1e-4


def test_the_loop_of_the_page_runs(root: Path):
    (code,) = re.findall(r"^```python\n(.*?)^```$", (root / "docs/stepwise.md").read_text(), re.DOTALL | re.MULTILINE)
    known: dict[str, Any] = {}
    exec(code.replace('"scenes', f'"{root}/scenes'), known)
    with pytest.raises(fc.InputError, match="closed"):
        known["sim"].advance(1e-3)


# Equations -----------------------------------------------------------------------------------------------------------


def test_the_equations_are_those_of_the_double_pendulum():
    """Two equal rods of point masses, relative angles a and b: the textbook's mass matrix and bias."""
    bob = {"type": "rigid", "mass": 1.0, "inertia": [1e-12] * 3, "com": [0.0, -1.0, 0.0]}
    frames = {"top": {}, "end": {"position": [0.0, -1.0, 0.0]}}
    scene = fc.load_scene(
        {
            "title": "Double pendulum",
            "time": {"end": 1.0},
            "body": {
                "ground": {"type": "ground", "frames": {"O": {}}},
                **{f"rod_{n}": {**bob, "frames": frames} for n in "ab"},
            },
            "joint": {
                "a": {"type": "revolute", "between": ["ground.O", "rod_a.top"]},
                "b": {"type": "revolute", "between": ["rod_a.end", "rod_b.top"]},
            },
            "load": {"gravity": {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]}},
            "start": {"joint": {"a": {"position": 1.0}, "b": {"position": 0.5, "velocity": 2.0}}},
        }
    )
    with fc.simulation(scene) as sim:
        sim.advance(0.3)
        (a, b), (u, v) = ([sim.read(f"{n}.{kind}") for n in "ab"] for kind in ("position", "velocity"))
        found = sim.equations()
        order = [found.coordinates.index(n) for n in "ab"]
    mass = [[3.0 + 2.0 * np.cos(b), 1.0 + np.cos(b)], [1.0 + np.cos(b), 1.0]]
    weight = 9.81 * np.array([2.0 * np.sin(a) + np.sin(a + b), np.sin(a + b)])
    bias = np.sin(b) * np.array([-2.0 * u * v - v**2, u**2]) + weight
    assert found.mass[np.ix_(order, order)] == pytest.approx(np.array(mass), abs=1e-10)
    assert found.bias[order] == pytest.approx(bias, abs=1e-9)
    assert found.speeds[order] == pytest.approx([u, v])


@pytest.mark.parametrize("name", ["four_bars_2", "gears", "bushing", "clearance_four_bar"])
def test_the_equations_hold_for_the_motion(root: Path, name: str):
    """M a + bias lies in the rows of the closures, M gives the kinetic energy, Jacobians the velocities."""
    scene = check(root, name)
    with fc.simulation(scene) as sim:
        sim.advance(0.2 * scene.time.end)
        one, before = sim.equations(), sim.state
        assert 0.5 * one.speeds @ one.mass @ one.speeds == pytest.approx(sim.read("kinetic"), rel=1e-9)
        for body in scene.body:
            if scene.body[body].type != "ground":
                velocity = sim.read(f"{body}.velocity")
                assert sim.jacobian(f"{body}.velocity") @ one.speeds == pytest.approx(velocity, abs=1e-9)
        step = 1e-6 * scene.time.end
        sim.advance(step)
        ahead = sim.equations().speeds
        sim.state = before
        sim.advance(2.0 * step)
        acceleration = (4.0 * ahead - 3.0 * one.speeds - sim.equations().speeds) / (2.0 * step)
    free = null_space(one.closures) if one.closures.size else np.eye(len(one.speeds))
    force = np.abs(one.bias).max() + np.abs(one.mass @ acceleration).max()
    # of the differences: rounding of the speeds over a step that is 1e-6 of the run, and its square
    assert np.abs(free.T @ (one.mass @ acceleration + one.bias)).max() < 1e-5 * force


# Refusals ------------------------------------------------------------------------------------------------------------


def test_wrong_names_values_and_durations_are_refused_in_words():
    with fc.simulation(pushed(0.0)) as sim:
        for name, value, said in (
            ("load.pusch", 1.0, "did you mean 'load.push.force'"),
            ("load.push.torque", 1.0, "no such input"),
            ("load.push", float("nan"), "nan is not a number"),
            ("load.push", "3 m", "'3 m' is a length, but a force is expected"),
            ("load.push", (1.0, 2.0, 3.0), "3 numbers are given"),
            ("load.push", None, "None is not a number"),
        ):
            with pytest.raises(fc.InputError, match=said):
                sim.inputs[name] = value
        for duration, said in ((-1e-3, "not a duration"), (np.nan, "not a duration"), (2.0, "beyond the scene's end")):
            with pytest.raises(fc.InputError, match=said):
                sim.advance(duration)
        with pytest.raises(fc.InputError, match=r"did you mean 'A\.position'"):
            sim.read("A.positon")
        with pytest.raises(fc.InputError, match="is not a velocity"):
            sim.jacobian("A.position")
        state = sim.state
        for wrong in (b"", state[:-1], state[:200] + b"?" + state[201:], "text"):
            with pytest.raises(fc.InputError, match="damaged"):
                sim.state = wrong
        with fc.simulation(pushed(1.0)) as other, pytest.raises(fc.InputError, match="of another scene"):
            other.state = state
        sim.advance(1.0)
        assert sim.read("A.position") == 0.0  # nothing of all this has moved it
    with pytest.raises(fc.InputError, match="closed"):
        sim.advance(0.1)


def test_a_law_that_is_no_number_is_no_input():
    law = {"type": "harmonic", "amplitude": 1.0, "frequency": 1.0}
    with fc.simulation(slide(load={"push": {"type": "joint-force", "joint": "A", "force": law}})) as sim:
        assert list(sim.inputs) == []
        with pytest.raises(fc.InputError, match=r"\[load.push\] has no such input; an input is .* gives as a number"):
            sim.inputs["load.push"] = 1.0


def test_a_motion_that_cannot_continue_says_so_until_it_is_restored():
    """A slide driven out of its rod's reach."""
    scene = fc.load_scene(
        {
            **SLIDE,
            "body": {
                "ground": {"type": "ground", "frames": {"A": {}, "B": {"position": [0.0, 0.3, 0.0]}}},
                "slide": SLIDE["body"]["slide"],
                "rod": {
                    "type": "rigid",
                    "mass": 1.0,
                    "inertia": [0.01, 0.01, 0.01],
                    "pose": {"position": [0.0, 0.15, 0.0]},
                    "frames": {"a": {"position": [0.0, -0.15, 0.0]}, "b": {"position": [0.0, 0.15, 0.0]}},
                },
            },
            "joint": {
                "A": SLIDE["joint"]["A"],
                "a": {"type": "spherical", "between": ["slide.O", "rod.a"]},
                "b": {"type": "spherical", "between": ["ground.B", "rod.b"]},
            },
            "drive": {"d": {"joint": "A", "law": 0.0}},
        }
    )
    with fc.simulation(scene) as sim:
        state = sim.state
        sim.inputs["drive.d"] = 0.1
        with pytest.raises(fc.SolverError):
            sim.advance(0.5)
        with pytest.raises(fc.SolverError, match="restore an earlier state"):
            sim.advance(0.1)
        sim.state = state
        sim.advance(0.1)
        assert sim.time == 0.1


# Going on from a run -------------------------------------------------------------------------------------------------


def split(scene: Any, fraction: float, folder: Path) -> tuple[Any, Any]:
    """The run of a scene at its end, in one piece and in two."""
    between = fraction * scene.time.end
    fc.run(fc.edited(scene, {"time.end": between})).to_netcdf(folder / "run.nc")
    later = fc.edited(scene, {"time.start": between, "start": {"from": str(folder / "run.nc")}})
    return fc.run(scene), fc.run(later)


@pytest.mark.parametrize(
    "name, fraction, allowed",
    [
        ("four_bars_2", 0.5, 1e-7),  # closed loops that have turned three times
        ("controllers", 0.504, 1e-10),  # integrals, limited ones too; at the 72nd sample of one controller
        ("clearance_slider_crank", 0.5, 1e-9),  # in contact
        ("stops", 0.5, 1e-9),
        ("bushing", 0.5, 1e-9),
        ("spinup_beam_stiffened", 0.5, 1e-7),  # modes that move the centre of mass to second order
    ],
)
def test_a_run_goes_on_from_a_run(root: Path, tmp_path: Path, name: str, fraction: float, allowed: float):
    """allowed: some hundred times what two runs at the scene's tolerance differ by."""
    whole, later = split(check(root, name), fraction, tmp_path)
    assert "start_mended" not in later.attrs
    for kind in ("position", "angular_velocity", "joint_position", "modal_coordinate", "controller_force"):
        if kind in whole:
            assert later[kind][-1].values == pytest.approx(whole[kind][-1].values, abs=allowed), kind


def test_bristles_go_on(root: Path, tmp_path: Path):
    """A pendulum whose pin's bristles hold it bent; half a run later they still do."""
    bristles = {"law": "lugre", "static": 0.5, "dynamic": 0.4, "v_stribeck": 2e-2, "bristle_stiffness": 1e3}
    scene = fc.edited(check(root, "pendulum"), {"joint.hinge.friction": {**bristles, "radius": 0.2}, "time.end": 1.0})
    whole, later = split(scene, 0.5, tmp_path)
    assert np.abs(whole.internal_state.values).max() > 1e-6
    for kind in ("position", "internal_state"):
        assert later[kind][-1].values == pytest.approx(whole[kind][-1].values, abs=1e-9)


def test_a_run_goes_on_from_a_time_in_it(root: Path, tmp_path: Path):
    scene = check(root, "pendulum")
    whole = fc.run(scene)
    whole.to_netcdf(tmp_path / "run.nc")
    middle = float(whole.time[len(whole.time) // 2])
    start = {"from": str(tmp_path / "run.nc"), "time": middle}
    later = fc.run(fc.edited(scene, {"time.start": middle, "start": start}))
    assert later.position[-1].values == pytest.approx(whole.position[-1].values, abs=1e-8)
    assert float(later.time[0]) == middle


def test_a_run_that_cannot_be_continued_is_refused_in_words(root: Path, tmp_path: Path):
    scene, file = check(root, "pendulum"), tmp_path / "run.nc"
    whole = fc.run(fc.edited(scene, {"time.end": 0.1}))
    whole.to_netcdf(file)
    data = file.read_bytes()

    def refused(said: str, start: dict[str, Any] | None = None, other: Any = scene) -> None:
        with pytest.raises(fc.InputError, match=said) as error:
            fc.run(fc.edited(other, {"start": {"from": str(file), **(start or {})}}))
        assert "start" in str(error.value)

    refused(r"no row at 0\.0333 s; the nearest are at ", {"time": 0.0333})
    refused("determines the whole start: remove start.at", {"at": "equilibrium"})
    refused("of other bodies: this scene has 'slide', that run has not", None, slide())
    file.write_bytes(data[: len(data) // 2])
    refused("run.nc cannot be read as a run")
    file.write_bytes(b"not a run")
    refused("run.nc cannot be read as a run")
    whole[["kinetic"]].to_netcdf(file)
    refused("is not a run of flexclear")
    for name, value in (("velocity", np.nan), ("quaternion", 3.0)):
        broken = whole.copy(deep=True)
        broken[name][-1] = value
        broken.to_netcdf(file)
        refused("run.nc is damaged")
    whole.isel(time=slice(0, 0)).to_netcdf(file)
    refused("has no rows")
    file.unlink()
    refused("there is no file")
    file.mkdir()
    refused("is not an ordinary file")
    with pytest.raises(fc.InputError, match="time is that of a run"):
        fc.edited(scene, {"start": {"time": 0.1}})
