"""Bushings against closed forms: coupled plane motion, natural frequencies, and torque as the slope of the energy."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexclear.pipeline.core.system.errors import SolverError
from tests.analytic.mechanism_runs import frequencies, run
from tests.properties.mechanisms import rigid, scene, simulate

K = np.array([[2000.0, 300.0, 10.0], [300.0, 1500.0, -20.0], [10.0, -20.0, 4.0]])
C = np.diag([8.0, 6.0, 0.02])
M = np.diag([2.0, 2.0, 0.03])


def closed_form(times: np.ndarray) -> np.ndarray:
    """x, y, angle and their rates; in a plane the equations are linear for any angle."""
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    start = np.array([0.02, -0.01, 1.8, 0.0, 0.5, 0.0])
    return np.array([expm(t * A) @ start for t in times])


def test_a_block_on_a_bushing_moves_as_the_linear_equations_say() -> None:
    dataset = run("checks/bushing")
    known = closed_form(dataset.time.values)
    # rtol 1e-11 over some hundred steps leaves 1e-11 of a metre
    assert dataset.position.values[:, 0, :2] == pytest.approx(known[:, :2], abs=1e-9)
    assert dataset.bushing_displacement.values[:, 0, :2] == pytest.approx(known[:, :2], abs=1e-9)
    assert dataset.bushing_rotation.values[:, 0, 2] == pytest.approx(known[:, 2], abs=1e-8)
    force = -(known[:, :3] @ K + known[:, 3:] @ C)
    # forces err by stiffness and damping times what positions and rates err by: 1e-8 of the largest, ten times and more
    assert dataset.load_force.values[:, 0, :2] == pytest.approx(force[:, :2], abs=1e-6 * np.abs(force).max())
    assert dataset.load_moment.values[:, 0, 2] == pytest.approx(force[:, 2], abs=1e-6 * np.abs(force).max())
    stored = 0.5 * np.einsum("ti,ij,tj->t", known[:, :3], K, known[:, :3])
    assert dataset.elastic.values == pytest.approx(stored, abs=1e-8 * stored.max())
    assert np.abs(dataset.energy_error).max() < 1e-8 * stored.max()


def test_natural_frequencies_of_a_mounted_block() -> None:
    """The undamped ones, of the eigenproblem that the full matrices pose."""
    small = frequencies("checks/bushing", (("load.mount.damping", (0.0,) * 6),))
    out_of_plane = np.array([[1000.0 / 2.0]]), np.linalg.solve(np.diag([0.01, 0.02]), [[5.0, 1.0], [1.0, 6.0]])
    squares = [np.linalg.eigvals(block).real for block in (np.linalg.solve(M, K), *out_of_plane)]
    known = np.sort(np.sqrt(np.concatenate(squares))) / (2.0 * np.pi)
    # central differences with extrapolation reach 1e-9
    assert np.sort(small.frequency.values) == pytest.approx(known, rel=1e-7)


def turning(speed: list[float], stiffness: list[float], end: float, **more: object) -> dict[str, object]:
    """A round body on a bushing at its centre, set turning; SI."""
    mount = {"type": "bushing", "between": ["ground.o", "b.o"], "stiffness": stiffness, **more}
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "b": rigid(1.0, 0.01, {"o": {}}, pose={}, angular_velocity=speed),
    }
    return scene(bodies, {}, end, load={"mount": mount})


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.6, -0.48, 0.64)], ids=["along z", "oblique"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_bushing_resists_beyond_half_a_turn_as_below(share: float, direction: tuple[float, float, float]) -> None:
    """Alike in all directions it is a torsional spring about any axis: A sin(sqrt(k/J) t), up to a full turn."""
    stiffness, inertia = 2.0, 0.01
    omega, largest = np.sqrt(stiffness / inertia), share * 2.0 * np.pi
    run = simulate(turning([largest * omega * d for d in direction], [1e3] * 3 + [stiffness] * 3, 0.6))
    known = largest * np.sin(omega * run.time.values)
    assert np.abs(known).max() > 0.9 * largest
    # rtol 1e-12 over some hundred steps
    turned = run.bushing_rotation.values[:, 0] @ np.array(direction)
    assert turned == pytest.approx(known, abs=1e-8)
    assert run.load_moment.values[:, 0] @ np.array(direction) == pytest.approx(-stiffness * known, abs=1e-7)
    assert np.abs(run.energy_error).max() < 1e-9 * 0.5 * stiffness * largest**2


def test_energy_is_conserved_while_a_body_passes_half_a_turn_about_changing_axes() -> None:
    """Unequal stiffness moves the axis of rotation: the torque is the slope of one energy on both sides."""
    run = simulate(turning([20.0, 35.0, -30.0], [1e3] * 3 + [2.0, 1.5, 1.0], 1.0))
    size = np.linalg.norm(run.bushing_rotation.values[:, 0], axis=1)
    assert size.max() > 1.1 * np.pi
    # as accurate as rtol 1e-12 keeps a joule
    assert np.abs(run.energy_error).max() < 1e-8


@pytest.mark.parametrize("integrator", [{"rtol": 1e-8}, {"rtol": 1e-3}])
def test_a_bushing_that_comes_to_a_full_turn_ends_the_run_in_words(integrator: dict[str, object]) -> None:
    table = turning([0.0, 0.0, 100.0], [1e3] * 3 + [2.0] * 3, 1.0)
    table["solver"] = integrator
    with pytest.raises(SolverError, match=r"bushing mount has turned by 35\d deg.*joint-spring"):
        simulate(table)


def test_a_bushing_that_does_not_resist_rotation_turns_for_ever() -> None:
    run = simulate(turning([0.0, 0.0, 100.0], [1e3] * 3 + [0.0] * 3, 0.5))
    assert run.angular_velocity.values[:, 0, 2] == pytest.approx(np.full(run.sizes["time"], 100.0), rel=1e-12)
