"""``flexclear show``: the start pose with names, for every scene, without anything that computes or compiles."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import flexclear as fc
from flexclear.artifacts.paths import PROJECT
from flexclear.post.render import gl, surfaces
from flexclear.post.render.layout import CLEARANCE_COLOR, LOAD_COLOR, part_pose
from flexclear.post.render.ruler import pixels_per_metre, project, round_length
from flexclear.post.render.start_view import AXIS, columns, heights, page_view
from tests.processes import printed
from tests.stages.conftest import Command

SCENES = sorted(
    path.relative_to(PROJECT).as_posix()
    for folder in ("scenes/checks", "scenes/gallery", "scenes/sps4", "stages/templates")
    for path in (PROJECT / folder).rglob("*.toml")
    if re.search(r"^\[time\]|^extends", path.read_text(encoding="utf-8"), re.MULTILINE)
)


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_can_be_shown(scene: str, root: Path):
    seen = fc.show(root / scene)
    assert seen.refused is None
    assert not seen.gaps
    loaded = fc.load_scene(root / scene)
    names = {mark.text for mark in seen.view.marks}
    bodies = {name for name, body in loaded.body.items() if body.type != "ground"}
    assert names >= bodies | set(loaded.joint) | set(loaded.drive)
    for part in seen.view.drawn.parts:
        assert np.isfinite(part.surface.points).all()
    reported = page_view(seen.view)
    assert len(reported["labels"]) == len(seen.view.marks)
    assert np.isfinite([label["at"] for label in reported["labels"]]).all()


def test_nothing_that_compiles_is_imported(root: Path):
    program = (
        "import sys, flexclear as fc; [fc.show(scene) for scene in sys.argv[1:]]; "
        "assert not {'numba', 'llvmlite'} & set(sys.modules), 'something that compiles was imported'"
    )
    scenes = (
        str(root / name)
        for name in ("scenes/sps4/csj.toml", "pipeline/flexclear/stages/templates/slider_crank/slider_crank.toml")
    )
    printed(program, *scenes)


def test_a_loop_that_does_not_close_is_a_gap_of_its_length(root: Path):
    """A four-bar whose rocker's foot is moved away by twice what the links can reach over."""
    path = root / "pipeline/flexclear/stages/templates/four_bar/four_bar.toml"
    scene = fc.load_scene(path)
    low = np.array(scene.body["ground"].frames["D"].position)
    whole = fc.load_scene(path, override={"body.ground.frames.D.position": (low + np.array((0.3, 0.0, 0.0))).tolist()})
    seen = fc.show(whole)
    assert seen.refused is not None
    assert seen.refused.exit_code == 2
    (gap,) = [gap for gap in seen.view.gaps if np.linalg.norm(gap.end - gap.start) > 1e-3]
    assert np.linalg.norm(gap.end - gap.start) == pytest.approx(0.3, rel=1e-9)
    assert "300 mm" in seen.gaps[gap.joint]
    assert "does not fit: gap 300 mm" in {mark.detail for mark in seen.view.marks}


def test_the_command_writes_where_it_runs(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
):
    monkeypatch.chdir(tmp_path)
    said = command("show", root / "scenes/checks/pendulum.toml")
    page = (tmp_path / "pendulum_start.html").read_text(encoding="utf-8")
    reported = json.loads(re.search(r"<script type='application/json'>(.*?)</script>", page, re.DOTALL)[1])  # type: ignore[index]
    assert {label["text"] for label in reported["labels"]} == {"bob", "hinge"}
    assert (tmp_path / "pendulum_start.png").exists() == gl.can_draw()
    assert "pendulum_start.html" in said.out


def test_check_shows_what_it_refuses(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command):
    monkeypatch.chdir(tmp_path)
    scene = (root / "pipeline/flexclear/stages/templates/four_bar/four_bar.toml").read_text(encoding="utf-8")
    moved = re.sub(r"(frames\.D = .*position = \[)[^,]+", r'\g<1>"900 mm"', scene)
    assert moved != scene
    Path("apart.toml").write_text(moved, encoding="utf-8")
    assert "does not fit at the start" in command("check", "--show", "apart.toml", code=2).err
    assert Path("apart_start.html").exists()


