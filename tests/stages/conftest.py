"""The workflow at work with small engines in place of the real ones: in a copy of the project, or in this process.

Their `simulated` and `derive_arrays` make little datasets, and log each call to a file. `simulated` does not end
while there is a file of the name HELD_BY.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from flexclear import dynamics
from flexclear.commands.__main__ import main
from flexclear.dynamics import analyses
from flexclear.post.single_run import series
from flexclear.stages import scenes
from flexclear.stages.sweeps import sweep_engine
from flexclear.workflow import cores
from tests.processes import copied

#: a process that is silent for so long hangs, however slow or busy the machine is [s]
PATIENCE = 600.0

ENGINE = """
import os, time
from pathlib import Path
import numpy as np
import xarray as xr
from flexclear.system.errors import SolverError
from flexclear.scene.schema import Scene

def log(text):
    with open(os.environ["CALLS"], "a") as file:
        file.write(text + "\\n")

def simulated(scene, bundles, progress):
    log(f"simulate {scene.name}")
    progress(0.5, "half way")
    if "fails" in scene.name:
        raise SolverError("at t = 0.1 s joint A1: no step is small enough")
    while os.path.exists(os.environ.get("HELD_BY", "")):
        time.sleep(0.01)
    time_axis = np.arange(5) * scene.output.interval
    names = ["a", "platform"]
    data = {"position": (("time", "body"), np.outer(time_axis, [1.0, 2.0]))}
    attributes = {"scene": scene.name, "parameters": scene.model_dump_json()}
    if scene.accuracy is not None:
        attributes["accuracy_verdict"] = "missed: ball.position has an error of 2e-06, 2 times the requested accuracy"
    if "doubtful" in scene.name:
        attributes["warnings"] = "the rod bends too far\\nthe contact is too deep"
    return xr.Dataset(data, coords={"time": time_axis, "body": names}, attrs=attributes)

def ensemble(scene, bundles, progress):
    log(f"ensemble {scene.name}")
    return xr.Dataset({"position": (("member",), np.zeros(scene.ensemble.members))})
"""

POST = """
def derive_arrays(run, ensemble):
    log(f"post {run.attrs['scene']}")
    return run.to_xarray().mean("time")
"""

SCENE = """
title = "Ball in a socket"
[time]
end = "1 s"
[output]
interval = "0.1 ms"
[body.ground]
type = "ground"
frames.S = {}
[body.ball]
type = "rigid"
mass = "1 kg"
inertia = [1.0, 1.0, 1.0]
pose = {}
frames.B = {}
"""

JOINT = """
[joint.J]
type = "spherical"
between = ["ground.S", "ball.B"]
"""

CONTACT = """
extends = "ideal.toml"
title = "Ball in a socket, with clearance"
[replace.joint.J]
type = "clearance-spherical"
between = ["ground.S", "ball.B"]
clearance = "0.5 mm"
ball_radius = "20 mm"
normal = { law = "lankarani-nikravesh", restitution = 0.9, stiffness = 1e11 }
"""


def interruptible() -> None:
    """Tests that a shell put into the background ignore Ctrl-C, and so would what they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@dataclass(frozen=True)
