"""State spaces against closed forms, natural frequencies, and small steps of the equations of motion."""

from typing import Any

import numpy as np
import pytest
import scipy.signal
import xarray as xr

from flexclear.dynamics import analyses
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import Table, ground, joint, rigid, scene, simulated

G = 9.81
#: A and B: rounding of some hundred products; C and D: differences over four points, with a part in 1e10 of the values
EXACT, DIFFERENCE = 1e-12, 1e-9


def matrices(given: Scene, **pose: Any) -> xr.Dataset:
    return analyses.state_space(given, bundles(given), silent, given.watched_quantities(), **pose)


def check(name: str, changes: dict[str, Any] | None = None) -> Scene:
    return load_scene(TREE / "scenes" / "checks" / f"{name}.toml", override=changes or {})


def same_poles(A: np.ndarray, vibrations: xr.Dataset, within: float) -> None:
    """Compare eigenvalues with those of `frequencies`, which lists one of each pair; within: of the largest, absolute
    because several zeros of one matrix are only known to the root of rounding."""
    size, omega = -vibrations.decay_rate.values, 2.0 * np.pi * vibrations.frequency.values
    pairs = np.concatenate([size + 1j * omega, (size - 1j * omega)[omega > 0.0]])
    missing = len(A) - len(pairs)  # motions without stiffness and damping have two zeros, and are listed once
    expected = np.sort_complex(np.concatenate([pairs, np.zeros(missing)]))
    found = np.sort_complex(np.linalg.eigvals(A))
    order = np.argsort(np.round(expected.imag, 3) + 1e-6 * expected.real)
    mine = np.argsort(np.round(found.imag, 3) + 1e-6 * found.real)
    np.testing.assert_allclose(found[mine], expected[order], rtol=0.0, atol=within * np.abs(expected).max())


def cart(k: int, mass: float) -> Table:
    return rigid(mass, 0.01, {"O": {}}, pose={"position": [0.0, float(k), 0.0]})


def carts() -> Scene:
    """Two carts on rails, held and joined by springs and a damper, with a force on the first."""
    spring = {"type": "joint-spring"}
    table = scene(
        {"ground": ground(a=(0.0, 0.0, 0.0), b=(0.0, 1.0, 0.0)), "first": cart(0, 2.0), "second": cart(1, 3.0)},
        {"a": joint("prismatic", "ground.a", "first.O"), "b": joint("prismatic", "ground.b", "second.O")},
        load={
            "hold": {**spring, "joint": "a", "stiffness": 50.0, "damping": 1.0},
            "between": {"type": "joint-expression", "joint": "a", "force": "-80 N/m * (a.position - b.position)"},
            "back": {"type": "joint-expression", "joint": "b", "force": "80 N/m * (a.position - b.position)"},
            "push": {"type": "joint-force", "joint": "a", "force": 0.5},
        },
        view={"watch": ["second.position.z", "first.acceleration.z", "a.position - b.position"]},
    )
    return Scene.model_validate(table)


