"""The examples of docs/extending.md: a module, and one other place, are all that a new part takes.

All are installed in a copy of the sources; a scene that names one runs there from the command line, and what it gives
is compared with a closed form. Uncompiled, because they take some hundred evaluations, and compiling takes longer.
"""

import json
import os
import re
import shutil
from math import exp, sinh
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from tests.processes import copied, python

#: example -> folder that its module is put in
PLACES = {
    "kutta3": "pipeline/flexclear/dynamics/integrate",
    "oldham": "pipeline/flexclear/dynamics/joints",
    "safaeifar_farshidianfar": "pipeline/flexclear/dynamics/contact/normal",
    "ball_in_tube": "pipeline/flexclear/dynamics/contact/surfaces",
    "smooth_coulomb": "pipeline/flexclear/dynamics/contact/friction",
    "quadratic_drag": "pipeline/flexclear/dynamics/loads",
    "cycloidal": "pipeline/flexclear/dynamics/drives",
    "momentum": "pipeline/flexclear/dynamics/record",
    "turns": "pipeline/flexclear/post/single_run",
    "mass": "pipeline/flexclear/commands",
}


def examples(root: Path) -> Path:
    return root / "docs" / "examples" / "extending"


def edited(text: str, hunk: str) -> str:
    """A text after one hunk of a diff, whose old lines it has once."""
    lines = [line for line in hunk.splitlines() if line]
    old = "\n".join(line[1:] for line in lines if line[0] in " -")
    new = "\n".join(line[1:] for line in lines if line[0] in " +")
    assert text.count(old) == 1, old
    return text.replace(old, new)


