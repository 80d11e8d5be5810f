"""The examples of docs/extending.md: a module, and one other place, are all that a new part takes.

All are installed in a copy of the sources; a scene that names one runs there from the command line, and what it gives
is compared with a closed form. Uncompiled, because they take some hundred evaluations, and compiling takes longer.
"""

import re
import shutil
from math import exp, sinh
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from tests.processes import copied, python

#: example -> folder that its module is put in
PLACES = {
    "kutta3": "pipeline/dynamics/integrate",
    "pin_in_slot": "pipeline/dynamics/joints",
    "safaeifar_farshidianfar": "pipeline/dynamics/contact/normal",
    "smooth_coulomb": "pipeline/dynamics/contact/friction",
    "quadratic_drag": "pipeline/dynamics/loads",
    "cycloidal": "pipeline/dynamics/drives",
    "momentum": "pipeline/dynamics/record",
    "mass": "flexclear/commands",
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
        head, *hunks = (examples(root) / f"{name}.diff").read_text().split("@@\n")
        other = folder / head.removeprefix("--- ").strip()
        for hunk in hunks:
            other.write_text(edited(other.read_text(), hunk))
    flexclear(folder, "run", *map(str, examples(root).glob("*.toml")), "--to", "simulate", "--jobs", "1", "-q")
    return folder


def flexclear(tree: Path, *arguments: str) -> str:
    own = {"PYTHONPATH": str(tree), "FLEXCLEAR_RESULTS": str(tree / "results"), "NUMBA_DISABLE_JIT": "1"}
    own["FLEXCLEAR_KERNELS"] = str(tree / "kernels")
    return python("-m", "flexclear", *arguments, cwd=tree, **own).stdout


def ran(tree: Path, name: str) -> xr.Dataset:
    """The run of the example's scene."""
    with xr.open_dataset(tree / "results" / "runs" / name / "run.nc") as found:
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
    """Nothing pushes the mass centre sideways, and the energy gives the speed at each angle below the horizontal."""
    run = ran(tree, "pin_in_slot")
    mass, arm, inertia, g = 2.0, 0.5, 0.03, 9.81
    place = run["frame_position"].sel(frame="bob.pin").values
    centre, omega = run["position"].values[:, 0], run["angular_velocity"].values[:, 0, 2]
    drop = -centre[:, 1] / arm
    assert drop.max() > 0.9
    known = 2.0 * mass * g * arm * drop / (inertia + mass * arm**2 * (1.0 - drop**2))
    # the integrator's tolerance is 1e-10, of omega^2 up to 650 rad^2/s^2: it leaves 6e-8 there
    np.testing.assert_allclose(centre[:, 0], arm, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(omega**2, known, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(place[:, 1:], 0.0, rtol=0.0, atol=1e-12)


def test_a_normal_law(tree: Path) -> None:
    """The rebound of a free impact under F = K d^n (1 + a d'/v): a (1 + e) + ln((1 - a e)/(1 + a)) = 0."""
    run = ran(tree, "safaeifar_farshidianfar")
    a = 1.25 * 0.3 / 0.7
    rebound = brentq(lambda e: a * (1.0 + e) + np.log((1.0 - a * e) / (1.0 + a)), 0.1, 0.99, xtol=1e-15)
    # the integrator's tolerance is 1e-10: it leaves 8e-11
    assert run["velocity"].values[-1, 0, 2] == pytest.approx(rebound, rel=1e-8)


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


def blocks(page: str) -> list[str]:
    return re.findall(r"^```\w+\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("name", PLACES)
def test_the_page_shows_what_is_tested(root: Path, name: str) -> None:
    page = (root / "docs" / "extending.md").read_text()
    shown = blocks(page)
    files = sorted(examples(root).glob(f"{name}.*"))
    assert {path.suffix for path in files} >= {".py", ".diff"}
    for path in files:
        assert path.read_text() in shown, f"{path.name} is not on the page, or differs from it"
    assert f"`{PLACES[name]}/{name}.py`" in page


@pytest.mark.parametrize("name", ["effect", "contact", "model", "record"])
def test_the_page_shows_the_folder_of_an_effect(root: Path, name: str) -> None:
    path = "pipeline/dynamics/effects/wear"
    page = (root / "docs" / "extending.md").read_text()
    assert f"`{path}/{name}.py`:\n\n```python\n{(root / path / name).with_suffix('.py').read_text()}```" in page
    assert {one.stem for one in (root / path).glob("*.py")} == {"__init__", "effect", "contact", "model", "record"}


def test_every_example_is_tested(root: Path) -> None:
    assert {path.stem for path in examples(root).iterdir()} == set(PLACES)
