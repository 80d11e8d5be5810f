"""A scene of one's own: what `new` writes is right, what is wrong in it is told at once, editors know its keys."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.artifacts.paths import results_root
from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.scene import lines
from flexclear.pipeline.core.scene.json_schema import scene_schema
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.plausibility import oddities
from flexclear.stages import run
from flexclear.stages.__main__ import main
from flexclear.stages.as_json import as_json
from flexclear.stages.new import KINDS, TEMPLATES, write
from tests.stages.typical_mistakes import MISTAKES

REPORTED = dict(
    re.findall(r"^## (.+)\n((?:.+\n?)+)", (Path(__file__).parent / "typical_mistakes.txt").read_text(), re.MULTILINE)
)
#: sweeps are no scenes, though they lie beside them
SCENES = [p for p in sorted((Path(__file__).parents[2] / "scenes").rglob("*.toml")) if p.parent.name != "sweeps"]
#: right in itself, but more than `[limits]` allows
TOO_MUCH = ("far too many rows",)
RECIPES = sorted((Path(__file__).parents[2] / "meshes").rglob("*.toml"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_new_writes_has_no_mistake(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["new", kind, str(tmp_path / "own")]) == 0
    scene, *_ = sorted((tmp_path / "own").glob("*.toml"), key=lambda path: "[body" not in path.read_text())
    assert main(["check", str(scene)]) == 0
    assert "no error" in capsys.readouterr().out
    assert main(["new", kind, str(tmp_path / "own")]) == 2
    assert "is there already" in capsys.readouterr().err


def test_all_beginnings_fit_into_one_folder(tmp_path: Path) -> None:
    written = [path for kind in KINDS for path in write(kind, tmp_path)]
    assert len({path.name for path in written}) == len(written)


def test_a_hundred_typical_mistakes_are_all_in_the_table():
    assert len(MISTAKES) >= 100
    assert set(REPORTED) == set(MISTAKES)


@pytest.mark.parametrize("name", MISTAKES)
def test_a_typical_mistake_gets_its_message(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file, old, new = MISTAKES[name]
    folder = tmp_path / "own"
    write("slider-crank", folder)
    text = (folder / file).read_text()
    assert old is None or old in text
    (folder / file).write_text(text + new if old is None else text.replace(old, new, 1))
    assert main(["check", str(folder / "slider_crank.toml")]) == (4 if name in TOO_MUCH else 2)
    said = capsys.readouterr().err.replace(f"{folder.resolve()}/", "").replace(f"{folder}/", "")
    # lists of all names that there are grow with the program
    assert re.sub(r"(known|one of): .*", r"\1: ...", said).strip() == REPORTED[name].strip()


@pytest.mark.parametrize(
    "old,new,told",
    [
        (
            'clearance = "0.1 mm"',
            "clearance = 0.1",
            r"\[joint.pin.clearance\], line \d+: 100 mm is more than the pin's radius, 10 mm",
        ),
        (
            'inertia = ["600 kg mm^2", "600 kg mm^2", "1000 kg mm^2"]',
            "inertia = [600, 600, 1000]",
            r"\[body.crank.inertia\], line \d+: a radius of gyration of 35.4 m for a body whose frames",
        ),
        ('mass = "0.8 kg"', "mass = 800", r"\[body.crank.mass\], line \d+: 800 kg for a body whose frames lie within"),
        ('change = "360 deg"', "change = 360", r'360 rad are 57.3 turns\n.*write "360 deg" for degrees'),
        (
            'interval = "0.1 ms"',
            'interval = "1 s"',
            r"\[output.interval\], line \d+: 1 s is longer than the run of 0.13 s",
        ),
        (
            '[joint.wrist]\ntype = "revolute"\nbetween = ["rod.small_end", "slider.pin"]\n',
            "",
            r"nothing connects a frame of rod and slider.pin\n.*is a joint missing\?",
        ),
        (
            "[load.gravity]",
            '[load.hold]\ntype = "pid"\njoint = "guide"\nreference = 0.2\nproportional = -5.0\n\n[load.gravity]',
            r"\[load.hold.proportional\], line \d+: -5 pushes the coordinate away from its reference",
        ),
    ],
)
def test_what_looks_like_a_slip_of_units_is_told_and_not_refused(
    old: str, new: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    scene, _ = write("slider-crank", tmp_path)
    assert old in scene.read_text()
    scene.write_text(scene.read_text().replace(old, new))
    assert main(["check", str(scene)]) == 0
    assert re.search(told, capsys.readouterr().err)


def test_run_looks_first_and_computes_nothing_for_a_mistyped_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    scene, _ = write("slider-crank", tmp_path / "own")
    scene.write_text(scene.read_text().replace('"rod.small_end"', '"rod.smal_end"'))
    assert main(["run", str(scene)]) == 2
    said = capsys.readouterr().err
    assert "[joint.wrist.between], line" in said
    assert "did you mean 'small_end'?" in said
    assert not (tmp_path / "results").exists()


def test_mistakes_of_several_files_are_told_together_and_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, rod = write("slider-crank", tmp_path)
    scene.write_text(scene.read_text().replace('"0.8 kg"', "-1").replace('"crank.pin"] ', '"crank.pim"] '))
    rod.write_text(rod.read_text().replace('"7850 kg/m^3"', '"7850 kg"'))
    assert main(["check", str(scene), "--json"]) == 2
    found = {(Path(m["file"]).name, m["line"], m["problem"].split()[0]) for m in json.loads(capsys.readouterr().out)}
    text = scene.read_text().splitlines()
    mass = 1 + next(k for k, line in enumerate(text) if line.startswith("mass = -1"))
    between = 1 + next(k for k, line in enumerate(text) if '"crank.pim"' in line and line.startswith("between"))
    density = 1 + next(k for k, line in enumerate(rod.read_text().splitlines()) if line.startswith("density"))
    assert {(file, line) for file, line, _ in found} == {
        ("slider_crank.toml", mass),
        ("slider_crank.toml", between),
        ("rod.toml", density),
    }


def test_a_mistake_in_an_extended_scene_is_told_in_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, _ = write("slider-crank", tmp_path)
    scene.write_text(scene.read_text().replace('mass = "0.8 kg"', "mass = -1"))
    (tmp_path / "other.toml").write_text('extends = "slider_crank.toml"\n')
    assert main(["check", str(tmp_path / "other.toml")]) == 2
    said = capsys.readouterr().err
    assert re.search(r"other.toml \[body.crank.mass\], line \d+ of .*slider_crank.toml: must be greater than 0", said)


def test_lines_are_those_of_the_text():
    text = '# a\n[body.rod] # b\ntype = "rigid"\nframes."a.b" = {}\ntext = """\n[joint.x]\n"""\n[[x]]\ny = 1\n'
    found = lines.written(text)
    assert found["body", "rod"] == 2
    assert found["body", "rod", "type"] == 3
    assert found["body", "rod", "frames", "a.b"] == 4
    assert ("joint",) not in found
    assert found["x", "y"] == 9


@pytest.fixture(scope="module")
def validators():
    jsonschema = pytest.importorskip("jsonschema")
    from flexclear.pipeline.structure.fe.json_schema import recipe_schema

    found = [jsonschema.Draft202012Validator(schema) for schema in (scene_schema(), recipe_schema())]
    for one in found:
        one.check_schema(one.schema)
    return found


@pytest.mark.parametrize("path", [*SCENES, *sorted(TEMPLATES.rglob("*.toml"))], ids=lambda path: path.stem)
def test_the_schema_accepts_what_the_loader_accepts(path: Path, validators):
    table = tomllib.loads(path.read_text())
    recipe = "shape" in table
    if not recipe:
        assert oddities(load_scene(path)) == []
    assert list(validators[recipe].iter_errors(table)) == []


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_the_schema_accepts_every_recipe(path: Path, validators):
    assert list(validators[1].iter_errors(tomllib.loads(path.read_text()))) == []


def test_the_schema_refuses_what_is_no_scene(validators):
    scene = tomllib.loads((TEMPLATES / "four_bar" / "four_bar.toml").read_text())
    assert not validators[0].is_valid({**scene, "titel": "a"})
    assert not validators[0].is_valid({key: value for key, value in scene.items() if key != "body"})
    assert not validators[0].is_valid({**scene, "remove": ["joint.A"]})  # edits nothing
    assert validators[0].is_valid({"extends": "a.toml", "remove": ["joint.A"], "set": {"body": {"rod": {"mass": 1}}}})


@pytest.mark.parametrize("kind", ["scene", "recipe"])
def test_schemas_say_what_they_are(kind: str, capsys: pytest.CaptureFixture[str]):
    assert main(["schema", kind]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["$id"] == f"urn:flexclear:schema:{kind}"


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_every_command_and_its_options(shell: str, capsys: pytest.CaptureFixture[str]):
    assert main(["completion", shell]) == 0
    said = capsys.readouterr().out
    assert 'compare) options="-h --help --set --jobs' in said
    assert "--ideal" in said
    assert all(verb in said for verb in ("new", "check", "report"))


def test_a_value_is_changed_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, _ = write("slider-crank", tmp_path)
    graph = run.graphs([str(scene)], ["joint.pin.clearance=0.3 mm", "solver.rtol=1e-6"])[0]
    assert graph.scene.joint["pin"].clearance == pytest.approx(3e-4, rel=1e-12)
    assert graph.scene.solver.rtol == 1e-6
    assert "joint.pin.clearance=0.3_mm" in graph.simulate.folder  # the results of the file stay
    assert main(["why", str(scene), "--set", "joint.pin.clearence=1"]) == 2
    assert "did you mean 'clearance'" in capsys.readouterr().err
    assert main(["why", str(scene), "--set", "joint"]) == 2
    assert "is no KEY=VALUE" in capsys.readouterr().err


def test_a_scene_from_a_table_is_that_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import flexclear as fc

    path, _ = write("slider-crank", tmp_path)
    monkeypatch.chdir(tmp_path)
    scene = fc.load_scene(tomllib.loads(path.read_text()))
    assert scene.model_dump() == fc.load_scene(path).model_dump()
    assert repr(scene).startswith("<Scene slider-crank-with-a-flexible-rod")
    assert len(repr(scene)) < 250
    with pytest.raises(InputError, match="only files do"):
        fc.load_scene({"extends": "a.toml"})


def test_every_template_is_a_kind_that_new_knows():
    assert {path.name.replace("_", "-") for path in TEMPLATES.iterdir()} == set(KINDS)


def test_check_looks_whether_the_joints_of_flexible_bodies_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Without a mode: where nothing is deformed."""
    scene, _ = write("leg", tmp_path)
    text = scene.read_text()
    assert 'position = [0, 0, "260 mm"]' in text
    scene.write_text(text.replace('position = [0, 0, "260 mm"]', 'position = ["20 mm", 0, "260 mm"]'))
    assert main(["check", str(scene)]) == 2
    assert re.search(r"\[joint\.\w+", capsys.readouterr().err)


