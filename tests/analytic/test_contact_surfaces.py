"""Balls on planes, pins in slots, wear, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts.schema import RUN
from flexclear.post.single_run.series import PIECES, derive, spread_over_surface, surface_area
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.start import Start
from flexclear.scene.variants import contacts_that_stay, ideal_scene
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, impacts, run
from tests.properties.mechanisms import Table, frame, joint, rigid, scene, simulate, simulated
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


def test_a_plane_has_no_ideal_joint_in_its_place() -> None:
    """It is reported, and not replaced by something else."""
    whole = load_scene(TREE / "scenes" / f"{PLANE}.toml")
    with pytest.raises(InputError, match="that can be removed"):
        ideal_scene(whole)
    assert contacts_that_stay({name: one.type for name, one in whole.joint.items()}) == list(whole.contacts())


def test_a_yoke_without_clearance_follows_the_cosine() -> None:
    """Its pin slides in the slot by the sine; a pin in a fixed slot flies along it, and turns with its body."""
    tight = ideal_scene(load_scene(TREE / "scenes" / f"{YOKE}.toml"))
    assert {name: one.type for name, one in tight.joint.items() if "slot" in name} == {"slot": "slot"}
    turning = tight.body["free"].model_copy(update={"angular_velocity": (0.0, 0.0, 3.0)})
    dataset = simulated(tight.model_copy(update={"body": tight.body | {"free": turning}}))
    t = dataset.time.values
    place = dataset.position.sel(body="yoke").values
    known = np.stack([0.05 * np.cos(20.0 * t), 0.0 * t, 0.0 * t], axis=1)
    # the drive prescribes all of it: rounding and the loop's closure
    np.testing.assert_allclose(place, known, rtol=0.0, atol=1e-10)
    slid = dataset.joint_position.sel(coordinate="slot.translation").values
    np.testing.assert_allclose(slid, 0.05 * np.sin(20.0 * t), rtol=0.0, atol=1e-10)
    # nothing acts on the free body: rounding of steps at 1e-9
    np.testing.assert_allclose(dataset.position.sel(body="free").values[:, 0], 2.0 * t, rtol=0.0, atol=1e-9)
    assert dataset.joint_position.sel(coordinate="free.rotation").values == pytest.approx(3.0 * t, abs=1e-9)
    force = dataset.joint_force.sel(joint="slot").values[:, 0]
    assert np.abs(force) == pytest.approx(np.abs(0.5 * 0.05 * 20.0**2 * np.cos(20.0 * t)), abs=1e-7)


CRANK, BELOW, ROCKER, COUPLER, RAIL = 0.08, 0.2, 0.43, 0.2, 0.25
STARTED: Table = {"joint": {"P": {"near": np.pi / 2}, "T": {"near": -1.48}}}


def shaper(**slot: Any) -> Scene:
    """Whitworth's quick return: a crank's pin in the slot of a rocker, which moves a ram by a coupler."""
    aside = {"position": [0.0, RAIL, 0.0], "axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"O": {}, "P": frame((0.0, -BELOW, 0.0)), "rail": aside}},
        "crank": rigid(5.0, 0.02, {"O": {}, "pin": frame((CRANK, 0.0, 0.0))}),
        "rocker": rigid(6.0, 0.1, {"P": {}, "slot": frame((0.2, 0, 0)), "T": frame((ROCKER, 0, 0))}, com=[0.22, 0, 0]),
        "coupler": rigid(1.0, 0.004, {"T": {}, "R": frame((COUPLER, 0.0, 0.0))}, com=[0.1, 0.0, 0.0]),
        "ram": rigid(6.0, 0.1, {"R": {}, "rail": {"axes": aside["axes"]}}),
    }
    joints = {
        "O": joint("revolute", "ground.O", "crank.O"),
        "P": joint("revolute", "ground.P", "rocker.P"),
        "T": joint("revolute", "rocker.T", "coupler.T"),
        "R": joint("revolute", "coupler.R", "ram.R"),
        "rail": joint("prismatic", "ground.rail", "ram.rail"),
        "slot": {"type": "slot", "between": ["rocker.slot", "crank.pin"]} | slot,
    }
    table = scene(bodies, joints, 1.0, 1e-7, start=STARTED)
    table["output"]["interval"] = 2e-3
    law = {"type": "polynomial", "coefficients": [np.pi / 2, 2.0 * np.pi]}
    cut = {"type": "point-force", "frame": "ram.R", "force": [-800.0, 0.0, 0.0]}
    return Scene.model_validate(table | {"drive": {"motor": {"joint": "O", "law": law}}, "load": {"cut": cut}})


def ram(t: np.ndarray, off: float = 0.0) -> np.ndarray:
    """Position of the ram along its rail [m] with the pin so far off the slot's middle line."""
    x, y = CRANK * np.cos(np.pi / 2 + 2.0 * np.pi * t), BELOW + CRANK * np.sin(np.pi / 2 + 2.0 * np.pi * t)
    angle = np.arctan2(y, x) - np.arcsin(off / np.hypot(x, y))
    top = ROCKER * np.stack([np.cos(angle), np.sin(angle)]) - np.array([[0.0], [BELOW]])
    return np.asarray(top[0] + np.sqrt(COUPLER**2 - (RAIL - top[1]) ** 2))


