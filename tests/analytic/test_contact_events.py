"""Events that are easily missed: grazing, simultaneous and resting contacts, short stops of the sliding."""

import math

import numpy as np
import pytest
import xarray as xr

from tests.analytic.mechanism_runs import Overrides, of_kind, run
from tests.properties.mechanisms import simulate

BOUNCE, ROLLING = "checks/bounce", "checks/socket_rolling"
CLEARANCE, GRAVITY, MASS, STIFFNESS = 0.1, 9.81, 1.0, 1e8


def thrown_up(beyond: float) -> xr.Dataset:
    """The ball thrown up from the centre so that, without the wall, it would turn this far [m] beyond it."""
    speed = math.sqrt(2.0 * GRAVITY * (CLEARANCE + beyond))
    return run(BOUNCE, (("body.ball.velocity", (0.0, 0.0, speed)), ("time.end", "0.2 s")))


@pytest.mark.parametrize("beyond", [1e-12, 1e-9, 1e-6])
def test_a_grazing_contact_is_located_however_short_it_is(beyond: float) -> None:
    dataset = thrown_up(beyond)
    (begun,), (ended,) = of_kind(dataset, "closing"), of_kind(dataset, "opening")
    # the gap is located to 1e-13 of the clearance, the speed is the root of twice that share of `beyond`
    known, fraction = math.sqrt(2.0 * GRAVITY * beyond), 1e-13 * CLEARANCE / beyond
    assert dataset.event_approach_speed.values[begun] == pytest.approx(known, rel=fraction + 1e-6)
    turns = math.sqrt(2.0 * CLEARANCE / GRAVITY)
    assert float(dataset.event_time[begun]) < turns < float(dataset.event_time[ended])
    assert float(dataset.event_time[ended] - dataset.event_time[begun]) <= 2.0 * known / GRAVITY * (1.0 + fraction)
    assert float(dataset.event_peak_penetration[begun]) <= beyond * (1.0 + fraction)


@pytest.mark.parametrize("short", [1e-12, 1e-9])
def test_a_near_miss_is_no_contact(short: float) -> None:
    dataset = thrown_up(-short)
    assert dataset.sizes["event"] == 0
    # an output falls within 0.5 ms of the turn
    assert float(dataset.contact_gap.min()) == pytest.approx(short, abs=0.5 * GRAVITY * 0.5e-3**2)


def test_simultaneous_contacts_are_all_located_and_independent() -> None:
    ball = {"type": "rigid", "mass": MASS, "inertia": [4e-3] * 3, "pose": {}, "frames": {"centre": {}}}
    law = {"law": "lankarani-nikravesh", "restitution": 0.7, "stiffness": STIFFNESS}
    joint = {"type": "clearance-spherical", "clearance": CLEARANCE, "ball_radius": 0.1, "normal": law}
    names = ("left", "middle", "right")
    table = {
        "title": "three balls fall at once",
        "body": {"ground": {"type": "ground", "frames": {"socket": {}}}, **dict.fromkeys(names, ball)},
        "joint": {name: {**joint, "between": ["ground.socket", f"{name}.centre"]} for name in names},
        "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -GRAVITY]}},
        "time": {"end": 0.5},
        "output": {"interval": 0.01},
    }
    dataset, alone = simulate(table), run(BOUNCE)
    begun, known = of_kind(dataset, "closing"), of_kind(alone, "closing")[:2]
    assert sorted(dataset.event_contact.values[begun[:3]]) == sorted(dataset.contact.values)
    assert dataset.event_time.values[begun] == pytest.approx(np.repeat(alone.event_time.values[known], 3), abs=1e-8)
    assert np.ptp(dataset.event_time.values[begun[:3]]) <= 1e-12
    speeds = np.repeat(alone.event_approach_speed.values[known], 3)
    # the ball alone and the three take other steps, at 1e-10
    assert dataset.event_approach_speed.values[begun] == pytest.approx(speeds, rel=1e-8)


def test_a_bouncing_ball_comes_to_rest_in_contact() -> None:
    overrides: Overrides = (("joint.contact.normal.restitution", 0.3), ("time.end", "1.5 s"))
    dataset = run(BOUNCE, overrides)
    begun, ended = of_kind(dataset, "closing"), of_kind(dataset, "opening")
    assert len(begun) == len(ended) + 1
    assert len(begun) < 60
    # the latched rate of the last impact damps the little that is left of it
    assert dataset.contact_normal_force.values[-1, 0] == pytest.approx(MASS * GRAVITY, rel=1e-3)
    assert np.diff((dataset.kinetic + dataset.potential + dataset.elastic).values).max() <= 1e-9 * MASS * GRAVITY


def test_a_stop_of_the_sliding_within_one_step_is_noted() -> None:
    """A ball that cannot turn slides to and fro, so smoothly that steps do not see its stop of a microsecond."""
    angle, slow, resting = 0.5, 1e-6, 8.03e-8  # (m g cos(angle) / K)^(2/3)
    place = ((5e-4 + resting) * math.sin(angle), 0.0, -(5e-4 + resting) * math.cos(angle))
    law = (
        ("law", "modified-coulomb"), ("static", 1e-6), ("dynamic", 1e-6), ("v_static", slow), ("v_dynamic", 2.0 * slow),
    )  # fmt: skip
    overrides: Overrides = (
        ("joint.contact.friction", law), ("body.ball.pose.position", place), ("time.end", "60 ms"),
        ("body.ball.inertia", (10.0, 10.0, 10.0)), ("output.interval", "20 us"),
    )  # fmt: skip
    dataset = run(ROLLING, overrides)
    stops, goes = of_kind(dataset, "sticking"), of_kind(dataset, "slipping")
    x = dataset.velocity.sel(body="ball", axis="x").values
    turns = np.flatnonzero(x[1:-1] * x[2:] < 0.0) + 1  # the first output is at rest
    assert len(turns) == 2
    # next to the start's
    assert len(stops) == len(turns)
    assert len(goes) == len(turns) + 1
    for k, stop, go in zip(turns, stops, goes[1:], strict=True):
        between = dataset.event_time.values[[stop, go]]
        assert dataset.time.values[k] <= between[0] < between[1] <= dataset.time.values[k + 1]
        pulled = np.linalg.norm(dataset.acceleration.sel(body="ball").values[k, :2])
        # the level is passed twice; the acceleration is that of the nearest output, within 20 us of 45 ms
        assert between[1] - between[0] == pytest.approx(2.0 * slow / pulled, rel=0.2)
