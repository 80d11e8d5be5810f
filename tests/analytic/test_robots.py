"""Scenes from robots' files next to MuJoCo, which compiles the same files; the files are written here."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import flexclear as fc

mujoco = pytest.importorskip("mujoco", reason="pip install 'flexclear[robots]'")

from benchmarks.families import robots  # noqa: E402
from flexclear.scene.plausibility import implausible_values  # noqa: E402
from flexclear.stages.new_scene import write_from  # noqa: E402

#: every kind of joint, several at a body, references, fixed bodies, one without mass, springs, armature
TREE = """<mujoco model="tree">
  <compiler angle="radian" autolimits="true"/>
  <option gravity="0.3 0 -9.81"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="base" pos="0.1 0.2 1">
      <freejoint name="root"/>
      <geom type="box" size=".1 .2 .05" euler="0.1 0.2 0.3"/>
      <site name="handle" pos="0 0 0.05"/>
      <body name="hat" pos="0 0 .1"><geom type="sphere" size=".03"/>
        <body name="tip"><site name="point"/></body></body>
      <body name="thigh" pos=".1 0 -.1" quat="0.9 0.1 0.3 0.2">
        <joint name="hip x" axis="1 0 0" armature=".02" damping=".3" range="-1 1.5"/>
        <joint name="hip y" axis="0 1 0.2" ref="0.3" stiffness="2" springref="0.5" frictionloss=".1"/>
        <joint name="hip z" axis="0 0 1" pos="0 .02 0"/>
        <geom type="capsule" fromto="0 0 0 .02 0 -.4" size=".03"/>
        <body name="shin" pos="0 0 -.4">
          <joint name="slide" type="slide" axis="0 .1 1" ref="0.02" armature=".5" stiffness="80"/>
          <geom type="ellipsoid" size=".03 .04 .2" pos="0 0 -.2"/>
          <body name="foot" pos="0 0 -.3">
            <joint name="ankle" type="ball" stiffness="1.5"/>
            <inertial pos=".05 0 0" mass=".3" fullinertia=".002 .003 .0035 .0001 .0002 .0003"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""

#: a four-bar with a gear and a held coordinate, and actuators of each kind with a counterpart
ACTED = """<mujoco model="acted">
  <compiler angle="radian"/>
  <option><flag contact="disable"/></option>
  <worldbody>
    <body name="a_body"><joint name="a" axis="0 1 0" damping=".02"/>
      <geom type="capsule" fromto="0 0 0 0 0 1" size=".02"/>
      <body name="b_body" pos="0 0 1"><joint name="b" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size=".02"/>
      </body></body>
    <body name="c_body" pos="1 0 0"><joint name="c" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 1" size=".02"/></body>
    <body name="wheel_body" pos="3 0 0"><joint name="wheel" axis="0 1 0"/>
      <geom type="cylinder" size=".2 .02"/></body>
    <body name="pinion_body" pos="3 0 1"><joint name="pinion" axis="0 1 0"/>
      <geom type="cylinder" size=".1 .02"/></body>
    <body name="rail_body" pos="5 0 0"><joint name="rail" type="slide" axis="1 0 0"/><geom size=".1"/></body>
    <body name="drone" pos="7 0 1" gravcomp="0.25"><freejoint/><geom type="box" size=".2 .1 .05"/>
      <site name="rotor" pos=".2 0 .1" euler="0.2 0.1 0"/></body>
    <body name="door_body" pos="9 0 0"><joint name="door" axis="0 0 1"/><geom size=".1" pos=".3 0 0"/></body>
  </worldbody>
  <equality>
    <connect name="pin" body1="b_body" body2="c_body" anchor="1 0 0"/>
    <joint name="mesh" joint1="pinion" joint2="wheel" polycoef="0 -2 0 0 0"/>
    <joint name="stuck" joint1="door" polycoef="0 0 0 0 0"/>
    <joint name="odd" joint1="rail" joint2="wheel" polycoef="0 1 2 0 0" active="false"/>
  </equality>
  <actuator>
    <motor name="push" joint="wheel" gear="3" ctrlrange="-1 1" ctrllimited="true"/>
    <position name="hold" joint="a" kp="20" kv="3" gear="2" forcerange="-9 9"/>
    <velocity name="turn" joint="pinion" kv="0.5"/>
    <general name="odd" joint="rail" gainprm="4" biastype="affine" biasprm="1 -6 -2"/>
    <motor name="lift" site="rotor" gear="0 0 5 0 0 1"/>
    <muscle name="muscle" joint="rail" lengthrange="0 1"/>
    <general name="late" joint="rail" dyntype="filter" dynprm="0.1" gainprm="2"/>
  </actuator>
  <keyframe><key name="home" ctrl="0.5 0.6 2 0.7 1 0 1.5"/></keyframe>
</mujoco>"""

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial><origin xyz="0 0 .2" rpy="0 .1 0"/><mass value="2"/>
      <inertia ixx=".03" iyy=".025" izz=".02" ixy=".001" ixz="0" iyz=".002"/></inertial>
    <visual><geometry><mesh filename="package://arm/surfaces/{mesh}"/></geometry></visual>
    <collision><geometry><cylinder radius=".05" length=".4"/></geometry></collision>
  </link>
  <link name="tool">
    <inertial><mass value=".1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="slider">
    <inertial><mass value=".5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 .1" rpy=".2 0 .3"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="2"/>
    <dynamics damping=".4" friction=".2"/></joint>
  <joint name="flange" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="0 0 .4"/></joint>
  <joint name="rail" type="prismatic"><parent link="upper"/><child link="slider"/><axis xyz="1 0 0"/>
    <limit lower="-.1" upper=".1" effort="1" velocity="0"/><mimic joint="shoulder" multiplier=".05" offset="0"/></joint>
  <transmission name="t"/>
