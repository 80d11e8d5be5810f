"""Solids from STEP files that Gmsh writes, against closed forms of blocks, holes and shafts."""

import importlib.util
import re
import signal
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.commands.__main__ import main
from flexclear.scene.load import load_scene
from flexclear.stages.cad_scene import _fits_hole
from flexclear.structure.fe.solid import geometry, step
from flexclear.structure.fe.solid.recipe import StepFile
from flexclear.structure.fe.solid.step import Round
from flexclear.structure.kinds import kind
from flexclear.structure.modes.bundle import rigid_of
from flexclear.system.errors import InputError, ResourceError


def has_gmsh() -> bool:
    """Without some libraries of the system its package cannot be loaded."""
    if importlib.util.find_spec("gmsh") is None:
        return False
    try:
        import gmsh  # noqa: F401
    except OSError:
        return False
    return True


needs_gmsh = pytest.mark.skipif(not has_gmsh(), reason="Gmsh: pip install -e '.[cad]', apt-get install libglu1-mesa")
Draw = Callable[[Any], None]


def write(path: Path, draw: Draw) -> Path:
    """Write a STEP file, in mm, of what `draw` makes with the kernel.

    The kernel keeps the unit of the last file that it read, until it reads another: hence the second time.
    """
    import gmsh

    gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    if hasattr(signal, "SIGPIPE"):  # Gmsh lets a closed pipe end its process; Python makes an error of it
        signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        for _ in range(2):
            draw(gmsh.model.occ)
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
            gmsh.clear()
            gmsh.model.occ.importShapes(str(path))
            gmsh.clear()
    finally:
        gmsh.finalize()
    return path


def drilled(occ: Any, solid: int, *holes: tuple[float, float, float]) -> int:
    """Cut holes along z, x, y and radius of each, through a solid."""
    tools = [(3, occ.addCylinder(x, y, -50.0, 0.0, 0.0, 200.0, radius)) for x, y, radius in holes]
    return int(occ.cut([(3, solid)], tools)[0][0][1])


def block(occ: Any) -> None:
    drilled(occ, occ.addBox(0.0, 0.0, 0.0, 100.0, 40.0, 20.0), (20.0, 20.0, 8.0))


def con_rod(occ: Any) -> None:
    """Two eyes of 40 and 24 mm with a shank, and bores of 20 and 12 mm, 120 mm apart."""
    ends = [(3, occ.addCylinder(x, 0.0, 0.0, 0.0, 0.0, 20.0, r)) for x, r in ((0.0, 20.0), (120.0, 12.0))]
    rod = occ.fuse(ends, [(3, occ.addBox(0.0, -8.0, 4.0, 120.0, 16.0, 12.0))])[0][0][1]
    drilled(occ, rod, (0.0, 0.0, 10.0), (120.0, 0.0, 6.0))


def hinge(radius: float) -> Draw:
    """A plate with a hole of 12.2 mm, and a plate with a pin in it."""

    def draw(occ: Any) -> None:
        drilled(occ, occ.addBox(-40.0, -15.0, 0.0, 60.0, 30.0, 10.0), (0.0, 0.0, 6.1))
        pin = occ.addCylinder(0.0, 0.0, 0.0, 0.0, 0.0, 20.0, radius)
        occ.fuse([(3, pin)], [(3, occ.addBox(-15.0, -15.0, 10.0, 80.0, 30.0, 10.0))])

    return draw


@needs_gmsh
def test_a_block_with_a_hole_has_its_volume_inertia_and_hole(tmp_path: Path) -> None:
    (found,) = step.solids(write(tmp_path / "block.step", block), "part")
    side, area = np.array([0.1, 0.04, 0.02]), np.pi * 0.008**2
    whole, gone = side.prod(), area * 0.02
    centre = (whole * side / 2.0 - gone * np.array([0.02, 0.02, 0.01])) / (whole - gone)
    np.testing.assert_allclose(found.volume, whole - gone, rtol=1e-9)
    np.testing.assert_allclose(found.centre, centre, rtol=0.0, atol=1e-9)
    # about z: the box less the hole, both moved to the common centre
    box = whole * ((side[0] ** 2 + side[1] ** 2) / 12.0 + np.sum((side / 2.0 - centre)[:2] ** 2))
    hole = gone * (0.008**2 / 2.0 + np.sum((np.array([0.02, 0.02]) - centre[:2]) ** 2))
    np.testing.assert_allclose(found.inertia[2, 2], box - hole, rtol=1e-9)
    (bore,) = found.rounds
    assert bore.hole
    np.testing.assert_allclose([bore.radius, bore.length], [0.008, 0.02], rtol=1e-9)
    np.testing.assert_allclose([bore.centre, bore.axis], [[0.02, 0.02, 0.01], [0.0, 0.0, 1.0]], rtol=0.0, atol=1e-9)


