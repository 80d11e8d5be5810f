"""How texts, units, inertias and directions of scenes are read, whoever wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pydantic import TypeAdapter, ValidationError

from flexclear.artifacts import compliance
from flexclear.dynamics.model.mechanism import build
from flexclear.numerics.rotations import quaternion_to_matrix, rotation_between, rotation_vector_to_matrix
from flexclear.scene import units
from flexclear.scene.fields import Inertia, Pose, Position
from flexclear.scene.load import load_scene
from flexclear.scene.units import UNITS, any_quantity, quantity, unit
from flexclear.structure.fe.beam_recipe import NodeFrame
from flexclear.structure.fe.recipe_parts import TurnedFrame
from flexclear.system.errors import InputError


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
    with pytest.raises(ValueError, match=f"is {named}, but a torque is expected"):
        quantity(text, "torque")


def test_nanometres_are_no_newton_metres() -> None:
    assert (unit("nm"), unit("Nm")) == ((1e-9, "length"), (1.0, "torque"))


BASE = """
title = "sound"
time.end = "1 s"
[body.ground]
type = "ground"
frames.O = {}
[body.crank]
type = "rigid"
mass = 1.0
inertia = [0.1, 0.1, 0.1]
frames.A = {}
frames.P = { position = [0.3, 0.0, 0.0] }
[joint.A]
type = "revolute"
between = ["ground.O", "crank.A"]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "scene.toml"


@pytest.mark.parametrize("content", [bytes(range(256)), BASE.encode("utf-16")], ids=["bytes", "UTF-16"])
def test_files_that_are_no_text_are_refused(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not text in UTF-8"):
        load_scene(path)


def test_a_byte_order_mark_is_no_mistake(path: Path) -> None:
    path.write_bytes(b"\xef\xbb\xbf" + BASE.replace("\n", "\r\n").encode())
    assert load_scene(path).title == "sound"


def test_fixed_joints_that_do_not_fit_together_are_refused(path: Path) -> None:
    body = '[body.x]\ntype = "rigid"\nmass = 1.0\ninertia = [1, 1, 1]\nframes.b.position = [0.1, 0, 0]\nframes.a = {}'
    welds = '[joint.w{}]\ntype = "fixed"\nbetween = ["crank.{}", "x.{}"]\n'
    path.write_text(f"{BASE}{body}\n{welds.format(1, 'P', 'a')}{welds.format(2, 'A', 'b')}")
    with pytest.raises(InputError, match=r"\[joint.w2.between\].*0.4 m and 0 deg apart"):
        build(load_scene(path), {})


def test_one_step_and_one_value_need_no_list(path: Path) -> None:
    ten = '{ type = "constant", value = "10 deg" }'
    step = '{ type = "step", start = 0, end = "1 s", change = "30 deg" }'
    listed = '{ type = "step", start = [0], end = ["1 s"], change = ["30 deg"] }'
    drives = []
    for laws in (f'"10 deg", {step}', f"{ten}, {listed}"):
        path.write_text(BASE + f'[drive.d]\njoint = "A"\nlaw = {{ type = "sum", laws = [{laws}] }}\n')
        drives.append(load_scene(path).drive)
    assert drives[0] == drives[1]


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
    with pytest.raises(ValidationError, match="give an orientation once"):
        Pose.model_validate({"axis": [0, 0, 1], other: value})


def test_frames_of_recipes_take_an_axis_too() -> None:
    across = TypeAdapter(NodeFrame).validate_python({"x": "10 mm", "axis": [0, 0, 1]})
    assert across.orientation() == pytest.approx(np.eye(3), abs=0.0)
    upright = TypeAdapter(TurnedFrame).validate_python({"axis": [1, 0, 0]})
    assert upright.orientation()[:, 2] == pytest.approx([1, 0, 0], abs=1e-15)
    for model, more in ((NodeFrame, {"x": 0.0}), (TurnedFrame, {})):
        with pytest.raises(ValidationError, match="give an orientation once"):
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
    (reported,) = compliance.warnings(xr.Dataset({"compliance_share": fraction}, attrs=attributes), names, "rod")
    return reported


def test_the_remedy_for_missing_compliance_is_one_that_the_body_does_not_have() -> None:
    assert 'reference = "craig-bampton"' in lacking("fixed-fixed", "A B")
    other_frames, too_few = lacking("craig-bampton", "A"), lacking("craig-bampton", "A B")
    assert 'interfaces = ["A", "B"]' in other_frames
    assert 'no static shapes for ["B"]' in other_frames
    assert "more normal modes than now (count = 12)" in too_few
    assert 'reference = "craig-bampton"' not in other_frames + too_few


@pytest.mark.parametrize("text", ["900 N/m s", "3 N m/deg s", "2 kN/s", "60 mm", "4 N s/rad"])
def test_a_quantity_whose_dimension_is_known_later_is_read_twice_alike(text: str) -> None:
    once = any_quantity(text)
    assert isinstance(once, str)
    assert any_quantity(once) == once


@pytest.mark.parametrize("moments", [(0.0, 1e-5, 1e-5), (1e-5, 1e-5, 2e-5), (1e-5, 2e-5, 2.5e-5)])
def test_an_inertia_that_was_turned_elsewhere_is_read(moments: tuple[float, ...]) -> None:
    """Turning leaves roundings: entries of 1e-53, zero moments below zero, sides that differ in the last digits."""
    read = TypeAdapter(Inertia).validate_python
    random = np.random.default_rng(0)
    for _ in range(50):
        turn = rotation_vector_to_matrix(random.normal(size=3))
        quarter = rotation_vector_to_matrix(0.5 * np.pi * random.integers(-1, 2, size=3))
        for R in (turn, quarter, quarter @ quarter):
            given = (R @ (np.diag(moments) @ R.T)) * (1.0 + 1e-16 * random.normal(size=(3, 3)))
            found = np.array(read(given.tolist()))
            assert np.array_equal(found, found.T)
            # what is read is the symmetric part: half of the rounding of two products of matrices, and of the noise
            assert np.abs(found - given).max() <= 1e-14 * max(moments)
    with pytest.raises(ValidationError, match="symmetric"):
        read((given + 1e-9 * max(moments) * np.eye(3, k=1)).tolist())
    with pytest.raises(ValidationError, match="are impossible"):
        read([-1e-9 * max(moments), *moments[1:]])


def test_a_vectors_size_counts_and_not_its_components() -> None:
    """What turning leaves of a zero is no mistake; a vector that is too small as a whole is one."""
    assert TypeAdapter(Position).validate_python(["0.3 m", 1.8e-17 * 1.8e-17 * 1.8e-17, 0.0]) == (0.3, 5.832e-51, 0.0)
    for vector in ([1e-60, 0.0, 1e-70], [0.0, 1e60, 1.0]):
        with pytest.raises(ValidationError, match="outside of the supported range"):
            TypeAdapter(Position).validate_python(vector)


def test_listed_units_are_the_products_that_they_look_like(monkeypatch: pytest.MonkeyPatch) -> None:
    # a thousandth of a pascal alone is no unit: it would hide a wrong letter of MPa
    for text in [text for text in UNITS if not text.isalpha() and text not in ("%", "mPa s")]:
        listed = UNITS[text]
        with monkeypatch.context() as without:
            without.setattr(
                units, "UNITS", {name: one for name, one in UNITS.items() if name != text}
            )  # order is shown
            unit.cache_clear()
            found = unit(text)
        assert found is not None, text
        assert found == (pytest.approx(listed[0], rel=1e-14), listed[1]), text
    unit.cache_clear()