</robot>"""


def _file(tmp_path: Path, text: str | bytes, name: str = "robot.xml") -> Path:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _scene(tmp_path: Path, text: str, name: str = "robot.xml") -> tuple[fc.Scene, str]:
    path = fc.new(_file(tmp_path, text, name), tmp_path / "scene")
    return fc.load_scene(path), path.read_text()


@pytest.mark.parametrize("text", [TREE, ACTED], ids=["tree", "acted"])
def test_mass_matrix_gravity_and_bias_are_those_of_mujoco(text: str, tmp_path: Path):
    """In ten random poses; what is left is rounding."""
    robot, written = robots.pair(_file(tmp_path, text))
    apart = robots.equations(robot, written, 10)
    assert max(apart.values()) < 1e-12, apart


def test_free_motion_is_the_limit_of_mujocos_for_small_steps(tmp_path: Path):
    """Its errors fall with the fourth power of the step of its Runge-Kutta method."""
    robot, written = robots.pair(_file(tmp_path, TREE))
    apart = robots.free_motion(robot, written, (4e-3, 2e-3, 1e-3))
    assert apart[-1] < 1e-8
    assert 3.5 < np.log2(apart[0] / apart[1]) < 4.5
    assert 3.5 < np.log2(apart[1] / apart[2]) < 4.5


def _accelerations(tmp_path: Path, text: str, name: str, joints: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the accelerations of joints at the start of the run, and those of MuJoCo without limits."""
    scene, _ = _scene(tmp_path, text, name)
    run = fc.run(fc.edited(scene, {"time.end": "1 ms", "output.interval": "1 ms"}))
    ours = [fc.quantity(run, f"{joint}.acceleration").values[0] for joint in joints]
    from flexclear.stages.robots.files import read

    model = read(_file(tmp_path, text, name)).model
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return np.array(ours), np.array([data.qacc[model.joint(joint).dofadr[0]] for joint in joints])


def test_actuators_push_as_in_mujoco(tmp_path: Path):
    """Joints outside of loops, whose constraints MuJoCo softens; its filter starts from 0, so that one is left out."""
    text = ACTED.replace('<general name="late" joint="rail" dyntype="filter" dynprm="0.1" gainprm="2"/>', "")
    text = text.replace(" 0 1.5", " 0").replace('<muscle name="muscle" joint="rail" lengthrange="0 1"/>', "")
    text = text.replace('ctrl="0.5 0.6 2 0.7 1 0"', 'ctrl="0.5 0.6 2 0.7 1"')
    without = text[: text.index("<equality>")] + text[text.index("</equality>") + len("</equality>") :]
    ours, theirs = _accelerations(tmp_path, without, "open.xml", ["a", "b", "wheel", "pinion", "rail"])
    assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9)


