"""A scene of one's own: what `new` writes is right, what is wrong in it is reported at once, editors know its keys."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts.paths import results_root
from flexclear.commands import check, show
from flexclear.commands.check import examine
from flexclear.commands.new import KINDS, TEMPLATES, write
from flexclear.scene import toml_files
from flexclear.scene.json_schema import scene_schema
from flexclear.scene.plausibility import implausible_values
from flexclear.scene.schema import Scene
from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.system.errors import InputError
from tests.properties import mechanisms
from tests.properties.mechanisms import frame, ground, joint, rigid
from tests.stages.conftest import Command
from tests.stages.typical_mistakes import MISTAKES, OTHER, WARNED

REPORTED = dict(
    re.findall(r"^## (.+)\n((?:.+\n?)+)", (Path(__file__).parent / "typical_mistakes.txt").read_text(), re.MULTILINE)
)
#: sweeps are no scenes, though they lie next to them
SCENES = [p for p in sorted((Path(__file__).parents[2] / "scenes").rglob("*.toml")) if p.parent.name != "sweeps"]
#: right in itself, but more than `[limits]` allows
TOO_MUCH = ("far too many rows",)
RECIPES = sorted((Path(__file__).parents[2] / "meshes").rglob("*.toml"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_new_writes_has_no_mistake(kind: str, tmp_path: Path, command: Command):
    command("new", kind, tmp_path / "own")
    scene, *_ = sorted((tmp_path / "own").glob("*.toml"), key=lambda path: "[body" not in path.read_text())
    assert "no error" in command("check", scene).out
    assert "already exists" in command("new", kind, tmp_path / "own", code=2).err


def test_all_beginnings_fit_into_one_folder(tmp_path: Path) -> None:
    written = [path for kind in KINDS for path in write(kind, tmp_path)]
    assert len({path.name for path in written}) == len(written)


def test_all_typical_mistakes_are_in_the_table():
    assert len(MISTAKES) >= 220
    assert set(REPORTED) == set(MISTAKES)


@pytest.fixture(scope="module")
def made() -> dict[object, list[check.Body]]:
    """Meshes by the texts of their recipes: to make one takes longer than all else that is looked at."""
    return {}


@pytest.fixture
def meshed_once(made: dict[object, list[check.Body]], monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = check._mesh_recipe

    def known(path: Path, segment: tuple[int, int] | None, seen: check.Findings) -> list[check.Body]:
        text = path.read_text()
        if (text, segment) not in made:
            found = list(mesh(path, segment, seen))
            if seen.warnings or "file" in text:
                return found
            made[text, segment] = found
        return made[text, segment]

    monkeypatch.setattr(check, "_mesh_recipe", known)


@pytest.mark.usefixtures("meshed_once")
@pytest.mark.parametrize("name", MISTAKES)
def test_a_typical_mistake_gets_its_message(name: str, tmp_path: Path, command: Command):
    file, old, new = MISTAKES[name]
    folder = tmp_path / "own"
    write("slider-crank", folder)
    text = (folder / file).read_text() if old != "" else ""
    assert old is None or old in text
    (folder / file).write_text(text.replace(old, new, 1) if old else text + new)
    code = 4 if name in TOO_MUCH else 0 if name in WARNED else 2
    said = command("check", folder / (file if file == OTHER else "slider_crank.toml"), code=code).err
    said = said.replace(f"{folder}/", "").replace(f"{folder}:", ".:")
    # lists of all names that there are grow with the program
    assert re.sub(r"(known|one of): .*", r"\1: ...", said).strip() == REPORTED[name].strip()


@pytest.fixture(scope="module")
def validators():
    jsonschema = pytest.importorskip("jsonschema")
    from flexclear.structure.fe.recipe import recipe_schema

    found = [jsonschema.Draft202012Validator(schema) for schema in (scene_schema(), recipe_schema())]
    for one in found:
        one.check_schema(one.schema)
    return found


@pytest.mark.usefixtures("meshed_once")
@pytest.mark.parametrize("path", [*SCENES, *RECIPES, *sorted(TEMPLATES.rglob("*.toml"))], ids=lambda path: path.stem)
def test_nothing_that_the_project_ships_is_doubted(path: Path, validators):
    """No scene, recipe or template has an error or a plausibility warning, and the schema accepts each of them."""
    seen = examine(str(path))
    assert [str(error) for error in seen.errors] == []
    assert [str(warning) for warning in seen.warnings] == []
    table = tomllib.loads(path.read_text())
    assert list(validators[path in RECIPES or "shape" in table].iter_errors(table)) == []


@pytest.mark.parametrize("verb", ["check", "show", "why"])
def test_a_value_of_the_command_line_is_doubted_where_it_is_given(
    verb: str, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch, fresh: Path
):
    monkeypatch.setattr(show, "show_start", lambda scene, quiet: ([], None))  # nothing is drawn
    scene, _ = write("slider-crank", tmp_path)
    said = command(verb, scene, "--set", "joint.pin.clearance=0.2").err
    assert "warning: --set joint.pin.clearance: 200 mm is more than the pin's radius, 10 mm" in said


def test_a_run_from_python_prints_plausibility_warnings(capsys: pytest.CaptureFixture[str], fresh: Path):
    import flexclear as fc

    scene = fc.load_scene("scenes/checks/pendulum.toml", override={"output.interval": 50.0})
    run = fc.run(scene)
    assert "[output.interval], line" in capsys.readouterr().err
    assert run.attrs["warnings"] == ""
    table = run.to_dataframe()
    assert list(table.index) == list(run["time"].values)
    assert np.array_equal(table["position bob x [m]"], run["position"].sel(body="bob", axis="x"))


def test_members_that_would_all_be_the_same_run_are_refused_before_anything_runs(
    tmp_path: Path, command: Command, fresh: Path
):
    (scene,) = write("pendulum", tmp_path / "own")
    scene.write_text(scene.read_text() + "\n[ensemble]\nmembers = 3\n")
    for verb in ("check", "run"):
        assert "[ensemble], line" in (said := command(verb, scene, code=2).err)
        assert "neither clearance joint nor stop" in said
    assert not fresh.exists()


def test_errors_of_several_files_are_reported_together_and_as_json(tmp_path: Path, command: Command):
    scene, rod = write("slider-crank", tmp_path)
    scene.write_text(scene.read_text().replace('"0.8 kg"', "-1").replace('"crank.pin"] ', '"crank.pim"] '))
    rod.write_text(rod.read_text().replace('"7850 kg/m^3"', '"7850 kg"'))
    said = json.loads(command("check", scene, "--json", code=2).out)
    text = scene.read_text().splitlines()
    mass = 1 + next(k for k, line in enumerate(text) if line.startswith("mass = -1"))
    between = 1 + next(k for k, line in enumerate(text) if '"crank.pim"' in line and line.startswith("between"))
    density = 1 + next(k for k, line in enumerate(rod.read_text().splitlines()) if line.startswith("density"))
    assert {(Path(m["file"]).name, m["line"]) for m in said} == {
        ("slider_crank.toml", mass),
        ("slider_crank.toml", between),
        ("rod.toml", density),
    }


def test_an_error_in_an_extended_scene_is_reported_in_its_file(tmp_path: Path, command: Command):
    scene, _ = write("slider-crank", tmp_path)
    scene.write_text(scene.read_text().replace('mass = "0.8 kg"', "mass = -1"))
    (tmp_path / "other.toml").write_text('extends = "slider_crank.toml"\n')
    said = command("check", tmp_path / "other.toml", code=2).err
    assert re.search(r"other.toml \[body.crank.mass\], line \d+ of .*slider_crank.toml: must be greater than 0", said)


def test_lines_are_those_of_the_text():
    text = '# a\n[body.rod] # b\ntype = "rigid"\nframes."a.b" = {}\ntext = """\n[joint.x]\n"""\n[[x]]\ny = 1\n'
    found = toml_files.lines_of_keys(text)
    assert found["body", "rod"] == 2
    assert found["body", "rod", "type"] == 3
    assert found["body", "rod", "frames", "a.b"] == 4
    assert ("joint",) not in found
    assert found["x", "y"] == 9


@pytest.mark.parametrize("square_radius, warned", [(1e-2, False), (1e4, True)], ids=["disc", "kg m^2 for kg mm^2"])
def test_a_disc_is_larger_than_the_distances_of_its_frames_and_denser_than_air(square_radius: float, warned: bool):
    moments = [k * 10.0 * square_radius for k in (0.5, 0.5, 1.0)]
    bodies = {"ground": ground(axle=(0, 0, 0)), "disc": rigid(10.0, moments, {"centre": frame((1e-3, 0.0, 0.0))})}
    table = mechanisms.scene(bodies, {"axle": joint("revolute", "ground.axle", "disc.centre")}, end=1.0)
    assert bool(implausible_values(Scene.model_validate(table))) == warned


def test_the_schema_refuses_what_is_no_scene(validators):
    scene = tomllib.loads((TEMPLATES / "four_bar" / "four_bar.toml").read_text())
    assert not validators[0].is_valid({**scene, "titel": "a"})
    assert not validators[0].is_valid({key: value for key, value in scene.items() if key != "body"})
    assert not validators[0].is_valid({**scene, "remove": ["joint.A"]})  # edits nothing
    assert validators[0].is_valid({"extends": "a.toml", "remove": ["joint.A"], "set": {"body": {"rod": {"mass": 1}}}})


@pytest.mark.parametrize("kind", ["scene", "recipe"])
def test_schemas_say_what_they_are(kind: str, command: Command):
    schema = json.loads(command("schema", kind).out)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["$id"] == f"urn:flexclear:schema:{kind}"
    assert kind == "recipe" or {"body", "joint", "drive", "load", "time"} <= schema["properties"].keys()


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_every_command_and_its_options(shell: str, command: Command):
    said = command("completion", shell).out
    assert 'compare) options="-h --help --set --jobs' in said
    assert "--ideal" in said
    assert all(verb in said for verb in ("new", "check", "report"))


def test_a_value_is_changed_from_the_command_line(tmp_path: Path, command: Command):
    scene, _ = write("slider-crank", tmp_path)
    graph = scenes.graphs([str(scene)], ["joint.pin.clearance=0.3 mm", "solver.rtol=1e-6"])[0]
    assert graph.scene.joint["pin"].clearance == pytest.approx(3e-4, rel=1e-12)
    assert graph.scene.solver.rtol == 1e-6
    assert "joint.pin.clearance=0.3_mm" in graph.simulate.folder  # the results of the file stay
    assert "did you mean 'clearance'" in command("why", scene, "--set", "joint.pin.clearence=1", code=2).err
    assert "is not KEY=VALUE" in command("why", scene, "--set", "joint", code=2).err


def test_a_scene_from_a_table_is_that_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import flexclear as fc

    path, _ = write("slider-crank", tmp_path)
    monkeypatch.chdir(tmp_path)
    scene = fc.load_scene(tomllib.loads(path.read_text()))
    assert scene.model_dump() == fc.load_scene(path).model_dump()
    assert repr(scene).startswith("<Scene slider-crank-with-a-flexible-rod")
    assert len(repr(scene)) < 250
    with pytest.raises(InputError, match="only files can do"):
        fc.load_scene({"extends": "a.toml"})


def test_every_template_is_a_kind_that_new_knows():
    assert {path.parent.name.replace("_", "-") for path in TEMPLATES.glob("*/*.toml")} == set(KINDS)


def test_check_looks_whether_the_joints_of_flexible_bodies_fit(tmp_path: Path, command: Command):
    """Without a mode: where nothing is deformed."""
    scene, _ = write("leg", tmp_path)
    text = scene.read_text()
    assert 'position = [0, 0, "260 mm"]' in text
    scene.write_text(text.replace('position = [0, 0, "260 mm"]', 'position = ["20 mm", 0, "260 mm"]'))
    assert re.search(r"\[joint\.\w+", command("check", scene, code=2).err)


@pytest.mark.parametrize("at", ["ideal", "poses"])
def test_check_warns_of_a_crank_behind_a_gear_that_starts_anywhere(at: str, tmp_path: Path, command: Command):
    """The drive turns the pinion, and the gear's offset is that of the start: any angle of the crank fits."""
    path = write("four-bar", tmp_path)[0]
    text = "\n".join(line for line in path.read_text().split("\n") if not line.startswith("pose = "))
    text = (
        text.replace('"C.peak_force", ', "")
        .replace('joint = "A"', 'joint = "m"')
        .replace("frames.A = {}", "frames.A = {}\nframes.m = {}")
    )
    if at == "poses":  # with an ideal pin: loose, the loop would leave the crank at zero
        text = (
            f"{text.partition('[joint.C]')[0]}[joint.C]\ntype = 'revolute'\nbetween = ['coupler.C', 'rocker.C']\n"
            + (f"[drive.motor]{text.partition('[drive.motor]')[2]}")
        )
    more = """
    [body.pinion]
    type = "rigid"
    mass = 0.5
    inertia = [2e-4, 2e-4, 4e-4]
    frames.c = {}
    [joint.m]
    type = "revolute"
    between = ["ground.m", "pinion.c"]
    [gear.pair]
    first = "m"
    second = "A"
    ratio = -0.25
    [start]
    """
    start = 'at = "ideal"\n' if at == "ideal" else ""
    path.write_text(f'{text}{more}{start}joint.D.near = "80 deg"\n')
    said = command("check", path).err
    assert "[start]" in said
    assert "does not say where free coordinates start: A is at" in said
    assert "[start.joint.A] position" in said
    path.write_text(f'{text}{more}{start}joint.D.near = "80 deg"\njoint.A.position = "10 deg"\n')
    assert "does not say" not in command("check", path).err


