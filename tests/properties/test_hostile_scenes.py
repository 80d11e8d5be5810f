"""Scene files of the worst kind: each refused in words, with place and remedy, and never by a traceback."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from flexclear.pipeline.core.numerics.rotations import rotation_vector_to_matrix
from flexclear.pipeline.core.scene import units
from flexclear.pipeline.core.scene.fields import Inertia, Position
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.units import UNITS, unit
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.model.assembly import assembled
from flexclear.pipeline.dynamics.model.mechanism import build

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
WELDED = """
[body.x]
type = "rigid"
mass = 1.0
inertia = [1.0, 1.0, 1.0]
frames.a = {}
frames.b = { position = [0.1, 0.0, 0.0] }
[joint.w1]
type = "fixed"
between = ["crank.P", "x.a"]
[joint.w2]
type = "fixed"
between = ["crank.A", "x.b"]
"""

#: scene -> words of the refusal
HOSTILE: dict[str, tuple[str, ...]] = {
    "": ("[title]", "is missing"),
    "body = [1, 2]": ("[body]", "expected a table", "[body.NAME]"),
    "body = 3": ("[body]", "expected a table"),
    BASE.replace("crank.A", "crankA"): ("[joint.A.between.1]", "body.FRAME"),
    BASE.replace("mass = 1.0", "mass = 1e300"): ("[body.crank.mass]", "beyond what can be computed with"),
    BASE.replace("[0.1, 0.1, 0.1]", "[[0.1], [0.1, 1], 0.1]"): ("[body.crank.inertia]", "3x3 matrix"),
    BASE
    + "view.watch = ['A.position']\n[body.rod]\ntype = 'flexible'\nmesh = 'rod.toml'\n"
    + "modes = { reference = 'free-free', count = 1000000000000 }": ("[body.rod.modes.count", "less than or equal to"),
    BASE + '[body."../up"]\ntype = "ground"': ("[body.../up]", "is no name"),
    BASE + "[joint.B]\nbetween = 5": ("[joint.B.type]",),
    BASE + "[load.f]\ntype = 'point-force'\nframe = 'crank.P'\nforce = 5": ("[load.f.force]", "expected a list"),
    BASE + '[solver]\nintegrator = "rk4"': ("[solver]", "rk4 has no error estimate", "give step"),
    BASE + '[solver]\nintegrator = "rk4"\nstep = "-1 us"': ("[solver.step]", "greater than 0"),
    BASE + '[solver]\nstep = "1 mm"': ("[solver.step]", "'1 mm' is a length"),
    BASE + '[solver]\nevents = "at step ends"': ("[solver]", "needs fixed steps", "give step"),
    BASE + '[solver]\nintegrator = "generalized-alpha"\nrho_inf = 1.5': ("[solver.rho_inf]", "less than or equal to 1"),
    BASE + "[solver]\nrho_inf = 0.5": ("[solver]", "rho_inf belongs to generalized-alpha"),
    BASE + "[solver]\nrtol = -1e-9": ("[solver.rtol]", "must be greater than"),
    BASE + "[solver]\nevaluations = 99999999999999999999999": ("[solver.evaluations]", "less than or equal to"),
    "x = " + "[" * 3000 + "]" * 3000: ("too deeply",),
    "[body.kürbel]": ("is not TOML", "quotation marks"),
    'extends = ["sound.toml"]': ("[extends]", "one file"),
    'extends = "."': ("cannot be read",),
    'extends = "sound.toml"\nreplace = [1]': ("[replace]", "expected a table"),
    'extends = "sound.toml"\n[set.body]\ncrank = 5': ("[set.body]", "[set.body.NAME]"),
    'extends = "sound.toml"\nremove = 5': ("[remove]", "list of paths"),
    'extends = "sound.toml"\nbody = 5': ("[body]", "expected a table"),
    'extends = "sound.toml"\n[set.body.crank]\nmas = 1': ("[body.crank.mas]", "did you mean 'mass'?"),
}


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: text.replace("\n", " ")[-40:])
def test_a_hostile_file_is_refused_in_words(text: str, tmp_path: Path) -> None:
    (tmp_path / "sound.toml").write_text(BASE)
    path = tmp_path / "hostile.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_scene(path)
    assert error.value.exit_code == 2
    for word in HOSTILE[text]:
        assert word in str(error.value)


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    for content in (bytes(range(256)), BASE.encode("utf-16")):
        path.write_bytes(content)
        with pytest.raises(InputError, match="is not text in UTF-8"):
            load_scene(path)


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + BASE.replace("\n", "\r\n").encode())
    assert load_scene(path).title == "sound"


def test_fixed_joints_that_do_not_fit_together_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(BASE + WELDED)
    with pytest.raises(InputError) as error:
        build(load_scene(path), {})
    assert "[joint.w2.between]" in str(error.value)
    assert "0.4 m and 0 deg apart" in str(error.value)


def test_drives_out_of_reach_are_distinguished_from_joints_that_do_not_fit(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        BASE
        + """