def test_actuators_have_their_gains_and_the_rest_is_listed(tmp_path: Path):
    scene, text = _scene(tmp_path, ACTED)
    hold, odd, turn = (scene.load[name] for name in ("hold", "odd", "turn"))
    # force = gear (kp (u - gear q) - kv gear q'), kp = 20, kv = 3, gear = 2, u = 0.6
    assert (hold.proportional, hold.derivative, hold.reference.value) == (80.0, 12.0, 0.3)
    assert hold.limits == (-18.0, 18.0)
    # force = 4 u + 1 - 6 q - 2 q', u = 0.7
    assert (odd.proportional, odd.derivative) == (6.0, 2.0)
    assert odd.reference.value == pytest.approx(3.8 / 6.0)
    assert turn.derivative == 0.5
    assert turn.reference.coefficients == (0.0, 2.0)
    assert scene.load["push"].force.value == 1.5
    assert [one.value for one in scene.load["lift"].force] == [0.0, 0.0, 5.0]
    assert [one.value for one in scene.load["lift_torque"].torque] == [0.0, 0.0, 1.0]
    assert scene.load["late"].force.value == 3.0
    assert scene.gear["mesh"].ratio == -2.0
    assert scene.drive["stuck"].joint == "door"
    assert scene.joint["pin"].type == "spherical"
    weight = scene.body["drone"].mass * 9.81
    assert scene.load["drone_gravity_compensation"].force[2].value == pytest.approx(0.25 * weight)
    head = text.partition("title")[0]
    for words in ("actuator muscle: its force is of type muscle", "equality constraint odd: not active", "0.1 s"):
        assert words in head


