"""Small rigid scenes with known answers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix, rotation_vector_to_matrix, skew
from tests.analytic.mechanism_runs import run


def test_pendulum_follows_jacobis_functions() -> None:
    """IFToMM A01 asks for 1e-5 m at 10 s; from the horizontal, sin(theta/2) = k sn(K - w t), k^2 = 1/2."""
    dataset = run("checks/pendulum")
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81) * dataset.time.values, 0.5)
    angle = 2.0 * np.arcsin(np.sqrt(0.5) * sn) * np.sign(dn)
    position = dataset.position.sel(body="bob").values
    assert position == pytest.approx(np.column_stack([-np.sin(angle), -np.cos(angle), 0.0 * angle]), abs=1e-8)


def test_heavy_top_follows_eulers_equations_to_its_published_end() -> None:
    dataset = run("checks/heavy_top").sel(body="top")
    moments = np.array([15.234375, 0.46875, 15.234375])  # about the fixed point

    def rhs(_: float, y: np.ndarray) -> np.ndarray:
        R, omega = y[:9].reshape(3, 3), y[9:]
        torque = np.cross([0.0, 15.0, 0.0], R.T @ [0.0, 0.0, -9.81])
        return np.concatenate([(R @ skew(omega)).ravel(), (torque - np.cross(omega, moments * omega)) / moments])

    y0 = np.concatenate([np.eye(3).ravel(), [0.0, 150.0, -4.61538]])
    time = dataset.time.values
    known = solve_ivp(rhs, (0.0, 1.0), y0, "DOP853", t_eval=time, rtol=1e-12, atol=1e-12)
    R = known.y[:9].T.reshape(-1, 3, 3)
    # ten nutations: errors of rtol 1e-10 per step add up over some hundred steps
    assert dataset.position.values == pytest.approx(R[:, :, 1], abs=1e-7)
    spin = np.einsum("ti,ti->t", dataset.angular_velocity.values, R[:, :, 1])
    assert spin == pytest.approx(150.0, abs=1e-6)
    # of the benchmark's converged solution
    assert dataset.position.values[-1] == pytest.approx([0.1733439, 0.6400886, -0.7484908], abs=1e-6)


def test_thrown_body_flies_a_parabola_and_keeps_its_angular_momentum() -> None:
    dataset = run("checks/free_body").sel(body="box")
    time = dataset.time.values[:, None]
    R0 = rotation_vector_to_matrix(np.array([0.3, -0.2, 0.5]))
    start = np.array([0.2, 0.0, 1.0]) + R0 @ [0.1, 0.0, 0.0]
    path = start + np.array([1.0, 2.0, 3.0]) * time + 0.5 * np.array([0.0, 0.0, -9.81]) * time**2
    assert dataset.position.values == pytest.approx(path, abs=1e-9)
    R = quaternion_to_matrix(dataset["quaternion"].values)
    inertia = R @ np.diag([0.02, 0.03, 0.04]) @ np.swapaxes(R, 1, 2)
    momentum = np.einsum("tij,tj->ti", inertia, dataset.angular_velocity.values)
    known = R0 @ np.diag([0.02, 0.03, 0.04]) @ R0.T @ [0.2, 10.0, -0.1]
    # the instability multiplies early errors by some hundred before the first flip ends
    assert momentum == pytest.approx(np.tile(known, (len(time), 1)), abs=1e-8)
