"""PID controllers against matrix exponentials, and a sampled one against its exact discretisation."""

import numpy as np
import pytest
from scipy.linalg import expm

from tests.analytic.mechanism_runs import run

SCENE = "checks/controllers"


def linear(A: list[list[float]], start: list[float], times: np.ndarray) -> np.ndarray:
    return np.array([expm(t * np.array(A)) @ start for t in times])


@pytest.mark.parametrize(
    "coordinate, inertia, stiffness, damping, target", [("A", 2.0, 200.0, 8.0, 0.1), ("D", 0.03, 3.0, 0.1, 9.0)]
)
def test_a_step_is_answered_as_a_system_of_second_order_does(
    coordinate: str, inertia: float, stiffness: float, damping: float, target: float
) -> None:
    """Of the rotor beyond a full turn."""
    dataset = run(SCENE)
    t, decay = dataset.time.values, damping / (2.0 * inertia)
    omega = np.sqrt(stiffness / inertia - decay**2)
    known = target * (1.0 - np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t)))
    # rtol 1e-11 over some hundred steps, of a metre or some radians
    assert dataset.joint_position.sel(coordinate=coordinate).values == pytest.approx(known, abs=1e-8 * target)


def test_the_integral_part_takes_a_disturbance_and_a_ramp_up() -> None:
    dataset = run(SCENE)
    m, P, I, D, ramp, push = 2.0, 300.0, 900.0, 20.0, 0.2, -5.0
    # x, v, z, t, 1
    A = [
        [0, 1, 0, 0, 0],
        [-P / m, -D / m, 1 / m, P * ramp / m, (D * ramp + push) / m],
        [-I, 0, 0, I * ramp, 0],
        [0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0],
    ]
    known = linear(A, [0.0, 0.0, 0.0, 0.0, 1.0], dataset.time.values)
    assert dataset.joint_position.sel(coordinate="B").values == pytest.approx(known[:, 0], abs=1e-9)
    assert dataset.controller_integral.sel(controller="B").values == pytest.approx(known[:, 2], abs=1e-7)
    given = P * (ramp * known[:, 3] - known[:, 0]) + known[:, 2] + D * (ramp - known[:, 1])
    assert dataset.controller_force.sel(controller="B").values == pytest.approx(given, abs=1e-7)


def test_the_integral_follows_a_limited_force() -> None:
    """At its limit all along, the slide falls away as under 1 N, and the integral part follows that limit."""
    dataset = run(SCENE)
    m, P, I, D, limit, rate = 2.0, 50.0, 30.0, 10.0, 1.0, 2.0
    t = dataset.time.values
    assert dataset.joint_position.sel(coordinate="C").values == pytest.approx(0.25 * t**2, abs=1e-10)
    assert dataset.controller_force.sel(controller="C").values == pytest.approx(limit, rel=1e-12)
    # z' = I (1 - x) + (limit - P (1 - x) - z + D v)/T with x = limit t^2/(2 m), over z, t^2, t, 1
    a = limit / (2.0 * m)
    A = [
        [-rate, (rate * P - I) * a, rate * D * 2.0 * a, I + rate * (limit - P)],
        [0, 0, 2, 0],
        [0, 0, 0, 1],
        [0, 0, 0, 0],
    ]
    known = linear(A, [0.0, 0.0, 0.0, 1.0], t)[:, 0]
    assert dataset.controller_integral.sel(controller="C").values == pytest.approx(known, abs=1e-8)


def test_a_sampled_controller_holds_its_force_between_samples() -> None:
    dataset = run(SCENE)
    m, P, I, D, T, low, high, target = 2.0, 200.0, 400.0, 10.0, 0.007, -15.0, 12.0, 0.1
    times, x, v, z, before = [], 0.0, 0.0, 0.0, target
    forces, places = [], []
    for k in range(143):
        error = target - x
        asked = P * error + z + D * (error - before) / T
        force = min(max(asked, low), high)
        z, before = z + T * (I * error + (force - asked) * I / P), error
        times.append(k * T)
        places.append(x)
        forces.append(force)
        x, v = x + v * T + 0.5 * force / m * T**2, v + force / m * T
    assert max(forces) == high
    at = np.searchsorted(dataset.time.values, np.array(times) - 1e-9)
    assert dataset.time.values[at] == pytest.approx(times, abs=1e-12)
    # between samples the motion is a parabola, which the method gets to rounding
    assert dataset.joint_position.sel(coordinate="E").values[at] == pytest.approx(places, abs=1e-11)
    # what is recorded at a sample is what held before it
    assert dataset.controller_force.sel(controller="E").values[at[1:]] == pytest.approx(forces[:-1], abs=1e-9)
    inside = np.searchsorted(times, dataset.time.values - 1e-9) - 1
    assert dataset.controller_force.sel(controller="E").values[1:] == pytest.approx(
        np.array(forces)[inside[1:]], abs=1e-9
    )
    work = float(dataset.load_work[-1])
    assert np.abs(dataset.energy_error.values).max() < 1e-9 * work
