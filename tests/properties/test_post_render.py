"""What is drawn has the size of what was computed."""

import base64
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.artifacts.paths import PROJECT
from flexclear.post import body_shape
from flexclear.post.body_shape import AROUND, PER_CELL, centre_line, scale_to
from flexclear.post.body_shape import rod_surface as surface
from flexclear.post.render import gl, gltf, player
from flexclear.post.render.forms import equivalent_solid
from flexclear.post.render.layout import part_pose
from flexclear.post.render.mechanism import Looks, drawn_points, mechanism
from flexclear.post.render.panel import panel
from flexclear.post.render.pictures import Shown, make
from flexclear.post.render.player import _camera
from flexclear.post.render.view import ANGLE, eye
from flexclear.post.single_run.series import derive
from flexclear.system.errors import SolverError
from tests.paper import synthetic

needs_gl = pytest.mark.skipif(gl.library_state().endswith("none"), reason=gl.REMEDY)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1 / 3, 2 / 3, 2 / 3)], ids=["upright", "turned"])
@pytest.mark.parametrize("radius, length, half", [(0.020, 0.212, 0.106), (0.1, 0.0, 0.003)], ids=["cylinder", "disc"])
def test_round_bodies_are_drawn_with_their_own_radius_length_and_axis(
    radius: float, length: float, half: float, axis: tuple[float, float, float]
):
    """From mass and inertia; a disc without thickness is drawn with some, to be seen."""
    mass, z = 2.0, np.array(axis)
    along, across = 0.5 * mass * radius**2, mass * (3.0 * radius**2 + length**2) / 12.0
    solid = equivalent_solid(mass, across * np.eye(3) + (along - across) * np.outer(z, z))
    assert solid.round
    np.testing.assert_allclose(solid.half, [radius, radius, half], rtol=1e-12)
    assert abs(solid.axes[:, 2] @ z) == pytest.approx(1.0, abs=1e-12)


def test_box_is_drawn_with_its_own_edges():
    mass, a, b, c = 1.3, 0.1, 0.2, 0.35
    solid = equivalent_solid(mass, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 12.0)
    assert not solid.round
    assert sorted(solid.half) == pytest.approx([a / 2, b / 2, c / 2], rel=1e-12)
    assert np.linalg.det(solid.axes) == pytest.approx(1.0)


def test_undeformed_rod_is_a_cylinder_of_its_radius():
    bundle = synthetic.bundle()
    points, size = surface(bundle, np.zeros(7))
    rings = points[1:-1]
    np.testing.assert_allclose(np.hypot(rings[..., 1], rings[..., 2]), 0.01, rtol=1e-12)
    assert size.max() == 0.0
    assert rings[:, 0, 0].min() == pytest.approx(0.0, abs=1e-15)
    assert rings[:, 0, 0].max() == pytest.approx(0.24, rel=1e-12)


def test_drawn_deformation_has_the_share_that_was_asked_for():
    bundle = synthetic.bundle()
    q = np.eye(7)[2]
    _, displacement, _ = centre_line(bundle, q, scale_to(bundle, q, 0.1))
    assert np.linalg.norm(displacement, axis=1).max() == pytest.approx(0.1 * 0.24, rel=1e-9)


def test_centre_line_passes_through_the_nodes():
    bundle = synthetic.bundle()
    q = np.eye(7)[1]
    points, displacement, _ = centre_line(bundle, q)
    nodes = bundle.node_position.values + bundle.shape_translation.values @ q
    for node in nodes:
        assert np.linalg.norm(points + displacement - node, axis=1).min() < 1e-12


def test_panel_of_a_run_without_platform_joints_or_contacts():
    """One free body: it is the body that is watched, and its energy is shown."""
    run = synthetic.run().sel(body=["rod1"], frame=["rod1.top"]).isel(joint=slice(0, 0))
    shown = panel(run, derive(run), (352, 640))
    assert shown.frame(0).shape == (640, 352, 3)
    assert (shown.frame(0) != shown.frame(900)).any()


