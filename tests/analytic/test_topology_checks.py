"""Closed loops with known answers: Andrews' and Bricard's mechanisms, four-bars that pass singular poses."""

import tomllib

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from flexclear.dynamics.record.dataset import record_run
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.run import integrate
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from tests.analytic import four_bars
from tests.analytic.mechanism_runs import TREE, run
from tests.properties.mechanisms import Table, simulate

TIGHT = (("solver.rtol", 1e-12),)

# Angles [rad] and rates [rad/s] of Andrews' mechanism at 0.03 s: independent solution whose scaled difference from
# the solution published in the Test Set for IVP Solvers (Mazzia & Magherini, andrews.f) is 9e-11 in the
# angles and 3e-8 in the rates.  Order: beta, theta, gamma, phi, delta, Omega, epsilon.
ANDREWS = np.array([
    15.810771195153439, -15.756371058411503, 0.04082224011964324, -0.534730116342084, 0.524409965879954,
    0.5347301163420843, 1.0480807410419377,
])  # fmt: skip
ANDREWS_RATES = np.array([
    1139.9203022591125, -1424.3792951775529, 11.032911910542026, 19.29337410489815, 0.5735699148254771,
    -19.293374104898152, 0.3231791492467143,
])  # fmt: skip
#: accelerations of the published solution [rad/s^2]
ANDREWS_ACCELERATIONS = np.array([
    -24631.76316945196, 51850.37701610329, 324102.5686413781, 566749.3645176213, 16743.62929479361,
    -566749.3645176222, 9826.520791458423,
])  # fmt: skip
#: kinetic energy and the spring's less 0.033 N m times beta, the same at all times [J]; beta at the start
ANDREWS_ENERGY, ANDREWS_START = 1.4378329575321425, -0.06171389001427645

# IFToMM A02 on the regular branch: (angle [rad], its rate [rad/s]) of the rods at 10 s, and the times of the singular
# poses [s]; integrals of the one-degree-of-freedom equation at rtol 1e-13, and for N = 2 the published
# converged (0.32845738, 0.94451879) of the top.
FOUR_BARS = {2: (31.750597186984365, 1.5066421808370012), 40: (31.597433743984947, 1.1676221087499428)}
SINGULAR = {
    2: [
        0.7143555292929554, 1.228159393314122, 2.6568704519001205, 3.1706743159212873, 4.599385374507356,
        5.113189238528524, 6.541900297114673, 7.055704161135842, 8.484415219722077, 8.998219083743251,
    ],
    40: [
        0.7215810248256522, 1.2440209038789913, 2.687182953530358, 3.209622832583697, 4.6527848822350695,
        5.175224761288408, 6.618386810939828, 7.14082668999317, 8.58398873964471, 9.106428618698054,
    ],
}  # fmt: skip


def angles(dataset: xr.Dataset, body: str) -> np.ndarray:
    """Angle about z, turns counted [rad], of a body of a planar mechanism."""
    R = quaternion_to_matrix(dataset["quaternion"].sel(body=body).values)
    return np.asarray(np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0])))


def andrews(dataset: xr.Dataset, field: str) -> np.ndarray:
    """The source's seven coordinates, or rates of them, at the end of a run."""
    if field == "angle":
        K = {k: angles(dataset, f"K{k}")[-1] for k in range(1, 8)}
    else:
        K = {k: float(dataset[field].sel(body=f"K{k}").values[-1, 2]) for k in range(1, 8)}
    return np.array([K[1], K[2] - K[1], K[3], K[4] - K[5], K[5], K[6] - K[7], K[7]])


def test_andrews_mechanism_has_its_published_end_at_default_and_tight_tolerance() -> None:
    """Accepted: 1e-5 by default settings, 1e-8; the reference is known to 1e-10 in angles, 3e-8 in rates."""
    assert andrews(run("checks/andrews_squeezer"), "angle") == pytest.approx(ANDREWS, rel=1e-5)
    dataset = run("checks/andrews_squeezer", (("solver.rtol", 1e-13),))
    assert andrews(dataset, "angle") == pytest.approx(ANDREWS, rel=1e-8, abs=1e-9)
    assert andrews(dataset, "angular_velocity") == pytest.approx(ANDREWS_RATES, rel=0, abs=1e-8 * 1424.0)
    # the published accelerations belong to its positions and rates, which differ by those 3e-8
    largest = np.abs(ANDREWS_ACCELERATIONS).max()
    assert andrews(dataset, "angular_acceleration") == pytest.approx(ANDREWS_ACCELERATIONS, rel=0, abs=1e-6 * largest)


