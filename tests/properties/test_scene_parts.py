"""Drives, laws, joints and loads that cannot be are refused before anything is compiled, in words."""

import copy
from pathlib import Path

import numpy as np
import pytest

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.clearance import ClearanceRevolute
from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.quantity import parse
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import tabulate
from flexclear.stages import simulation

TREE = Path(__file__).resolve().parents[2]

SCENE = """
title = "wrong"
[time]
end = "1 s"
[body.base]
type = "ground"
frames.O = {}
[body.a]
type = "rigid"
mass = 1.0
inertia = [0.1, 0.1, 0.1]
frames.O = {}
frames.far = { position = [0.5, 0.0, 0.0] }
[body.b]
type = "rigid"
mass = 1.0
inertia = [0.1, 0.1, 0.1]
frames.O = {}
[body.c]
type = "rigid"
mass = 1.0
inertia = [0.1, 0.1, 0.1]
frames.O = {}
[joint.hinge]
type = "revolute"
between = ["base.O", "a.O"]
[joint.sleeve]
type = "cylindrical"
between = ["a.far", "b.O"]
[joint.weld]
type = "fixed"
between = ["b.O", "c.O"]
"""

CONSTANT = 'law = { type = "constant" }'


def spline(more: str) -> str:
    return f'[drive.d]\njoint = "hinge"\nlaw = {{ type = "spline", {more} }}'


#: what is added to the scene -> place, and words that the message must hold
WRONG = {
    f'[drive.d]\njoint = "weld"\n{CONSTANT}': ("drive.d.joint", "fixed joint 'weld' has no coordinate"),
    f'[drive.d]\njoint = "sleeve"\n{CONSTANT}': ("drive.d.coordinate", "2 coordinates", "rotation, translation"),
    f'[drive.d]\njoint = "sleeve"\ncoordinate = "y"\n{CONSTANT}': ("drive.d.coordinate", "no 'y'"),
    '[drive.d]\njoint = "hinge"\nlaw = { type = "constant", value = "3 mm" }': (
        "drive.d.law",
        "'0.003 m'",
        "an angle",
        "deg",
    ),
    '[drive.d]\njoint = "hinge"\nlaw = { type = "harmonic", amplitude = [1.0], frequency = [] }': ("one entry per",),
    '[drive.d]\njoint = "hinge"\nlaw = { type = "polynomial", coefficients = [] }': ("coefficients",),
    spline("time = [0.0], value = [0.0]"): ("at least 2 points, not 1",),
    spline("time = [0.0, 0.6, 0.5, 1.0], value = [0.0, 0.1, 0.2, 0.3]"): ("point 3 at 0.5 s follows one at 0.6 s",),
    spline("time = [0.0, 1.0], value = [0.0]"): ("2 times, but 1 values",),
    spline("time = [0.0, 0.5], value = [0.0, 0.1]"): ("drive.d.law", "from 0 s to 0.5 s", "add points"),
    spline('time = [0.0, 0.4, 1.0], value = [0.0, 0.1, 0.2], ends = "periodic"'): ("drive.d.law", "periodic"),
    '[drive.d]\njoint = "hinge"\nlaw = { type = "table", file = "no.csv", time = { column = "t", unit = "s" }, '
    'value = { column = "x", unit = "deg" } }': ("no.csv cannot be read", "No such file"),
    '[drive.d]\njoint = "hinge"\nlaw.type = "piecewise"\nlaw.sections = [{ start = 0.0, law = { type = "constant" } }, '
    '{ start = 0.5, law = { type = "constant", value = 0.1 } }]': ("drive.d.law", "value", "jumps at 0.5 s"),
    '[drive.d]\nframe = "a.far"\nposition.x = { type = "constant" }\nactuators = ["hinges"]': (
        "drive.d.actuators",
        "no joint 'hinges'",
    ),
    '[drive.d]\nframe = "base.O"\nposition.x = { type = "constant" }': ("drive.d.frame", "ground"),
    '[drive.d]\nframe = "a.nowhere"\nposition.x = { type = "constant" }': ("drive.d.frame", "no frame 'a.nowhere'"),
    '[drive.d]\nframe = "a.far"': ("at least one component",),
    '[drive.d]\nframe = "a.far"\nangles = "rotation-vector"\nrotation.x = { type = "constant" }': ("three components",),
    '[load.l]\ntype = "point-force"\nframe = "a.fat"\nforce = [1.0, 0.0, 0.0]': ("load.l", "no frame", "a.far"),
    '[load.l]\ntype = "point-force"\nframe = "a.far"\nforce = ["1 N m", 0.0, 0.0]': ("load.l.force", "torque", "force"),
    '[load.l]\ntype = "spring-damper"\nbetween = ["b.O", "c.O"]\nstiffness = 1.0\nfree_length = 0.1': (
        "load.l",
        "move as one",
    ),
    '[load.l]\ntype = "spring-damper"\nbetween = ["base.O", "a.far"]': ("load.l", "a damping, or both"),
    '[load.l]\ntype = "joint-spring"\njoint = "hinge"\nstiffness = "3 N/m"': ("load.l", "torsional stiffness"),
    '[load.l]\ntype = "joint-spring"\njoint = "hinge"\nstiffness = -1.0': ("load.l", "must not be negative"),
    '[load.l]\ntype = "joint-friction"\njoint = "hinge"\ncoulomb = { static = 0.1, dynamic = 0.2, v_static = 0.1, '
    "v_dynamic = 0.2 }": ("load.l", "nor exceed static", "dynamic = 0.2, static = 0.1"),
    '[load.l]\ntype = "joint-friction"\njoint = "sleeve"\nviscous = 1.0': ("load.l.coordinate", "2 coordinates"),
    '[load.l]\ntype = "joint-force"\njoint = "hinge"\nforce = "1 N"': ("load.l.force", "force", "torque"),
    '[load.l]\ntype = "joint-force"\njoint = "weld"\nforce = 1.0': ("load.l.joint", "no coordinate"),
}