@pytest.fixture(scope="module")
def tree(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources with all examples in it, which has run their scenes."""
    folder = copied(tmp_path_factory.mktemp("project"))
    for name, place in PLACES.items():
        shutil.copy(examples(root) / f"{name}.py", folder / place)
        for file in (examples(root) / f"{name}.diff").read_text().split("--- ")[1:]:
            head, *hunks = file.split("@@\n")
            other = folder / head.strip()
            for hunk in hunks:
                other.write_text(edited(other.read_text(), hunk))
    flexclear(folder, "run", *map(str, examples(root).glob("*.toml")), "--to", "post", "--jobs", "1", "-q")
    return folder


def interpreted(tree: Path, *arguments: str) -> str:
    """What Python prints in the tree."""
    own = {"FLEXCLEAR_RESULTS": str(tree / "results"), "NUMBA_DISABLE_JIT": "1"}
    return python(*arguments, cwd=tree, FLEXCLEAR_KERNELS=str(tree / "kernels"), **own).stdout


def flexclear(tree: Path, *arguments: str) -> str:
    return interpreted(tree, "-m", "flexclear", *arguments)


def ran(tree: Path, name: str, what: str = "run") -> xr.Dataset:
    """The run of the example's scene, or what follows from it."""
    with xr.open_dataset(tree / "results" / "runs" / name / f"{what}.nc") as found:
        return found.load()


def test_an_integrator(tree: Path) -> None:
    """In n steps the state of a linear system is multiplied by the n-th power of the method's stability polynomial."""
    run = ran(tree, "kutta3")
    step, A = 0.005, np.array([[0.0, 1.0], [-100.0, -2.0]])
    R = np.eye(2) + step * A + (step * A) @ (step * A) / 2.0 + np.linalg.matrix_power(step * A, 3) / 6.0
    known = np.array([np.linalg.matrix_power(R, n) @ [0.1, 0.0] for n in range(run.sizes["time"])])
    assert run.sizes["time"] == 101
    # rounding of a hundred steps and of the times at which they end; the method's own error is 1e-6 m
    np.testing.assert_allclose(run["position"].values[:, 0, 2], known[:, 0], rtol=0.0, atol=1e-12)


def test_a_joint_with_two_freedoms(tree: Path) -> None:
    """Parallel shafts turn together, by 10 t^2, and the drive speeds up both."""
    run = ran(tree, "oldham")
    turn = 10.0 * run["time"].values ** 2
    known = np.stack([np.cos(0.5 * turn), 0.0 * turn, 0.0 * turn, np.sin(0.5 * turn)], axis=1)
    # prescribed motion is evaluated, not integrated: the loop is closed to 1e-12 or so
    np.testing.assert_allclose(run["quaternion"].sel(body="follower").values, known, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(run["drive_force"].values[:, 0], (0.02 + 0.03) * 20.0, rtol=1e-9)


def test_a_normal_law(tree: Path) -> None:
    """The rebound of a free impact under F = K d^n (1 + a d'/v): a (1 + e) + ln((1 - a e)/(1 + a)) = 0."""
    run = ran(tree, "safaeifar_farshidianfar")
    a = 1.25 * 0.3 / 0.7
    rebound = brentq(lambda e: a * (1.0 + e) + np.log((1.0 - a * e) / (1.0 + a)), 0.1, 0.99, xtol=1e-15)
    # the integrator's tolerance is 1e-10: it leaves 8e-11
    assert run["velocity"].values[-1, 0, 2] == pytest.approx(rebound, rel=1e-8)


def test_surfaces(tree: Path) -> None:
    """Between contacts of pi sqrt(m/K), half a vibration, it flies 2 c across; along the tube nothing acts."""
    run = ran(tree, "ball_in_tube")
    contact, clearance, t = np.pi * np.sqrt(0.5 / 2e6), 0.002, run["time"].values
    beat = 2.0 * clearance + contact  # at 1 m/s
    phase = (t + clearance) % (2.0 * beat)
    back = phase > beat  # at the wall on the other side, and back from there
    within, sign = np.where(back, phase - beat, phase), np.where(back, -1.0, 1.0)
    wall = clearance + np.sin(np.pi * np.maximum(within - 2.0 * clearance, 0.0) / contact) * contact / np.pi
    across = sign * np.where(within < 2.0 * clearance, within - clearance, wall)
    # the integrator's tolerance is 1e-10, of millimetres; four contacts
    np.testing.assert_allclose(run["position"].values[:, 0, 0], across, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run["position"].values[:, 0, 2], 3.0 * t, rtol=0.0, atol=1e-12)


#: compiled functions of steps against the same in Python, as for parts of the program
COMPARED = """
import sys
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.load import load_scene
from tests.properties.articulated_chains import evaluated
from tests.properties.test_routines import assert_alike

for path in sys.argv[1:]:
    assert_alike(evaluated(tabulate(build(load_scene(path), {})), turns=0.01))  # the ball touches the tube
"""


def test_compiled_steps_compute_what_python_does(root: Path, tree: Path) -> None:
    scenes = [examples(root) / f"{name}.toml" for name in ("oldham", "ball_in_tube", "quadratic_drag")]
    python("-c", COMPARED, *scenes, cwd=tree, PYTHONPATH=os.pathsep.join(map(str, (tree / "pipeline", root))))


def test_a_derived_result(tree: Path) -> None:
    """Of a rotor that only slows down: the integral of its speed, which the friction law's test knows."""
    found, run = ran(tree, "smooth_coulomb", "post"), ran(tree, "smooth_coulomb")
    spin = run["angular_velocity"].sel(body="ball").values[:, 1]
    angle = np.trapezoid(np.abs(spin), run["time"].values)
    assert float(found["turns"].sel(body="ball")) == pytest.approx(angle / (2.0 * np.pi), rel=1e-12)
    assert found["turns"].attrs["units"] == "1"


def test_a_friction_law(tree: Path) -> None:
    """I w' = -mu R N tanh(w R/v_s) gives sinh(w R/v_s) = sinh(w0 R/v_s) exp(-mu N R^2 t/(I v_s))."""
    run = ran(tree, "smooth_coulomb")
    mu, v_s, force, radius, inertia = 0.4, 0.2, 10.0, 0.1, 0.02
    spin = run["angular_velocity"].sel(body="ball").values[:, 1]
    decay = mu * force * radius**2 / (inertia * v_s)
    known = [sinh(3.0 * radius / v_s) * exp(-decay * t) for t in run["time"].values]
    # the integrator's tolerance is 1e-8; it leaves 2e-13
    np.testing.assert_allclose(np.sinh(spin * radius / v_s), known, rtol=1e-8)
    assert known[-1] < 0.7 * known[0]


def test_a_load(tree: Path) -> None:
    """Of m v' = -c v^2: v = v0/(1 + c v0 t/m) along the first direction."""
    run = ran(tree, "quadratic_drag")
    speed = 5.0 / (1.0 + 0.4 * 5.0 * run["time"].values / 2.0)
    # the integrator's tolerance is 1e-10
    np.testing.assert_allclose(run["velocity"].values[:, 0], speed[:, None] * [0.6, 0.0, 0.8], rtol=0.0, atol=1e-8)
    lost = 0.5 * 2.0 * (5.0**2 - speed[-1] ** 2)
    assert run["dissipated"].values[-1] == pytest.approx(lost, rel=1e-8)


def test_a_law_of_time(tree: Path) -> None:
    """A cam's slide accelerates by 2 pi h/T^2 sin(2 pi tau), and the drive pushes with m times that."""
    run = ran(tree, "cycloidal")
    tau = np.clip((run["time"].values - 0.1) / 0.3, 0.0, 1.0)
    height = 0.03 * (tau - np.sin(2.0 * np.pi * tau) / (2.0 * np.pi))
    push = 2.0 * 2.0 * np.pi * 0.03 / 0.3**2 * np.sin(2.0 * np.pi * tau)
    # prescribed motion is evaluated, not integrated: rounding
    np.testing.assert_allclose(run["position"].values[:, 0, 2], height, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(run["drive_force"].values[:, 0], push, rtol=0.0, atol=1e-11)


def test_a_record_on_request(tree: Path) -> None:
    """Of free fall: m (3, 0, -g t); recorded with its unit."""
    run = ran(tree, "momentum")
    t = run["time"].values
    known = 2.0 * np.stack([np.full_like(t, 3.0), np.zeros_like(t), -9.81 * t], axis=1)
    # the integrator's tolerance is 1e-10
    np.testing.assert_allclose(run["momentum"].sel(momentum_body="ball").values, known, rtol=0.0, atol=1e-8)
    assert run["momentum"].attrs["units"] == "kg m s-1"


def test_a_command(root: Path, tree: Path) -> None:
    scene = examples(root) / "smooth_coulomb.toml"
    shutil.copy(scene, tree / "two.toml")
    (tree / "two.toml").write_text(scene.read_text().replace("smooth-coulomb", "ambrosio").replace("v_smooth", "v1"))
    (tree / "two.toml").write_text((tree / "two.toml").read_text().replace("dynamic = 0.4", "dynamic = 0.4, v0 = 0.0"))
    assert flexclear(tree, "mass", "two.toml").endswith(": 1 kg\n")
    assert "mass of the rigid bodies" in flexclear(tree, "--help")


# The page -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PLACES)
def test_the_page_links_what_is_tested(root: Path, name: str) -> None:
    page = (root / "docs" / "extending.md").read_text()
    files = sorted(examples(root).glob(f"{name}.*"))
    assert {path.suffix for path in files} >= {".py", ".diff"}
    assert [path.name for path in files if f"](examples/extending/{path.name})" not in page] == []
    assert f"`{PLACES[name]}/{name}.py`" in page


def test_the_example_that_the_page_shows_is_its_files(root: Path) -> None:
    page = (root / "docs" / "extending.md").read_text()
    shown = re.findall(r"^```\w+\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    files = [examples(root) / f"safaeifar_farshidianfar{suffix}" for suffix in (".py", ".diff", ".toml")]
    assert shown == [path.read_text() for path in files]


def test_the_page_names_every_module_of_its_effect(root: Path) -> None:
    page, package = (root / "docs" / "extending.md").read_text(), root / "pipeline/flexclear/dynamics"
    modules = {path.relative_to(root).as_posix() for path in package.glob("*/wear.py")}
    assert len(modules) == 3
    assert modules == {name for name in re.findall(r"`([\w/]+\.py)`", page) if name.endswith("/wear.py")}


def test_every_example_is_tested(root: Path) -> None:
    assert {path.stem for path in examples(root).iterdir()} == set(PLACES)


# An integrator with steps of its own choice, in every place where integrators are named -------------------------------

HEUN = '''"""Heun's method of order 2, with Euler's as its error estimate."""

import numpy as np

from flexclear.scene.integrators import INTEGRATORS
from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import hermite
from flexclear.dynamics.integrate.method import Method, begin_afresh, keep_nothing, slope
from flexclear.dynamics.integrate.norms import error_scale
from flexclear.dynamics.integrate.runge_kutta import make_stages
from flexclear.dynamics.kernels import kernel

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
#: a quarter of the pendulum's period, IFToMM benchmark A01 [s]
QUARTER = 2.367841947576237 / 4.0
#: all that is asked of the tree about Heun's method, in one process
ASKED = """
import json
from pathlib import Path
from flexclear.study import cost_design
from flexclear import dynamics
from flexclear.scene.json_schema import scene_schema
from flexclear.scene.load import load_scene
from flexclear.system.errors import FlexclearError
from flexclear.post.cost.work_precision import LOOKS

silent = lambda share, text: None
new, own = load_scene("new.toml"), load_scene("own.toml")
ends, refused = [], []
for solver in ({"integrator": "hunn"}, {"integrator": "heun", "rtol": 1e-7, "evaluations": 40}):
    try:
        dynamics.simulate(load_scene("own.toml", {"solver": solver}), {}, silent)
    except FlexclearError as error:
        refused.append([error.exit_code, str(error)])
for solver in ({"rtol": 1e-6}, {"step": 0.004}):
    scene = load_scene("new.toml", {"solver": {"integrator": "heun", **solver}})
    run = dynamics.simulate(scene, {}, silent)
    ends.append([run.attrs["method"], *run.position.sel(body="bob").values[-1].tolist()])
heun = cost_design.all_methods(own, ("heun",))
designs = [("tolerance" if d.chooses_steps else "step", d.scene.solver) for d in heun]
print(json.dumps({
    "schema": scene_schema()["$defs"]["Solver"]["properties"]["integrator"]["enum"],
    "ends": ends,
    "refused": refused,
    "designs": [[group, solver.rtol, solver.step] for group, solver in designs if solver.integrator == "heun"],
    "looks": LOOKS,
}))
"""


@pytest.fixture(scope="module")
def heun(root: Path, tree: Path) -> dict[str, Any]:
    """What the tree answers when Heun's method is added to it by a module and two lines."""
    (tree / "pipeline/flexclear/dynamics/integrate/heun_euler.py").write_text(HEUN)
    listed = tree / "pipeline/flexclear/scene/integrators.py"
    before, above, after = listed.read_text().partition(ABOVE)
    assert above
    listed.write_text(f"{before}{LINE}\n        {above}{after}")
    table = tree / "pipeline/flexclear/dynamics/integrate/__init__.py"
    text = table.read_text().replace("import adams,", "import adams, heun_euler,")
    table.write_text(text.replace("METHODS = {", 'METHODS = {"heun": heun_euler.METHOD,'))
    scene = (root / "scenes/checks/pendulum.toml").read_text().replace('"10 s"', str(QUARTER))
    for name, solver in {"new": 'integrator = "heun"\nrtol = 1e-7', "own": ""}.items():
        (tree / f"{name}.toml").write_text(f"{scene}\n[solver]\n{solver}\n")
    return dict(json.loads(interpreted(tree, "-c", ASKED)))


def test_the_schema_of_scenes_knows_a_new_integrator(heun: dict[str, Any]) -> None:
    assert "heun" in heun["schema"]


def test_refusals_name_a_new_integrator_and_its_remedy(heun: dict[str, Any]) -> None:
    (misspelt, nearest), (used_up, why) = heun["refused"]
    assert (misspelt, used_up) == (2, 3)
    assert "did you mean 'heun'" in nearest
    assert "the last one by heun" in why
    assert "radau where contacts or friction are stiff" in why


def test_a_scene_runs_with_chosen_and_with_fixed_steps_of_it(heun: dict[str, Any]) -> None:
    """After a quarter of its period the pendulum hangs straight down."""
    for method, x, y, _ in heun["ends"]:
        assert method == "heun"
        # fixed steps of order 2 leave some (0.004 s * 4.4 rad/s)^2 / 10 of a radian, chosen ones less; the height is
        # off by half of the square of that
        assert abs(x) < 3e-4
        assert abs(y + 1.0) < 1e-7


def test_a_cost_study_compares_it(heun: dict[str, Any]) -> None:
    mine = heun["designs"]
    assert [rtol for group, rtol, _ in mine if group == "tolerance"] == [10.0**-k for k in range(3, 10)]
    assert [step for group, _, step in mine if group == "step"] == [1e-4, 3e-5, 1e-5, 3e-6]


def test_figures_distinguish_it_from_all_others(heun: dict[str, Any]) -> None:
    assert len({tuple(look) for look in heun["looks"].values()}) == len(heun["looks"])
    assert "heun" in heun["looks"]