def test_two_carts_are_their_mass_damping_and_stiffness_matrices() -> None:
    found = matrices(carts())
    K, C = np.array([[130.0, -80.0], [-80.0, 80.0]]), np.diag([1.0, 0.0])
    M = np.diag([2.0, 3.0])
    lower = -np.linalg.solve(M, np.hstack([K, C]))
    np.testing.assert_allclose(found.A, np.vstack([np.eye(2, 4, 2), lower]), rtol=0.0, atol=EXACT * 65.0)
    np.testing.assert_allclose(found.B, [[0.0], [0.0], [0.5], [0.0]], rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(found.C, [[0, 1, 0, 0], lower[0], [1, -1, 0, 0]], rtol=0.0, atol=DIFFERENCE * 65.0)
    np.testing.assert_allclose(found.D, [[0.0], [0.5], [0.0]], rtol=0.0, atol=DIFFERENCE)
    # the static solution under 0.5 N
    np.testing.assert_allclose(found.output_value, [0.01, 0.0, 0.0], rtol=0.0, atol=1e-12)
    assert found.state.values.tolist() == ["a", "b", "a rate", "b rate"]
    assert found.input.values.tolist() == ["load.push.force"]
    assert found.input_value.values.tolist() == [0.5]
    assert found.state_unit.values.tolist() == ["m", "m", "m/s", "m/s"]
    assert found.output_unit.values.tolist() == ["m", "m/s^2", "m"]


def pendulum(torque: Any, watch: list[str]) -> Scene:
    load = {"type": "joint-force", "joint": "hinge", "force": torque}
    return edited(check("pendulum"), {"load.motor": load, "view.watch": watch, "time.end": 1.5, "solver.rtol": 1e-12})


def test_a_pendulum_held_aside_by_a_torque() -> None:
    """Mass 1 kg, length 1 m: sin(angle) = torque/9.81, and the angle swings with g cos(angle)."""
    torque = 3.0
    found = matrices(pendulum(torque, ["bob.position.x", "hinge.force.y"]))
    cosine = np.sqrt(1.0 - (torque / G) ** 2)
    np.testing.assert_allclose(found.A, [[0.0, 1.0], [-G * cosine, 0.0]], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(found.B, [[0.0], [1.0]], rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(np.abs(found.C[0]), [cosine, 0.0], rtol=0.0, atol=DIFFERENCE)
    # the force along the rod holds the weight; across it, an acceleration lifts the bob
    np.testing.assert_allclose(found.output_value[1], G, rtol=1e-9)
    np.testing.assert_allclose(np.abs(found.D[1, 0]), torque / G, rtol=1e-8)


def test_a_small_step_of_the_torque_moves_the_pendulum_as_the_matrices_say() -> None:
    """The step is a part in 1e5 of the torque that lifts the bob by 90 degrees, so squares are a part in 1e5."""
    watch, step, rise = ["bob.position.x", "bob.velocity.x", "hinge.force.x"], 1e-4, 1e-6
    found = matrices(pendulum(3.0, watch))
    rising = {"type": "step", "start": [0.0], "end": [rise], "change": [step]}
    law = {"type": "sum", "laws": [{"type": "constant", "value": 3.0}, rising]}
    run = simulated(edited(pendulum(law, watch), {"start": {"at": "equilibrium"}, "output.interval": 0.05}))
    plant = scipy.signal.StateSpace(*(found[name].values for name in "ABCD"))
    times = np.linspace(0.0, 1.5, 31)
    _, response, _ = scipy.signal.lsim(plant, np.full(len(times), step), times)
    run = run.sel(time=times, method="nearest")
    series = [run.position.sel(body="bob", axis="x"), run.velocity.sel(body="bob", axis="x")]
    series.append(run.joint_force.sel(joint="hinge", axis="x"))
    for k, values in enumerate(series):
        moved = values.values - found.output_value.values[k]
        # the second-order part of the forces is larger: 9.81 times that of the positions
        np.testing.assert_allclose(moved[1:], response[1:, k], rtol=0.0, atol=1e-4 * np.abs(response[:, k]).max())


@pytest.mark.parametrize("held", [True, False])
def test_a_drive_is_held_or_becomes_the_force_that_holds_it(held: bool) -> None:
    """The pendulum at 0.3 rad from the vertical: torque -g sin(0.3)."""
    drive = {"joint": "hinge", "law": {"type": "constant", "value": 0.3}}
    changes = {
        "drive": {"motor": drive},
        "body.bob.pose": None,
        "view": {"watch": ["bob.position.x"]},
        "body.bob.com": [0.0, -1.0, 0.0],
    }
    given = check("pendulum", changes)
    found = matrices(given, held=held)
    if held:
        assert found.sizes["state"] == found.sizes["input"] == 0
        assert found.D.shape == (1, 0)
        return
    assert found.input.values.tolist() == ["drive.motor.force"]
    np.testing.assert_allclose(found.input_value, [G * np.sin(0.3)], rtol=1e-10)
    np.testing.assert_allclose(found.A, [[0.0, 1.0], [-G * np.cos(0.3), 0.0]], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.B, [[0.0], [1.0]], rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(found.C, [[np.cos(0.3), 0.0]], rtol=0.0, atol=DIFFERENCE)
    np.testing.assert_allclose(found.output_value, [np.sin(0.3)], rtol=1e-12)


def test_a_controller_keeps_its_integral_as_a_state_and_settles() -> None:
    """2 kg under k_p = 300, k_i = 900, k_d = 20 SI: transfer function (k_d s^2 + k_p s + k_i)/(m s^3 + ...)."""
    changes = {"load.B.reference": "0.2 m", "view.watch": ["B.position"], "load.E": None, "load.C": None}
    found = matrices(edited(check("controllers"), changes))
    inputs, outputs = found.input.values.tolist(), found.output.values.tolist()
    assert outputs == ["B.position"]
    np.testing.assert_allclose(found.output_value, [0.2], rtol=1e-9)  # reached in spite of a force of -5 N
    assert "load.B integral" in found.state.values
    assert found.state_unit.sel(state="load.B integral") == "N"
    at, rate = inputs.index("load.B.reference"), inputs.index("load.B.reference rate")
    A, B, C, D = (found[name].values for name in "ABCD")
    for s in (0.0, 2j, 3.0 + 5j):
        value = C @ np.linalg.pinv(s * np.eye(len(A)) - A) @ B + D
        transfer = value[0, at] + s * value[0, rate]
        numerator = 20.0 * s**2 + 300.0 * s + 900.0
        np.testing.assert_allclose(transfer, numerator / (2.0 * s**3 + numerator), rtol=1e-8)


@pytest.mark.parametrize(
    "name",
    ["bifilar_pendulum", "socket_swing", "andrews_squeezer", "clearance_pendulum", "clamped_rod", "spring_pendulum"],
)
def test_poles_are_the_natural_vibrations(name: str) -> None:
    given = check(name)
    vibrations = analyses.frequencies(given, bundles(given), silent)
    same_poles(matrices(given, held=True).A.values, vibrations, 1e-9)


def test_a_controller_that_samples_is_refused() -> None:
    with pytest.raises(InputError, match=r'\[load.E\]: samples its error.*\n  hint: write type = "pid"'):
        matrices(check("controllers"))
