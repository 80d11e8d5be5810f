"""Bodies as clouds of mass points: their integrals and their energy, by brute force, next to those of a bundle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr


@dataclass(frozen=True)
class Cloud:
    """Mass points [kg] (p,), their places [m] (3, p) and their shapes per modal coordinate (3, p, n)."""

    mass: np.ndarray
    place: np.ndarray
    shape: np.ndarray


def same_integrals(data: xr.Dataset, points: Cloud, length: float) -> None:
    """All invariants of a bundle are those of the cloud; length: of the body [m]."""
    mass, X, S = points.mass, points.place, points.shape
    weighted, total = S * mass[:, None], float(mass.sum())
    # Cauchy-Schwarz: a mass-normalised shape has int rho S <= sqrt(m), int rho X S <= sqrt(int rho X^2)
    size = np.sqrt(total)
    expected: dict[str, tuple[np.ndarray, float]] = {
        "mass": (np.array(total), total),
        "first_moment": (X @ mass, total * length),
        "second_moment": ((X * mass) @ X.T, total * length**2),
        "modal_first_moment": (weighted.sum(axis=1), size),
        "position_mode_moment": (np.einsum("kp,lpj->klj", X, weighted), size * length),
        "mode_mode_moment": (np.einsum("kpi,lpj->klij", S, weighted, optimize=True), 1.0),
    }
    for name, (values, scale) in expected.items():
        # both sums add some thousand terms: eps * sqrt(1e4) of the largest, with a margin
        np.testing.assert_allclose(data[name].values, values, rtol=0.0, atol=1e-12 * scale, err_msg=name)


def same_energy(data: xr.Dataset, points: Cloud) -> None:
    """Velocity, spin, deformation and its rate at random; every coupling term of the body is in it."""
    n = data.sizes["mode"]
    random = np.random.default_rng(20190702)
    for _ in range(5):
        v, omega = random.normal(size=3), 10.0 * random.normal(size=3)
        q, rate = 1e-3 * random.normal(size=n), random.normal(size=n)
        r = points.place + points.shape @ q
        velocity = v[:, None] + np.cross(omega, r, axisb=0, axisc=0) + points.shape @ rate
        expected = 0.5 * float(points.mass @ (velocity**2).sum(axis=0))
        assert kinetic(data, v, omega, q, rate) == pytest.approx(expected, rel=1e-10)


def kinetic(data: xr.Dataset, v: np.ndarray, omega: np.ndarray, q: np.ndarray, rate: np.ndarray) -> float:
    """Kinetic energy from the bundle alone, body axes."""
    P, F = data["position_mode_moment"].values, data["mode_mode_moment"].values
    first = data["first_moment"].values + data["modal_first_moment"].values @ q
    first_rate = data["modal_first_moment"].values @ rate
    second = data["second_moment"].values + P @ q + (P @ q).T + np.einsum("klij,i,j->kl", F, q, q)
    # int rho r_k rdot_l
    mixed = P @ rate + np.einsum("klij,i,j->kl", F, q, rate)
    inertia = np.trace(second) * np.eye(3) - second
    spin = np.array([mixed[1, 2] - mixed[2, 1], mixed[2, 0] - mixed[0, 2], mixed[0, 1] - mixed[1, 0]])
    energy = 0.5 * float(data["mass"]) * v @ v + v @ np.cross(omega, first) + v @ first_rate
    return float(energy + 0.5 * omega @ inertia @ omega + omega @ spin + 0.5 * rate @ data["modal_mass"].values @ rate)
