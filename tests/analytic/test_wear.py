"""Wear of contacts and what impacts take, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from flexclear.pipeline.core.artifacts.schema import RUN
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.post.single_run.series import PIECES, derive, spread_over_surface
from tests.analytic.mechanism_runs import run
from tests.properties.mechanisms import Table, frame, joint, rigid, scene, simulate

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
