"""A new integrator is one module and one line: a copy of the project with Heun's method added, used in every place."""

import json
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests import processes

MODULE = '''"""Heun's method of order 2, with Euler's as its error estimate."""

import numpy as np

from flexclear.pipeline.core.scene.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import hermite
from flexclear.pipeline.dynamics.integrate.method import Method, begin_afresh, keep_nothing, slope
from flexclear.pipeline.dynamics.integrate.norms import error_scale
from flexclear.pipeline.dynamics.integrate.runge_kutta import make_stages
from flexclear.pipeline.dynamics.kernels import kernel

A = np.array([[0.0, 0.0], [1.0, 0.0]])
B, C = np.array([0.5, 0.5]), np.array([0.0, 1.0])


@kernel
def error(d, step):
    total = 0.0
    for c in range(d.ny):
        total += (0.5 * step * (d.w[slope(d, 1) + c] - d.w[slope(d, 0) + c]) / error_scale(d, c)) ** 2
    return np.sqrt(total / d.ny)


def make_kernels(evaluate, retract):
    _, proceed = make_stages(evaluate, A, B, C)
    return begin_afresh, proceed, error, hermite.make_extend(2), keep_nothing


METHOD = Method(
    traits=INTEGRATORS["heun"],
    room=m.Room(4, hermite.ROWS),
    last=2,
    make_kernels=make_kernels,
    staged=True,
    interpolate=hermite.interpolate,
    error_order=1,
)
'''
LINE = '"heun": Traits("heun_euler", 2, hands_over_to=STIFF, tolerances=TO_1E_9, steps=STEPS),'
ABOVE = '"dopri5": Traits('
LIST, FOLDER = Path("pipeline/core/scene/integrators.py"), Path("pipeline/dynamics/integrate")
#: a quarter of the pendulum's period, IFToMM benchmark A01 [s]
QUARTER = 2.367841947576237 / 4.0

Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def copy(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with the module and the line, and two scenes of a pendulum."""
    folder = processes.copied(tmp_path_factory.mktemp("project"))
    (folder / FOLDER / "heun_euler.py").write_text(MODULE)
    before, above, after = (folder / LIST).read_text().partition(ABOVE)
    assert above
    (folder / LIST).write_text(f"{before}{LINE}\n        {above}{after}")
    scene = (root / "scenes/checks/pendulum.toml").read_text().replace('"10 s"', str(QUARTER))
    for name, solver in {"new": 'integrator = "heun"\nrtol = 1e-7', "own": "", "none": 'integrator = "hunn"'}.items():
        (folder / f"{name}.toml").write_text(f"{scene}\n[solver]\n{solver}\n")
    return folder


@pytest.fixture(scope="module")
def python(copy: Path) -> Command:
    """Runs the copy's modules or code, interpreted: what is compiled is the same."""
    apart = {"FLEXCLEAR_RESULTS": str(copy / "results"), "FLEXCLEAR_KERNELS": str(copy / "kernels")}
    interpreted = {"PYTHONPATH": str(copy), "NUMBA_DISABLE_JIT": "1"}
    return partial(processes.python, cwd=copy, succeeds=False, **apart, **interpreted)


#: all that is asked of the copy, in one process
ASKED = """
import json
from pathlib import Path
from flexclear.commands import cost_design
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.json_schema import scene_schema
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.workflow.fingerprint import Sources
from flexclear.pipeline.dynamics.compile.functions import digest
from flexclear.pipeline.dynamics.compile.sources import sources
from flexclear.pipeline.dynamics.effects import Parts, Scheme
from flexclear.pipeline.post.cost.work_precision import LOOKS
from flexclear.stages import simulation

new, own = load_scene("new.toml"), load_scene("own.toml")
ends = []
for solver in ({"rtol": 1e-6}, {"step": 0.004}):
    scene = load_scene("new.toml", {"solver": {"integrator": "heun", **solver}})
    run = dynamics.simulate(scene, {}, lambda share, text: None)
    ends.append([run.attrs["method"], *run.position.sel(body="bob").values[-1].tolist()])
designs = [(d.group, d.scene.solver) for d in cost_design.wide(own, ("heun",))]
closure = Sources(Path.cwd()).closure
print(json.dumps({
    "schema": scene_schema()["$defs"]["Solver"]["properties"]["integrator"]["enum"],
    "ends": ends,
    "designs": [[group, solver.rtol, solver.step] for group, solver in designs if solver.integrator == "heun"],
    "looks": LOOKS,
    "keys": [sorted(closure(["flexclear.stages.simulation", *simulation.modules(s)])) for s in (new, own)],
    "code": CODE,
}))
"""
#: machine code of another integrator, by the digests of its sources
CODE = """{name: digest(text) for name, text in sources(
    Parts(("free",), surfaces=("clearance-spherical",), forms=("hysteretic",)), Scheme("dop853")).items()}"""
IMPORTS = ASKED[: ASKED.index("new, own")]


@pytest.fixture(scope="module")
def found(python: Command) -> dict[str, Any]:
    """What the copy answers."""
    done = python("-c", ASKED.replace("CODE", CODE))
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def test_the_schema_of_scenes_knows_it(found: dict[str, Any]) -> None:
    assert "heun" in found["schema"]


def test_a_misspelt_name_gets_the_nearest_one(python: Command) -> None:
    done = python("-m", "flexclear", "run", "none.toml", "--to", "simulate")
    assert done.returncode == 2
    assert "did you mean 'heun'" in done.stderr


def test_a_scene_runs_with_chosen_and_with_fixed_steps(found: dict[str, Any]) -> None:
    """After a quarter of its period the pendulum hangs straight down."""
    for method, x, y, _ in found["ends"]:
        assert method == "heun"
        # fixed steps of order 2 leave some (0.004 s * 4.4 rad/s)^2 / 10 of a radian, chosen ones less; the height is
        # off by half of the square of that
        assert abs(x) < 3e-4
        assert abs(y + 1.0) < 1e-7


def test_refusals_name_it_and_its_remedy(copy: Path, python: Command) -> None:
    (copy / "short.toml").write_text((copy / "new.toml").read_text() + "evaluations = 40\n")
    done = python("-m", "flexclear", "run", "short.toml", "--to", "simulate")
    assert done.returncode == 3
    assert "at last by heun" in done.stderr
    assert "radau where contacts or friction are stiff" in done.stderr


def test_a_cost_study_compares_it(found: dict[str, Any]) -> None:
    mine = found["designs"]
    assert [rtol for group, rtol, _ in mine if group == "tolerance"] == [10.0**-k for k in range(3, 10)]
    assert [step for group, _, step in mine if group == "step"] == [1e-4, 3e-5, 1e-5, 3e-6]


def test_figures_distinguish_it_from_all_others(found: dict[str, Any]) -> None:
    assert len({tuple(look) for look in found["looks"].values()}) == len(found["looks"])
    assert "heun" in found["looks"]


def test_keys_hold_its_module_and_what_goes_on_for_it(found: dict[str, Any]) -> None:
    new, own = map(set, found["keys"])
    package = "flexclear.pipeline.dynamics.integrate"
    assert {f"{package}.heun_euler", f"{package}.radau"} <= new
    assert f"{package}.heun_euler" not in own


def test_it_makes_no_other_integrator_compile_anew(found: dict[str, Any]) -> None:
    assert found["code"] == json.loads(processes.printed(f"{IMPORTS}print(json.dumps({CODE}))"))
