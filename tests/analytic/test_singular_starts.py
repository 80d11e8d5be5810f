"""Runs that start in a singular pose, and integrators that pass some: two four-bar loops whose rods lie in one line."""

import tomllib

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from flexclear.pipeline.core.system.errors import SolverError
from tests.analytic import four_bars
from tests.properties.mechanisms import Table, simulate

LOOPS, SPEED = 2, 3.0
#: moment of inertia and of weight about the pins, per `four_bars.inclination` [kg m^2], [kg m]
INERTIA, WEIGHT = (LOOPS + 1) / 3.0 + LOOPS, (LOOPS + 1) / 2.0 + LOOPS


def lying(**solver: object) -> Table:
    """All rods along x, turning down at SPEED: from here every loop may also become an antiparallelogram."""
    table = tomllib.loads(four_bars.text(LOOPS, end=0.5, interval=0.05)) | {"solver": {"rtol": 1e-12, **solver}}
    for k in range(LOOPS + 1):
        table["body"][f"rod{k}"] |= {
            "pose": {"position": [k, 0.0, 0.0], "rotation_vector": [0.0, 0.0, -0.5 * np.pi]},
            "velocity": [0.0, -0.5 * SPEED, 0.0],
            "angular_velocity": [0.0, 0.0, -SPEED],
        }
    for k in range(1, LOOPS + 1):
        table["body"][f"beam{k}"] |= {"pose": {"position": [k, 0.0, 0.0]}, "velocity": [0.0, -SPEED, 0.0]}
    return table


def error(dataset: xr.Dataset, angle: np.ndarray) -> float:
    """Largest distance of a rod's top from where the regular branch has it [m]."""
    known = np.column_stack([np.sin(angle), np.cos(angle)])
    tops = [dataset.frame_position.sel(frame=f"rod{k}.top").values[:, :2] - [k, 0.0] for k in range(LOOPS + 1)]
    return float(np.abs(np.array(tops) - known).max())


def test_a_run_leaves_a_singular_pose_along_the_branch_that_its_velocities_belong_to() -> None:
    dataset = simulate(lying())
    pull = four_bars.GRAVITY * WEIGHT / INERTIA
    known = solve_ivp(
        lambda _, y: [y[1], pull * np.sin(y[0])],
        (0.0, 0.5), [0.5 * np.pi, SPEED], "DOP853", t_eval=dataset.time.values, rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    # rtol 1e-12, and slopes of which rounding next to the pose leaves 1e-11
    assert error(dataset, known.y[0]) < 1e-9
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * float(dataset.kinetic.max())
    # the start itself is the limit of its neighbours, whose fourth-order share is below 1e-6
    start = dataset.isel(time=0).sel(body="beam1")
    assert start.acceleration.values == pytest.approx([-(SPEED**2), -pull, 0.0], abs=1e-6)
    assert start.velocity.values == pytest.approx([0.0, -SPEED, 0.0], abs=1e-9)
    # two ranks are lost there, one per loop
    assert dataset["rank"].values[:2].tolist() == [2, 4]


def test_a_run_from_a_singular_pose_can_be_asked_for_accuracy() -> None:
    """Its equations cannot be linearised there, so that nothing tells which integrator suits it."""
    table = lying() | {"accuracy": {"beam1.position": "0.1 mm"}, "output": {"interval": 0.05}}
    del table["solver"]
    dataset = simulate(table)
    assert dataset.attrs["method_reason"].startswith("dop853: it is tried first")
    assert dataset.attrs["accuracy_verdict"] == "met"
    known = simulate(lying())
    assert float(np.abs(dataset.position - known.position).sel(body="beam1").max()) < 1e-4


def at_rest(table: Table) -> None:
    for body in table["body"].values():
        body.pop("velocity", None)
        body.pop("angular_velocity", None)


def told_of_one(table: Table) -> None:
    for name in table["body"]:
        if name != "rod0":
            table["body"][name].pop("velocity", None)
            table["body"][name].pop("angular_velocity", None)


def between_branches(table: Table) -> None:
    """Closed to first order, as any speeds of the rods are here, and of no motion."""
    for name in ("beam1", "beam2"):
        table["body"][name].pop("velocity", None)
        table["body"][name].pop("angular_velocity", None)
    table["body"]["rod1"] |= {"velocity": [0.0, -1.0, 0.0], "angular_velocity": [0.0, 0.0, -2.0]}


@pytest.mark.parametrize("spoil", [at_rest, told_of_one, between_branches])
def test_a_singular_start_without_the_velocities_of_one_branch_is_refused(spoil) -> None:
    table = lying()
    spoil(table)
    with pytest.raises(SolverError) as caught:
        simulate(table)
    assert caught.value.exit_code == 3
    for part in ("t = 0 s", "starts in a singular pose", "condition number", "right1", "right2", "velocities"):
        assert part in str(caught.value), part
