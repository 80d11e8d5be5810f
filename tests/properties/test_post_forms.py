"""Bodies are drawn between their joints, with shapes of the scene where it gives some; files say what was computed."""

from __future__ import annotations

import json
import struct
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import meshio
import numpy as np
import pytest

from flexclear.dynamics import analyses
from flexclear.post.body_shape import AROUND, PER_CELL, surface
from flexclear.post.render import film_speed, forms, gl, gltf, panel, player, surfaces, vibrations
from flexclear.post.render.forms import Seat, equivalent_solid, wheels
from flexclear.post.render.mechanism import Looks, Mechanism, drawn_points, mechanism
from flexclear.post.render.pictures import MAKERS, Shown, make
from flexclear.post.render.vibrations import Vibrations
from flexclear.scene.load import load_scene
from flexclear.stages import rendering, simulation
from flexclear.stages.scenes import require_names
from flexclear.structure.kinds import kind
from flexclear.structure.modes.bundle import rigid_drawing
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.paper import synthetic

needs_gl = pytest.mark.skipif(gl.library_state().endswith("none"), reason=gl.REMEDY)
#: points are kept in single precision by files and pages
SINGLE = 1e-6


def seat(place: list[float], joint: str, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Seat:
    return Seat(f"b.{place}", np.array(place), surfaces.axes_along(np.array(axis)), joint, True)


def spans(surface: surfaces.Surface) -> np.ndarray:
    return np.ptp(surface.points, axis=0)


def volume(surface: surfaces.Surface) -> float:
    a, b, c = np.moveaxis(surface.points[surface.triangles], 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_a_crank_with_the_inertia_of_a_flywheel_is_a_flat_bar_between_its_pins():
    """The drum with its inertia has a radius of 141 mm; the crank is 50 mm long."""
    flywheel = equivalent_solid(2.0, np.diag([0.01, 0.01, 0.02]))
    bar = forms.link([seat([0, 0, 0], "revolute"), seat([0.05, 0, 0], "revolute")], np.zeros(3), flywheel, 0.3)
    width = 2.0 * min(forms.WIDTH * 0.3, forms.WIDEST * 0.05)
    np.testing.assert_allclose(spans(bar)[:2], [0.05 + width, width], rtol=0.02)  # corners of a polygon of 32
    assert spans(bar)[2] < width


def test_three_pins_are_joined_by_a_plate_across_their_axis():
    places = [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]]
    plate = forms.link([seat(p, "revolute", (0, 1, 0)) for p in places], np.zeros(3), None, 0.5)
    assert spans(plate)[1] < 0.1 * spans(plate)[0]
    assert volume(plate) > 0.5 * 0.1 * 0.1 * spans(plate)[1]


def test_balls_in_space_are_joined_by_round_bars():
    places = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
    star = forms.link([seat(p, "spherical") for p in places], np.zeros(3), None, 0.5)
    for place in places:
        assert np.linalg.norm(star.points - place, axis=1).min() < 0.01


def test_a_slender_bar_has_the_radius_of_its_inertia():
    """A steel bar of radius 6 and length 300 mm."""
    radius, length, mass = 0.006, 0.3, 0.27
    across = mass * (3 * radius**2 + length**2) / 12
    solid = equivalent_solid(mass, np.diag([0.5 * mass * radius**2, across, across]))
    bar = forms.link([seat([-0.15, 0, 0], "spherical"), seat([0.15, 0, 0], "spherical")], np.zeros(3), solid, 0.4)
    np.testing.assert_allclose(spans(bar), [0.3, 0.012, 0.012], rtol=0.01)


def test_a_bob_hangs_on_its_arm():
    pendulum = forms.link([seat([0, 0, 0], "revolute")], np.array([0.0, -0.5, 0.0]), None, 1.0)
    assert pendulum.points[:, 1].max() < 0.05
    assert pendulum.points[:, 1].min() < -0.5


@pytest.mark.parametrize(
    "surface, size",
    [
        (surfaces.box((0.1, 0.2, 0.3)), 0.006),
        (surfaces.cylinder(0.1, 0.3), np.pi * 0.003),
        (surfaces.sphere(0.1), 4 / 3 * np.pi * 0.001),
        (surfaces.bar(np.zeros(3), np.array([0.3, 0.3, 0.0]), 0.02), np.pi * 0.0004 * 0.3 * np.sqrt(2)),
        (surfaces.prism(surfaces.hull(np.array([[0.0, 0], [1, 0]]), 0.1), 0.2), 0.2 * (0.2 + np.pi * 0.01)),
    ],
)
def test_surfaces_are_closed_and_turned_outwards(surface: surfaces.Surface, size: float):
    assert volume(surface) == pytest.approx(size, rel=0.03)  # round ones have 32 corners
    corners = surface.points[surface.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    large = np.linalg.norm(face, axis=1) > 1e-9
    assert (np.einsum("ij,ij->i", face, surface.normals[surface.triangles[:, 0]])[large] > 0.0).all()


SHAPES = [
    {"type": "box", "size": ["100 mm", "20 mm", "10 mm"], "pose": {"position": ["0.2 m", 0, 0]}},
    {"type": "cylinder", "radius": "5 mm", "length": "40 mm", "pose": {"axis": [1, 0, 0]}},
]


def test_a_scene_says_what_a_body_looks_like_and_no_run_depends_on_it():
    plain = load_scene("scenes/checks/pendulum.toml")
    name = next(iter(plain.rigid()))
    drawn = load_scene(
        "scenes/checks/pendulum.toml", override={f"body.{name}.geometry": SHAPES, f"body.{name}.color": "#CC79A7"}
    )
    assert simulation.params(drawn) == simulation.params(plain)
    reported = rendering.params(drawn, "motion", "html")["bodies"][name]
    assert reported["color"] == "#CC79A7"
    surface = forms.shapes(reported["geometry"], Path("."))
    assert surface.points.max(axis=0) == pytest.approx([0.25, 0.01, 0.005], rel=1e-12)
    assert surface.points[:, 0].min() == pytest.approx(-0.02, rel=1e-12)
    assert "bodies" not in rendering.params(plain, "modes", "html")


@pytest.mark.parametrize("suffix", [".stl", ".vtk", ".ply", ".obj"])
def test_shapes_come_from_files_of_other_programs(suffix: str, tmp_path: Path):
    box = surfaces.box((100.0, 20.0, 10.0))
    meshio.Mesh(box.points, [("triangle", box.triangles)]).write(tmp_path / f"part{suffix}")
    read = forms.read(tmp_path / f"part{suffix}", 1e-3)
    np.testing.assert_allclose(spans(read), [0.1, 0.02, 0.01], rtol=SINGLE)
    assert volume(read) == pytest.approx(2e-5, rel=SINGLE)


def test_of_a_volume_mesh_the_boundary_is_drawn(tmp_path: Path):
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    meshio.Mesh(x, [("tetra", np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))]).write(tmp_path / "two.vtk")
    read = forms.read(tmp_path / "two.vtk", 1.0)
    assert len(read.triangles) == 6  # of eight faces two are inside
    # the corner's sixth of a cube, and what lies beyond it: a third
    assert volume(read) == pytest.approx(1 / 6 + 1 / 3, rel=1e-12)


@pytest.mark.parametrize("content", [b"no mesh at all", b"solid\nendsolid\n"])
def test_a_file_that_is_no_surface_is_refused_in_words(content: bytes, tmp_path: Path):
    (tmp_path / "part.stl").write_bytes(content)
    with pytest.raises(InputError, match=r"part\.stl"):
        forms.read(tmp_path / "part.stl", 1.0)


def test_a_missing_shape_file_is_refused_with_its_key():
    scene = load_scene("scenes/checks/pendulum.toml")
    name = next(iter(scene.rigid()))
    there = load_scene(
        "scenes/checks/pendulum.toml", override={f"body.{name}.geometry": [{"type": "file", "file": "/no/part.stl"}]}
    )
    with pytest.raises(InputError, match=rf"body\.{name}\.geometry\.0.*no/part\.stl"):
        require_names(there)


def test_a_film_is_slow_around_the_strongest_impact_and_even_without():
    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    strong = film_speed.strongest_impacts(run)
    assert strong.size
    shown = film_speed.frame_times(run, seconds=4.0, slower=10.0)
    slowest = shown.times[np.argmax(shown.slower)]
    assert np.abs(strong - slowest).min() < film_speed.AROUND * np.ptp(run.time.values) * 2.0
    assert (np.diff(shown.times) > 0.0).all()
    even = film_speed.frame_times(run, seconds=4.0, slower=1.0)
    np.testing.assert_allclose(np.diff(even.times), np.diff(even.times)[0], rtol=1e-3)  # by the grid of the pace
    assert even.times[[0, -1]] == pytest.approx(run.time.values[[0, -1]], abs=1e-12)


def test_the_viewer_bends_a_rod_as_the_run_does():
    """Its linear fields, against the drawn skin: apart from what round sections keep of second order."""
    run, bundle = synthetic.run("sps4/far_cb", modes=7), synthetic.bundle()
    (rod,) = mechanism(run, {"rod1": bundle}, Looks(exaggeration=1.0)).flexible
    step = run.sizes["time"] // 2
    rest = surface(bundle, np.zeros(bundle.sizes["mode"]))[0]
    q = run.modal_coordinate.values[step, rod.columns]
    fields = player.linear_fields(rod.bundle)
    points = rest - bundle.first_moment.values / float(bundle.mass) + np.tensordot(q, fields, axes=1)
    true, _ = drawn_points(run, rod, step)
    own = true - run.position.values[step, rod.index]
    lengths = [np.linalg.norm(x.reshape(-1, AROUND + 1, 3).mean(axis=1), axis=1) for x in (points, own)]
    np.testing.assert_allclose(*lengths, atol=1e-9)


@pytest.fixture(scope="module")
def shown() -> Shown:
    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    return Shown(run=run, bundles={"rod1": synthetic.bundle()}, title="A scene")


def test_a_gltf_file_is_whole_and_moves_every_body(shown: Shown):
    content = make("motion", "gltf", shown)["motion.glb"]
    magic, version, length, size, kind = struct.unpack("<IIIII", content[:20])
    assert (magic, version, length, kind) == (0x46546C67, 2, len(content), 0x4E4F534A)
    reported = json.loads(content[20 : 20 + size])
    for accessor in reported["accessors"]:
        view = reported["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert view["byteLength"] == 4 * width * accessor["count"]
        assert view["byteOffset"] + view["byteLength"] <= reported["buffers"][0]["byteLength"]
    (animation,) = reported["animations"]
    moved = {reported["nodes"][c["target"]["node"]]["name"] for c in animation["channels"]}
    assert moved == {str(name) for name in shown.run.body.values}
    assert sum(c["target"]["path"] == "weights" for c in animation["channels"]) == 1


def test_each_mode_of_a_gltf_file_takes_a_second_and_moves_its_own_shape() -> None:
    bundle = synthetic.bundle()
    content = gltf.modes("rod", bundle, np.ones(bundle.sizes["mode"]))
    size = struct.unpack("<I", content[12:16])[0]
    reported = json.loads(content[20 : 20 + size])
    assert len(reported["animations"]) == bundle.sizes["mode"]
    for animation in reported["animations"]:
        (sampler,) = animation["samplers"]
        times, weights = (reported["accessors"][sampler[key]] for key in ("input", "output"))
        assert (times["min"], times["max"]) == ([0.0], [1.0])
        assert weights["max"] == [1.0]
        assert weights["count"] == times["count"] * bundle.sizes["mode"]


def test_a_series_for_paraview_names_files_that_are_there(shown: Shown):
    found = make("motion", "pvd", shown)
    entries = ET.fromstring(found["motion.pvd"]).findall(".//DataSet")
    assert {e.get("file") for e in entries} == set(found) - {"motion.pvd"}
    assert {e.get("name") for e in entries} == {"bodies", "forces"}
    times = [float(e.get("timestep", "nan")) for e in entries if e.get("name") == "bodies"]
    assert times == sorted(times)
    for name, content in found.items():
        assert ET.fromstring(content).tag == "VTKFile", name


def test_all_modes_of_a_body_are_in_its_page(shown: Shown):
    page = make("modes", "html", shown)["modes.html"].decode()
    reported = json.loads(page.split("<script type='application/json'>")[1].split("</script>")[0])
    assert len(reported["shapes"]) == 7
    assert all(
        f"{f:.5g} Hz" in shape["label"]
        for f, shape in zip(synthetic.bundle().frequency.values, reported["shapes"], strict=True)
        if f > 0
    )
    assert "<title>A scene: modes</title>" in page


def test_the_mode_sets_of_several_bodies_are_shown_next_to_each_other():
    sets = {f"{scene}: rod1": synthetic.bundle() for scene in ("free", "fixed")}
    page = make("modes", "html", Shown(bundles=sets))["modes.html"].decode()
    assert page.count("<div class='viewer'") == 2
    assert all(f"{name}: 7 modes" in page for name in sets)
    assert "<div class='side-by-side'>" in page


def test_a_joint_is_shown_in_space_with_its_gap_and_force(shown: Shown):
    page = make("joint", "html", shown)["joint.html"].decode()
    reported = json.loads(page.split("<script type='application/json'>")[1].split("</script>")[0])
    run, name = shown.run, str(shown.run["contact"].values[0])
    gap, force = (reading["values"] for reading in reported["readings"])
    steps = np.searchsorted(run["time"].values, np.array(reported["times"]) - 1e-9)
    np.testing.assert_allclose(gap, 1e6 * run["contact_gap"].values[steps, 0], rtol=1e-3)  # four digits are written
    assert max(force) <= float(run["contact_normal_force"].max()) * 1.001
    assert f"{name}: path of the centre" in page
    clearance = json.loads(run.attrs["parameters"])["joint"][name]["clearance"]
    room = panel.drawn_joint(run, 0).room
    np.testing.assert_allclose(np.linalg.norm(room.points, axis=1), clearance, rtol=1e-12)


def test_a_path_is_a_round_tube_that_does_not_twist():
    turn = np.linspace(0.0, 4.0 * np.pi, 200)
    helix = np.column_stack([np.cos(turn), np.sin(turn), 0.1 * turn])
    tube = surfaces.tube(helix, 0.01, corners=8)
    rings = tube.points.reshape(200, 9, 3)
    np.testing.assert_allclose(np.linalg.norm(rings - helix[:, None], axis=-1), 0.01, rtol=1e-9)
    # neighbouring rings face each other: no corner goes further than the path and its own size
    assert (
        np.linalg.norm(np.diff(rings, axis=0), axis=-1).max() < 1.1 * np.linalg.norm(np.diff(helix, axis=0), axis=1)[0]
    )
    still = surfaces.tube(np.tile(helix[:1], (5, 1)), 0.01)
    assert np.linalg.norm(still.points - helix[0], axis=1).max() < 0.0101


@pytest.fixture(scope="module")
def swinging() -> tuple[Mechanism, Vibrations]:
    """A pendulum about its lowest place, and how it is drawn vibrating."""
    linear = analyses.frequencies(load_scene("scenes/checks/pendulum.toml"), {}, silent)
    drawn = mechanism(vibrations.as_run(linear), {}, Looks())
    return drawn, vibrations.vibrations(drawn, linear)


def test_a_vibrating_pendulum_turns_about_its_pin_and_is_not_drawn_too_far(swinging: tuple[Mechanism, Vibrations]):
    drawn, reported = swinging
    assert len(reported.labels) == 1
    pin = drawn.run["frame_position"].values[0, 0]
    for piece in reported.pieces:
        way, arm = reported.scale[0] * piece.moved[0, 0], piece.surface.points - pin
        np.testing.assert_allclose(np.einsum("ij,ij->i", way, arm), 0.0, atol=1e-12)  # a rotation, linearised
        assert (np.linalg.norm(way, axis=1) <= (vibrations.TURN + 1e-9) * np.linalg.norm(arm, axis=1)).all()


@needs_gl
def test_a_film_of_vibrations_goes_through_whole_periods(swinging: tuple[Mechanism, Vibrations]):
    pictures = np.array(list(vibrations.frames(*swinging, 8)))
    assert pictures.shape == (12, 540, 960, 3)  # 1.5 s of 8 pictures
    np.testing.assert_array_equal(pictures[:6], pictures[6:])
    assert np.abs(pictures[3].astype(int) - pictures[0]).max() > 50  # of 255: the other side half a period later
    assert vibrations.sheet(*swinging).shape == (360, 480, 3)


@pytest.mark.parametrize("what, kind", [("joint", "gltf"), ("vibrations", "pvd")])
def test_what_cannot_be_shown_so_is_not_offered(what: str, kind: str):
    assert kind not in MAKERS[what]
    assert {name: tuple(kinds) for name, kinds in MAKERS.items()} == rendering.FORMATS


# Wheels and sections --------------------------------------------------------------------------------------------------


def test_wheels_of_gears_touch_where_their_pitch_circles_do(root: Path):
    """Thirty teeth each of sun and planets, ninety of the ring, 90 mm between the axes; a rack at 100 mm."""
    given = tomllib.loads((root / "scenes" / "checks" / "gears.toml").read_text())
    given["gear"]["rack"]["ratio"] = -0.1
    offsets = {"planet1.axis": [0.09, 0, 0], "planet2.axis": [-0.045, 0.0779, 0], "planet3.axis": [-0.045, -0.0779, 0]}

    def placed(frame: str) -> tuple[np.ndarray, np.ndarray]:
        return np.array(offsets.get(frame, [0.0, 0.0, 0.0]), dtype=float), np.eye(3)

    found = wheels(given, placed)
    # the offsets are rounded to a tenth of a millimetre
    assert [(w.radius, w.inner) for w in found["sun"][:1]] == [(pytest.approx(0.045, abs=1e-4), False)]
    assert [(w.radius, w.inner) for w in found["ring"][:1]] == [(pytest.approx(0.135, abs=1e-4), True)]
    assert found["planet2"][0].radius == pytest.approx(0.045, abs=1e-4)
    assert found["wheel"][0].radius == 0.1
    assert "rack" not in found


def test_a_ring_and_a_tube_are_seen_from_outside():
    """The volume that the triangles enclose is positive, as of every other form."""
    where = Seat("ring.axis", np.zeros(3), np.eye(3), "revolute", False)
    turn = np.linspace(0.0, 2.0 * np.pi, 129)
    torus = surfaces.tube(np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn]), 0.1, corners=12)
    for shape in (torus, *(forms.wheel_of_gear(where, 1.0, 1.0, inner=inner) for inner in (True, False))):
        assert volume(shape) > 0.0


