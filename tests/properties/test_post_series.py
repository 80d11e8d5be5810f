"""What post derives from runs: angles, deviations, horizons, impacts, sections."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from flexclear.artifacts import quantities
from flexclear.artifacts.quantities import common_times
from flexclear.numerics.rotations import (
    angle_about_y,
    quaternion_product,
    rotation_between,
    rotation_since_start,
    rotation_vector_to_quaternion,
)
from flexclear.post.single_run.series import derive, member_spread, separation_time
from flexclear.scene.quantity import Quantity
from papers.wang_wang_2019.deviations import ensemble_deviations, max_deviation, velocity_at_events
from papers.wang_wang_2019.figures.phase import at_times
from tests.paper import synthetic

angles = st.floats(-1.5, 1.5)
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@pytest.fixture(scope="module")
def run() -> xr.Dataset:
    """Of the mechanism with a loose joint."""
    return synthetic.run("sps4/csj", clearance=True)


@given(angles)
def test_angle_about_y_is_the_angle_of_a_rotation_about_y(angle):
    q = rotation_vector_to_quaternion(np.array([0.0, angle, 0.0]))
    # asin loses digits as the square of the distance to 90 degrees: 1/cos(1.5) = 14 times the rounding of some products
    assert angle_about_y(q) == pytest.approx(angle, abs=5e-14)


@given(vectors, vectors, vectors)
def test_rotation_between_two_poses_does_not_depend_on_the_world(a, b, world):
    qa, qb, qw = (rotation_vector_to_quaternion(v) for v in (a, b, world))
    turned = rotation_between(quaternion_product(qw, qa), quaternion_product(qw, qb))
    assert turned == pytest.approx(rotation_between(qa, qb), abs=1e-12)  # products of three unit quaternions


@given(st.floats(1e-12, 3.1), vectors)
def test_rotation_between_is_accurate_for_tiny_angles(angle, axis):
    axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-3 else np.array([1.0, 0.0, 0.0])
    base = rotation_vector_to_quaternion(np.array([0.3, -0.2, 0.5]))
    turned = quaternion_product(base, rotation_vector_to_quaternion(angle * axis))
    assert rotation_between(base, turned) == pytest.approx(angle, rel=1e-6, abs=1e-15)
    assert rotation_between(base, -turned) == pytest.approx(rotation_between(base, turned), abs=1e-15)


@given(vectors, vectors, st.floats(-40.0, 40.0), st.sampled_from([0.005, 0.25]))
def test_a_rotation_about_a_fixed_axis_is_drawn_with_its_sign_and_its_full_turns(axis, start, rate, interval):
    axis = np.array([0.0, 0.6, -0.8]) if np.linalg.norm(axis) < 1e-3 else axis / np.linalg.norm(axis)
    rate += np.copysign(0.1, rate)  # what does not turn has no axis
    time = np.arange(0.0, 2.0, interval)  # of the coarser one: ten radians between rows
    angle = rate * time + 0.3 * np.sin(7.0 * time)
    turns = np.column_stack([np.cos(0.5 * angle), np.outer(np.sin(0.5 * angle), axis)])
    turns[::3] *= -1.0  # which is the same rotation
    q = quaternion_product(turns, rotation_vector_to_quaternion(start))
    found = rotation_since_start(time, q, np.outer(rate + 2.1 * np.cos(7.0 * time), axis))
    assert found.axis is not None
    along = np.sign(np.dot(found.axis, axis))
    assert found.axis == pytest.approx(along * axis, abs=1e-7)  # rounding of the products over the smallest turn
    assert found.angle == pytest.approx(along * angle, abs=1e-6)


def test_the_axis_of_a_planar_motion_is_that_of_the_world():
    angle = np.linspace(0.0, -3.0, 31)
    q = np.column_stack([np.cos(0.5 * angle), np.zeros((31, 2)), np.sin(0.5 * angle)])
    found = rotation_since_start(np.linspace(0.0, 1.0, 31), q, np.tile([0.0, 0.0, -3.0], (31, 1)))
    assert found.title == "rotation about z"
    assert found.angle == pytest.approx(angle, abs=1e-13)  # of an arc tangent and its unwrapping


def test_a_rotation_about_changing_axes_is_drawn_as_the_angle_from_the_start():
    time = np.linspace(0.0, 1.0, 201)
    vectors = np.column_stack([time, 0.5 * np.sin(3.0 * time), np.zeros_like(time)])
    q = np.array([rotation_vector_to_quaternion(v) for v in vectors])
    found = rotation_since_start(time, q, np.zeros((time.size, 3)))
    assert found.axis is None
    assert found.title == "rotation from the start"
    assert found.angle == pytest.approx(rotation_between(q[:1], q), abs=1e-15)  # it is that function


def test_a_run_does_not_deviate_from_itself():
    run = synthetic.run()
    found = max_deviation(run, run, "platform")
    assert (found.angle, found.rotation, found.displacement, found.velocity) == (0.0, 0.0, 0.0, 0.0)


def test_deviation_is_taken_at_common_times_only():
    a, b = synthetic.run(), synthetic.run("sps4/csj", clearance=True, noise=1e-4)
    assert b.sizes["time"] > a.sizes["time"]
    i, j = common_times(a.time.values, b.time.values)
    assert i.size == a.sizes["time"]
    # a grid is counted up in two ways, whose rounding differs
    np.testing.assert_allclose(a.time.values[i], b.time.values[j], rtol=0.0, atol=1e-13 * a.time.values[-1])
    # the wobble is a sine of 300 Hz sampled every 0.1 ms: its top is missed by at most 0.1 %
    assert max_deviation(b, a, "platform").displacement == pytest.approx(1e-4, rel=2e-3)


def test_what_happens_between_outputs_is_seen_at_events():
    """A smooth motion of 5 Hz at outputs, and one that leaves it by a jump between two of them and comes back."""

    def moving(time: np.ndarray) -> xr.Dataset:
        motion = {"velocity": np.sin(10.0 * np.pi * time), "acceleration": 10.0 * np.pi * np.cos(10.0 * np.pi * time)}
        dims, axis = ("time", "body", "axis"), [0.0, 0.0, 1.0]
        data = {name: (dims, values[:, None, None] * axis) for name, values in motion.items()}
        return xr.Dataset(data, coords={"time": time, "body": ["platform"], "axis": ["x", "y", "z"]})

    grid = 1e-3 * np.arange(201)
    other = moving(np.sort(np.append(grid, 0.0734)))
    struck = other.assign(velocity=other.velocity + 0.25 * ((other.time == 0.0734) & (other.axis == "z")))
    # a cubic between outputs leaves (2 pi 5 h)^4 / 384 = 2.5e-9
    assert velocity_at_events(struck, moving(grid), "platform") == pytest.approx((0.25, 0.0734), abs=1e-7)
    assert velocity_at_events(struck, moving(grid), "platform", until=0.07)[0] < 1e-7


def test_nearly_simultaneous_events_are_not_compared():
    """Two accurate runs have the same impact a picosecond apart, between which a contact moves."""
    grid = 1e-4 * np.arange(1801)
    a, b = np.sort(np.append(grid, 0.05587679981)), np.sort(np.append(grid, 0.05587679981 + 1e-12))
    i, j = common_times(a, b)
    np.testing.assert_array_equal(a[i], grid)
    np.testing.assert_array_equal(b[j], grid)


def test_a_grid_and_a_finer_one_share_the_times_of_the_coarse_one():
    coarse, fine = 1e-4 * np.arange(1801), 1e-5 * np.arange(18001)
    i, j = common_times(coarse, fine)
    # where rounding differs, a time may be taken for two by bad luck: one in a thousand
    assert i.size >= 0.99 * coarse.size
    np.testing.assert_allclose(coarse[i], fine[j], rtol=0.0, atol=1e-13)


def test_deviation_stops_at_the_given_time():
    a, b = synthetic.run(), synthetic.run(noise=1e-4)
    early, late = max_deviation(b, a, "platform", until=0.01), max_deviation(b, a, "platform")
    assert early.until == pytest.approx(0.01, abs=1e-9)
    assert early.displacement < 0.6 * late.displacement  # the wobble grows linearly over the first 20 ms


def test_runs_without_common_times_are_refused():
    run = synthetic.run()
    with pytest.raises(ValueError, match="no output time in common"):
        max_deviation(run, run.assign_coords(time=run.time + 3e-5), "platform")


def test_horizon_is_where_members_part(run: xr.Dataset):
    found = synthetic.ensemble(run, growth=60.0)
    time, velocity = found.time.values, found.velocity.values
    end = separation_time(time, velocity)
    peak = np.linalg.norm(velocity, axis=-1).max()
    at = int(np.searchsorted(time, end - 1e-12))
    assert member_spread(velocity)[at] > 1e-3 * peak
    assert (member_spread(velocity)[:at] <= 1e-3 * peak).all()


def test_members_are_as_far_apart_as_the_body_in_which_they_differ_most():
    velocity = np.zeros((2, 1, 3, 3))  # two members, one time, three bodies: apart by 0, 2 and 10 m/s
    velocity[:, 0, 1, 0], velocity[:, 0, 2, 1:] = [-1.0, 1.0], [[-3.0, -4.0], [3.0, 4.0]]
    assert member_spread(velocity) == pytest.approx([5.0])


def test_horizon_of_members_that_stay_together_is_the_end(run: xr.Dataset):
    members = synthetic.ensemble(run, growth=0.0)
    assert separation_time(members.time.values, members.velocity.values) == run.time.values[-1]


def test_faster_growth_shortens_the_horizon(run: xr.Dataset):
    ends = [float(derive(run, synthetic.ensemble(run, growth=g)).ensemble_horizon) for g in (0.0, 40.0, 60.0, 90.0)]
    assert ends == sorted(ends, reverse=True)
    assert len(set(ends)) == 4


def test_an_ensemble_is_summarised_by_mean_spread_and_quantiles(run: xr.Dataset):
    """Evenly spaced members: the quantile q of them lies at the share q of their range."""
    members = synthetic.ensemble(run, members=5, growth=60.0)
    post, q = derive(run, members), np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    np.testing.assert_array_equal(post["quantile"].values, q)
    velocity = members.velocity.values
    known = velocity[0] + q[:, None, None, None] * (velocity[-1] - velocity[0])
    np.testing.assert_allclose(post.velocity_quantile.values, known, atol=1e-12)  # rounding of interpolation
    np.testing.assert_allclose(post.velocity_mean.values, velocity[2], atol=1e-12)
    # counts 21 to 25, shares 0.02 to 4.02
    assert float(post.impact_count_mean.sel(contact="A1")) == pytest.approx(23.0, rel=1e-14)
    assert float(post.impact_count_std.sel(contact="A1")) == pytest.approx(np.sqrt(2.5), rel=1e-14)
    assert post.contact_time_share_quantile.sel(contact="A1").values == pytest.approx(0.02 + 4.0 * q, rel=1e-12)
    assert post.peak_force_quantile.dims == ("quantile", "contact")


def test_ensemble_deviation_of_one_member_is_that_of_its_run():
    run, ideal = synthetic.run("sps4/csj", clearance=True, noise=1e-4), synthetic.run()
    same = synthetic.ensemble(run, members=3, growth=0.0)
    middle = ensemble_deviations(same, ideal, "platform")[1]  # the middle member is the run itself
    assert middle.velocity == max_deviation(run, ideal, "platform").velocity


def test_scene_without_contact_gets_no_contact_series():
    post = derive(synthetic.run())
    assert not [name for name in post.data_vars if str(name).startswith(("impact", "contact", "clearance", "eccentr"))]
    assert float(post.horizon) == synthetic.END


def test_contact_force_is_the_reaction_of_a_joint_with_clearance(run: xr.Dataset):
    post = derive(run)
    for joint, force in (("A1", run.contact_force.sel(contact="A1")), ("A2", run.joint_force.sel(joint="A2"))):
        np.testing.assert_array_equal(post.reaction.sel(joint=joint).values, np.linalg.norm(force.values, axis=-1))


def test_impacts_are_closings_paired_with_their_openings():
    post = derive(synthetic.run("sps4/csj", clearance=True))
    assert post.sizes["impact"] == synthetic.BURSTS.size == int(post.impact_count[0])
    np.testing.assert_allclose(post.impact_duration.values, synthetic.BURST_LENGTH, rtol=1e-9)
    assert set(post.impact_separation_speed.values) == {0.18}
    assert float(post.clearance[0]) == pytest.approx(0.5e-3, rel=1e-12)


@pytest.mark.parametrize("slow, impacts", [(0.99e-4, 0), (1.01e-4, 1)])
def test_slow_closings_are_no_impacts(run: xr.Dataset, slow: float, impacts: int):
    """Just below and just above the threshold of 1e-4 m/s that the pages name, wherever impacts are selected."""
    speed = run.event_approach_speed.values.copy()
    speed[0] = slow
    run = run.assign(event_approach_speed=("event", speed))
    expected = synthetic.BURSTS.size - 1 + impacts
    assert derive(run).sizes["impact"] == expected
    assert quantities.contact_values(run, Quantity("A1", "impact_times")).size == expected


def test_an_impact_that_has_not_ended_is_counted_and_listed_without_its_end(run: xr.Dataset):
    run = run.isel(event=slice(0, -1))
    post = derive(run)
    assert int(post.impact_count[0]) == synthetic.BURSTS.size == post.sizes["impact"]
    for name in ("impact_duration", "impact_separation_speed"):
        assert np.isnan(post[name].values).tolist() == [False] * (synthetic.BURSTS.size - 1) + [True]


def test_run_and_post_mean_the_same_by_horizon(run: xr.Dataset):
    post = derive(run.assign(horizon=0.123), synthetic.ensemble(run))
    assert float(post.horizon) == 0.123
    assert float(post.ensemble_horizon) < 0.123  # the made-up members part earlier


def test_time_in_contact_is_that_of_the_located_events(run: xr.Dataset):
    """Whatever rows a run has: those inside contacts are denser than elsewhere."""
    expected = synthetic.BURSTS.size * synthetic.BURST_LENGTH / synthetic.END
    for rows in (run, run.isel(time=slice(None, None, 7))):
        ends = rows.time.values[-1] - rows.time.values[0]
        assert float(derive(rows).contact_time_share[0]) == pytest.approx(expected * synthetic.END / ends, rel=1e-9)


def test_a_contact_that_is_closed_at_the_end_counts_until_then(run: xr.Dataset):
    """Without its opening it lasts until the end of the run instead of for 0.2 ms."""
    duration = run.event_duration.values.copy()
    last = np.flatnonzero(np.isfinite(duration))[-1]
    duration[last] = np.nan
    found = derive(run.assign(event_duration=("event", duration)).isel(event=slice(0, -1)))
    seconds = (synthetic.BURSTS.size - 1) * synthetic.BURST_LENGTH + synthetic.END - run.event_time.values[last]
    assert float(found.contact_time_share[0]) == pytest.approx(seconds / synthetic.END, rel=1e-9)


@pytest.mark.parametrize("nudge", [-1.0, 1.0])
def test_rounding_does_not_choose_between_two_equal_peaks(run: xr.Dataset, nudge: float):
    """A stroke that ends as it began has its largest acceleration twice."""
    acceleration = np.zeros_like(run.acceleration.values)
    acceleration[3] = -70.0
    acceleration[-4] = 70.0 * (1.0 + nudge * np.finfo(float).eps)
    post = derive(run.assign(acceleration=(run.acceleration.dims, acceleration)))
    assert (post.peak_acceleration_time == run.time.values[3]).all()


def test_sections_are_never_interpolated():
    time = np.array([0.0, 0.1, 0.2, 0.3])
    (found,) = at_times(time, np.array([0.1, 0.15, 0.3]), 10.0 * time)
    np.testing.assert_allclose(found, [1.0, 3.0])