def test_mechanism_draws_every_body_joint_and_rod_of_a_run():
    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    drawn = mechanism(run, {"rod1": synthetic.bundle()})
    names = list(run.body.values)
    assert [rod.index for rod in drawn.flexible] == [names.index("rod1")]
    owners = {part.owner for part in drawn.parts}
    assert {k for k in owners if k is not None} == set(range(len(names))) - {names.index("rod1")}
    (loose,) = (part for part in drawn.parts if part.contact is not None)
    assert np.linalg.norm(loose.surface.points, axis=1) == pytest.approx(0.02, rel=1e-6)  # the ball's own radius


def test_a_drawn_part_of_a_joint_is_where_its_frame_is():
    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    drawn = mechanism(run, {"rod1": synthetic.bundle()})
    (loose,) = (part for part in drawn.parts if part.contact is not None)
    step = run.sizes["time"] // 2
    np.testing.assert_allclose(
        part_pose(run, loose, step)[:3, 3], run.frame_position.sel(frame="ball_A1.centre").values[step], atol=1e-15
    )


def test_all_that_is_drawn_is_in_the_picture():
    drawn = mechanism(synthetic.run("sps4/far_cb", modes=7), {"rod1": synthetic.bundle()})
    place, focus = eye(drawn.view, drawn.cloud, 1.5)
    near = (place - focus) / np.linalg.norm(place - focus)
    right = np.cross(drawn.view.up, near) / np.linalg.norm(np.cross(drawn.view.up, near))
    seen = (drawn.cloud - place) @ np.array([right, np.cross(near, right), -near]).T
    slope = np.tan(0.5 * np.radians(ANGLE))
    assert (seen[:, 2] > 0.0).all()
    assert np.abs(seen[:, 1] / seen[:, 2]).max() < slope
    assert np.abs(seen[:, 0] / seen[:, 2]).max() < 1.5 * slope
    assert max(np.abs(seen[:, 1] / seen[:, 2]).max(), np.abs(seen[:, 0] / seen[:, 2]).max() / 1.5) > 0.7 * slope


def test_zoom_enlarges_stills_and_the_page_alike():
    """Twice as large: the eye of a still is half as far from its focus, the page's camera has half the opening."""
    drawn = mechanism(synthetic.run("sps4/far_cb", modes=7), {"rod1": synthetic.bundle()})
    (far, focus), (near, same) = (eye(drawn.view, drawn.cloud, 1.5, zoom) for zoom in (1.0, 2.0))
    np.testing.assert_array_equal(focus, same)
    np.testing.assert_allclose(near - focus, 0.5 * (far - focus), rtol=1e-13)
    (whole, part) = (_camera(drawn.view, drawn.cloud, zoom) for zoom in (1.0, 2.0))
    assert [whole[name] for name in ("eye", "focus", "up")] == [part[name] for name in ("eye", "focus", "up")]
    assert part["reach"] == pytest.approx([0.5 * one for one in whole["reach"]], rel=1e-14)