def test_a_wrong_scene_is_refused_as_everywhere(tmp_path: Path, command: Command):
    assert "nothing.toml" in command("show", tmp_path / "nothing.toml", code=2).err


def test_axes_lie_along_the_joints(root: Path):
    """The drawn axis of a hinge reaches as far to both sides along its z, and nowhere else."""
    seen = fc.show(root / "scenes/checks/pendulum.toml").view
    hinge = next(mark for mark in seen.marks if mark.text == "hinge")
    axis = seen.drawn.parts[-1].surface
    assert isinstance(axis, surfaces.Surface)
    extent = np.sort(np.ptp(axis.points, axis=0))
    assert extent[2] == pytest.approx(2.0 * AXIS * seen.drawn.size, rel=1e-6)
    assert extent[1] < 0.1 * extent[2]
    assert 0.5 * (axis.points.max(axis=0) + axis.points.min(axis=0)) == pytest.approx(hinge.point, abs=1e-12)


def test_a_start_like_the_ideal_mechanism_is_shown_with_its_loose_joints(root: Path):
    path = root / "scenes/checks/clearance_slider_crank.toml"
    seen = fc.show(fc.load_scene(path, override={"start": {"at": "ideal"}})).view
    details = {mark.text: mark.detail for mark in seen.marks}
    assert details["pin"].startswith("clearance-revolute 100 µm")
    assert [part.contact for part in seen.drawn.parts if part.color == CLEARANCE_COLOR] == [0]
    assert any("clearances drawn" in note for note in seen.notes)


def test_loads_along_joints_stops_and_gears_have_names(root: Path):
    details = set()
    for name in ("checks/stops", "checks/gears", "gallery/gear_shaft", "gallery/cam"):
        scene = fc.load_scene(root / f"scenes/{name}.toml")
        marks = {(mark.text, mark.detail) for mark in fc.show(scene).view.marks}
        forces = {n for n, load in scene.load.items() if load.type != "gravity"}
        assert {text for text, _ in marks} >= forces | set(scene.stop) | set(scene.gear)
        details |= {detail for _, detail in marks}
    assert {"gear -3.0: wheel – pinion", "joint-spring: rail"} <= details
    assert any(text.startswith("stop of ") and "°" in text for text in details)


def test_up_is_against_gravity_in_spatial_pictures_too(root: Path):
    scene = fc.load_scene(root / "scenes/gallery/stewart.toml")
    sideways = fc.edited(scene, {"load.gravity.acceleration": [0.0, 9.81, 0.0]})
    for one, up in ((scene, [0.0, 0.0, 1.0]), (sideways, [0.0, -1.0, 0.0])):
        seen = fc.show(one).view.drawn.view
        assert not seen.planar
        assert seen.up == pytest.approx(up, abs=1e-12)


CAR = """
title = "Wishbone in two bushings, on a strut"
time = { end = 0.1 }
[body.ground]
type = "ground"
[body.ground.frames]
front = { position = [0.15, 0, 0] }
rear = { position = [-0.15, 0, 0] }
top = { position = [0, 0.3, 0.5] }
[body.arm]
type = "rigid"
mass = 3.0
inertia = [0.02, 0.03, 0.04]
com = [0, 0.18, 0]
pose = {}
[body.arm.frames]
front = { position = [0.15, 0, 0] }
rear = { position = [-0.15, 0, 0] }
ball = { position = [0, 0.4, 0] }
[load.front]
type = "bushing"
between = ["ground.front", "arm.front"]
stiffness = [8e6, 3e6, 8e6, 20, 200, 200]
[load.rear]
type = "bushing"
between = ["ground.rear", "arm.rear"]
stiffness = [3e6, 8e6, 8e6, 20, 200, 200]
[load.strut]
type = "spring-damper"
between = ["ground.top", "arm.ball"]
stiffness = 3e4
damping = 1500.0
free_length = 0.4
"""