def test_andrews_mechanism_has_one_freedom_and_out_of_plane_reactions_that_nothing_determines() -> None:
    dataset = run("checks/andrews_squeezer")
    assert set(dataset.mobility.values) == {1}
    # three loops of five rows in space, of two in the plane
    assert set(dataset["rank"].values) == {6}
    assert dataset.attrs["redundant_closure_rows"] == 9
    assert dataset.reaction_redundant.values.all()
    energy = dataset.kinetic + dataset.potential + dataset.elastic - dataset.load_work
    assert energy.values - 0.033 * ANDREWS_START == pytest.approx(ANDREWS_ENERGY, rel=1e-9)


# Four-bars ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loops", four_bars.LOOPS)
def test_the_committed_scene_is_the_generated_one(loops: int) -> None:
    assert four_bars.path(loops).read_text() == four_bars.text(loops)


@pytest.mark.parametrize("loops", [*four_bars.LOOPS, 3])
def test_four_bars_stay_on_the_regular_branch_through_ten_singular_poses(loops: int) -> None:
    """Accepted: 1e-4 m at 10 s, energy within 0.1 J. All along, because a wrong branch may come back.

    Of three loops the last rows do not reach the first.
    """
    dataset = simulate(tomllib.loads(four_bars.text(3))) if loops == 3 else run(f"checks/four_bars_{loops}")
    theta = four_bars.inclination(loops, dataset.time.values)
    top = dataset.frame_position.sel(frame="rod0.top").values[:, :2]
    assert top == pytest.approx(np.column_stack([np.sin(theta), np.cos(theta)]), abs=1e-6)
    assert np.abs(dataset.energy_error.values).max() < 1e-4
    assert len(dataset.pass_time) == 10


@pytest.mark.parametrize("loops", [2, 40])
def test_four_bars_at_tight_tolerance_pass_where_they_must(loops: int) -> None:
    """To 1e-8: ten passes at rtol 1e-12 each leave some 1e-10. Each is recorded with its condition and joint."""
    dataset = run(f"checks/four_bars_{loops}", TIGHT)
    angle, rate = FOUR_BARS[loops]
    top = dataset.frame_position.sel(frame="rod0.top").values[-1, :2]
    assert top == pytest.approx([np.sin(angle), np.cos(angle)], abs=1e-8)
    assert dataset.angular_velocity.sel(body="rod0").values[-1, 2] == pytest.approx(-rate, rel=1e-7)
    last = dataset.frame_position.sel(frame=f"rod{loops}.top").values[-1, :2] - [loops, 0.0]
    assert last == pytest.approx(top, abs=1e-8)
    # located on an interpolant between recorded rows some hundredths of a second apart
    assert dataset.pass_time.values == pytest.approx(SINGULAR[loops], abs=1e-5)
    assert set(dataset.pass_rank_loss.values) == {loops}
    assert (dataset.pass_condition.values > 1e3).all()
    assert set(dataset.pass_joint.values) <= {f"right{k}" for k in range(1, loops + 1)}
    assert set(dataset.mobility.values) == {1}


@pytest.mark.parametrize("integrator", ["rk4", "generalized-alpha"])
def test_each_pass_is_listed_once_whatever_the_distance_of_the_rows_before_it(integrator: str) -> None:
    """Fixed steps leave none between an output and the step over the pose; the directions turn a lot meanwhile."""
    solver = {"integrator": integrator, "step": 1e-3}
    dataset = simulate(table("four_bars_2", **{"solver": solver, "time.end": 3.0}))
    known = [t for t in SINGULAR[2] if t < 3.0]
    # of second order in the step: generalized-alpha is 7e-7 s off
    assert dataset.pass_time.values == pytest.approx(known, abs=1e-5)
    assert list(dataset.pass_rank_loss.values) == [2] * len(known)


# Redundant rows -----------------------------------------------------------------------------------------------------


def table(name: str, **overrides: object) -> Table:
    return load_scene(TREE / "scenes" / "checks" / f"{name}.toml", overrides).model_dump(exclude_none=True)


def same_motion(a: xr.Dataset, b: xr.Dataset, within: float) -> None:
    for field in ("position", "velocity", "angular_velocity", "acceleration"):
        known = b[field].values
        assert np.abs(a[field].values - known).max() <= within * np.abs(known).max(), field