def test_check_looks_at_a_recipe_as_a_recipe(tmp_path: Path, command: Command):
    _, rod = write("slider-crank", tmp_path)
    # 200 mm x 12 mm x 8 mm of 7850 kg/m^3
    reported = f"{rod}: a mesh recipe, straight-beam, frames: big_end, middle, small_end, mass 0.15072 kg; no error"
    assert reported in command("check", rod).out
    text = rod.read_text()
    rod.write_text(
        text.replace("elements = 10", "element = 10").replace('small_end = { x = "200 mm"', "small_end = { x = 1")
    )
    said = json.loads(command("check", rod, "--json", code=2).out)
    assert {m["place"].partition(" ")[2] for m in said} >= {"[elements]", "[element]"}
    rod.write_text(text.replace("elements = 10", "elements = 1000000"))
    assert "1e+06 cells are more than the 500000 that limits.cells allows" in command("check", rod, code=4).err


SWEEP = (
    'scene = "slider_crank.toml"\nkeep = ["wrist.peak_force"]\nvary."joint.wrist.clearance" = ["0.1 mm", "0.2 mm"]\n'
)
LOOK = 'flexclear check {} checks it; bodies of scenes name it: mesh = "{}"'
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
    case: str, tmp_path: Path, fresh: Path, command: Command
):
    write("slider-crank", tmp_path)
    (tmp_path / "many.toml").write_text(SWEEP)
    verb, name, said, hint = STRAY[case]
    path = (tmp_path / f"{name}.toml").resolve()
    assert command(verb, path, code=2).err == f"flexclear: {path}: is {said}\n  hint: {hint.format(path, path)}\n"


