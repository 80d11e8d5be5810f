"""Tables of drives in files next to scenes, and edits of scenes."""

import copy
from pathlib import Path

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.load import edited, load_scene
from flexclear.scene.loose_joints import ClearanceRevolute
from flexclear.scene.quantity import parse
from flexclear.stages import simulation
from flexclear.system.errors import InputError

TREE = Path(__file__).resolve().parents[2]

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
    pendulum = (TREE / "scenes" / "checks" / "pendulum.toml").read_text()
    path.write_text(pendulum.replace('end = "10 s"', 'end = "1 s"') + law)
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
        ("time,angel\n0,0\n1000,1\n", ("no column 'angle'", "did you mean 'angel'")),
        ("time,angle\n0,0\n1000,x\n", ("row 3", "no numbers in columns 1 and 2")),
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
    scene = load_scene(TREE / "pipeline" / "flexclear" / "stages" / "templates" / "slider_crank" / "slider_crank.toml")
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
