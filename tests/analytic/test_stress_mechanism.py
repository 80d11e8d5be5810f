"""Section forces of rod 1 in the paper's mechanism against the joint forces and the motion of its pieces."""

from __future__ import annotations

from functools import cache

import numpy as np
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix
from tests.analytic.stress_runs import recorded, run

PIECES = 12
FINE = 5e-7  #: [s]


@cache
def far() -> xr.Dataset:
    return run("sps4/far_cb", {})


@cache
def fine() -> xr.Dataset:
    return run("sps4/far_cb", {"time.end": 200 * FINE, "output.interval": FINE})


def rod1() -> xr.Dataset:
    return recorded("sps4/far_cb", {})[1]["rod1"]


def at_joint(name: str) -> np.ndarray:
    """Size of a joint's force [N] over time."""
    size: np.ndarray = np.linalg.norm(far().joint_force.sel(joint=name).values, axis=1)
    return size


def test_section_forces_at_the_interfaces_are_the_joint_forces() -> None:
    """P1 at the lower end, where all of the rod's inertia was summed on the way; the ball's stem at the upper end."""
    force = np.linalg.norm(far().section_force.values, axis=2)
    for section, joint in ((0, "P1"), (-1, "fixed_ball_A1")):
        known = at_joint(joint)
        assert np.abs(force[:, section] - known).max() <= 1e-8 * known.max()
    moment = np.linalg.norm(far().section_moment.values, axis=2)
    for section, joint in ((0, "P1"), (-1, "fixed_ball_A1")):
        known = np.linalg.norm(far().joint_moment.sel(joint=joint).values, axis=1)
        assert np.abs(moment[:, section] - known).max() <= 1e-8 * known.max()


def test_each_piece_is_moved_by_the_forces_at_its_ends() -> None:
    """Axial force against mass times acceleration of each twelfth of the rod, from the recorded motion: the rod's
    centre of mass, its turning, and the modal accelerations as differences of the recorded rates. Those err by
    (omega h)^2 / 6 of the fastest coordinate, 0.1 % at 20 kHz and h = 0.5 us."""
    data = fine()
    pull = np.diff(data.section_force.values[:, :, 0].reshape(len(data.time), PIECES, 2), axis=2)[1:-1, :, 0]
    rod = data.sel(body="rod1").isel(time=slice(1, -1))
    R = quaternion_to_matrix(rod["quaternion"].values)
    omega, alpha = rod["angular_velocity"].values[:, None], rod["angular_acceleration"].values[:, None]
    u = data["modal_velocity"].values
    du = (u[2:] - u[:-2]) / (2.0 * FINE)
    reduced = rod1()
    # of the middle of each piece against the rod's centre of mass, both per modal coordinate; extension is linear there
    mass = float(reduced["mass"])
    middle = 0.5 * (reduced["shape_translation"].values[1:] + reduced["shape_translation"].values[:-1])
    shape = middle - reduced["modal_first_moment"].values / mass
    place = 0.5 * (reduced["node_position"].values[1:] + reduced["node_position"].values[:-1])
    arm = np.einsum("tij,pj->tpi", R, place - reduced["first_moment"].values / mass)
    bent = np.einsum("tij,pjm,tm->tpi", R, shape, du)
    a = rod["acceleration"].values[:, None] + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm)) + bent
    inertia = mass / PIECES * np.einsum("tpi,ti->tp", a, R[:, :, 0])
    assert np.abs(pull - inertia).max() <= 0.01 * np.abs(inertia).max()