def test_joints_of_a_file_keep_their_coordinates_limits_and_springs(tmp_path: Path):
    scene, text = _scene(tmp_path, TREE)
    assert {name: joint.type for name, joint in scene.joint.items() if "rotor" not in name} == {
        "root": "free",
        "hat_weld": "fixed",
        "hip_x": "revolute",
        "hip_y": "revolute",
        "hip_z": "revolute",
        "slide": "prismatic",
        "ankle": "spherical",
    }
    assert (scene.stop["hip_x_ends"].lower, scene.stop["hip_x_ends"].upper) == (-1.0, 1.5)
    assert (scene.load["hip_y_spring"].stiffness, scene.load["hip_y_spring"].rest) == (2.0, 0.5)
    assert scene.load["hip_y_friction"].coulomb.dynamic == 0.1
    assert scene.load["hip_x_friction"].viscous == 0.3
    assert scene.start.joint["hip_y"][""].position == 0.3
    assert scene.gear["slide_rotor_gear"].ratio == "1.0 rad/m"
    assert "handle" in scene.body["base"].frames
    assert "point" in scene.body["hat"].frames  # a body without mass belongs to the one that carries it
    assert [shape.type for shape in scene.body["thigh"].geometry] == ["cylinder", "sphere", "sphere"]
    assert "not drawn: 1 plane" in text
    assert "contacts between geoms, of which 5 may touch" in text
    run = fc.run(fc.edited(scene, {"time.end": "1 ms", "output.interval": "1 ms"}))
    model = mujoco.MjModel.from_xml_string(TREE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for body in ("base", "thigh", "shin", "foot"):
        there = data.xipos[model.body(body).id]
        assert fc.quantity(run, f"{body}.position").values[0] == pytest.approx(there, abs=1e-12)


def test_rotors_are_plausible_and_not_drawn(tmp_path: Path):
    from flexclear.post.render.mechanism import Looks, shown_parts

    scene, _ = _scene(tmp_path, TREE)
    assert implausible_values(scene) == []
    table = scene.model_dump(exclude_none=True)
    unseen = {name: {"geometry": []} for name, body in table["body"].items() if body.get("geometry") == ()}
    shown = shown_parts(table, Looks(unseen))
    assert set(scene.body) - set(shown["body"]) == {"hip_x_rotor", "slide_rotor"}
    assert set(scene.joint) - set(shown["joint"]) == {"hip_x_rotor_bearing", "slide_rotor_bearing"}
    assert shown["gear"] == {}
    assert shown["load"].keys() == scene.load.keys()
    assert shown_parts(table, Looks()) == table


def test_urdf_with_fixed_links_surfaces_and_a_mimicking_joint(tmp_path: Path):
    surface = tmp_path / "arm" / "surfaces" / "upper.obj"
    surface.parent.mkdir(parents=True)
    surface.write_text("v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .4\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    (tmp_path / "arm" / "urdf").mkdir()
    scene, text = _scene(tmp_path / "arm" / "urdf", ARM.replace("{mesh}", "upper.obj"), "arm.urdf")
    assert scene.body["upper"].mass == 2.0
    R = np.array([[np.cos(0.1), 0, np.sin(0.1)], [0, 1, 0], [-np.sin(0.1), 0, np.cos(0.1)]])
    J = R @ np.array([[0.03, 0.001, 0], [0.001, 0.025, 0.002], [0, 0.002, 0.02]]) @ R.T
    assert np.array(scene.body["upper"].inertia) == pytest.approx(J, abs=1e-12)
    assert (scene.joint["tool_weld"].type, scene.joint["rail"].type) == ("fixed", "prismatic")
    (gear,) = scene.gear.values()
    assert (gear.first, gear.second, gear.ratio) == ("shoulder", "rail", "0.05 m/rad")
    (shown,) = scene.body["upper"].geometry
    assert (tmp_path / "arm" / "urdf" / "scene" / shown.file).stat().st_size == 84 + 4 * 50
    assert "transmissions of actuators: 1" in text
    assert "limits of the joints' speeds" in text


@pytest.mark.parametrize("mesh, why", [("gone.stl", "there is no such file"), ("upper.dae", "are read")])
def test_surfaces_of_a_urdf_that_cannot_be_read_are_listed(mesh: str, why: str, tmp_path: Path):
    (tmp_path / "surfaces").mkdir()
    (tmp_path / "surfaces" / "upper.dae").write_text("<COLLADA/>")
    paths, lost = write_from(_file(tmp_path, ARM.replace("{mesh}", mesh), "arm.urdf"), tmp_path / "scene")
    assert [path.name for path in paths] == ["arm.toml"]
    assert any(mesh in item and why in item for item in lost)


def test_coupled_coordinates_start_where_their_coupling_holds(tmp_path: Path):
    """Polynomials count from the references of both joints; the file's start, or its zero, breaks them."""
    text = """<mujoco><compiler angle="radian"/><worldbody>
      <body name="a"><joint name="q" axis="0 0 1" ref="0.1"/><geom size=".1"/></body>
      <body name="b" pos="1 0 0"><joint name="r" axis="0 0 1" ref="0.7"/><geom size=".1"/></body>
      <body name="c" pos="2 0 0"><joint name="s" type="slide"/><geom size=".1"/></body>
      <body name="d" pos="3 0 0"><joint name="t"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
      <equality><joint joint1="s" joint2="r" polycoef="0.2 0.1 0 0 0"/>
        <joint joint1="r" joint2="q" polycoef="0.5 -2 0 0 0"/><joint joint1="t" polycoef="0.25 0 0 0 0"/></equality>
      <keyframe><key qpos="0.3 0 0 1" qvel="1 0 0 1"/></keyframe></mujoco>"""
    scene, written = _scene(tmp_path, text)
    b, starts = 0.7 + 0.5 - 2.0 * (0.3 - 0.1), {name: one[""] for name, one in scene.start.joint.items()}
    assert [starts[name].position for name in "qrs"] == pytest.approx([0.3, b, 0.2 + 0.1 * (b - 0.7)])
    assert [starts[name].velocity for name in "qrs"] == pytest.approx([1.0, -2.0, -0.2])
    assert scene.drive["loop_2"].law.value == starts["t"].position == 0.25
    assert "positions at the start follow from coupled joints: s, r" in written


def test_what_a_file_disables_does_not_act(tmp_path: Path):
    """Constraints, springs and dampers of tendons, one group of actuators; controls are not clipped."""
    text = """<mujoco><option actuatorgroupdisable="2">
      <flag constraint="disable" clampctrl="disable" spring="disable" damper="disable"/></option>
      <worldbody><site name="top" pos="0 .1 1"/>
      <body name="a"><joint name="j" axis="0 1 0" frictionloss=".3" range="-10 10" limited="true"/>
        <geom size=".1" pos=".5 0 0"/><site name="end" pos=".5 0 0"/>
        <body name="b" pos=".5 0 0"><joint name="k" axis="0 1 0"/><geom size=".1" pos=".5 0 0"/></body></body>
      </worldbody>
      <tendon><spatial stiffness="40" damping="2" springlength=".3">
        <site site="top"/><site site="end"/></spatial></tendon>
      <equality><joint joint1="j" joint2="k"/></equality>
      <actuator><motor name="on" joint="j" ctrlrange="-1 1" ctrllimited="true"/><motor name="off" joint="k" group="2"/>
      </actuator><keyframe><key ctrl="5 7" qpos="0.05 0.2" qvel="1 2"/></keyframe></mujoco>"""
    ours, theirs = _accelerations(tmp_path, text, "robot.xml", ["j", "k"])
    assert ours == pytest.approx(theirs, rel=1e-9)
    head = (tmp_path / "scene" / "robot.toml").read_text().partition("title")[0]
    assert "actuator off: the file disables its group 2" in head
    assert "contacts" not in head


def test_limits_and_laws_of_actuators_and_tendons_that_differ_are_listed(tmp_path: Path):
    text = """<mujoco><worldbody><site name="top" pos="0 .1 1"/>
      <body name="a" gravcomp="1"><joint name="j" axis="0 1 0" actuatorfrcrange="-2 2" actuatorgravcomp="true"/>
        <geom size=".1" pos=".5 0 0"/><site name="end" pos=".5 0 0"/></body></worldbody>
      <tendon><spatial name="line" stiffness="10 5"><site site="top"/><site site="end"/></spatial></tendon>
      <actuator><motor name="one" joint="j"/>
        <position name="half" joint="j" kp="50" forcelimited="true" forcerange="-1 inf"/>
        <general name="grows" joint="j" dyntype="integrator" actlimited="true" actrange="-1 1"/>
        <general name="late" site="end" gear="0 0 2 0 0 0" dyntype="filter" dynprm="0.1"/></actuator>
      <keyframe><key ctrl="0 0 0.5 3" act="0 0"/></keyframe></mujoco>"""
    scene, written = _scene(tmp_path, text)
    assert scene.load["half"].limits == (-1.0, 2.0)
    assert [one.value for one in scene.load["late"].force] == [0.0, 0.0, 6.0]
    head = " ".join(written.partition("title")[0].replace("\n#", "").split())
    for words in (
        "gravity compensation of joint j is not limited with its actuators",
        "limits of the sum of all actuators of joint j hold for each alone",
        "limits of the activation of actuator grows: -1 to 1",
        "limits of the force of actuator grows, which grows with time",
        "stiffness and damping of tendon line beyond the linear term",
        "actuator late acts at once, without its filter of 0.1 s",
    ):
        assert head.count(words) == 1, words


BODY = '<mujoco><worldbody><body name="a"><joint name="j"/><geom size=".1"/></body></worldbody></mujoco>'
MESH = BODY.replace("<worldbody>", '<asset><mesh name="m" file="gone.stl"/></asset><worldbody>')
REFUSED: dict[str, tuple[str | bytes, str, str]] = {
    "cut": (BODY[:50], "is not complete XML", "copy it again"),
    "not a number": (
        BODY.replace('".1"', '"nan"'),
        '<geom name=""> size="nan" is not a finite number',
        "write a number",
    ),
    "infinite": (BODY.replace('size=".1"', 'size=".1" mass="inf"'), 'mass="inf" is not a finite number', "write"),
    "entities": ('<!DOCTYPE m [<!ENTITY a "aa">]><mujoco model="&a;"/>', "declares entities", "without <!DOCTYPE"),
    "bytes": (
        ('<?xml version="1.0" encoding="latin-1"?>' + BODY.replace('"a"', '"\xfc"')).encode("latin-1"),
        "is not complete XML: 'utf-8' codec can't decode",
        "copy it again",
    ),
    "other file": ("<svg/>", "its outermost element is <svg>", "the robot's own file"),
    "no body": ("<mujoco/>", "holds no body that moves", "own file"),
    "copies": (
        BODY.replace('<body name="a">', '<replicate count="1900"><replicate count="1900"><body>').replace(
            "</body>", "</body></replicate></replicate>"
        ),
        "<replicate> asks for 3.61e+06 entries",
        "use fewer",
    ),
    "values": (
        BODY.replace("<worldbody>", '<size nuser_body="2000000000"/><worldbody>'),
        "<size> asks for 2e+09",
        "fewer",
    ),
    "field": (
        BODY.replace(
            "<worldbody>", '<asset><hfield name="h" nrow="9e5" ncol="9e5" size="1 1 1 1"/></asset><worldbody>'
        ),
        "<hfield> asks for 8.1e+11",
        "fewer",
    ),
    "mesh": (MESH.replace('<geom size=".1"/>', '<geom type="mesh" mesh="m"/>'), "gone.stl", "correct the file"),
    "include": ('<mujoco><include file="gone.xml"/></mujoco>', '<include file="gone.xml">', "put it there"),
    "plugin": (
        BODY.replace("<worldbody>", '<extension><plugin plugin="x.y"/></extension><worldbody>'),
        "x.y",
        "correct",
    ),
    "schema": (BODY.replace('name="j"', 'nmae="j"'), "nmae", "correct the file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_files_that_are_no_robots_are_refused_with_the_record_and_a_remedy(name: str, tmp_path: Path):
    text, problem, remedy = REFUSED[name]
    path = _file(tmp_path, text)
    with pytest.raises(fc.InputError) as error:
        fc.new(path, tmp_path / "scene")
    said = str(error.value)
    assert said.startswith(str(path))
    assert problem in said.partition("\n")[0]
    assert remedy in said.partition("\n")[2]
    assert not (tmp_path / "scene").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes")
def test_a_pipe_in_the_place_of_a_mesh_is_not_read(tmp_path: Path):
    os.mkfifo(tmp_path / "gone.stl")
    with pytest.raises(fc.InputError, match="not an ordinary file"):
        fc.new(_file(tmp_path, MESH), tmp_path / "scene")


def test_a_mass_that_would_follow_from_a_missing_surface_is_refused(tmp_path: Path):
    text = ARM.replace("{mesh}", "gone.stl")
    start = text.index('<link name="tool">')
    part = text[start : text.index("</link>", start)]
    mesh = '<link name="tool"><collision><geometry><mesh filename="gone.stl"/></geometry></collision>'
    with pytest.raises(fc.InputError, match=r'the mass of <link name="tool"> follows from "gone\.stl"'):
        fc.new(_file(tmp_path, text.replace(part, mesh), "arm.urdf"), tmp_path / "scene")


def test_without_mujoco_it_is_asked_for_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(fc.InputError, match=r"pip install 'flexclear\[robots\]'"):
        fc.new(_file(tmp_path, BODY), tmp_path / "scene")


def test_names_that_a_scene_cannot_have_are_changed_and_stay_apart(tmp_path: Path):
    text = BODY.replace('name="a"', 'name="left/arm 1"').replace('name="j"', 'name="left arm/1"')
    scene, _ = _scene(tmp_path, text)
    assert list(scene.body) == ["ground", "left_arm_1"]
    assert list(scene.joint) == ["left_arm_1_joint"]


def test_a_start_beyond_a_limit_rests_on_the_stop(tmp_path: Path):
    text = BODY.replace('<joint name="j"/>', '<joint name="j" range="10 20"/>')
    scene, _ = _scene(tmp_path, text)
    assert scene.stop["j_ends"].initial_approach_speed == 0
    assert fc.run(fc.edited(scene, {"time.end": "1 ms"}))["time"].size > 1


def test_a_keyframe_is_the_start_with_its_speeds(tmp_path: Path):
    text = """<mujoco><worldbody><body name="a" pos="0 0 1"><freejoint/><geom size=".1" pos=".1 0 0"/>
      <body name="b"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body></body></worldbody>
      <keyframe><key name="up" qpos="1 2 3 0.6 0.8 0 0 0.4" qvel="0.1 0.2 0.3 1 2 3 0.5"/></keyframe></mujoco>"""
    scene, _ = _scene(tmp_path, text)
    run = fc.run(fc.edited(scene, {"time.end": "1 ms", "output.interval": "1 ms"}))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for b, name in ((1, "a"), (2, "b")):
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, b, twist, 0)
        assert fc.quantity(run, f"{name}.position").values[0] == pytest.approx(data.xipos[b], abs=1e-9)
        assert fc.quantity(run, f"{name}.velocity").values[0] == pytest.approx(twist[3:], abs=1e-9)
        assert fc.quantity(run, f"{name}.angular_velocity").values[0] == pytest.approx(twist[:3], abs=1e-9)
    assert fc.quantity(run, "j.velocity").values[0] == pytest.approx(0.5)
