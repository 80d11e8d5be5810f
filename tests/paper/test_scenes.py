"""The scene files load, fit together at the start, and hold the paper's data and the declared assumptions."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flexclear.dynamics.model.merge import Placement, frames_of, merge, start_places
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import bundles
from tests.reference import sps4

TREE = Path(__file__).resolve().parents[2]
SCENES = TREE / "scenes"
FILES = sorted(p.relative_to(SCENES).as_posix() for p in SCENES.glob("**/*.toml") if "sweeps" not in p.parts)
MECHANISMS = [f for f in FILES if f.startswith("sps4/") and "frequencies" not in f]
#: positions are typed to 17 digits; some ten products and sums of lengths below 1 m round to this, each by 1e-16
ROUNDING = 3e-15


def scene(name: str) -> Scene:
    """A scene by its path below scenes/."""
    return load_scene(SCENES / name)


@cache
def start(name: str) -> dict[str, Placement]:
    """Every named frame of a scene in the world at the start; bodies without a pose hang on fixed joints."""
    s = scene(name)
    frames = frames_of(s, bundles(s))
    groups, group_of = merge(s, frames)
    poses = start_places(s, groups, group_of, frames)
    found = {}
    for frame, here in frames.items():
        group = group_of[here.body]
        found[frame] = poses[group].of(groups[group].placements[here.body]).of(here.placement)
    return found


def parts(s: Scene) -> dict[str, object]:
    """Every body, joint, drive and load as plain data without its texts on sources."""
    table = s.model_dump(include={"body", "joint", "drive", "load"})
    return {f"{family}.{n}": _bare(p) for family, group in table.items() for n, p in group.items()}


def _bare(part: object) -> object:
    return {k: _bare(v) for k, v in part.items() if k != "source"} if isinstance(part, dict) else part


def layout_of(name: str) -> sps4.Layout:
    """The layout of a scene of the paper's mechanism, by the scene's name."""
    return sps4.FIRST if "first" in name else sps4.LAYOUT


def differing(a: str, b: str) -> set[str]:
    """Names of the parts that two scenes do not share."""
    one, two = parts(scene(a)), parts(scene(b))
    return {n for n in one.keys() | two.keys() if one.get(n) != two.get(n)}


@pytest.mark.parametrize("name", FILES)
def test_every_scene_loads_under_its_own_name(name: str) -> None:
    assert scene(name).name == name.removesuffix(".toml")


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_part_with_numbers_says_where_they_are_from(name: str) -> None:
    s = scene(name)
    reported = {place.split(".")[0] + "." + place.split(".")[1] for place in s.sources() if "." in place}
    numbers = {f"body.{n}" for n in s.body} | {f"drive.{n}" for n in s.drive} | {f"load.{n}" for n in s.load}
    numbers |= {f"joint.{n}" for n in s.contacts()}
    assert numbers <= reported


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_frames_of_every_joint_meet_at_the_start(name: str) -> None:
    for joint in scene(name).joint.values():
        a, b = (start(name)[frame] for frame in joint.between)
        assert np.abs(a.p - b.p).max() <= ROUNDING
        if joint.type in ("fixed", "prismatic"):
            assert np.abs(a.R - b.R).max() <= ROUNDING


@pytest.mark.parametrize("name", MECHANISMS)
def test_joint_centres_are_the_assumed_ones(name: str) -> None:
    frames, layout = start(name), layout_of(name)
    up = np.array([0.0, 0.0, layout.height])
    for k in range(4):
        assert frames[f"socket_A{k + 1}.centre"].p == pytest.approx(layout.A[k] + up, abs=ROUNDING)
        assert frames[f"ball_B{k + 1}.centre"].p == pytest.approx(layout.B[k], abs=ROUNDING)
    assert frames["ball_C.centre"].p == pytest.approx(up, abs=ROUNDING)


def test_masses_and_inertias_are_those_of_table_1() -> None:
    s = scene("sps4/ideal.toml")
    known = {
        "rod": sps4.ROD,
        "cylinder": sps4.CYLINDER,
        "ball": sps4.BALL,
        "socket": sps4.SOCKET,
        "platform": sps4.PLATE,
    }
    known["central"] = sps4.CENTRAL_ROD
    for name, body in s.rigid().items():
        expected = next(data for start_of, data in known.items() if name.startswith(start_of))
        assert body.mass == expected.mass
        inertia = np.diag([expected.transverse, expected.transverse, expected.axial])
        assert np.array(body.inertia) == pytest.approx(inertia, rel=1e-14)


@pytest.mark.parametrize("name", ["sps4/ideal.toml", "sps4/variants/first.toml"])
def test_legs_add_up_to_the_lengths_of_the_parts(name: str) -> None:
    s, frames = scene(name), start(name)
    for k in range(1, 5):
        axis = frames[f"ball_A{k}.centre"].p - frames[f"ball_B{k}.centre"].p
        length = np.linalg.norm(axis)
        assert length == pytest.approx(layout_of(name).length, abs=ROUNDING)
        for frame, along in (
            (f"rod{k}.bottom", length - 0.28),
            (f"rod{k}.top", length - 0.04),
            (f"cylinder{k}.bottom", 0.04),
        ):
            away = frames[frame].p - frames[f"ball_B{k}.centre"].p
            assert away == pytest.approx(along * axis / length, abs=ROUNDING)
        assert s.body[f"ball_B{k}"].com[2] == -s.body[f"ball_A{k}"].com[2] == sps4.BALL_CENTRE


def test_clearance_joint_is_that_of_tables_3_and_6() -> None:
    joint, known = scene("sps4/csj.toml").contacts()["A1"], sps4.Contact()
    assert (joint.clearance, joint.ball_radius, joint.floor) == (known.clearance, known.ball_radius, known.floor)
    for material in (joint.socket_material, joint.ball_material):
        assert (material.youngs_modulus, material.poisson) == (known.youngs_modulus, known.poisson)
    assert joint.normal.restitution == known.restitution
    friction = joint.friction
    assert (friction.static, friction.dynamic) == (known.mu_static, known.mu_dynamic)
    assert (friction.v_static, friction.v_dynamic) == (known.v_static, known.v_dynamic)


def test_restitution_gravity_height_and_counts_are_declared_assumptions() -> None:
    said = scene("sps4/far_csj_cb.toml").assumptions()
    for place in ("joint.A1.normal.restitution", "body.platform.pose", "body.rod1.modes", "joint.P1", "drive.P3"):
        assert place in said
    assert "load.gravity" in scene("sps4/variants/gravity.toml").assumptions()


def test_an_effect_is_one_part_of_a_scene() -> None:
    assert differing("sps4/ideal.toml", "sps4/csj.toml") == {"joint.A1"}
    assert differing("sps4/ideal.toml", "sps4/far_cb.toml") == {"body.rod1"}
    assert differing("sps4/csj.toml", "sps4/far_csj_fixed.toml") == {"body.rod1"}
    assert differing("sps4/far_free.toml", "sps4/far_csj_free.toml") == {"joint.A1"}
    assert differing("sps4/ideal.toml", "sps4/variants/gravity.toml") == {"load.gravity"}


def test_the_scenes_of_the_first_layout_differ_from_the_others_in_places_alone() -> None:
    """Ground, platform, cylinders and rods stand elsewhere; masses, joints, drives and modes are the same."""
    moved = {"body.ground", "body.platform", "body.central_rod"}
    moved |= {f"body.{part}{k}" for part in ("cylinder", "rod") for k in range(1, 5)}
    assert differing("sps4/ideal.toml", "sps4/variants/first.toml") == moved
    for name in ("csj", "far_free", "far_fixed", "far_cb", "far_csj_free", "far_csj_fixed", "far_csj_cb"):
        first = f"sps4/variants/first_{name}.toml"
        assert differing(f"sps4/{name}.toml", first) == moved
        one, other = (scene(place).body["rod1"].model_dump() for place in (f"sps4/{name}.toml", first))
        assert {key for key in one if key != "source" and one[key] != other[key]} == {"pose"}


@pytest.mark.parametrize("millimetres", [60, 120])
def test_prismatic_variants_move_only_the_prismatic_joints(millimetres: int) -> None:
    moved = {f"{part}{k}" for part in ("joint.P", "body.cylinder") for k in range(1, 5)}
    assert differing("sps4/ideal.toml", f"sps4/variants/prismatic_{millimetres}mm.toml") == moved
    clearance = f"sps4/variants/prismatic_{millimetres}mm_csj.toml"
    assert differing(f"sps4/variants/prismatic_{millimetres}mm.toml", clearance) == {"joint.A1"}
    assert parts(scene(clearance))["joint.A1"] == parts(scene("sps4/csj.toml"))["joint.A1"]


def test_stacked_variant_raises_centres_of_mass_only() -> None:
    moved = {"body.platform"} | {f"body.socket_{n}" for n in ("A1", "A2", "A3", "A4", "C")}
    assert differing("sps4/ideal.toml", "sps4/variants/stacked.toml") == moved
    s = scene("sps4/variants/stacked.toml")
    # units are turned into SI by a product, and so are these: a unit of the last place, 3e-18, each
    assert s.body["platform"].com == pytest.approx((0.0, 0.0, 22.5e-3), abs=1e-16)
    assert s.body["socket_C"].com == pytest.approx((0.0, 0.0, 7.048e-3), abs=1e-16)
