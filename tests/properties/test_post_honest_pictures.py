"""Pictures show true sizes, name what is drawn larger, draw rounding as a zero line, and planes from their normal."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.layout_engine import ConstrainedLayoutEngine

import flexclear as fc
from flexclear.post.overview import sweep_figures
from flexclear.post.overview.curves import NOISE, format_to_digits, impacts_text, rounding_range, without_noise
from flexclear.post.plotting import style
from flexclear.post.render import start_view
from flexclear.post.render.layout import CLEARANCE_COLOR
from flexclear.post.render.mechanism import SOCKET
from flexclear.post.render.ruler import exaggeration
from flexclear.post.render.view import plane, view

#: mechanism with a loose joint, and the key of the radius of its pin or ball
LOOSE = [
    ("pipeline/flexclear/stages/templates/slider_crank/slider_crank.toml", "pin_radius"),
    ("scenes/sps4/csj.toml", "ball_radius"),
]


@pytest.mark.parametrize("path, key", LOOSE)
def test_pins_and_balls_have_their_true_radius(path: str, key: str, root):
    scene = fc.load_scene(root / path)
    ((name, joint),) = scene.contacts().items()
    drawn = fc.show(scene).view.drawn
    (pin,) = [part for part in drawn.parts if part.color == CLEARANCE_COLOR]
    across = pin.surface.points if key == "ball_radius" else pin.surface.points @ _across(pin.surface.points)
    reach = np.linalg.norm(across - 0.5 * (across.max(axis=0) + across.min(axis=0)), axis=1).max()
    assert reach == pytest.approx(getattr(joint, key), rel=1e-6)
    assert name in {mark.text for mark in fc.show(scene).view.marks}


def _across(points: np.ndarray) -> np.ndarray:
    """Two directions across the axis of a cylinder, which is the one whose extent differs from the two others."""
    variance, axes = np.linalg.eigh(np.cov(points.T))
    alike = (0, 1) if variance[1] - variance[0] < variance[2] - variance[1] else (1, 2)
    return axes[:, alike]


def test_the_factor_of_a_clearance_is_what_is_drawn(root):
    scene = fc.load_scene(root / LOOSE[0][0])
    ((_, joint),) = scene.contacts().items()
    factor = (SOCKET - 1.0) * joint.pin_radius / joint.clearance
    assert f"clearances drawn {format_to_digits(factor, 2)} times larger" in exaggeration(fc.show(scene).view.drawn)


@pytest.mark.parametrize("letter", "iW")
def test_long_names_of_a_start_end_before_the_edge(letter: str):
    axes = style.canvas(start_view.SIZE).figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, start_view.SIZE[0]), ylim=(start_view.SIZE[1], 0))
    marks = [start_view.Mark(letter * n, letter * 2 * n, np.zeros(3), "k") for n in (3, 200)]
    start_view._columns(axes, marks * 2, np.array([[x, 300.0 + x] for x in (400, 500, 1200, 1300)]))
    assert len(axes.texts) == 8
    for text in axes.texts:
        box = text.get_window_extent()
        assert box.x0 > 0.0
        assert box.x1 < start_view.SIZE[0]
        assert text.get_text().endswith("…") == (text.get_text().count(letter) > 10)


def test_a_zero_line_has_no_range_of_its_own():
    with style.set_style():
        figure, ((zero, small),) = style.grid(1, 2, (4.0, 2.0))
        for axes, size in ((zero, 0.0), (small, 1e-9)):
            axes.plot([0.0, 1.0], [0.0, size])
            style.mark_only_zero(axes)
        assert list(zero.get_yticks()) == [0.0]
        assert max(small.get_ylim()) == pytest.approx(1e-9, rel=0.2)
        style.files("x", figure)


def test_both_files_of_a_figure_have_the_layout_that_was_solved_once(monkeypatch):
    """To solve it takes as long as to draw both."""
    solved, solve = [], ConstrainedLayoutEngine.execute
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda self, fig: solved.append(solve(self, fig)))
    with style.set_style():
        figure, _ = style.grid(1, 2, (4.0, 2.0))
        assert set(style.files("x", figure)) == {"x.png", "x.svg"}
    assert len(solved) == 1


@pytest.mark.parametrize(
    "values, borders",
    [([1.0, 2.0, 5.0], [0.5, 1.5, 3.5, 6.5]), ([0.1, 1.0, 10.0], np.sqrt([0.001, 0.1, 10.0, 1000.0]))],
    ids=["linear", "logarithmic"],
)
def test_cells_of_a_map_end_halfway_between_its_values(values, borders):
    assert sweep_figures._edges(np.array(values)) == pytest.approx(np.array(borders))


def test_labels_of_sweeps_are_words_and_units_as_written():
    values = {"drive.motor.law.speed": ("drive.motor.law.speed", [10.0, 20.0], {"units": "rad s-1"})}
    sweep = xr.Dataset(coords=values)
    assert sweep_figures._axis(sweep, "drive.motor.law.speed") == "law speed of motor (rad/s)"
    sweep["drive.motor.law.speed"].attrs["written_units"] = "rpm"
    assert sweep_figures._axis(sweep, "drive.motor.law.speed") == "law speed of motor (rpm)"
    assert sweep_figures._scale(sweep, "drive.motor.law.speed")[0] == pytest.approx(30.0 / np.pi)
    assert sweep_figures._in_words("A1.peak_force") == "A1: peak force"
    assert sweep_figures._in_words("rod.tip.position.largest x") == "rod.tip: position, largest x"
    assert sweep_figures._in_words("force(A1) - force(A2)") == "force(A1) - force(A2)"


def test_rounding_is_a_zero_line_and_small_motion_is_not():
    time = np.linspace(0.0, 1.0, 50)
    assert (without_noise(1e-17 * np.sin(9.0 * time), NOISE * 0.3) == 0.0).all()
    assert (without_noise(0.2 + 1e-17 * np.sin(9.0 * time), NOISE * 0.3) == 0.2).all()
    small = 1e-6 * np.sin(9.0 * time)
    assert np.array_equal(without_noise(small, NOISE * 0.3), small)
    edge = 2.0 * NOISE * np.sin(9.0 * time)
    assert np.array_equal(without_noise(edge, NOISE), edge)


def test_rounding_is_judged_by_the_whole_motion_where_all_curves_of_a_kind_are_rounding():
    """A crane of 100 m that turns at 1 rad/s, 50 J: a stage on it moves by a nanometre, its joints carry nothing."""
    frames = np.array([[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]] * 2)
    vectors = ("time", "body", "axis")
    run = xr.Dataset(
        {
            "frame_position": (("time", "frame", "axis"), frames),
            "position": (vectors, np.zeros((2, 1, 3))),
            "velocity": (vectors, np.zeros((2, 1, 3))),
            "angular_velocity": (vectors, np.ones((2, 1, 3))),
            "kinetic": ("time", [0.0, 50.0]),
        }
    )
    change = np.array([0.0, 1.0])
    for unit, rounding, motion in (("m", 1e-15, 1e-9), ("m/s", 1e-14, 1e-9), ("N", 1e-13, 1e-9), ("N m", 1e-12, 1e-6)):
        assert not without_noise(rounding * change, rounding_range(run, rounding * change, unit)).any()
        assert np.array_equal(
            without_noise(motion * change, rounding_range(run, motion * change, unit)), motion * change
        )
    without_frames = run.isel(frame=slice(0))
    assert rounding_range(without_frames, change, "m") == rounding_range(without_frames, change, "rad") > 0.0


@pytest.mark.parametrize(
    "count, closed, said",
    [
        (0, 0.0, "no impact"),
        (1, 0.2, "one impact"),
        (40, 0.4, "40 impacts"),
        (1, 0.97, "one impact; the contact is closed"),
    ],
)
def test_a_contact_that_hardly_opens_is_called_so(count: int, closed: float, said: str):
    words = impacts_text(count, closed)
    assert words.startswith(said)
    assert ("most of the time" in words) == (closed > 0.9)


# From where a mechanism is looked at --------------------------------------------------------------------------------


def moving(turn: np.ndarray, along: np.ndarray) -> xr.Dataset:
    """Two bodies that turn about `turn` and move along `along`, over time."""
    fraction = np.linspace(0.1, 1.0, 7)[:, None, None] * np.array([1.0, -0.5])[None, :, None]
    dims = ("time", "body", "axis")
    return xr.Dataset({"angular_velocity": (dims, fraction * turn), "velocity": (dims, fraction * along)})


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 1, 0], [1, 2, -2]])
def test_the_normal_is_the_axis_of_turning(axis: list[float]):
    normal = np.array(axis) / np.linalg.norm(axis)
    in_plane = np.cross(normal, [0.3, -0.5, 0.8])
    found = plane(moving(normal, in_plane))
    assert found is not None
    assert abs(found @ normal) == pytest.approx(1.0, abs=1e-12)


def test_motion_out_of_the_plane_is_spatial():
    assert plane(moving(np.array([0.0, 0, 1]), np.array([1.0, 0, 0.1]))) is None
    assert plane(moving(np.zeros(3), np.array([1.0, 0, 0]))) is None  # along a line: any plane through it


def test_up_is_against_gravity_and_the_axis_across_runs_to_the_right():
    run = moving(np.array([0.0, 0, -1.0]), np.array([1.0, 0, 0]))
    reported = {"load": {"g": {"type": "gravity", "acceleration": [0, -9.81, 0]}}}
    found = view(run, reported)
    assert found.planar
    np.testing.assert_allclose(found.up, [0, 1, 0], atol=1e-12)
    assert found.direction[2] > 0.0  # from +z, so that x runs to the right
    assert np.cross(found.up, found.direction)[0] > 0.0


def test_a_requested_direction_is_taken():
    found = view(moving(np.array([0.0, 0, 1]), np.array([1.0, 0, 0])), {}, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(found.direction / np.linalg.norm(found.direction), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.up, [0, 0, 1], atol=1e-12)
