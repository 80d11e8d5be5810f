"""What is drawn has the size of what was computed."""

from __future__ import annotations

from dataclasses import replace

import meshio
import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.post import body_shape, derive
from flexclear.pipeline.post.render import gl
from flexclear.pipeline.post.render.mechanism import mechanism, placed
from flexclear.pipeline.post.render.panel import panel
from flexclear.pipeline.post.render.pictures import pictures
from flexclear.pipeline.post.render.solids import equivalent, mesh, plate
from flexclear.pipeline.post.rod_shape import AROUND, PER_CELL, centre_line, scale_to, surface
from tests.paper import synthetic

needs_gl = pytest.mark.skipif(gl.state().endswith("none"), reason=gl.REMEDY)


def test_cylinder_is_drawn_with_its_own_radius_and_length():
    """A solid cylinder of radius 20 and length 212 mm from its mass and inertia."""
    mass, radius, length = 2.0, 0.020, 0.212
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    solid = equivalent(mass, np.diag([across, across, 0.5 * mass * radius**2]))
    assert solid.round
    np.testing.assert_allclose(solid.half, [radius, radius, 0.5 * length], rtol=1e-12)


def test_disc_is_drawn_flat_with_its_axis_upright():
    mass, radius = 0.31, 0.1
    solid = equivalent(mass, np.diag([0.25, 0.25, 0.5]) * mass * radius**2)
    assert solid.round
    assert abs(solid.axes[2, 2]) == pytest.approx(1.0)
    np.testing.assert_allclose(solid.half[:2], radius, rtol=1e-12)


def test_box_is_drawn_with_its_own_edges():
    mass, a, b, c = 1.3, 0.1, 0.2, 0.35
    solid = equivalent(mass, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 12.0)
    assert not solid.round
    assert sorted(solid.half) == pytest.approx([a / 2, b / 2, c / 2], rel=1e-12)
    assert np.linalg.det(solid.axes) == pytest.approx(1.0)


def test_turned_cylinder_is_drawn_turned():
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    along, across = 1e-4, 2e-3
    solid = equivalent(1.0, across * np.eye(3) + (along - across) * np.outer(axis, axis))
    assert abs(solid.axes[:, 2] @ axis) == pytest.approx(1.0, abs=1e-12)


def test_a_flat_body_with_joints_at_the_corners_of_a_rectangle_is_a_square_plate():
    """A plate of side 200 and thickness 1 mm has the inertia of a disc about all axes: its joints tell."""
    mass, a, t = 0.31, 0.2, 0.001
    solid = equivalent(mass, np.diag([a * a + t * t, a * a + t * t, 2.0 * a * a]) * mass / 12.0)
    assert solid.round
    corners = np.array([[x, y, 0.0] for x in (0.0866, -0.0866) for y in (0.05, -0.05)])
    square = plate(solid, np.vstack([corners, np.zeros(3)]))
    assert not square.round
    assert square.half[:2] == pytest.approx([a / 2, a / 2], rel=1e-4)  # of the thickness squared over the side's
    assert np.abs(square.axes[:, :2].T @ [0.0, 1.0, 0.0]) == pytest.approx([1.0, 0.0], abs=1e-12)
    assert plate(solid, corners[:3]) is solid


def test_arms_reach_the_frames_outside_the_solid():
    solid = equivalent(1.0, np.diag([1e-4, 1e-4, 1e-4]))
    far = np.array([0.0, 0.0, 0.5])
    assert mesh(solid, {"b.far": far}, 0.01).bounds.z_max == pytest.approx(0.5, abs=1e-6)  # single precision points
    assert mesh(solid, {"b.near": 0.01 * far}, 0.01).bounds.z_max < 0.1


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
    assert len(drawn.rigid) == run.sizes["body"] - 1
    assert [rod.index for rod in drawn.flexible] == [list(run.body.values).index("rod1")]
    assert len(drawn.balls) == 8
    assert [ball.radius for ball in drawn.balls if ball.contact is not None] == [0.02]


def test_drawn_rod_lies_at_its_body_in_the_world():
    """The bundle's centre of mass is put where the run has it."""
    run = synthetic.run("sps4/far_cb", modes=7)
    bundle = synthetic.bundle()
    mass = float(bundle.mass)
    middle = xr.DataArray(mass * np.array([0.12, 0.0, 0.0]), dims="axis")
    drawn = mechanism(run, {"rod1": bundle.assign(first_moment=middle)})
    points = placed(run, drawn.flexible[0], 0)[0].reshape(-1, AROUND + 1, 3)
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


@needs_gl
@pytest.mark.parametrize("corners", [1, 3, 4])
def test_shapes_of_solids_become_pages_and_files(corners, tmp_path):
    from flexclear.pipeline.post.render import shapes

    plate = solid(corners)
    content = shapes.page(plate, 1)
    assert content == shapes.page(plate, 1)
    assert b"vtk" in content
    (tmp_path / "plate.vtu").write_bytes(shapes.vtu(plate))
    read = meshio.read(tmp_path / "plate.vtu")
    np.testing.assert_array_equal(read.cells[0].data, plate.cell_node.values)
    np.testing.assert_allclose(read.point_data["mode_2_200.0Hz"], plate.shape_translation.values[:, :, 1])


def test_state_of_gl_is_said_without_drawing():
    assert gl.state().startswith("GL")


def test_without_gl_there_are_no_pictures_but_a_line_that_says_why(monkeypatch, capsys):
    monkeypatch.setattr("flexclear.pipeline.post.render.gl.works", lambda: False)
    assert pictures(xr.Dataset(), {}) == {}
    assert gl.REMEDY in capsys.readouterr().err


@needs_gl
def test_a_film_moves():
    """Both the rod and the rigid bodies: a second picture of one scene shows what has moved since the first."""
    from flexclear.pipeline.post.render import film

    run = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7)
    drawn = mechanism(run, {"rod1": synthetic.bundle()})
    scene = film.plotter((200, 160))
    actors = film._build(scene, drawn)
    film._look(scene, drawn)
    last = run.sizes["time"] // 2
    seen = []
    for body in (replace(drawn, rigid=(), balls=()), replace(drawn, flexible=(), balls=())):
        moving = film.Actors(actors.rigid if body.rigid else (), (), actors.flexible if body.flexible else ())
        for step in (0, last):
            film._place(body, moving, step, glow=False)
            seen.append(film.image(scene).astype(int))
    scene.close()
    assert np.abs(seen[1] - seen[0]).max() > 20  # the rod
    assert np.abs(seen[3] - seen[2]).max() > 20  # everything else


@needs_gl
@pytest.mark.slow
def test_pictures_of_a_run_are_all_there_and_repeat(monkeypatch):
    # 24 pictures show as much as 168
    monkeypatch.setattr("flexclear.pipeline.post.render.film.SECONDS", 0.8)
    run = synthetic.run("sps4/far_csj_cb", clearance=True, noise=1e-4, modes=7)
    first = pictures(run, {"rod1": synthetic.bundle()})
    assert {name.partition(".")[0] for name in first} == {"mechanism", "film", "mode_rod1", "modes_rod1"}
    assert b"vtk" in first["mode_rod1.html"]
    again = pictures(run, {"rod1": synthetic.bundle()})
    for name in ("mechanism.png", "film.mp4", "modes_rod1.vtu", "mode_rod1.html"):
        assert first[name] == again[name], name