@pytest.mark.parametrize(
    "name, end, freer, count",
    [
        ("bricard", 2.0, {"R6": "cylindrical"}, 1),
        ("four_bars_1", 0.6, {"left1": "spherical", "right1": "cylindrical"}, 3),
    ],
)
def test_a_mechanism_moves_as_the_one_whose_joints_leave_no_row_redundant(
    name: str, end: float, freer: dict[str, str], count: int
) -> None:
    """Joints that may also slide or turn take the redundant rows away, and do not."""
    redundant = table(name, **{"time.end": end, "solver": {"rtol": 1e-12}})
    joints = redundant["joint"] | {joint: redundant["joint"][joint] | {"type": kind} for joint, kind in freer.items()}
    with_rows, without = simulate(redundant), simulate({**redundant, "joint": joints})
    assert (with_rows.attrs["redundant_closure_rows"], without.attrs["redundant_closure_rows"]) == (count, 0)
    assert set(with_rows.mobility.values) == set(without.mobility.values) == {1}
    same_motion(with_rows, without, 1e-9)
    assert with_rows.reaction_redundant.values.all()
    assert not without.reaction_redundant.values.any()
    # some hundred steps of rtol 1e-12 at energies of some ten joules
    assert np.abs(with_rows.energy_error.values).max() < 1e-8
    assert with_rows.constraint_error.values.max() < 1e-12
    if name == "four_bars_1":
        # what is determined is the same: forces in the plane
        forces = [d.joint_force.sel(joint=list(joints)).values[:, :, :2] for d in (with_rows, without)]
        assert forces[0] == pytest.approx(forces[1], rel=0, abs=1e-8 * np.abs(forces[1]).max())


def test_the_motion_does_not_depend_on_which_rows_are_solved_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows chosen anew whenever others stand out a little more, instead of when the present ones are worn out."""
    scene = Scene.model_validate(table("bricard", **{"time.end": 2.0, "solver": {"rtol": 1e-12}}))
    once = integrate(scene, {}, lambda fraction, text: None)
    monkeypatch.setattr(closure_rows, "WORN", 0.99)
    monkeypatch.setattr(closure_rows, "BETTER", 1.0)
    often = integrate(scene, {}, lambda fraction, text: None)
    changes = [[time for time, _ in run.trajectory.selections] for run in (once, often)]
    assert changes[0] != changes[1]
    same_motion(record_run(often).to_xarray(), record_run(once).to_xarray(), 1e-9)


def test_rows_are_chosen_anew_before_the_present_ones_depend_on_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Near 1.25 s the five rows that are best at the start do, though the mechanism is as movable as ever."""
    scene = Scene.model_validate(table("bricard", **{"time.end": 2.0, "solver": {"rtol": 1e-12}}))
    run = integrate(scene, {}, lambda fraction, text: None)
    (_, first), (time, second) = run.trajectory.selections
    assert 1.0 < time < 1.247
    assert not np.array_equal(first, second)
    assert not run.trajectory.collocations
    # without that they do depend on each other, and a polynomial has to lead over the time at which they do
    monkeypatch.setattr(closure_rows, "improve", lambda *_: False)
    (over,) = integrate(scene, {}, lambda fraction, text: None).trajectory.collocations
    assert over.start < 1.247 < over.end


def test_a_row_in_a_singular_pose_itself_is_the_limit_of_its_neighbours() -> None:
    """The crank turns steadily and lies exactly at an output time; the parallelogram goes on as one."""
    law = {"type": "polynomial", "coefficients": (0.0, -np.pi)}
    drive = {"drive": {"crank": {"joint": "foot0", "law": law}}, "time.end": 1.0, "output.interval": 0.25}
    made = table("four_bars_1", **{"solver": {"rtol": 1e-12}, **drive})
    for body in made["body"].values():
        body.pop("velocity", None)
        body.pop("angular_velocity", None)
    with np.errstate(all="ignore"):
        dataset = simulate(made)
    at = dataset.sel(time=0.5)
    assert 0.5 in dataset.time.values
    assert dataset.pass_time.values == pytest.approx([0.5], abs=1e-6)
    # the mean of both sides of the pose, some 1e-4 s away
    assert at.angular_velocity.sel(body="rod1").values == pytest.approx([0.0, 0.0, -np.pi], abs=1e-6)
    assert at.acceleration.sel(body="rod1").values == pytest.approx([-0.5 * np.pi**2, 0.0, 0.0], abs=1e-4)
    assert dataset.position.sel(body="rod1").values[-1] == pytest.approx([1.0, -0.5, 0.0], abs=1e-9)


# Starts in a singular pose: two four-bar loops whose rods lie in one line --------------------------------------------

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
    assert dataset.attrs["method_reason"].startswith("dop853: default")
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