[body.block]
type = "rigid"
mass = 1.0
inertia = [1.0, 1.0, 1.0]
pose = { position = [0.3, 0.0, 0.0], axes = { z = [1, 0, 0], x = [0, 1, 0] } }
frames.pin = { axes = { z = [0, 1, 0], x = [0, 0, 1] } }
frames.slide = {}
[body.rail]
type = "ground"
frames.slide = { axes = { z = [1, 0, 0], x = [0, 1, 0] } }
[joint.P]
type = "spherical"
between = ["crank.P", "block.pin"]
[joint.rail]
type = "prismatic"
between = ["rail.slide", "block.slide"]
[drive.far]
joint = "rail"
law = "0.305 m"
"""
    )
    with pytest.raises(InputError) as error:
        assembled(build(load_scene(path), {}))
    assert "[drive.far.law]" in str(error.value)
    assert "out of reach" in str(error.value)


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
    with pytest.raises(ValidationError, match="belong to no body"):
        read([-1e-9 * max(moments), *moments[1:]])


def test_a_vectors_size_counts_and_not_its_components() -> None:
    """What turning leaves of a zero is no mistake; a vector that is too small as a whole is one."""
    assert TypeAdapter(Position).validate_python(["0.3 m", 1.8e-17 * 1.8e-17 * 1.8e-17, 0.0]) == (0.3, 5.832e-51, 0.0)
    for vector in ([1e-60, 0.0, 1e-70], [0.0, 1e60, 1.0]):
        with pytest.raises(ValidationError, match="beyond what can be computed with"):
            TypeAdapter(Position).validate_python(vector)


def test_listed_units_are_the_products_that_they_look_like(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in [text for text in UNITS if not text.isalpha() and text != "%"]:
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


def test_coefficients_have_units_over_powers_of_seconds(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    drive = '[drive.d]\njoint = "A"\nlaw = { type = "polynomial", coefficients = ["30 deg", "X"] }\n'
    path.write_text(BASE + drive.replace("X", "60 rpm"))
    assembled(build(load_scene(path), {}))
    path.write_text(BASE + drive.replace("X", "10 deg"))
    with pytest.raises(InputError, match="coefficient of t\\^1 of an angle"):
        assembled(build(load_scene(path), {}))


def test_one_step_and_one_value_need_no_list(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    step = '{ type = "step", start = 0, end = "1 s", change = "30 deg" }'
    path.write_text(BASE + f'[drive.d]\njoint = "A"\nlaw = {{ type = "sum", laws = ["10 deg", {step}] }}\n')
    listed = step.replace("start = 0", "start = [0]").replace('"1 s"', '["1 s"]').replace('"30 deg"', '["30 deg"]')
    other = tmp_path / "other.toml"
    ten = '{ type = "constant", value = "10 deg" }'
    other.write_text(BASE + f'[drive.d]\njoint = "A"\nlaw = {{ type = "sum", laws = [{ten}, {listed}] }}\n')
    assert load_scene(path).drive == load_scene(other).drive
