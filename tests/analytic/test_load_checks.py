"""Scenes with springs, dampers, drives and new joints against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.analytic.mechanism_runs import run
from tests.properties.mechanisms import body, frame, ground, joint, scene, simulate


@pytest.mark.slow
def test_a_damped_oscillator_decays_as_its_closed_form() -> None:
    dataset = run("checks/oscillator")
    m, k, c = 2.0, 200.0, 4.0
    decay = c / (2.0 * m)
    omega = np.sqrt(k / m - decay**2)
    t = dataset.time.values
    x = 0.1 * np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    # rtol 1e-10 over some tens of steps
    assert dataset.load_length.sel(load="spring").values - 0.25 == pytest.approx(x, abs=1e-10)
    lost = 0.5 * k * 0.1**2 - (dataset.kinetic + dataset.elastic)
    assert dataset.dissipated.values == pytest.approx(lost.values, abs=1e-9)


@pytest.mark.slow
def test_an_elastic_pendulum_bounces_and_swings_as_theory_says() -> None:
    dataset = run("checks/spring_pendulum").sel(body="ball")
    k, l0, g = 500.0, 0.8, 9.81
    t, hanging = dataset.time.values, l0 + g / k
    length = hanging - (hanging - 0.79962) * np.cos(np.sqrt(k) * t)
    # the sideways 0.01 mm changes the length in second order, 1e-10 m
    assert -dataset.position.values[:, 2] == pytest.approx(length, abs=1e-9)

    def hill(_: float, y: np.ndarray) -> list[float]:
        stretch = hanging - (hanging - 0.79962) * np.cos(np.sqrt(k) * _) - l0
        return [y[1], -k * stretch / (stretch + l0) * y[0]]

    known = solve_ivp(hill, (0.0, 2.0), [1e-5, 0.0], "DOP853", t_eval=t, rtol=1e-12, atol=1e-18)
    # next order of the amplitude, and rtol of the size of the mechanism
    assert dataset.position.values[:, 0] == pytest.approx(known.y[0], abs=1e-9)


@pytest.mark.slow
def test_a_cardan_joint_turns_unevenly_by_its_formula() -> None:
    dataset = run("checks/universal_shaft")
    bend, first = np.radians(30.0), dataset.drive_position.sel(drive="motor").values
    second = dataset.sel(coordinate="plate.rotation")
    known = np.unwrap(np.arctan2(np.sin(first), np.cos(bend) * np.cos(first)))
    # closed to 1e-13 of a mechanism of some 0.1 m
    assert second.joint_position.values == pytest.approx(known, abs=1e-10)
    ratio = np.cos(bend) / (1.0 - np.sin(bend) ** 2 * np.cos(first) ** 2)
    assert second.joint_velocity.values == pytest.approx(4.0 * np.pi * ratio, rel=1e-10)
    # power in is power stored: the motor's torque against the change of the kinetic energy
    inertia = 5e-4 + 2e-4
    power = inertia * second.joint_velocity.values * second.joint_acceleration.values
    cross = dataset.kinetic.values - 0.5 * inertia * second.joint_velocity.values**2
    # the second shaft turns about its centre, which the crossing of the axes holds: the rest is the first shaft's
    assert cross == pytest.approx(0.5 * 1e-3 * (4.0 * np.pi) ** 2, rel=1e-10)
    assert dataset.drive_force.sel(drive="motor").values * 4.0 * np.pi == pytest.approx(power, abs=1e-9)


@pytest.mark.slow
def test_a_joint_with_one_freedom_driven_and_one_free() -> None:
    dataset = run("checks/spindle")
    t, omega = dataset.time.values, 3.0 * np.pi
    about_axis = 0.04 + 3.0 * 0.1**2
    turning = -np.radians(60.0) * omega**2 * np.cos(omega * t)
    assert dataset.drive_force.sel(drive="turning").values == pytest.approx(about_axis * turning, abs=1e-10)
    angle = dataset.joint_position.sel(coordinate="axis.rotation").values
    assert angle == pytest.approx(np.radians(60.0) * (np.cos(omega * t) - 1.0), abs=1e-13)
    fall = -3.0 * 9.81 / 300.0 * (1.0 - np.cos(10.0 * t))
    assert dataset.joint_position.sel(coordinate="axis.translation").values == pytest.approx(fall, abs=1e-10)
    assert np.abs(dataset.energy_error.values).max() < 1e-9


@pytest.mark.slow
def test_a_partly_driven_joint_may_be_written_the_other_way_round() -> None:
    """With its first frame on the rotor, both coordinates change their signs, and so do the law and the force."""
    known = run("checks/spindle")
    other = run(
        "checks/spindle",
        (
            ("joint.axis.between", ("rotor.axis", "ground.axis")),
            ("drive.turning.law.amplitude", ("-60 deg",)),
            ("drive.turning.law.offset", "60 deg"),
        ),
    )
    # the same equations but for the order in which numbers are added
    for field, sign in (("position", 1.0), ("acceleration", 1.0), ("drive_force", -1.0), ("joint_position", -1.0)):
        assert sign * other[field].values == pytest.approx(known[field].values, abs=1e-9), field


@pytest.mark.slow
def test_a_torsion_spring_counts_its_turns() -> None:
    """Released five half turns from its rest, it swings through all of them: theta = 5 pi (1 - cos(w t))."""
    spring = {"type": "joint-spring", "joint": "hinge", "stiffness": "2 N m/rad", "rest": 5.0 * np.pi}
    wheel = body((0.0, 0.0, 0.0), frames={"axle": frame((0.0, 0.0, 0.0))}, com=[0.0, 0.0, 0.0])
    table = scene(
        {"base": ground(O=(0.0, 0.0, 0.0)), "wheel": wheel},
        {"hinge": joint("revolute", "base.O", "wheel.axle")},
        end=1.0,
        load={"spring": spring},
        output={"interval": 0.01},
    )
    dataset = simulate(table)
    known = 5.0 * np.pi * (1.0 - np.cos(np.sqrt(2.0 / 0.015) * dataset.time.values))
    # rtol 1e-12 of thirty radians over some ten steps
    assert dataset.joint_position.values[:, 0] == pytest.approx(known, abs=1e-9)
    assert dataset.load_length.values[:, 0] == pytest.approx(known, abs=1e-9)
    assert dataset.elastic.values == pytest.approx((known - 5.0 * np.pi) ** 2, abs=1e-7)


@pytest.mark.slow
def test_a_spring_of_no_length_is_an_ordinary_spring() -> None:
    """A free body on it moves on an ellipse that may pass near, or through, the point where it has no direction."""
    table = scene(
        {
            "base": ground(O=(0.0, 0.0, 0.0)),
            "ball": body((0.2, 0.0, 0.0), frames={"C": frame((0.0, 0.0, 0.0))}, com=[0.0, 0.0, 0.0]),
        },
        {},
        end=1.0,
        load={"s": {"type": "spring-damper", "between": ["base.O", "ball.C"], "stiffness": 100.0, "free_length": 0.0}},
    )
    dataset = simulate(table)
    known = 0.2 * np.cos(10.0 * dataset.time.values)
    assert dataset.position.values[:, 0, 0] == pytest.approx(known, abs=1e-10)
    at_rest = dict(
        table, body={**table["body"], "ball": body((0.0, 0.0, 0.0), frames={"C": frame((0, 0, 0))}, com=[0, 0, 0])}
    )
    still = simulate(at_rest)
    assert np.abs(still.position.values).max() == 0.0
