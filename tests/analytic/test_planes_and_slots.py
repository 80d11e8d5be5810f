"""Balls on planes and pins in slots against closed forms: bounces, rolling and sliding, the Scotch yoke."""

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.variants import ideal
from flexclear.pipeline.core.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, impacts, run
from tests.reference import contact_solutions as exact

PLANE, YOKE = "checks/ball_on_plane", "checks/scotch_yoke"
G, SLOPE = 9.81, np.radians(30.0)


def test_a_ball_bounces_on_a_floor_as_in_one_dimension() -> None:
    dataset = run(PLANE)
    found = impacts(dataset, contact="floor")
    known = exact.bounces(1.0, 1e8, 0.7, G, 0.05, 0.5)
    assert len(found["start"]) == len(known)
    for name in ("start", "approach"):
        assert found[name] == pytest.approx([getattr(b, name) for b in known], abs=1e-7)
    # without friction it travels on, 5 m off the plane's origin
    position, t = dataset.position.sel(body="bouncing").values, dataset.time.values
    assert position[:, 0] == pytest.approx(0.3 * t, abs=1e-12)
    assert position[:, 1] == pytest.approx(-1.0 - 0.2 * t, abs=1e-12)


def along(dataset: xr.Dataset, body: str) -> tuple[np.ndarray, np.ndarray]:
    """Speed down the slope, and speed of the ball's surface against its centre where it touches."""
    down = np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
    return dataset.velocity.sel(body=body).values @ down, 0.1 * dataset.angular_velocity.sel(body=body).values[:, 1]


def test_a_ball_rolls_down_a_slope_by_five_sevenths() -> None:
    dataset = run(PLANE)
    speed, rolling = along(dataset, "rolling")
    # the regularised law lets it creep: mu(v) = 2/7 tan(slope) at a slip below v_static = 1 mm/s
    assert speed == pytest.approx(5.0 / 7.0 * G * np.sin(SLOPE) * dataset.time.values, abs=1e-3)
    creep = (speed - rolling)[dataset.time.values > 0.01]
    y = np.roots([-1.0, 0.0, 3.0, -2.0 * 2.0 / 7.0 * np.tan(SLOPE) / 0.5])
    slip = 1e-3 * float(min(root.real for root in y if 0.0 < root.real < 1.0))
    assert creep == pytest.approx(slip, rel=1e-3)
    assert dataset.contact_normal_force.sel(contact="grip").values == pytest.approx(G * np.cos(SLOPE), rel=1e-6)


def test_a_ball_slides_where_friction_is_too_small_to_roll() -> None:
    dataset = run(PLANE)
    speed, rolling = along(dataset, "sliding")
    t, mu = dataset.time.values, 0.1
    # until it slides at v_static, which takes 1 mm/s over 3 m/s^2, friction is smaller
    assert speed == pytest.approx(G * (np.sin(SLOPE) - mu * np.cos(SLOPE)) * t, abs=1e-3)
    assert rolling == pytest.approx(2.5 * mu * G * np.cos(SLOPE) * t, abs=1e-3)
    late = t > 0.1
    assert np.diff(speed[late]) / np.diff(t[late]) == pytest.approx(G * (np.sin(SLOPE) - mu * np.cos(SLOPE)), rel=1e-6)
    lost = dataset.contact_friction_loss.sel(contact="slip").values[-1]
    assert lost == pytest.approx(mu * G * np.cos(SLOPE) * np.trapezoid(speed - rolling, t), rel=1e-3)
    assert np.abs(dataset.energy_error.values).max() < 1e-7


def test_a_scotch_yoke_follows_the_cosine_within_its_clearance() -> None:
    dataset = run(YOKE)
    clearance, t = 1e-4, dataset.time.values
    off = dataset.position.sel(body="yoke").values[:, 0] - 0.05 * np.cos(20.0 * t)
    deep = float(dataset.contact_penetration.sel(contact="slot").max())
    assert 0.0 < deep < 0.5 * clearance
    assert np.abs(off).max() <= clearance + deep + 1e-9
    assert off.max() > 0.9 * clearance
    assert off.min() < -0.9 * clearance
    # pressed to a wall, it is driven by m r omega^2 cos(omega t) there
    pressed = (dataset.contact_gap.sel(contact="slot").values < 0.0) & (np.abs(np.cos(20.0 * t)) > 0.7) & (t > 0.1)
    force = dataset.contact_force.sel(contact="slot").values[:, 0]
    known = 0.5 * 0.05 * 20.0**2 * np.cos(20.0 * t)
    assert np.median(np.abs(force[pressed] / known[pressed] - 1.0)) < 0.05


def test_a_pin_meets_the_round_ends_of_its_slot() -> None:
    dataset = run(YOKE)
    found = impacts(dataset, contact="free")
    way, now, speed = 0.051, 0.0, 2.0
    for k, start in enumerate(found["start"]):
        now += (way if k == 0 else 2.0 * way) / speed
        assert start == pytest.approx(now, abs=1e-8)
        assert found["approach"][k] == pytest.approx(speed, rel=1e-6)
        now, speed = now + found["duration"][k], 0.5 * speed
    assert len(found["start"]) == 3
    across = dataset.position.sel(body="free").values[:, 1] - 0.15
    assert np.abs(across).max() < 1e-12


@pytest.mark.parametrize("name", [PLANE, YOKE])
def test_planes_and_slots_have_no_ideal_joint_in_their_place(name: str) -> None:
    """They are reported, and not replaced by something else."""
    with pytest.raises(InputError, match="that could be taken away"):
        ideal(load_scene(TREE / "scenes" / f"{name}.toml"))