@needs_gmsh
def test_its_mesh_has_the_same_mass_the_wanted_size_and_equal_bytes(tmp_path: Path) -> None:
    """Quadratic sides bow to the circle: the area of a segment of 30 degrees is off by 1e-4 of the hole's."""
    write(tmp_path / "block.step", block)
    tie = {"tie": "rigid", "on": {"cylinder": {"point": [0.02, 0.02, 0.0], "axis": [0, 0, 1], "radius": 0.008}}}
    recipe = {
        "interfaces": ["bore"],
        "shape": {"type": "step", "file": "block.step", "size": "8 mm"},
        "material": {"youngs_modulus": 2.1e11, "poisson": 0.3, "density": 7850.0},
        "frames": {"bore": tie | {"position": [0.02, 0.02, 0.01]}},
    }
    mesh = kind.build(recipe, tmp_path)
    rigid = rigid_of(kind.of_mesh(mesh).assemble(mesh), "block")
    np.testing.assert_allclose(rigid["mass"], 7850.0 * (8e-5 - np.pi * 0.008**2 * 0.02), rtol=1e-5)
    tied = mesh["node_position"].values[mesh["tie_node"].values]
    np.testing.assert_allclose(np.hypot(*(tied - [0.02, 0.02, 0.0])[:, :2].T), 0.008, rtol=1e-6)
    assert len(tied) >= 2 * 12 * 2  # twelve elements around, with middle nodes, on both rims
    corners = mesh["node_position"].values[mesh["cell_node"].values[:, :4]]
    edges = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1)
    assert 0.5 * 0.008 < np.median(edges.max(axis=(1, 2))) < 2.0 * 0.008
    again = kind.build(recipe, tmp_path)
    assert mesh.identical(again)
    straight = step.mesh_step_file(
        StepFile(type="step", file="block.step", size=0.01, element="tet4"), tmp_path, "part"
    )
    geometry.check(straight, "part")


@needs_gmsh
def test_a_rod_becomes_a_scene_with_an_interface_for_each_bore(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "rod.step", con_rod)
    assert main(["new", "--from", "rod.step", "my"]) == 0
    assert "wrote my" in capsys.readouterr().out
    scene, recipe = load_scene(Path("my/rod.toml")), tomllib.loads(Path("my/part1_mesh.toml").read_text())
    frames = scene.body["part1"].frames
    assert list(frames) == recipe["interfaces"] == ["hole1", "hole2"]
    apart = np.subtract(frames["hole2"].position, frames["hole1"].position)
    np.testing.assert_allclose(apart, [0.12, 0.0, 0.0], rtol=0.0, atol=1e-9)
    assert [recipe["frames"][name]["on"]["cylinder"]["radius"] for name in frames] == [0.01, 0.006]
    assert scene.joint["pivot" if "pivot" in scene.joint else "base"].type == "revolute"
    assert main(["check", "my/rod.toml", "my/part1_mesh.toml"]) == 0
    assert "mass 0.336" in capsys.readouterr().out  # of 42.82 cm^3 of steel
    assert main(["new", "--from", "rod.step", "my"]) == 2
    assert "already exists" in capsys.readouterr().err


@needs_gmsh
@pytest.mark.parametrize("radius, kind_of_joint", [(6.0, "clearance-revolute"), (6.1, "revolute"), (2.0, "")])
def test_a_pin_in_a_hole_is_a_joint_with_half_the_difference_of_their_diameters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, radius: float, kind_of_joint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "hinge.step", hinge(radius))
    assert main(["new", "--from", "hinge.step", "."]) == 0
    scene = load_scene(Path("hinge.toml"))
    joints = {name: joint for name, joint in scene.joint.items() if name != "base"}
    assert [joint.type for joint in joints.values() if name_of_pin(joint)] == [kind_of_joint] * bool(kind_of_joint)
    if kind_of_joint == "clearance-revolute":
        assert joints["pin1"].between == ("part1.hole1", "part2.shaft1")
        np.testing.assert_allclose(joints["pin1"].clearance, 1e-4, rtol=1e-6)
        np.testing.assert_allclose([joints["pin1"].pin_radius, joints["pin1"].length], [6e-3, 0.01], rtol=1e-6)
    assert main(["check", "hinge.toml"]) == 0


