"""Balls on planes, pins in slots, wear, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts.schema import RUN
from flexclear.post.single_run.series import PIECES, derive, spread_over_surface
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.variants import ideal
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, impacts, run
from tests.properties.mechanisms import Table, frame, joint, rigid, scene, simulate
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
    with pytest.raises(InputError, match="that can be removed"):
        ideal(load_scene(TREE / "scenes" / f"{name}.toml"))


# Wear, and what impacts take -----------------------------------------------------------------------------------------

RADIUS, LENGTH, WEIGHT, STIFFNESS, CLEARANCE = 0.01, 0.02, 50.0, 1e6, 1e-4
TURNS, SECONDS = 2, 0.25
WAY = TURNS * 2.0 * np.pi * RADIUS
WEAR = {"coefficient": 1e-4, "hardness": 2e9, "sectors": 36}
ACROSS = {"axes": {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}}


def hanging() -> Table:
    """A carrier that hangs on a turning shaft by a hole with clearance, and cannot turn."""
    start = CLEARANCE + WEIGHT / STIFFNESS
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"bearing": ACROSS, "guide": {}}},
        "shaft": rigid(1.0, 0.01, {"pin": ACROSS}, pose={}),
        "carrier": rigid(WEIGHT / 10.0, 0.01, {"guide": {}, "hole": ACROSS}, pose=frame((0.0, 0.0, -start))),
    }
    hole = joint("clearance-revolute", "carrier.hole", "shaft.pin") | {
        "clearance": CLEARANCE,
        "pin_radius": RADIUS,
        "length": LENGTH,
        "normal": {"law": "kelvin-voigt", "stiffness": STIFFNESS, "damping": 1e3},
        "initial_approach_speed": 0.0,
        "wear": WEAR,
    }
    joints = {"guide": joint("prismatic", "ground.guide", "carrier.guide"), "hole": hole}
    joints["bearing"] = joint("revolute", "ground.bearing", "shaft.pin")
    turning = {"type": "polynomial", "coefficients": [0.0, TURNS * 2.0 * np.pi / SECONDS]}
    gravity = {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -10.0]}}
    table = scene(bodies, joints, SECONDS, 1e-10, load=gravity, drive={"turn": {"joint": "bearing", "law": turning}})
    table["output"]["interval"] = SECONDS / 72.0
    return table


def test_a_turning_pin_wears_by_archards_law() -> None:
    """Depth = k F s/(H A): all around the pin, and in the one sector of the hole where it hangs."""
    dataset = simulate(hanging())
    post = derive(dataset)
    volume = WEAR["coefficient"] * WEIGHT * WAY / WEAR["hardness"]
    # the start is at rest to rounding; rtol 1e-10
    assert float(post.wear_distance[0]) == pytest.approx(WAY, rel=1e-8)
    assert float(post.wear_volume[0]) == pytest.approx(volume, rel=1e-8)
    around = 2.0 * np.pi * RADIUS * LENGTH
    # 72 rows over two turns: one in 16 pieces of a sector may fall into the next one
    assert post.wear_depth_inner.values[0, 0] == pytest.approx(volume / around, rel=1.01 / PIECES)
    assert post.wear_depth_inner.values.mean() == pytest.approx(volume / around, rel=1e-8)
    sector = around * (1.0 + CLEARANCE / RADIUS) / WEAR["sectors"]
    hole = post.wear_depth_outer.values[0, 0]
    assert sorted(hole)[-1] == pytest.approx(volume / sector, rel=1e-8)
    assert np.count_nonzero(hole) == 1
    # the pin presses the hole's upper side: z of the world is -y of the frame
    assert hole[26] + hole[27] == hole.max()
    assert post.wear_impulse_outer.values.sum() == pytest.approx(WEIGHT * SECONDS, rel=1e-8)


def test_without_wear_nothing_of_it_is_recorded() -> None:
    table = hanging()
    del table["joint"]["hole"]["wear"]
    assert not Scene.model_validate(table).worn()
    assert {name for name in RUN if name.startswith("wear_")}  # what there would be
    dataset = simulate(table)
    assert not [name for name in dataset if str(name).startswith("wear_")]
    assert not [name for name in derive(dataset) if str(name).startswith("wear_")]


def test_a_map_keeps_totals_and_puts_them_where_the_contact_was() -> None:
    """On a sphere in bands of equal height, which have equal areas."""
    angle = np.linspace(0.0, np.pi, 181)
    way = np.stack([np.cos(angle), np.sin(angle), np.full(181, 0.3)], axis=1)
    found = spread_over_surface(way, np.stack([angle, angle**2], axis=1), 8, 10)
    assert found.sum(axis=(0, 1)) == pytest.approx([np.pi, np.pi**2], rel=1e-12)  # rounding
    band = int((0.3 / np.hypot(1.0, 0.3) + 1.0) / 2.0 * 10)
    # a step of the way is one degree; its pieces fall to one side of a border
    assert found[band, :4, 0] == pytest.approx(np.pi / 4.0, abs=np.radians(1.0) / PIECES)
    assert np.count_nonzero(found[:, 4:]) == 0


def test_an_impact_takes_what_the_rebound_lacks() -> None:
    """Its momentum turns around: of a ball of 1 kg, which has its weight on it meanwhile."""
    post = derive(run("checks/bounce"))
    done = np.isfinite(post.impact_separation_speed.values)
    before, after = post.impact_approach_speed.values[done], post.impact_separation_speed.values[done]
    known = before + after + 9.81 * post.impact_duration.values[done]
    # both come from one run at rtol 1e-10; impulses of later bounces are differences of a growing sum
    assert post.impact_impulse.values[done] == pytest.approx(known, rel=1e-8)
    loss = 0.5 * (before**2 - after**2)
    assert post.impact_damping_loss.values[done] == pytest.approx(loss, rel=1e-6, abs=1e-8)
    assert done.sum() > 3