def test_a_spring_reaches_from_end_to_end_at_all_times():
    """A mass that swings on its spring: the coil is stretched to the distance of its ends, in pages and files, too."""
    run = fc.run(fc.load_scene(PROJECT / "scenes/checks/oscillator.toml", override={"time.end": 0.3}))
    drawn = mechanism(run, {})
    coil = next(part for part in drawn.parts if part.length is not None)
    mass = run["position"].sel(body="mass").values
    lengths = np.linalg.norm(mass, axis=1)  # the other end is the origin
    assert np.ptp(lengths) > 0.1 * lengths.max()
    for step in (0, len(mass) // 2, len(mass) - 1):
        matrix = part_pose(run, coil, step)
        heights = (coil.surface.points @ matrix[:3, :3].T + matrix[:3, 3]) @ mass[step] / lengths[step]
        assert [heights.min(), heights.max()] == pytest.approx([0.0, lengths[step]], abs=1e-9)
    reported = player.motion(drawn, 5)
    stretch = np.array([_decoded(track)[:, 7] for track in reported["tracks"]])
    assert np.ptp(stretch, axis=1).max() > 0.1
    assert b'"scale"' in gltf.motion(drawn, np.arange(3), 1.0)


def _decoded(track: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(track), dtype="<f4").reshape(-1, 8)


@needs_gl
def test_a_body_that_moves_far_is_in_the_first_picture_of_its_film():
    """A ball that falls by a metre from above the origin, where parts are before they are put in place."""
    from flexclear.post.render import film

    run = fc.run(fc.load_scene(PROJECT / "pipeline/flexclear/stages/templates/empty/scene.toml"))
    drawn = mechanism(run, {})
    first = next(iter(film.frames(drawn, derive(run), 12)))[:, : film.VIEW]
    # the ball is blue; background, floor and words are grey
    assert (first[:, :, 2].astype(int) - first[:, :, 0] > 40).sum() > 100


def test_drawn_rod_lies_at_its_body_in_the_world():
    """The bundle's centre of mass is put where the run has it."""
    run = synthetic.run("sps4/far_cb", modes=7)
    bundle = synthetic.bundle()
    mass = float(bundle.mass)
    middle = xr.DataArray(mass * np.array([0.12, 0.0, 0.0]), dims="axis")
    drawn = mechanism(run, {"rod1": bundle.assign(first_moment=middle)})
    points = drawn_points(run, drawn.flexible[0], 0)[0].reshape(-1, AROUND + 1, 3)
    rod = run.position.sel(body="rod1").values[0]
    np.testing.assert_allclose(points[1:-1, :-1].mean(axis=(0, 1)), rod, atol=1e-9)  # rings are even: mean = centre


def solid(corners: int) -> xr.Dataset:
    """A plate of 4 x 2 squares, 0.2 by 0.1 m, drawn by nodes, triangles or squares; it bends and it twists."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 0.2, 5), np.linspace(-0.05, 0.05, 3), indexing="ij"))
    shape = np.zeros((15, 3, 2))
    shape[:, 2] = np.stack([x**2, x * y], axis=1)
    index = np.arange(15).reshape(5, 3)
    square = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    cell = {1: np.arange(15)[:, None], 3: np.vstack([square[:, [0, 1, 2]], square[:, [0, 2, 3]]]), 4: square}[corners]
    return xr.Dataset(
        {
            "node_position": (("node", "axis"), np.stack([x, y, 0.0 * x], axis=1)),
            "cell_node": (("cell", "corner"), cell),
            "radius": (("cell",), np.zeros(len(cell))),
            "shape_translation": (("node", "axis", "mode"), shape),
            "shape_rotation": (("node", "axis", "mode"), 0.0 * shape),
            "frequency": (("mode",), [100.0, 200.0]),
        }
    )


@pytest.mark.parametrize("corners", [1, 3, 4])
def test_solids_are_drawn_by_their_nodes_and_faces(corners):
    plate = solid(corners)
    q = np.array([0.0, 3.0])
    scale = body_shape.scale_to(plate, q, 0.1)
    points, size = body_shape.surface(plate, q, scale)
    assert size.max() == pytest.approx(0.1 * 0.2, rel=1e-12)
    np.testing.assert_allclose(points[:, :2], plate.node_position.values[:, :2], rtol=1e-12)
    np.testing.assert_allclose(points[:, 2], scale * 3.0 * points[:, 0] * points[:, 1], rtol=0.0, atol=1e-15)
    assert body_shape.faces(plate).shape == (plate.sizes["cell"], corners)
    axes, extent = body_shape.box(plate)
    np.testing.assert_allclose(extent, [0.2, 0.1, 0.0], atol=1e-15)
    np.testing.assert_allclose(np.abs(axes), np.eye(3), atol=1e-12)


def test_a_rods_skin_is_closed_but_for_its_seam():
    bundle = synthetic.bundle()
    points, size = body_shape.surface(bundle, np.eye(7)[2])
    assert len(points) == len(size)
    _, same = np.unique(np.round(points, 12), axis=0, return_inverse=True)
    faces = same.ravel()[body_shape.faces(bundle)]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]  # the caps' faces have two corners at the centre
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}


def test_a_stepped_rod_is_drawn_with_each_cells_radius():
    bundle = synthetic.bundle()
    radius = np.where(np.arange(bundle.sizes["cell"]) < 4, 0.01, 0.004)
    rings = surface(bundle.assign(radius=("cell", radius)), np.zeros(7))[0][1:-1]
    drawn = np.hypot(rings[:, 0, 1], rings[:, 0, 2])
    np.testing.assert_allclose(drawn, np.append(np.repeat(radius, PER_CELL), radius[-1]), rtol=1e-12)


def test_state_of_gl_is_said_without_drawing():
    assert gl.library_state().startswith("GL")


def test_without_gl_there_is_no_film_but_an_error_that_says_why(monkeypatch):
    monkeypatch.setattr("flexclear.post.render.gl.can_draw", lambda: False)
    shown = Shown(run=synthetic.run("sps4/far_cb", modes=7), bundles={"rod1": synthetic.bundle()})
    with pytest.raises(SolverError, match="libgl1"):
        make("motion", "mp4", shown)
    assert b"viewer" in make("motion", "html", shown)["motion.html"]  # pages need no GL


@needs_gl
@pytest.mark.parametrize("direction", [None, (0.3, -1.0, 0.2)], ids=["with floor", "without"])
def test_a_film_draws_only_the_rows_that_change_as_a_whole_picture_has_them(direction: tuple[float, ...] | None):
    """From one point on, so that the strip grows; rounding of colours is one or two of 255, edges may be elsewhere."""
    from flexclear.post.render import film

    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    drawn = mechanism(run, {"rod1": synthetic.bundle()}, Looks(direction=direction))
    scene = film.plotter((film.VIEW, film.HEIGHT))
    strip = film.Strip(scene, film.image(scene), drawn.cloud[:1])
    actors = film._build(scene, drawn)
    film.place_camera(scene, drawn)
    for step in (0, run.sizes["time"] // 2):
        film._place(drawn, actors, step, impact=False)
        whole = film.still(drawn, step, (film.VIEW, film.HEIGHT)).astype(int)
        assert (np.abs(strip.image() - whole).max(axis=2) > 3).mean() < 1e-3
        assert (np.abs(whole - strip.empty).max(axis=2) > 20).mean() > 0.01  # the mechanism is in the picture
    scene.close()


@needs_gl
def test_a_film_moves():
    """A second picture of one scene shows what has moved since the first: the rod, and everything else."""
    from flexclear.post.render import film

    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    drawn = mechanism(run, {"rod1": synthetic.bundle()})
    scene = film.plotter((200, 160))
    actors = film._build(scene, drawn)
    film.place_camera(scene, drawn)
    last = run.sizes["time"] // 2
    seen = []
    for body in (replace(drawn, parts=()), replace(drawn, flexible=())):
        moving = film.Actors(actors.parts if body.parts else (), actors.flexible if body.flexible else ())
        for step in (0, last):
            film._place(body, moving, step, impact=False)
            seen.append(film.image(scene).astype(int))
    scene.close()
    assert np.abs(seen[1] - seen[0]).max() > 20  # the rod
    assert np.abs(seen[3] - seen[2]).max() > 20  # everything else


@needs_gl
@pytest.mark.slow
def test_pictures_of_a_run_repeat():
    # 19 pictures show as much as 90
    run = synthetic.run("sps4/far_csj_cb", clearance=True, noise=1e-4, modes=7)
    shown = Shown(run=run, bundles={"rod1": synthetic.bundle()}, looks=Looks(duration=0.8))
    for kind in ("png", "mp4", "html", "gltf", "pvd"):
        assert make("motion", kind, shown) == make("motion", kind, shown), kind