def test_a_loose_slot_moves_the_ram_of_a_quick_return_off_its_ideal_kinematics() -> None:
    """By what the geometry gives with the pin at a wall of the slot."""
    clearance, steel = 1e-4, {"youngs_modulus": 207e9, "poisson": 0.29}
    loose = {"type": "clearance-slot", "clearance": clearance, "travel": 0.2, "pin_radius": 0.012, "length": 0.02}
    loose |= {"slot_material": steel, "pin_material": steel, "normal": {"law": "flores", "restitution": 0.5}}
    whole = shaper(**loose).model_copy(update={"start": Start.model_validate(STARTED | {"at": "ideal"})})
    tight = simulated(ideal_scene(whole.model_copy(update={"start": Start.model_validate(STARTED)})))
    t = tight.time.values
    # prescribed motion through a loop: its closure
    assert tight.position.sel(body="ram").values[:, 0] == pytest.approx(ram(t), abs=1e-9)
    dataset = simulated(whole)
    t = dataset.time.values
    off = dataset.position.sel(body="ram").values[:, 0] - ram(t)
    # pressed as the ideal joint's force presses it, the pin starts at rest: the ram is off by the wall's distance
    wall = clearance + float(dataset.contact_penetration.sel(contact="slot")[0])
    walls = [float((ram(t[:1], side * wall) - ram(t[:1]))[0]) for side in (-1.0, 1.0)]
    # pins are pressed to 1e-9 of the clearance
    assert off[0] == pytest.approx(min(walls, key=lambda one: abs(one - off[0])), rel=1e-6)
    # so it is wherever the pin is pressed to a wall; the two walls differ at second order, by 1e-4 of it
    deep = dataset.contact_penetration.sel(contact="slot").values
    pressed, known = deep > 0.0, np.abs(ram(t, clearance + deep) - ram(t))
    assert np.abs(off)[pressed] == pytest.approx(known[pressed], rel=1e-3)
    # by 0.43/0.12 times the clearance where the pin is lowest, and by its depth there: together 0.5 mm
    assert np.abs(off).max() == pytest.approx(0.43 / 0.12 * (clearance + deep[np.abs(off).argmax()]), rel=0.01)


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
    assert not Scene.model_validate(table).wearing_joints()
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
    ball = {"ball_radius": 0.01, "clearance": 1e-3}
    areas = [surface_area(ball, side) for side in ("outer", "inner")]
    assert areas == pytest.approx([4e-6 * 121 * np.pi, 4e-4 * np.pi])


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