def test_a_sweep_or_a_scene_is_no_mesh_of_a_body(tmp_path: Path, command: Command):
    scene, _ = write("slider-crank", tmp_path)
    (tmp_path / "many.toml").write_text(SWEEP)
    text = scene.read_text()
    for other in ("many", "slider_crank"):
        scene.write_text(text.replace('mesh = "rod.toml"', f'mesh = "{other}.toml"'))
        assert "not a mesh recipe" in command("check", scene, code=2).err


def test_check_looks_at_sweeps_and_at_their_scenes(tmp_path: Path, command: Command):
    scene, _ = write("slider-crank", tmp_path)
    sweep = tmp_path / "many.toml"
    sweep.write_text(
        'scene = "slider_crank.toml"\nkeep = ["wrist.peak_force"]\nvary."joint.wrisst.clearance" = [1e-4]\n'
    )
    said = command("check", sweep, code=2).err
    assert "there is no 'joint.wrisst'" in said
    assert "did you mean" in said
    scene.write_text(scene.read_text().replace('mass = "0.8 kg"', "mass = -1"))
    assert "body.crank.mass" in command("check", sweep, code=2).err


def test_results_are_printed_as_json_for_scripts(command: Command, fresh: Path):
    assert json.loads(command("why", "checks/pendulum", "--json").out) == {
        "checks/pendulum": {"simulate": ["never run"], "post": ["never run"]}
    }


