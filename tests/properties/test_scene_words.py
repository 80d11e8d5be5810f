"""What is said of a wrong scene is true, names the key, and is said once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pydantic import TypeAdapter, ValidationError

from flexclear.pipeline.core.artifacts import deficits
from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix, rotation_between
from flexclear.pipeline.core.scene.fields import Pose
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.units import any_quantity, quantity, unit
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.beam_recipe import NodeFrame
from flexclear.pipeline.structure.fe.recipe_parts import TurnedFrame

HEAD = """title = "words"
[time]
end = 1.0
[body.g]
type = "ground"
frames.O = {}
[body.a]
type = "rigid"
mass = 1.0
inertia = [1.0, 1.0, 1.0]
frames.O = {}
"""
SOCKET = """[joint.c]
type = "clearance-spherical"
between = ["g.O", "a.O"]
clearance = "1 mm"
ball_radius = "10 mm"
normal = { law = "hertz", stiffness = 1e8 }
friction = { WORDS }
"""
BEAM = """[body.f]
type = "flexible"
mesh = "rod.toml"
modes = { reference = "craig-bampton", WORDS }
"""


def mistakes(tmp_path: Path, text: str) -> list[str]:
    """What is said of a scene with this text, one entry per mistake."""
    path = tmp_path / "scene.toml"
    path.write_text(HEAD + text)
    with pytest.raises(InputError) as refusal:
        load_scene(path)
    return [str(e) for e in getattr(refusal.value, "errors", [refusal.value])]


COULOMB = 'law = "modified-coulomb", static = 0.2, dynamic = 0.1, v_static = 1e-4, v_dynamic = 1e-3'
SAID = {
    SOCKET.replace("WORDS", "static = 0.2"): ("[joint.c.friction.law]", "is missing", "modified-coulomb, ambrosio"),
    SOCKET.replace("WORDS", COULOMB.replace("1e-4", "0")): (
        "[joint.c.friction.v_static]",
        "must be greater than 0 (got 0)",
    ),
    SOCKET.replace("WORDS", 'law = "ambrosio", dynamic = 0.1, v0 = 1.0, v1 = 0.5'): (
        "v0 must be below v1",
        "v0 = 1 m/s, v1 = 0.5 m/s",
    ),
    BEAM.replace("WORDS", 'count = "al"'): ("[body.f.modes.count]", "expected a whole number or 'all' (got 'al')"),
    BEAM.replace("WORDS", "count = 1") + "damping = -1": ("[body.f.damping]", "must be greater than 0 (got -1)"),
}


@pytest.mark.parametrize("text", SAID)
def test_one_error_is_reported_once_with_key_and_rule(tmp_path: Path, text: str) -> None:
    (said,) = mistakes(tmp_path, text)
    for words in SAID[text]:
        assert words in said


@pytest.mark.parametrize(
    "written, mended",
    [
        ("mass = 0.5 kg", 'mass = "0.5 kg"'),
        ("mass = 0.5kg # light", 'mass = "0.5 kg" # light'),
        ("inertia = [1e-3 kg m^2, 1.0, 2 g cm^2]", 'inertia = ["1e-3 kg m^2", 1.0, "2 g cm^2"]'),
        ('f = { x = "1 mm", y = 3 µm }', 'f = { x = "1 mm", y = "3 µm" }'),
        ("phase = 30 deg", 'phase = "30 deg"'),
    ],
)
def test_a_quantity_without_quotation_marks_is_reported_with_its_line_corrected(
    tmp_path: Path, written: str, mended: str
) -> None:
    (said,) = mistakes(tmp_path, f'[body.b]\ntype = "rigid"\n{written}\n')
    line = HEAD.count("\n") + 3
    assert f"scene.toml, line {line}: is not TOML: a quantity with a unit needs quotation marks" in said
    assert f"write {mended}" in said


def test_a_line_that_holds_no_quantity_is_left_to_the_reader_of_toml(tmp_path: Path) -> None:
    (said,) = mistakes(tmp_path, "[body.b\n")
    assert "with a unit" not in said
    assert "is not TOML" in said


@pytest.mark.parametrize(
    "text, dimension, value",
    [
        ("5 kHz", "angular velocity", 1e4 * np.pi),
        ("1 MHz", "angular velocity", 2e6 * np.pi),
        ("2 MN", "force", 2e6),
        ("3 mN", "force", 3e-3),
        ("3 Nm", "torque", 3.0),
        ("3 Nmm", "torque", 3e-3),
        ("3 kN m", "torque", 3e3),
        ("2 Nm/rad", "torsional stiffness", 2.0),
        ("2 Nms/rad", "torsional damping", None),
        ("2 Nm s/rad", "torsional damping", 2.0),
        ("7 mg", "mass", 7e-6),
        ("2 t", "mass", 2e3),
        ("5 kPa", "pressure", 5e3),
        ("2 bar", "pressure", 2e5),
        ("5 N/mm", "stiffness", 5e3),
        ("5 kN/mm", "stiffness", 5e6),
        ("5 N/um", "stiffness", 5e6),
        ("90 arcsec", "angle", np.pi / 7200.0),
        ("10 mrad", "angle", 1e-2),
        ("3 lbf", "force", 3 * 0.45359237 * 9.80665),
        ("1 h", "time", 3600.0),
        ("600 rpm", "angular velocity", 20.0 * np.pi),
        ("30 deg/s", "angular velocity", np.pi / 6.0),
        ("1 rev/min", "angular velocity", np.pi / 30.0),
        ("3 N*mm/deg", "torsional stiffness", 3e-3 * 180.0 / np.pi),
        ("2 kg·m²", "inertia", 2.0),
        ("4 g cm^2", "inertia", 4e-7),
        ("9810 mm/s²", "acceleration", 9.81),
        ("1 mm/ms^2", "acceleration", 1000.0),
        ("210000 N/mm^2", "pressure", 2.1e11),
    ],
)
def test_units_that_users_of_mechanisms_write(text: str, dimension: str, value: float | None) -> None:
    if value is None:
        with pytest.raises(ValueError, match="unknown unit"):
            quantity(text, dimension)
    else:
        # rounding of one product and of the constants
        assert quantity(text, dimension) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text, named", [("1 W", "a power"), ("3 J", "an energy"), ("2 rad/s^2", "an angular acceleration")]
)
def test_a_unit_in_the_wrong_place_is_known(text: str, named: str) -> None:
    with pytest.raises(ValueError, match=f"is {named}, but a torque belongs here"):
        quantity(text, "torque")


def test_nanometres_are_no_newton_metres() -> None:
    assert (unit("nm"), unit("Nm")) == ((1e-9, "length"), (1.0, "torque"))


DIRECTIONS = [
    (1, 0, 0),
    (0, 1, 0),
    (0, 0, 1),
    (0, 0, -1),
    (0.3, -0.2, 0.9),
    (-2, 1, -3),
    (1e-6, 1e-7, -1),
    (0, 1e-12, -1),
]


@pytest.mark.parametrize("axis", DIRECTIONS)
def test_one_axis_is_where_z_points_after_the_least_rotation(axis: tuple[float, ...]) -> None:
    found = Pose(axis=axis).as_quaternion()
    R, a = quaternion_to_matrix(found), np.array(axis) / np.linalg.norm(axis)
    # rounding, a few units in the last place of quaternion and matrix
    assert R[:, 2] == pytest.approx(a, abs=2e-15)
    assert pytest.approx(np.eye(3), abs=4e-15) == R.T @ R
    least = np.arctan2(np.hypot(a[0], a[1]), a[2])  # the angle between z and the axis
    assert rotation_between(np.array([1.0, 0.0, 0.0, 0.0]), found) == pytest.approx(least, abs=1e-11)


def test_opposite_to_z_the_frame_turns_about_x() -> None:
    R = quaternion_to_matrix(Pose(axis=(0, 0, -2)).as_quaternion())
    assert pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=1e-15) == R


@pytest.mark.parametrize("other", ["quaternion", "rotation_vector", "axes"])
def test_an_axis_is_given_alone(other: str) -> None:
    value = {"quaternion": [1, 0, 0, 0], "rotation_vector": [0, 0, 1], "axes": {"z": [0, 0, 1], "x": [1, 0, 0]}}[other]
    with pytest.raises(ValidationError, match="an orientation is given once"):
        Pose.model_validate({"axis": [0, 0, 1], other: value})


def test_frames_of_recipes_take_an_axis_too() -> None:
    across = TypeAdapter(NodeFrame).validate_python({"x": "10 mm", "axis": [0, 0, 1]})
    assert across.orientation() == pytest.approx(np.eye(3), abs=0.0)
    upright = TypeAdapter(TurnedFrame).validate_python({"axis": [1, 0, 0]})
    assert upright.orientation()[:, 2] == pytest.approx([1, 0, 0], abs=1e-15)
    for model, more in ((NodeFrame, {"x": 0.0}), (TurnedFrame, {})):
        with pytest.raises(ValidationError, match="an orientation is given once"):
            model.model_validate({"axis": [0, 0, 1], "axes": {"z": [0, 0, 1], "x": [1, 0, 0]}, **more})


def lacking(reference: str, interfaces: str) -> str:
    """What is reported of a body of which half the compliance between A and B is missing."""
    names, directions = ["A", "B"], ["x", "y", "z", "rx", "ry", "rz"]
    fraction = xr.DataArray(
        np.full((2, 2, 6), 0.5),
        dims=("frame", "frame_held", "direction"),
        coords={"frame": names, "frame_held": names, "direction": directions},
    )
    attributes = {"reference": reference, "interfaces": interfaces, "count": 12}
    (reported,) = deficits.warnings(xr.Dataset({"compliance_share": fraction}, attrs=attributes), names, "rod")
    return reported


def test_the_remedy_for_missing_compliance_is_one_that_the_body_does_not_have() -> None:
    assert 'reference = "craig-bampton"' in lacking("fixed-fixed", "A B")
    other_frames, too_few = lacking("craig-bampton", "A"), lacking("craig-bampton", "A B")
    assert 'interfaces = ["A", "B"]' in other_frames
    assert 'not made for ["B"]' in other_frames
    assert "more normal modes than now (count = 12)" in too_few
    assert 'reference = "craig-bampton"' not in other_frames + too_few


@pytest.mark.parametrize("text", ["900 N/m s", "3 N m/deg s", "2 kN/s", "60 mm", "4 N s/rad"])
def test_a_quantity_whose_dimension_is_known_later_is_read_twice_alike(text: str) -> None:
    once = any_quantity(text)
    assert isinstance(once, str)
    assert any_quantity(once) == once
