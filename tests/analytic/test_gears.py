"""Gears and racks against closed forms: Willis' equation, equivalent inertia, reactions; what repeats is redundant."""

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.mobility import analyse
from flexclear.pipeline.dynamics.model.model import tabulate
from tests.analytic.mechanism_runs import TREE, bundles, run

SCENE = "checks/gears"
G = 9.81


def test_a_planetary_train_turns_by_willis_equation() -> None:
    dataset = run(SCENE)
    speed = {name: dataset.joint_velocity.sel(coordinate=name).values for name in dataset.coordinate.values}
    # ring fixed: sun = (1 + 90/30) carrier; planet = (1 - 90/30) carrier against the ground; closed to rounding
    assert speed["sun_bearing"] == pytest.approx(4.0 * speed["carrier"], abs=1e-9)
    for planet in ("P1", "P2", "P3"):
        assert speed[planet] + speed["carrier"] == pytest.approx(-2.0 * speed["carrier"], abs=1e-9)
    # the brake of 0.5 N m at the sun turns all of it: inertia and torque reduced to the carrier
    planets = 3.0 * (0.2 * 0.09**2 + 2e-4 * 2.0**2)
    inertia = 0.02 + 0.002 * 4.0**2 + planets
    known = -0.5 * 4.0 / inertia * dataset.time.values
    # rtol 1e-10 of some tens of rad/s
    assert speed["carrier"] == pytest.approx(known, abs=1e-7)
    assert dataset.joint_position.sel(coordinate="carrier").values == pytest.approx(
        0.5 * known * dataset.time.values, abs=1e-7
    )


def test_a_rack_falls_as_its_mass_and_the_reduced_inertia_say() -> None:
    dataset = run(SCENE)
    reduced = 0.5 + 0.004 / 0.1**2
    fall = -0.5 * G / reduced
    t = dataset.time.values
    assert dataset.joint_position.sel(coordinate="rack").values == pytest.approx(0.5 * fall * t**2, abs=1e-9)
    wheel = dataset.joint_velocity.sel(coordinate="wheel").values
    assert wheel == pytest.approx(-fall * t / 0.1, abs=1e-7)
    # what the teeth hold the rack with: its weight less its acceleration
    assert dataset.gear_force.sel(gear="rack").values == pytest.approx(0.5 * (G + fall), rel=1e-9)


def test_torques_of_the_teeth_accelerate_a_planet() -> None:
    """Both gears of all planets turn them: what the dependent ones carry is nothing, the sum is determined."""
    dataset = run(SCENE)
    carrier = -2.0 / (0.02 + 0.002 * 16.0 + 3.0 * (0.2 * 0.09**2 + 8e-4))
    total = sum(dataset.gear_force.sel(gear=f"{kind}{k}").values for k in (1, 2, 3) for kind in "SR")
    assert total == pytest.approx(3.0 * 2e-4 * (-2.0 * carrier), abs=1e-8)
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * np.abs(dataset.load_work.values).max()


def test_gears_count_in_the_mobility_and_repeated_ones_as_redundant() -> None:
    model = tabulate(build(load_scene(TREE / "scenes" / f"{SCENE}.toml"), {}))
    found = analyse(model)
    # one of the train, one of rack and pinion; five rows of the sun's second bearing, its ring's as well, and the
    # gears of two planets that repeat the ratio of sun and ring
    assert found.mobility == 2
    assert found.redundant == found.rows - (model.nv - 2)
    without = load_scene(TREE / "scenes" / f"{SCENE}.toml")
    fewer = without.model_copy(update={"gear": {k: v for k, v in without.gear.items() if k not in ("S3", "R3")}})
    assert analyse(tabulate(build(fewer, {}))).mobility == 3
    one = without.model_copy(update={"gear": {k: v for k, v in without.gear.items() if k != "R3"}})
    assert analyse(tabulate(build(one, {}))).redundant == found.redundant - 1


def crank(*changes: tuple[str, object]) -> xr.Dataset:
    """The slider-crank with a flexible rod, let go at speed without a drive."""
    free = {"drive": {}, "body.crank.angular_velocity": (0.0, 0.0, 150.0), "time.end": "10 ms"}
    scene = load_scene(TREE / "scenes" / "checks" / "flexible_slider_crank.toml", {**free, **dict(changes)})
    return dynamics.simulate(scene, bundles(scene), silent)


def wheel(name: str, inertia: float, joint: str, ratio: float) -> list[tuple[str, object]]:
    """A wheel on the ground that is geared to a joint."""
    body = {"type": "rigid", "mass": 1.0, "inertia": [inertia] * 3, "pose": {}, "frames": {"axis": {}}}
    revolute = {"type": "revolute", "between": ["ground.main", f"{name}.axis"]}
    gear = {"first": joint, "second": name, "ratio": ratio}
    return [(f"body.{name}", body), (f"joint.{name}", revolute), ("gear", {name: gear})]


@pytest.mark.slow
def test_a_geared_flywheel_is_inertia_of_the_crank_of_a_flexible_mechanism() -> None:
    known = crank(("body.crank.inertia", (0.002727, 0.002727, 0.002727 + 4.0 * 2e-4)))
    geared = crank(*wheel("flywheel", 2e-4, "main", -2.0))
    turn = "main"
    for name in ("joint_position", "joint_velocity"):
        one, other = (run[name].sel(coordinate=turn).values for run in (known, geared))
        # rtol 1e-10 of 150 rad/s and its stiff rod over some hundred steps
        assert other == pytest.approx(one, abs=1e-6 * np.abs(one).max()), name
    assert geared.joint_velocity.sel(coordinate="flywheel").values == pytest.approx(
        -2.0 * geared.joint_velocity.sel(coordinate=turn).values, abs=1e-9
    )


@pytest.mark.slow
def test_a_gear_on_the_pin_of_a_flexible_rod_takes_no_energy() -> None:
    """The pin's angle has the rod's deformation in it; what the gear does there and at the wheel cancels."""
    geared = crank(*wheel("follower", 5e-5, "crank_pin", 1.5))
    pin, follower = (geared.joint_velocity.sel(coordinate=name).values for name in ("crank_pin", "follower"))
    assert follower == pytest.approx(1.5 * pin, abs=1e-8)
    assert np.ptp(follower) > 10.0
    # integrated at rtol 1e-10 over some hundred steps
    assert np.abs(geared.energy_error).max() < 1e-7 * geared.kinetic.max()
