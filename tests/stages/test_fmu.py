"""FMUs for co-simulation: checked by FMPy against the standard, and against runs of the same scenes."""

import os
import signal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexclear as fc
from flexclear.commands.__main__ import main

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")

SLIDE = """
title = "A slide & its spring"
time.end = "1 s"
view.watch = ["A.position", "A.velocity", "slide.velocity"]
body.ground = { type = "ground", frames.A = {} }
body.slide = { type = "rigid", mass = "2 kg", inertia = [0.01, 0.01, 0.01], frames.O = {} }
joint.A = { type = "prismatic", between = ["ground.A", "slide.O"] }
load.push = { type = "joint-force", joint = "A", force = "0 N" }
load.spring = { type = "joint-spring", joint = "A", stiffness = "20 N/m" }
"""


def exported(scene: Path, version: str, *more: str) -> str:
    target = scene.with_name(f"{scene.stem}_{version}.fmu")
    assert main(["export", str(scene), "--format", "fmu", "--fmi", version, "--out", str(target), *more]) == 0
    return str(target)


def written(folder: Path, text: str = SLIDE, name: str = "slide.toml") -> Path:
    (folder / name).write_text(text)
    return folder / name


class Slave:
    """An FMU of version 2 or 3 in steps, by names."""

    def __init__(self, file: str, parameters: dict[str, float] | None = None, stop: float | None = None) -> None:
        self.said: list[str] = []
        described = fmpy.read_model_description(file)
        self.refs = {one.name: one.valueReference for one in described.modelVariables}
        self.fmu = fmpy.instantiate_fmu(fmpy.extract(file), described, "CoSimulation")
        self.second = described.fmiVersion.startswith("2")
        self.begin(parameters or {}, stop)

    def begin(self, parameters: dict[str, float], stop: float | None = None) -> None:
        self.time = 0.0
        if self.second:
            self.fmu.setupExperiment(startTime=0.0, stopTime=stop)
        self.set(**parameters)
        self.fmu.enterInitializationMode(**({} if self.second else {"startTime": 0.0, "stopTime": stop}))
        self.fmu.exitInitializationMode()

    def set(self, **values: float) -> None:
        (self.fmu.setReal if self.second else self.fmu.setFloat64)(
            [self.refs[name] for name in values], list(values.values())
        )

    def get(self, name: str) -> float:
        return float((self.fmu.getReal if self.second else self.fmu.getFloat64)([self.refs[name]])[0])

    def step(self, duration: float) -> None:
        self.fmu.doStep(self.time, duration)
        self.time += duration

    def end(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.mark.parametrize("version", ["2", "3"])
def test_an_fmu_is_valid_and_moves_as_the_scene(tmp_path: Path, version: str) -> None:
    file = exported(written(tmp_path), version)
    assert validation.validate_fmu(file) == []
    given = {"load.push.force": 3.0, "load.spring.stiffness": 10.0}
    found = fmpy.simulate_fmu(file, start_values=given, output_interval=0.1, stop_time=1.0)
    times = found["time"]
    # x = F/k (1 - cos(sqrt(k/m) t)); the tolerance is the scene's default, 1e-8 or tighter
    assert found["A.position"] == pytest.approx(0.3 * (1.0 - np.cos(np.sqrt(5.0) * times)), abs=1e-8)
    assert found["slide.velocity.z"] == pytest.approx(0.3 * np.sqrt(5.0) * np.sin(np.sqrt(5.0) * times), abs=1e-7)


def test_an_fmu_with_impacts_and_a_flexible_body_is_the_run(root: Path, tmp_path: Path) -> None:
    for name, body in (("clearance_slider_crank", "piston"), ("flexible_slider_crank", "slider")):
        text = f'extends = "{root}/scenes/checks/{name}.toml"\n[view]\nwatch = ["{body}.position", "kinetic"]\n'
        scene = written(tmp_path, text, f"{name}.toml")
        run = fc.run(scene)
        found = fmpy.simulate_fmu(exported(scene, "3"), output_interval=float(run.time[-1]) / 20)
        # two runs at the scenes' tolerances, 1e-9 of lengths below a metre
        expected = run.position.sel(body=body)[-1].values
        assert [found[f"{body}.position.{k}"][-1] for k in "xyz"] == pytest.approx(expected, abs=1e-8)
        assert found["kinetic"][-1] == pytest.approx(float(run.kinetic[-1]), rel=1e-6)


@pytest.mark.parametrize("version", ["2", "3"])
def test_a_motion_with_impacts_is_restored_and_reset_to_the_last_bit(root: Path, tmp_path: Path, version: str) -> None:
    watch = '["piston.position", "piston.velocity", "kinetic"]'
    text = f'extends = "{root}/scenes/checks/clearance_slider_crank.toml"\n[view]\nwatch = {watch}\n'
    slave = Slave(exported(written(tmp_path, text), version))
    names = [name for name in slave.refs if name.startswith(("piston", "kinetic"))]

    def follow(steps: int) -> list[list[float]]:
        rows = []
        for _ in range(steps):
            slave.step(7e-4)
            rows.append([slave.get(name) for name in names])
        return rows

    fmu, short = slave.fmu, "FMUState"
    first = follow(6)
    state, time = getattr(fmu, f"get{short}")(), slave.time
    stored = getattr(fmu, f"serialize{short}")(state)
    second = follow(10)
    getattr(fmu, f"set{short}")(state)
    slave.time = time
    assert follow(10) == second
    again = (fmu.deSerializeFMUstate if version == "2" else fmu.deserializeFMUState)(stored)
    getattr(fmu, f"set{short}")(again)
    slave.time = time
    assert follow(10) == second
    fmu.reset()
    slave.begin({})
    assert follow(16) == first + second
    slave.end()


#: a slide on a spring whose other end a drive moves
PULLED = """
title = "A slide pulled by a spring"
time.end = "1 s"
view.watch = ["B.position"]
body.ground = { type = "ground", frames = { A = {}, B = {} } }
body.hook = { type = "rigid", mass = "1 g", inertia = [1e-6, 1e-6, 1e-6], frames.O = {} }
body.slide = { type = "rigid", mass = "1 kg", inertia = [0.01, 0.01, 0.01], frames.O = {} }
joint.A = { type = "prismatic", between = ["ground.A", "hook.O"] }
joint.B = { type = "prismatic", between = ["ground.B", "slide.O"] }
load.spring = { type = "joint-expression", joint = "B", force = "-30 N/m * (B.position - A.position)" }
drive.d = { joint = "A", law = 0 }
"""


def test_two_coupled_fmus_become_one_mechanism(tmp_path: Path) -> None:
    """Masses 2 and 1, the first on a spring of 20 N/m, 30 N/m between them, pushed by 3 N: by eigenvalues.

    Force and motion are exchanged after each step: the error falls with the first power of its length.
    """
    first, second = exported(written(tmp_path), "3"), exported(written(tmp_path, PULLED, "pulled.toml"), "2")
    mass, stiffness = np.diag([2.0, 1.0]), np.array([[50.0, -30.0], [-30.0, 30.0]])
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    rest = np.linalg.solve(stiffness, [3.0, 0.0])
    exact = rest - shapes @ (np.cos(np.sqrt(squares)) * np.linalg.solve(shapes, rest))
    found = []
    a, b = Slave(first), Slave(second)
    for h in (0.05, 0.025, 0.0125):
        for one in (a, b):
            one.fmu.reset()
            one.begin({})
        for _ in range(round(1.0 / h)):
            gap = b.get("B.position") - a.get("A.position")
            a.set(**{"load.push.force": 3.0 + 30.0 * gap})
            b.set(**{"drive.d.law": a.get("A.position")})
            a.step(h)
            b.step(h)
        found.append(np.array([a.get("A.position"), b.get("B.position")]))
    a.end()
    b.end()
    errors = [float(np.linalg.norm(one - exact)) for one in found]
    assert [x / y for x, y in pairwise(errors)] == pytest.approx([2.0, 2.0], abs=0.4)
    assert 2.0 * found[2] - found[1] == pytest.approx(exact, abs=5e-3)  # without the first power, measured 4e-4


def test_an_input_with_a_rate_and_a_longer_experiment(tmp_path: Path) -> None:
    """A force 1 - cos t on the spring's slide, in closed form; FMI 2.0 has rates of inputs.

    The cubics' error of the force is h^4/384, some 3e-7 N.
    """
    slave = Slave(exported(written(tmp_path), "2"), stop=2.0)
    for t in 0.1 * np.arange(20):
        rate = float(np.sin(t + 0.1))
        slave.set(**{"load.push.force": 1.0 - float(np.cos(t + 0.1)) - 0.1 * rate})
        slave.fmu.setRealInputDerivatives([slave.refs["load.push.force"]], [1], [rate])
        slave.step(0.1)
    exact = (1.0 - np.cos(np.sqrt(10.0) * 2.0)) / 20.0 - (np.cos(2.0) - np.cos(np.sqrt(10.0) * 2.0)) / 18.0
    assert slave.get("A.position") == pytest.approx(exact, abs=1e-6)
    slave.end()


def test_wrong_values_and_a_lost_process_are_errors(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def processes() -> set[int]:
        found = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
        return {int(one) for one in found if b"flexclear.stages.fmu" in Path(f"/proc/{one}/cmdline").read_bytes()}

    before = processes()
    slave: Any = Slave(exported(written(tmp_path), "2"))
    for wrong in (float("nan"), float("inf")):
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.set(**{"load.push.force": wrong})
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set(**{"A.position": 1.0})
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set(**{"load.spring.stiffness": 1.0})  # it has begun
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.fmu.doStep(0.0, 5.0)
    slave.step(0.1)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.fmu.doStep(0.0, 0.1)  # back in time without a stored state
    (child,) = processes() - before
    os.kill(child, signal.SIGKILL)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.step(0.1)
    slave.fmu.freeInstance()
    said = capfd.readouterr()
    assert "beyond the scene's end" in said.out + said.err
    assert "a step from 0 s is asked for, but the motion is at 0.1 s" in said.out + said.err
    assert "has ended" in said.out + said.err


def test_unknown_formats_and_versions_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = str(written(tmp_path))
    for options, said in (
        (["--format", "fmo"], "did you mean 'fmu'"),
        (["--format", "fmu", "--fmi", "4"], "is no version of FMI"),
        (["--format", "fmu", "--out", str(tmp_path / "x.zip")], "unknown format '.zip'"),
    ):
        assert main(["export", scene, *options]) == 2
        assert said in capsys.readouterr().err