def name_of_pin(joint: Any) -> bool:
    return {end.partition(".")[0] for end in joint.between} == {"part1", "part2"}


@needs_gmsh
@pytest.mark.parametrize(
    "content, words",
    [
        (b"", "does not begin as a STEP file"),
        (b"solid ascii stl", "does not begin as a STEP file"),
        (
            b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(1., 1e999,",
            "line 5 of 'part.step': 1e999 is no",
        ),
        (b"ISO-10303-21;\n" + b"\x00\xff" * 5000, "cannot read|has no solid"),
        (b"half", "cannot read|has no solid"),
        (b"nan", "line [0-9]+ of 'part.step': NAN is no number"),
    ],
    ids=["empty", "stl", "cut", "binary", "half", "nan"],
)
def test_a_damaged_step_file_is_refused_in_one_sentence(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "part.step"
    if content in (b"half", b"nan"):  # Gmsh 4.15 does not end with such coordinates
        whole = write(path, block).read_bytes()
        content = whole[: len(whole) // 2] if content == b"half" else re.sub(rb"\('',\(100?\.,", b"('',(NAN,", whole)
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        step.solids(path, "part")


@needs_gmsh
def test_a_solid_that_is_not_there_and_a_mesh_beyond_memory_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "block.step", block)
    with pytest.raises(InputError, match=r"'block.step' has 1 solids, no solid 2"):
        step.mesh_step_file(StepFile(type="step", file="block.step", size=0.01, solid=2), tmp_path, "part")
    with pytest.raises(ResourceError, match=r"a mesh of .* cells"):
        step.mesh_step_file(StepFile(type="step", file="block.step", size=1e-7), tmp_path, "part")
    sheet = write(tmp_path / "sheet.step", lambda occ: occ.addRectangle(0.0, 0.0, 0.0, 10.0, 10.0))
    with pytest.raises(InputError, match=r"'sheet.step' has no solid"):
        step.solids(sheet, "part")


@pytest.mark.parametrize(
    "command, words",
    [("import os; os.abort()", "it ended with -6"), ("import time; time.sleep(99)", "is not ready after 1 s")],
)
def test_where_gmsh_ends_or_does_not_end_the_file_is_refused(
    command: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some damaged files end its process, others keep it busy for ever."""
    (tmp_path / "part.step").write_text("ISO-10303-21; #1=PRODUCT('(nan, or inf)',1.);")
    monkeypatch.setattr(step, "find_spec", lambda name: name)
    monkeypatch.setattr(step, "COMMAND", command)
    monkeypatch.setattr(step, "LONGEST", 1.0)
    with pytest.raises(InputError, match=words):
        step.solids(tmp_path / "part.step", "part")


def test_without_gmsh_its_extra_is_asked_for_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gmsh", None)
    (tmp_path / "part.step").write_text("ISO-10303-21;")
    with pytest.raises(InputError, match=re.escape("pip install 'flexclear[cad]'")):
        step.solids(tmp_path / "part.step", "part")


def test_a_file_of_an_unknown_program_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--from", str(tmp_path / "part.sldprt")]) == 2
    assert "unknown ending '.sldprt'" in capsys.readouterr().err
    assert main(["new", "five-bar"]) == 2
    assert "did you mean 'four-bar'" in capsys.readouterr().err


def crossing(occ: Any) -> None:
    """A cube of 60 mm with two equal bores that cross, and a smaller one in the middle of a half of the first."""
    cube = drilled(occ, occ.addBox(0.0, 0.0, 0.0, 60.0, 60.0, 60.0), (30.0, 30.0, 6.0))
    occ.cut(
        [(3, cube)],
        [(3, occ.addCylinder(*at, r)) for at, r in (((-9, 30, 30, 80, 0, 0), 6), ((30, -9, 45, 0, 80, 0), 4))],
    )


def links(occ: Any) -> None:
    """Two bars, one on the other, with a bore of 10 and of 10.2 mm about one axis."""
    for x, z, r in ((-10.0, 0.0, 5.0), (70.0, 10.0, 5.1)):
        drilled(occ, occ.addBox(x, -10.0, z, 100.0, 20.0, 10.0), (80.0, 0.0, r))


def clevis(occ: Any) -> None:
    """A fork with bores of 12 mm, an eye with 12.2 mm that is not in its middle, and a pin of 11.8 mm."""
    gap = occ.cut(
        [(3, occ.addBox(-60.0, -15.0, -20.0, 80.0, 30.0, 40.0))],
        [(3, occ.addBox(-20.0, -20.0, -8.0, 60.0, 40.0, 20.0))],
    )
    drilled(occ, gap[0][0][1], (0.0, 0.0, 6.0))
    drilled(occ, occ.addBox(-15.0, -12.0, -7.0, 100.0, 24.0, 14.0), (0.0, 0.0, 6.1))
    occ.addCylinder(0.0, 0.0, -25.0, 0.0, 0.0, 60.0, 5.9)


@needs_gmsh
def test_bores_that_cross_have_their_full_length(tmp_path: Path) -> None:
    (solid,) = step.solids(write(tmp_path / "crossing.step", crossing), "crossing")
    rounds = sorted(solid.rounds, key=lambda one: tuple(one.axis))
    np.testing.assert_allclose([one.axis for one in rounds], np.eye(3)[::-1], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose([one.length for one in rounds], 0.06, rtol=1e-9)
    centres = np.array([[30.0, 30.0, 30.0], [30.0, 30.0, 45.0], [30.0, 30.0, 30.0]]) * 1e-3
    np.testing.assert_allclose([one.centre for one in rounds], centres, rtol=0.0, atol=1e-9)
    assert [one.hole for one in rounds] == [True] * 3


@needs_gmsh
@pytest.mark.parametrize(
    "draw, clearances",
    [(links, {("part1", "part2"): None}), (clevis, {("part1", "part3"): 1e-4, ("part2", "part3"): 2e-4})],
)
def test_joints_of_coaxial_holes_connect_without_more_and_meet_at_the_start(
    tmp_path: Path, draw: Draw, clearances: dict[tuple[str, str], float | None]
) -> None:
    """Bars next to each other share a pin that is not drawn; one that is drawn has a joint with each of them."""
    write(tmp_path / "parts.step", draw)
    assert main(["new", "--from", str(tmp_path / "parts.step"), str(tmp_path / "my")]) == 0
    scene = load_scene(tmp_path / "my" / "parts.toml")
    joints = {name: one for name, one in scene.joint.items() if name != "base"}
    ends = {name: [end.partition(".")[::2] for end in one.between] for name, one in joints.items()}
    found = {
        tuple(sorted(body for body, _ in ends[name])): getattr(one, "clearance", None) for name, one in joints.items()
    }
    assert found == pytest.approx(clearances)
    for (first, a), (second, b) in ends.values():
        assert scene.body[first].frames[a].position == pytest.approx(scene.body[second].frames[b].position, abs=1e-12)


@pytest.mark.parametrize(
    "radii, holes, fit",
    [
        *[((10.0, shaft), (True, False), shaft > 5.0) for shaft in (4.9, 5.1, 9.9, 10.0)],
        ((10.0, 10.5), (True, False), False),
        ((10.0, 8.1), (True, True), True),
        ((10.0, 7.9), (True, True), False),
    ],
)
def test_a_shaft_belongs_to_a_hole_that_is_at_most_twice_as_wide(
    radii: tuple[float, float], holes: tuple[bool, bool], fit: bool
) -> None:
    """Two holes share a pin if they are alike to a fifth."""
    rounds = [
        Round(hole, np.zeros(3), np.array([0.0, 0.0, 1.0]), r, 20.0) for r, hole in zip(radii, holes, strict=True)
    ]
    assert _fits_hole(*rounds) == _fits_hole(*rounds[::-1]) == fit


@needs_gmsh
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems do not say which signals are ignored")
def test_a_closed_pipe_stays_an_error_after_gmsh_has_run(tmp_path: Path) -> None:
    """It ended the process without a word; the signal's number is 13."""
    write(tmp_path / "plate.step", lambda kernel: kernel.addBox(0, 0, 0, 1, 1, 1))
    (ignored,) = (x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("SigIgn"))
    assert int(ignored.split()[1], 16) >> 12 & 1
