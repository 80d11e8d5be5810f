"""What README and the tutorial show can be done as it is there."""

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexclear as fc
from flexclear.commands.__main__ import main
from flexclear.commands.new import write


def blocks(page: Path, language: str) -> list[str]:
    """Texts between fences of a language, in their order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE)


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_process: None) -> Path:
    """An empty folder to work in, with results of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return tmp_path


def test_the_scene_of_the_readme_its_variant_and_its_python_run(root: Path, apart: Path) -> None:
    pendulum, worn = blocks(root / "README.md", "toml")
    (apart / "pendulum.toml").write_text(pendulum.replace('end = "1 s"', 'end = "50 ms"'))
    (apart / "worn.toml").write_text(worn)
    assert main(["check", "pendulum.toml", "worn.toml"]) == 0
    names: dict[str, Any] = {}
    (code,) = blocks(root / "README.md", "python")
    exec(compile(code, "README.md", "exec"), names)
    assert float(names["run"]["contact_normal_force"].max()) > 2.0 * 9.81


def test_the_tutorials_scenes_and_python_run(root: Path, apart: Path) -> None:
    scene, _ = write("slider-crank", apart)
    scene.write_text(scene.read_text().replace('end = "0.13 s"', 'end = "5 ms"'))
    (worn,) = blocks(root / "docs" / "tutorial.md", "toml")
    (apart / "worn.toml").write_text(worn)
    assert main(["check", "slider_crank.toml", "worn.toml"]) == 0
    assert main(["run", "-q", "slider_crank.toml", "--set", "joint.pin.clearance=0.3 mm"]) == 0
    assert main(["run", "-q", "slider_crank.toml"]) == 0
    (code,) = blocks(root / "docs" / "tutorial.md", "python")
    quick = code.replace('page = fc.report("slider_crank.toml")\n', "")  # a film: tests of the report make one
    assert quick != code
    names: dict[str, Any] = {}
    exec(compile(quick, "tutorial.md", "exec"), names)
    assert set(names["tree"].children) >= {"run", "bundle"}


def test_a_linear_model_is_loaded_as_the_page_says(root: Path, apart: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SciPy's and python-control's poles are the pendulum's frequency, that of the command."""
    (scene,) = write("pendulum", apart)
    push = '[load.motor]\ntype = "joint-force"\njoint = "hinge"\nforce = "0 N m"\n'
    joint = re.search(r"^\[joint\.(\w+)\]", scene.read_text(), re.MULTILINE)
    assert joint is not None
    (apart / "crane.toml").write_text(scene.read_text() + push.replace("hinge", joint[1]))
    assert main(["export", "-q", "crane.toml", "--format", "state-space"]) == 0
    assert "wrote crane.npz: 2 states, 1 input, " in capsys.readouterr().out
    names: dict[str, Any] = {}
    exec(compile(blocks(root / "docs" / "exchange.md", "python")[0], "exchange.md", "exec"), names)
    frequency = fc.frequencies("crane.toml")["frequency"].item()
    poles = np.sort_complex(np.linalg.eigvals(names["plant"].A))
    np.testing.assert_allclose(abs(poles), 2.0 * np.pi * frequency, rtol=1e-9)
    assert names["f"]["state_unit"].tolist() == ["rad", "rad/s"]
    if importlib.util.find_spec("control") is not None:
        import control

        plant = control.ss(*(names["f"][name] for name in "ABCD"))
        np.testing.assert_allclose(np.sort_complex(plant.poles()), poles, rtol=1e-9)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--format", "fmi"], "unknown format"),
        (["--format", "state-space", "--body", "rod"], "--body: has no meaning for the format state-space"),
        (["--format", "loads"], "the scene has 0 flexible bodies"),
        (["--format", "state-space", "--out", "plant.csv"], "unknown format '.csv'"),
        (["--format", "state-space", "--out", "none/plant.npz"], "its folder does not exist"),
        (["--format", "state-space", "--at", "1000 s"], "is outside of the scene's"),
    ],
)
def test_an_export_that_cannot_be_made_says_why(
    apart: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    write("pendulum", apart)
    assert main(["export", "-q", "pendulum.toml", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not list(apart.glob("*.npz"))


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX: apt-get install calculix-ccx")
def test_the_bar_from_calculix_is_the_bar_there(root: Path, apart: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = root / "docs" / "exchange.md"
    (_, code), (deck,), (_, recipe, scene) = (blocks(page, language) for language in ("python", "inp", "toml"))
    exec(compile(code, "exchange.md", "exec"), {})
    for name, text in (("bar", deck), ("free", deck.replace(", SOLVER=MATRIXSTORAGE", ""))):
        (apart / f"{name}.inp").write_text(text)
        subprocess.run(["ccx", name], check=True, capture_output=True, timeout=300)
    (apart / "bar.toml").write_text(recipe)
    (apart / "swing.toml").write_text(scene)
    assert main(["run", "-q", "swing.toml", "--to", "bundle"]) == 0
    printed = capsys.readouterr().out
    for line in re.findall(r"^    (mass .*|centre .*|inertia about .*)$", page.read_text(), re.MULTILINE):
        assert line in printed
    # CalculiX's own frequencies vary by 3e-6 with its threads
    for what, numbers in re.findall(r"^    (frequencies .*): ([\d. ]+) \.\.\.$", page.read_text(), re.MULTILINE):
        found = re.search(rf"{what}: ([\d. ]+)", printed)[1].split()  # type: ignore[index]
        expected = [float(one) for one in numbers.split()]
        assert [float(one) for one in found[: len(expected)]] == pytest.approx(expected, rel=3e-5)
    assert main(["run", "-q", "swing.toml"]) == 0
    capsys.readouterr()
    wrong = recipe.replace('"mm-t-s"', '"m-kg-s"')
    (apart / "bar.toml").write_text(wrong)
    assert main(["run", "-q", "swing.toml", "--to", "bundle"]) == 2
    assert 'units = "mm-t-s"' in capsys.readouterr().err