@pytest.mark.parametrize("addition", WRONG, ids=lambda text: text.replace("\n", " ")[:70])
def test_it_is_refused_with_place_value_rule_and_remedy(
    addition: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def compile_nothing(*_: object) -> None:
        raise AssertionError("compiled before the input was checked")

    monkeypatch.setattr(functions, "entry", compile_nothing)
    path = tmp_path / "wrong.toml"
    path.write_text(SCENE + addition)
    with pytest.raises(InputError) as error:
        dynamics.simulate(load_scene(path), {}, lambda fraction, text: None)
    for word in WRONG[addition]:
        assert word in str(error.value)


def test_the_scene_itself_is_right(tmp_path: Path) -> None:
    path = tmp_path / "right.toml"
    path.write_text(SCENE)
    tabulate(build(load_scene(path), {}))


# Tables in files ----------------------------------------------------------------------------------------------------

TABLE = """
[drive.d]
joint = "hinge"
[drive.d.law]
type = "table"
file = "moves/angle.csv"
time = { column = "time", unit = "ms" }
value = { column = "angle", unit = "deg" }
"""


def write(folder: Path, text: str, law: str = TABLE) -> Path:
    (folder / "moves").mkdir(exist_ok=True)
    (folder / "moves" / "angle.csv").write_text(text)
    path = folder / "scene.toml"
    path.write_text(SCENE + law)
    return path


ROWS = "time,other,angle\n# a remark\n0,9,0\n400,9,20\n1000,9,90\n"


def values(path: Path) -> np.ndarray:
    packed = tabulate(build(load_scene(path), {})).arrays
    pieces = packed.table(m.PIECES)
    return np.column_stack([pieces["start"], pieces["coefficients"][:, 0]])


def test_a_table_next_to_the_scene_is_read_in_its_units(tmp_path: Path) -> None:
    found = values(write(tmp_path, ROWS))
    # the tree meets the hinge from its first frame; three points make one cubic, cut at each of them
    assert found[:, 0] == pytest.approx([0.0, 0.4])
    assert found[:, 1] == pytest.approx(np.radians([0.0, 20.0]), abs=1e-15)


def test_columns_may_be_numbers(tmp_path: Path) -> None:
    law = TABLE.replace('"time", unit', "1, unit").replace('"angle", unit', "3, unit")
    assert np.array_equal(values(write(tmp_path, ROWS, law)), values(write(tmp_path, ROWS)))
    headless = ROWS.split("\n", 1)[1]
    assert np.array_equal(values(write(tmp_path, headless, law)), values(write(tmp_path, ROWS)))


def test_what_a_run_depends_on_is_the_content_of_the_table_not_its_place(tmp_path: Path) -> None:
    there = tmp_path / "there"
    there.mkdir()
    here, moved = (simulation.params(load_scene(write(folder, ROWS))) for folder in (tmp_path, there))
    assert here["scene"] == moved["scene"]
    assert str(tmp_path) not in str(here)
    edited = simulation.params(load_scene(write(tmp_path, ROWS.replace("20", "21"))))
    assert edited["scene"] != here["scene"]
    # a worker rebuilds the scene without the file
    (tmp_path / "moves" / "angle.csv").unlink()
    assert simulation.params(simulation.rebuild(copy.deepcopy(edited), {})) == edited


@pytest.mark.parametrize(
    "text, words",
    [
        ("time,angel\n0,0\n1000,1\n", ("no column 'angle'", "time, angel")),
        ("time,angle\n0,0\n1000,x\n", ("row 3", "'x'", "not two numbers")),
        ("time,angle\n0,0\n", ("at least 2 points",)),
        ("time,angle\n0,0\n500,1\n500,2\n", ("times must increase", "point 3")),
        ("", ("no column 'time'",)),
    ],
)
def test_tables_that_cannot_be_used_are_refused(text: str, words: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load_scene(write(tmp_path, text))
    for word in ("drive.d.law", *words):
        assert word in str(error.value)


def test_an_edit_takes_parts_and_keys_away_and_refuses_those_that_are_not_there() -> None:
    scene = load_scene(TREE / "scenes" / "checks" / "clearance_pendulum.toml")
    assert edited(scene, {"joint.hinge": None, "ensemble": None}).joint == {}
    joint = edited(scene, {"joint.hinge.friction": None}).joint["hinge"]
    assert isinstance(joint, ClearanceRevolute)
    assert joint.friction is None
    with pytest.raises(InputError, match=r"there is no 'joint\.hing'"):
        edited(scene, {"joint.hing": None})


def test_forces_along_angles_have_the_unit_of_torques_before_anything_is_run() -> None:
    scene = load_scene(TREE / "stages" / "templates" / "slider_crank" / "slider_crank.toml")
    law = {"law": "flores", "restitution": 0.5, "stiffness": 1e8}
    stops = {
        "way": {"joint": "guide", "upper": 0.4, "normal": law},
        "turn": {"joint": "main", "upper": 7.0, "normal": law},
    }
    scene = edited(scene, {"stop": stops})
    names = (
        "motor.drive_force",
        "turn.upper.peak_force",
        "turn.upper.impulse",
        "way.upper.peak_force",
        "slider.velocity",
    )
    units = [parse(name, scene.owners()).unit for name in names]
    assert units == ["N m", "N m", "N m s", "N", "m/s"]