def test_datasets_are_printed_as_json_with_units_and_without_what_json_lacks():
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


TWO_BODIES = """
title = "Two bodies that a joint was to connect"
time = { end = "10 ms" }
[body.a]
type = "rigid"
mass = "1 kg"
inertia = [1e-3, 1e-3, 1e-3]
pose = {}
frames.end = { position = ["0.1 m", 0, 0] }
[body.b]
type = "rigid"
mass = "1 kg"
inertia = [1e-3, 1e-3, 1e-3]
pose = { position = ["0.2 m", 0, 0] }
frames.start = { position = ["-0.1 m", 0, 0] }
"""
MISSING = "the frames 'a.end' and 'b.start' are unused and start at the same point: is a joint missing?"


def test_check_and_run_warn_of_a_forgotten_joint(
    tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch, fresh: Path
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.toml").write_text(TWO_BODIES)
    said = command("check", "two.toml")
    assert MISSING in said.err
    assert "free motions in addition to the drives: 12" in said.out
    said = command("run", "two.toml", "--json")
    assert MISSING in said.err
    assert MISSING in json.loads(said.out)["two"]["warnings"][0]
    assert MISSING not in command("check", "two.toml", "--set", "body.b.frames.start.position=[0, 0, 0]").err


ROLLING = """
title = "A ball on a plane"
time = { end = "10 ms" }
[body.ground]
type = "ground"
frames.plane = {}
[body.ball]
type = "rigid"
mass = "1 kg"
inertia = [4e-4, 4e-4, 4e-4]
pose = { position = [0, 0, "29 mm"] }
frames.centre = {}
[joint.floor]
type = "ball-on-plane"
between = ["ground.plane", "ball.centre"]
ball_radius = "32 mm"
normal = { law = "flores", restitution = 0.3, stiffness = 1e9 }
"""


def test_a_ball_that_starts_in_its_plane_is_refused_with_its_depth(tmp_path: Path, command: Command):
    (tmp_path / "ball.toml").write_text(ROLLING)
    said = command("check", tmp_path / "ball.toml", code=2).err
    assert "the ball starts with a penetration of 3 mm into the plane" in said
    assert "hint: move a body, lower the plane, or declare" in said
    assert "clearance" not in said
