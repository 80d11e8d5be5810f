"""A new integrator is one module and one line: a copy of the project with Heun's method added, used in every place."""

import json
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests import processes

MODULE = '''"""Heun's method of order 2, with Euler's as its error estimate."""

import numpy as np

from flexclear.pipeline.core.scene.integrators import INTEGRATORS
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
    slopes=4,
    last=2,
    dense=hermite.ROWS,
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


def asked(python: Command, code: str) -> object:
    """What code that prints JSON finds in the copy."""
    done = python("-c", f"import json\n{code}")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_schema_of_scenes_knows_it(python: Command) -> None:
    done = python("-m", "flexclear", "schema")
    assert done.returncode == 0, done.stderr
    assert "heun" in json.loads(done.stdout)["$defs"]["Solver"]["properties"]["integrator"]["enum"]


def test_a_misspelt_name_is_told_its_name(python: Command) -> None:
    done = python("-m", "flexclear", "run", "none.toml", "--to", "simulate")
    assert done.returncode == 2
    assert "did you mean 'heun'" in done.stderr


def test_a_scene_runs_with_chosen_and_with_fixed_steps(python: Command) -> None:
    """After a quarter of its period the pendulum hangs straight down."""
    found = asked(
        python,
        """
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.load import load_scene
ends = {}
for name, solver in {"chosen": {"rtol": 1e-6}, "fixed": {"step": 0.004}}.items():
    scene = load_scene("new.toml", {"solver": {"integrator": "heun", **solver}})
    run = dynamics.simulate(scene, {}, lambda share, text: None)
    ends[name] = [run.attrs["method"], *run.position.sel(body="bob").values[-1].tolist()]
print(json.dumps(ends))
""",
    )
    assert isinstance(found, dict)
    for method, x, y, _ in found.values():
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


def test_a_cost_study_compares_it(python: Command) -> None:
    found = asked(
        python,
        """
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.commands import cost_design
designs = cost_design.wide(load_scene("own.toml"), ("heun",))
print(json.dumps([[d.group, d.scene.solver.integrator, d.scene.solver.rtol, d.scene.solver.step] for d in designs]))
""",
    )
    assert isinstance(found, list)
    mine = [(group, rtol, step) for group, name, rtol, step in found if name == "heun"]
    assert [rtol for group, rtol, _ in mine if group == "tolerance"] == [10.0**-k for k in range(3, 10)]
    assert [step for group, _, step in mine if group == "step"] == [1e-4, 3e-5, 1e-5, 3e-6]


def test_figures_tell_it_from_all_others(python: Command) -> None:
    code = "from flexclear.pipeline.post.cost.work_precision import LOOKS\nprint(json.dumps(LOOKS))"
    looks = asked(python, code)
    assert isinstance(looks, dict)
    assert len({tuple(look) for look in looks.values()}) == len(looks)
    assert "heun" in looks


KEYS = """
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.workflow.fingerprint import Sources
from pathlib import Path
from flexclear.stages import simulation
sources = Sources(Path.cwd())
found = {}
for name in ("new", "own"):
    modules = simulation.modules(load_scene(f"{name}.toml"))
    found[name] = sorted(sources.closure(["flexclear.stages.simulation", *modules]))
print(json.dumps(found))
"""


def test_keys_hold_its_module_and_what_goes_on_for_it(python: Command) -> None:
    found = asked(python, KEYS)
    assert isinstance(found, dict)
    new, own = (set(found[name]) for name in ("new", "own"))
    package = "flexclear.pipeline.dynamics.integrate"
    assert {f"{package}.heun_euler", f"{package}.radau"} <= new
    assert f"{package}.heun_euler" not in own


def test_it_makes_no_other_integrator_compile_anew(python: Command) -> None:
    code = """
from flexclear.pipeline.dynamics.compile.functions import digest
from flexclear.pipeline.dynamics.compile.sources import sources
from flexclear.pipeline.dynamics.effects import Parts, Scheme
parts = Parts(("free",), surfaces=("clearance-spherical",), forms=("hysteretic",))
print(json.dumps({name: digest(text) for name, text in sources(parts, Scheme("dop853")).items()}))
"""
    assert asked(python, code) == json.loads(processes.printed(f"import json\n{code}"))
