"""What is drawn has the size of what was computed."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pipeline.post import derive
from pipeline.post.render import gl
from pipeline.post.render.mechanism import mechanism, rod_surface
from pipeline.post.render.panel import panel
from pipeline.post.render.pictures import pictures
from pipeline.post.render.solids import equivalent, mesh
from pipeline.post.rod_shape import centre_line, scale_to, surface
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
    points, _ = rod_surface(run, drawn.flexible[0], 0)
    rod = run.position.sel(body="rod1").values[0]
    np.testing.assert_allclose(points[1:-1, :-1].mean(axis=(0, 1)), rod, atol=1e-9)  # rings are even: mean = centre


def test_state_of_gl_is_said_without_drawing():
    assert gl.state().startswith("GL")


def test_without_gl_there_are_no_pictures_but_a_line_that_says_why(monkeypatch, capsys):
    monkeypatch.setattr("pipeline.post.render.gl.works", lambda: False)
    assert pictures(xr.Dataset(), {}) == {}
    assert gl.REMEDY in capsys.readouterr().err


@needs_gl
@pytest.mark.slow
def test_pictures_of_a_run_are_all_there_and_repeat():
    run = synthetic.run("sps4/far_csj_cb", clearance=True, noise=1e-4, modes=7)
    first = pictures(run, {"rod1": synthetic.bundle()})
    assert {name.partition(".")[0] for name in first} == {"mechanism", "film", "mode_rod1", "modes_rod1"}
    assert b"vtk" in first["mode_rod1.html"]
    again = pictures(run, {"rod1": synthetic.bundle()})
    for name in ("mechanism.png", "film.mp4", "modes_rod1.vtu", "mode_rod1.html"):
        assert first[name] == again[name], name