def test_check_looks_at_a_recipe_as_a_recipe(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    _, rod = write("slider-crank", tmp_path)
    assert main(["check", str(rod)]) == 0
    # 200 mm x 12 mm x 8 mm of 7850 kg/m^3
    assert f"{rod}: a mesh recipe, straight-beam, frames: big_end, middle, small_end, mass 0.15072 kg; no error" in (
        capsys.readouterr().out
    )
    text = rod.read_text()
    rod.write_text(
        text.replace("elements = 10", "element = 10").replace('small_end = { x = "200 mm"', "small_end = { x = 1")
    )
    assert main(["check", str(rod), "--json"]) == 2
    assert {m["place"].partition(" ")[2] for m in json.loads(capsys.readouterr().out)} >= {"[elements]", "[element]"}
    rod.write_text(text.replace("elements = 10", "elements = 1000000"))
    assert main(["check", str(rod)]) == 4
    assert "1e+06 cells are more than the 500000 that limits.cells allows" in capsys.readouterr().err


SWEEP = (
    'scene = "slider_crank.toml"\nkeep = ["wrist.peak_force"]\nvary."joint.wrist.clearance" = ["0.1 mm", "0.2 mm"]\n'
)
LOOK = 'flexclear check {} looks at it; bodies of scenes name it: mesh = "{}"'
#: command, what it is given, what that is, what the command takes, and the way on
STRAY = {
    "recipe run": ("run", "rod", "a mesh recipe, not a scene", LOOK),
    "recipe asked why": ("why", "rod", "a mesh recipe, not a scene", LOOK),
    "recipe drawn": ("render", "rod", "a mesh recipe, not a scene", LOOK),
    "recipe swept": ("sweep", "rod", "a mesh recipe, not a sweep of a scene", LOOK),
    "sweep run": ("run", "many", "a sweep of a scene, not a scene", "flexclear sweep {}"),
    "sweep planned": ("plan", "many", "a sweep of a scene, not a scene", "flexclear sweep {}"),
    "scene swept": ("sweep", "slider_crank", "a scene, not a sweep of a scene", "flexclear run {}"),
}


@pytest.mark.parametrize("case", STRAY)
def test_a_file_that_a_command_does_not_take_is_named_with_the_command_that_does(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    write("slider-crank", tmp_path)
    (tmp_path / "many.toml").write_text(SWEEP)
    command, name, said, hint = STRAY[case]
    path = (tmp_path / f"{name}.toml").resolve()
    assert main([command, str(path)]) == 2
    assert capsys.readouterr().err == f"flexclear: {path}: is {said}\n  hint: {hint.format(path, path)}\n"


def test_a_sweep_or_a_scene_is_no_mesh_of_a_body(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, _ = write("slider-crank", tmp_path)
    (tmp_path / "many.toml").write_text(SWEEP)
    text = scene.read_text()
    for other in ("many", "slider_crank"):
        scene.write_text(text.replace('mesh = "rod.toml"', f'mesh = "{other}.toml"'))
        assert main(["check", str(scene)]) == 2
        assert "not a mesh recipe" in capsys.readouterr().err


def test_check_looks_at_sweeps_and_at_their_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, _ = write("slider-crank", tmp_path)
    sweep = tmp_path / "many.toml"
    sweep.write_text(
        'scene = "slider_crank.toml"\nkeep = ["wrist.peak_force"]\nvary."joint.wrisst.clearance" = [1e-4]\n'
    )
    assert main(["check", str(sweep)]) == 2
    said = capsys.readouterr().err
    assert "there is no 'joint.wrisst'" in said
    assert "did you mean" in said
    scene.write_text(scene.read_text().replace('mass = "0.8 kg"', "mass = -1"))
    assert main(["check", str(sweep)]) == 2
    assert "body.crank.mass" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["clearance", "speed"])
def test_the_sweeps_of_the_project_have_no_mistake(name: str, capsys: pytest.CaptureFixture[str]):
    assert main(["check", f"sweeps/{name}"]) == 0
    assert "no error" in capsys.readouterr().out


def test_results_are_printed_as_json_for_scripts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    assert main(["why", "checks/pendulum", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "checks/pendulum": {"simulate": ["never run"], "post": ["never run"]}
    }


def test_datasets_are_told_as_json_with_units_and_without_what_json_lacks():
    data = xr.Dataset({"f": ("k", [1.0, np.nan], {"units": "Hz"})}, coords={"k": ["a", "b"]}, attrs={"n": np.int64(3)})
    found = json.loads(as_json({"scene": data}))["scene"]
    assert found["attributes"] == {"n": 3}
    assert found["variables"]["f"] == {"dims": ["k"], "units": "Hz", "values": [1.0, None]}
    assert found["variables"]["k"]["values"] == ["a", "b"]


def test_results_lie_below_the_folder_from_which_a_command_is_called(
    tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch
):
    """Within the checkout they are the project's own."""
    monkeypatch.delenv("FLEXCLEAR_RESULTS")
    monkeypatch.chdir(tmp_path)
    assert results_root() == tmp_path / "results"
    monkeypatch.chdir(root / "docs")
    assert results_root().resolve() == (root / "results").resolve()