def test_springs_dampers_and_bushings_are_drawn_and_a_wishbone_is_a_plate(tmp_path: Path):
    (tmp_path / "car.toml").write_text(CAR, encoding="utf-8")
    drawn = fc.show(tmp_path / "car.toml").view.drawn
    arm, *rest = [part for part in drawn.parts if part.owner == 0 and part.ends is None and part.frame is None]
    assert not rest
    corners = np.array([[0.15, 0.0, 0.0], [-0.15, 0.0, 0.0], [0.0, 0.4, 0.0]]) - [0.0, 0.18, 0.0]
    for corner in corners:  # the plate goes around each of its frames
        assert np.linalg.norm(arm.surface.points - corner, axis=1).min() < 0.05
    coil, cylinder, piston = (part for part in drawn.parts if part.ends is not None)
    ends = np.array([[0.0, 0.3, 0.5], [0.0, 0.4, 0.0]])
    for part, (start, end) in ((coil, ends), (cylinder, ends), (piston, ends[::-1])):
        matrix = part_pose(drawn.run, part, 0)
        assert matrix[:3, 3] == pytest.approx(start, abs=1e-12)
        assert np.cross(matrix[:3, 2], end - start) == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.ptp(coil.surface.points[:, 2]) == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-9)
    reach = [np.ptp(part.surface.points[:, 2]) for part in (cylinder, piston)]
    assert sum(reach) > np.linalg.norm(ends[1] - ends[0]) > max(reach)
    # rings of the bushings, in colour and place
    rings = [part for part in drawn.parts if part.color == LOAD_COLOR and part.ends is None]
    middles = [0.5 * (part.surface.points.max(axis=0) + part.surface.points.min(axis=0)) for part in rings]
    assert np.array(middles) == pytest.approx(np.array([[0.15, 0.0, 0.0], [-0.15, 0.0, 0.0]]), abs=1e-9)
    assert np.ptp(rings[0].surface.points, axis=0)[1] < np.ptp(rings[0].surface.points, axis=0)[0]  # about y
    assert np.ptp(rings[1].surface.points, axis=0)[0] < np.ptp(rings[1].surface.points, axis=0)[1]  # about x


def test_a_spring_on_a_rail_goes_around_the_body_that_slides(root: Path):
    """The follower's stem is 10 mm by 10 mm: its coil is wider than the diagonal."""
    drawn = fc.show(root / "scenes/gallery/cam.toml").view.drawn
    (coil,) = (part for part in drawn.parts if part.ends is not None)
    radius = np.linalg.norm(coil.surface.points[:, :2], axis=1).max()
    assert radius > reach_of_follower(root)


def reach_of_follower(root: Path) -> float:
    """Half the diagonal of the stem [m]."""
    _, stem = fc.load_scene(root / "scenes/gallery/cam.toml").body["follower"].geometry  # type: ignore[union-attr]
    return 0.5 * float(np.hypot(*stem.size[:2]))


def test_the_bar_is_as_long_as_it_says(root: Path):
    """Two points across the line of sight, in the plane of the point that is looked at."""
    drawn = fc.show(root / "scenes/sps4/csj.toml").view.drawn
    from flexclear.post.render.view import eye

    place, focus = eye(drawn.view, drawn.cloud, 1.6)
    right = np.cross(drawn.view.up, place - focus)
    ends = np.array([focus, focus + 0.1 * right / np.linalg.norm(right)])
    pixels = project(drawn, ends, (1600, 1000))
    assert pixels[0] == pytest.approx([800.0, 500.0], abs=1e-6)
    assert pixels[1, 0] - pixels[0, 0] == pytest.approx(0.1 * pixels_per_metre(drawn, (1600, 1000)), rel=1e-9)


@pytest.mark.parametrize("most, length", [(0.19, 0.1), (0.2, 0.2), (0.99, 0.5), (1.0, 1.0), (7e-6, 5e-6)])
def test_bars_have_round_lengths(most: float, length: float):
    assert round_length(most) == pytest.approx(length)


def test_names_do_not_cover_each_other():
    random = np.random.default_rng(0)
    points = np.column_stack([random.uniform(0, 1600, 60), random.uniform(480, 520, 60)])
    left, right = columns(points, 40)
    assert sorted([*left, *right]) == list(range(60))
    for names in (left, right):
        found = heights(points[names, 1], 17.0, 70.0, 910.0)
        assert np.diff(found).min() >= 17.0 - 1e-9
        assert found.min() >= 70.0
        assert found.max() <= 910.0