class Project:
    """Its folder, its results, and the calls that its engines logged.

    capsys: of a project in this process, else it is a copy.
    """

    folder: Path
    capsys: pytest.CaptureFixture[str] | None = None
    started: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def results(self) -> Path:
        return self.folder / "results"

    def environment(self, **more: str) -> dict[str, str]:
        """Whatever is said of other places, the copy keeps its compiled modules: without them a start takes twice."""
        elsewhere = ("FLEXCLEAR_RESULTS", "PYTHONDONTWRITEBYTECODE")
        kept = {name: value for name, value in os.environ.items() if name not in elsewhere}
        return {
            **kept,
            "PYTHONPATH": str(self.folder / "pipeline"),
            "CALLS": str(self.folder / "calls"),
            "PYTHONWARNINGS": "ignore",
            **more,
        }

    def start(self, *arguments: str, **environment: str) -> subprocess.Popen[str]:
        """The command, running."""
        return self._started("-m", "flexclear", *arguments, **environment)

    def _started(self, *arguments: str, **environment: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=self.folder,
            env=self.environment(**environment),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=interruptible,
        )
        self.started.append(process)
        return process

    def run(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """The command, done."""
        if self.capsys is not None:
            code = main(list(arguments))
            return subprocess.CompletedProcess(arguments, code, *self.capsys.readouterr())
        return self.python("-m", "flexclear", *arguments, **environment)

    def python(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Python in the copy, done."""
        with self._started(*arguments, **environment) as process:
            out, err = process.communicate(timeout=PATIENCE)
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    @property
    def hold(self) -> Path:
        """A file for HELD_BY, there until it is removed."""
        path = self.folder / "hold"
        path.touch()
        return path

    def began(self) -> bool:
        """Whether an engine was called since."""
        return (self.folder / "calls").exists()

    def calls(self) -> list[str]:
        """What the engines did since this was asked last."""
        path = self.folder / "calls"
        lines = path.read_text().splitlines() if self.began() else []
        path.unlink(missing_ok=True)
        return lines

    def add(self, name: str, text: str) -> None:
        """Write one more scene of the family tiny."""
        path = self.folder / "scenes" / "tiny" / f"{name}.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def edit(self, file: str, old: str, new: str) -> None:
        path = self.folder / file
        text, changed = path.read_text(), path.stat().st_mtime
        assert old in text
        path.write_text(text.replace(old, new))
        os.utime(path, (changed + 2.0, changed + 2.0))  # Python tells modules from compiled ones by whole seconds

    def artifact(self, stage: str) -> Path:
        """The only dataset of a stage in the cache."""
        (path,) = (self.results / "cache" / stage).glob("*.nc")
        return path


@pytest.fixture
def project(tmp_path: Path) -> Iterator[Project]:
    """A fresh copy with small engines and two scenes: tiny/ideal and tiny/contact."""
    folder = copied(tmp_path / "project")
    (folder / "pipeline" / "flexclear" / "dynamics" / "__init__.py").write_text(ENGINE)
    (folder / "pipeline" / "flexclear" / "dynamics" / "analyses.py").write_text("from flexclear.dynamics import *\n")
    derived = "from flexclear.dynamics import log\n" + POST
    (folder / "pipeline" / "flexclear" / "post" / "single_run" / "series.py").write_text(derived)
    made = Project(folder)
    made.add("ideal", SCENE + JOINT)
    made.add("contact", CONTACT)
    yield made
    for process in made.started:
        process.kill()  # where a test fails, what it holds would run on


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Project:
    """The same two scenes and engines in this process, for what is no matter of processes or of sources."""
    engines: dict[str, Any] = {}
    exec(ENGINE + POST, engines)
    for module, name in ((dynamics, "simulated"), (analyses, "ensemble"), (series, "derive_arrays")):
        monkeypatch.setattr(module, name, engines[name])
    monkeypatch.setattr(scenes, "DATA", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CALLS", str(tmp_path / "calls"))
    monkeypatch.setenv("FLEXCLEAR_RESULTS", "results")
    made = Project(tmp_path, capsys)
    made.add("ideal", SCENE + JOINT)
    made.add("contact", CONTACT)
    return made


@pytest.fixture
def one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is done in this process: to start others takes longer than most of what is tested."""
    monkeypatch.setattr(cores, "count_cores", lambda: 1)


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of results."""
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return tmp_path / "results"


class Printed(NamedTuple):
    out: str
    err: str


Command = Callable[..., Printed]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Run the command in this process, which has to end with the code; what it printed."""

    def run(*arguments: str | Path, code: int = 0) -> Printed:
        try:
            ended = main([str(argument) for argument in arguments])
        except SystemExit as end:
            ended = int(end.code or 0)
        printed = Printed(*capsys.readouterr())
        assert ended == code, printed.out + printed.err
        return printed

    return run


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Keys of the points that are run."""
    keys: list[str] = []
    plain = sweep_engine.Engine.run

    def watched(engine: Any, jobs: Sequence[sweep_engine.Job], *rest: Any) -> None:
        keys.extend(job.key for job in jobs)
        plain(engine, jobs, *rest)

    monkeypatch.setattr(sweep_engine.Engine, "run", watched)
    return keys


@pytest.fixture(scope="module")
def shared_results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Results that tests share, so that each body is made once, in this process: others take seconds to start.

    Who looks into results has its own, `fresh`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLEXCLEAR_RESULTS", str(tmp_path_factory.mktemp("results")))
        patch.setattr(cores, "count_cores", lambda: 1)
        yield