def test_a_rectangular_rod_is_drawn_with_its_sides(root: Path):
    """Width along y and height along z of the rod, at every ring; a tube has its outer radius."""
    recipe = tomllib.loads((root / "meshes" / "checks" / "leg.toml").read_text())
    shape = {"type": "straight-beam", "length": 0.2}
    plain = {"elements": 2, "shape": shape, "material": recipe["material"], "frames": {"a": {"x": 0.0}}}
    rectangle = {"section": {"type": "rectangle", "width": 0.012, "height": 0.008}}
    flat = rigid_drawing(kind.build(plain | rectangle, root))
    points, _ = surface(flat, np.zeros(1))
    assert np.ptp(points, axis=0) == pytest.approx([0.2, 0.012, 0.008], abs=1e-15)
    corners = np.abs(np.abs(points[:, 1:]) - [0.006, 0.004]).max(axis=1) < 1e-12
    assert corners.sum() == 5 * (2 * PER_CELL + 1)  # the first one is there twice
    round_one = plain | {"section": {"type": "tube", "radius": 0.01, "inner_radius": 0.008}}
    assert rigid_drawing(kind.build(round_one, root))["radius"].values == pytest.approx(0.01, rel=1e-12)


def test_an_outline_around_points_is_the_sum_of_their_hull_and_a_disc():
    """Its area, by mixed areas: a rectangle a x b and a polygon C of 32 corners, as wide as 2 m along both axes, give
    a b + 2 (a + b) m + |C|; points inside and on the edges change nothing."""
    a, b, m = 2.0, 1.0, 0.3
    points = np.array([[0, 0], [a, 0], [a, b], [0, b], [0.5 * a, 0], [0.7, 0.4], [a, 0.2]])
    x, y = surfaces.hull(points, m).T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))  # positive: anticlockwise
    disc = 0.5 * surfaces.ROUND * m**2 * np.sin(2.0 * np.pi / surfaces.ROUND)
    assert area == pytest.approx(a * b + 2.0 * (a + b) * m + disc, rel=1e-12)
    assert len(x) == surfaces.ROUND + 4  # each corner of the rectangle once more: no point on a straight edge
