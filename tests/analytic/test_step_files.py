"""Solids from STEP files that Gmsh writes, against closed forms of blocks, holes and shafts."""

import importlib.util
import re
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

    step.start_gmsh(gmsh)
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
        (b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(nan,1e999,", "cannot read|has no solid"),
        (b"ISO-10303-21;\n" + b"\x00\xff" * 5000, "cannot read|has no solid"),
        (b"half", "cannot read|has no solid"),
    ],
    ids=["empty", "stl", "cut", "binary", "half"],
)
def test_a_damaged_step_file_is_refused_in_one_sentence(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "part.step"
    if content == b"half":
        whole = write(path, block).read_bytes()
        content = whole[: len(whole) // 2]
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
