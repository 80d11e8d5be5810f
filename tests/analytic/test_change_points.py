"""Change points: poses in which another branch of the motion crosses are passed at speed, whatever the method.

Compared with the smooth branch of the loop equations, and for free motion with energy and with one equation of motion.
"""

import re

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.dynamics.record.dataset import record_run
from flexclear.dynamics.run.progress_rate import Judge, Judges
from flexclear.dynamics.run.run import RunInParts, integrate
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic import change_points as cp
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import Table, simulate

#: quick: the default and the extremes of the tolerance; all share their compiled code
TOLERANCES = (1e-4, 1e-10, 1e-13)
#: solver -> largest error of an angle of a driven mechanism [rad]: what the loops may be open, or rounding
METHODS: dict[str, tuple[Table, float]] = {
    **{f"dop853 {k}": ({"rtol": 10.0**-k}, max(10.0 ** (1 - k), 1e-11)) for k in range(4, 14)},
    **{f"dopri5 {k}": ({"integrator": "dopri5", "rtol": 10.0**-k}, max(10.0 ** (1 - k), 1e-11)) for k in range(4, 14)},
    **{f"radau {k}": ({"integrator": "radau", "rtol": 10.0**-k}, max(10.0 ** (1 - k), 1e-11)) for k in (4, 7, 10)},
    **{
        f"generalized-alpha {k}": ({"integrator": "generalized-alpha", "rtol": 10.0**-k}, 10.0 ** (1 - k))
        for k in (4, 6, 8)
    },
    **{
        f"{name} fixed": ({"integrator": name, "step": 2e-3}, 1e-8)
        for name in ("dop853", "dopri5", "rk4", "adams-bashforth-moulton", "radau", "generalized-alpha")
    },
}
STARTS = [0.3 + 0.41 * k for k in range(14)]


def angle(dataset: xr.Dataset, body: str) -> np.ndarray:
    """Angle of a body about z, turns not counted [rad]."""
    q = dataset["quaternion"].sel(body=body).values
    return np.asarray(2.0 * np.arctan2(q[:, 3], q[:, 0]))


def apart(found: np.ndarray, known: np.ndarray) -> float:
    """Largest difference of angles, whole turns apart."""
    return float(np.abs(np.angle(np.exp(1j * (found - known)))).max())


def four_bar_error(dataset: xr.Dataset, crank: np.ndarray, side: float, lengths: tuple[float, ...]) -> float:
    """Largest error of coupler and rocker; next to the pose the closed form itself holds half the digits."""
    clear = np.abs((crank + 2.0 * np.pi) % (2.0 * np.pi) - np.pi) > 1e-5
    found = np.column_stack([angle(dataset, "coupler"), angle(dataset, "rocker")])
    return apart(found[clear], cp.smooth(crank, side, lengths)[clear])


def steady_four_bar(
    start: float, side: float, solver: Table, lengths: tuple[float, ...] = cp.FOUR_BAR
) -> tuple[xr.Dataset, float]:
    """A turn and more at 4 rad/s, and its error."""
    table = cp.four_bar(start, side, lengths, solver=solver, time={"end": 2.0})
    dataset = simulate(cp.driven(table, "A", cp.steady(start, 4.0)))
    return dataset, four_bar_error(dataset, start + 4.0 * dataset.time.values, side, lengths)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_driven_four_bar_keeps_its_branch_at_every_tolerance(rtol: float) -> None:
    dataset, error = steady_four_bar(1.5, 1.0, {"rtol": rtol})
    # loops are closed to rtol, which an angle magnifies by ten at most; below that some hundred roundings
    assert error < max(100.0 * rtol, 1e-11)
    assert dataset.pass_time.values == pytest.approx([(np.pi - 1.5) / 4.0, (3.0 * np.pi - 1.5) / 4.0], abs=1e-7)
    assert set(dataset.pass_rank_loss.values) == {1}
    assert set(dataset.pass_joint.values) <= {"A", "B", "C", "D"}


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_free_scott_russell_mechanism_moves_as_its_one_equation_of_motion(rtol: float) -> None:
    table = cp.scott_russell(0.7, solver={"rtol": rtol})
    table["body"]["crank"]["angular_velocity"] = [0.0, 0.0, 8.0]
    dataset = simulate(table)
    known = cp.falling(0.7, 8.0, dataset.time.values)
    # errors of the steps grow with the motion, by less than a thousand in a second; the known one is good to 1e-12
    within = max(1e3 * rtol, 1e-10)
    assert np.abs(dataset.position.sel(body="slider").values[:, 0] - 0.4 * np.cos(known)).max() < within
    assert np.abs(dataset.energy_error.values).max() < max(1e4 * rtol, 1e-10) * float(dataset.kinetic.max())
    assert len(dataset.pass_time) > 1


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e3])
def test_a_pass_depends_on_no_unit_of_length(size: float) -> None:
    lengths = tuple(size * length for length in cp.FOUR_BAR)
    table = cp.four_bar(1.5, -1.0, lengths, time={"end": 2.0})
    del table["load"]  # at a nanometre gravity is all there is
    dataset = simulate(cp.driven(table, "A", cp.steady(1.5, 4.0)))
    assert four_bar_error(dataset, 1.5 + 4.0 * dataset.time.values, -1.0, lengths) < 1e-9
    assert len(dataset.pass_time) == 2


def test_what_is_recorded_near_a_change_point_is_the_smooth_motion() -> None:
    """Rows every tenth of a millisecond, some of which rounding would blur: accelerations go on smoothly."""
    table = cp.scott_russell(1.5, time={"end": 0.03}, output={"interval": 1e-4})
    dataset = simulate(cp.driven(table, "O", cp.steady(1.5, 6.0)))
    known = -0.4 * 36.0 * np.cos(1.5 + 6.0 * dataset.time.values)
    # rounding over the cube of the distance at which rows are no longer taken as they are
    assert np.abs(dataset.acceleration.sel(body="slider").values[:, 0] - known).max() < 1e-5


def test_passes_stay_recorded_when_another_method_takes_over() -> None:
    """Handed on after the first of two poses, in which a row is recorded."""
    first = (np.pi - 1.5) / 4.0
    table = cp.four_bar(1.5, 1.0, time={"end": 2.0}, output={"interval": 0.1 * first}, solver={"rtol": 1e-10})
    scene = Scene.model_validate(cp.driven(table, "A", cp.steady(1.5, 4.0)))
    panel = {"dop853": (Judge(50, lambda engine, looks: "so" if looks[-1].time > first + 0.1 else ""), "radau")}
    run = RunInParts(scene, {}, silent, Judges(panel, panel)).whole()
    assert run.model.scene.solver.integrator == "radau"
    # the pose is where closures depend on each other, which is known to the square root of what they are open
    assert [one.time for one in run.trajectory.passes] == pytest.approx([first, first + 0.5 * np.pi], abs=1e-6)
    found = record_run(run).to_xarray()
    assert four_bar_error(found, 1.5 + 4.0 * found.time.values, 1.0, cp.FOUR_BAR) < 1e-8  # a hundred times rtol


# Where it cannot go on -----------------------------------------------------------------------------------------------


def stopped(change: float) -> Table:
    """The crank turned by a step law within half a second, from 2.5 rad."""
    step = {"type": "step", "start": [0.0], "end": [0.5], "change": [change]}
    law = {"type": "sum", "laws": [{"type": "constant", "value": 2.5}, step]}
    return cp.driven(cp.four_bar(2.5), "A", law)


def test_rest_start_and_reach_are_three_sentences() -> None:
    with pytest.raises(SolverError, match=r"at t = 0\.5 s: .*comes to rest in a singular pose .*joint") as rest:
        simulate(stopped(np.pi - 2.5))
    with pytest.raises(SolverError, match=r"at t = 0 s: .*starts in a singular pose.*\[start\] branch") as start:
        simulate(cp.driven(cp.four_bar(np.pi), "A", cp.steady(np.pi, 1.0)))
    # the crank would stretch coupler and rocker beyond 0.55 m at arccos(17 / 24) from the ground, turning outwards
    lengths, limit = (0.3, 0.25, 0.3, 0.6), np.arccos((0.3**2 + 0.6**2 - 0.55**2) / (2 * 0.3 * 0.6))
    table = cp.driven(cp.four_bar(limit - 0.5, 1.0, lengths), "A", cp.steady(limit - 0.5, 2.0))
    with pytest.raises(SolverError, match=r"drive motor leads out of reach.*joint .*\[drive\.motor\]") as reach:
        simulate(table)
    time = float(str(reach.value).split("t = ")[1].split(" s")[0])
    assert time == pytest.approx(0.25, abs=1e-3)  # a little before speeds grow beyond bounds
    assert {error.value.exit_code for error in (rest, start, reach)} == {3}


@pytest.mark.parametrize("beyond", [-0.01, 1e-3, 0.003])
def test_a_motion_that_stops_near_the_pose_is_none_of_them(beyond: float) -> None:
    dataset = simulate(stopped(np.pi - 2.5 + beyond))
    assert len(dataset.pass_time) == (beyond > 0.0)
    crank = np.unwrap(angle(dataset, "crank"))
    # loops are closed to 1e-10, which angles magnify by the inverse of their distance from the pose; the closed form
    # has lost half its digits there, too
    assert four_bar_error(dataset, crank + 2.5 - crank[0], 1.0, cp.FOUR_BAR) < max(1e-7, 1e-9 / abs(beyond))


def test_a_rest_that_rounding_cannot_tell_from_the_pose_is_refused() -> None:
    with pytest.raises(SolverError, match="so close to a singular pose"):
        simulate(stopped(np.pi - 2.5 + 1e-5))


# Starts --------------------------------------------------------------------------------------------------------------


def from_rest(law: Table, **start: object) -> Table:
    return cp.driven(cp.four_bar(np.pi, **({"start": start} if start else {})), "A", law)


#: from rest, and at speed
LAWS = {
    "rest": {"type": "sum", "laws": [{"type": "constant", "value": np.pi}, {
        "type": "step", "start": [0.0], "end": [1.0], "change": [1.0]}]},
    "speed": cp.steady(np.pi, 1.0),
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("sign", [1, -1])
def test_the_scene_chooses_the_branch_out_of_a_change_point(law: str, sign: int) -> None:
    """The rocker turns by 0.74 or by -0.26 of what the crank does: roots of the loop equation's second-order part."""
    dataset = simulate(from_rest(LAWS[law], branch={"joint": "D", "sign": sign}))
    crank = np.unwrap(angle(dataset, "crank"))
    crank += np.pi - crank[0] % (2.0 * np.pi)
    sides = [
        apart(np.column_stack([angle(dataset, "coupler"), angle(dataset, "rocker")])[1:], known)
        for known in (np.array([cp.elbow(x, side, cp.FOUR_BAR) for x in crank[1:]]) for side in (1.0, -1.0))
    ]
    assert min(sides) < 1e-8  # out of rest the first stretch is known to 1e-8
    turned = np.unwrap(angle(dataset, "rocker"))
    assert np.sign(turned[-1] - turned[0]) == sign


def test_a_choice_that_is_none_is_refused() -> None:
    regular = cp.four_bar(2.0, start={"branch": {"joint": "D", "sign": 1}})
    for table, words in (
        (cp.driven(regular, "A", cp.steady(2.0, 1.0)), "does not start in a change point"),
        (from_rest(LAWS["speed"], branch={"joint": "E", "sign": 1}), "no joint 'E'"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            simulate(table)
        assert caught.value.place.startswith("[start.branch")


def test_an_open_choice_names_a_joint_that_distinguishes_the_branches() -> None:
    with pytest.raises(SolverError, match=r"2 ways, on which joint \w+ starts to move by") as caught:
        simulate(from_rest(LAWS["rest"]))
    assert "[start] branch = { joint =" in str(caught.value)


# All of them ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_every_method_passes_from_every_start(name: str) -> None:
    """Driven: from 14 angles with both elbows; the error is that of the closures alone."""
    solver, within = METHODS[name]
    for start in STARTS:
        for side in (1.0, -1.0):
            dataset, error = steady_four_bar(start, side, solver)
            assert error < within, (start, side)
            assert len(dataset.pass_time) == cp.passes(start + 8.0) - cp.passes(start), (start, side)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in METHODS if name.endswith((" 4", " 10", " 13", "fixed"))])
def test_free_four_bars_keep_their_branch(name: str) -> None:
    """Wherever the crank has come to, coupler and rocker are where the smooth branch has them."""
    solver, within = METHODS[name]
    for k, start in enumerate(STARTS):
        side = (-1.0) ** k
        table = cp.four_bar(start, side, solver={**solver, "ledger_tolerance": 0.1})
        table["body"]["crank"]["angular_velocity"] = [0.0, 0.0, 9.0]
        dataset = simulate(table)
        crank = np.unwrap(angle(dataset, "crank"))
        crank += start - crank[0]
        assert four_bar_error(dataset, crank, side, cp.FOUR_BAR) < 10.0 * within, start


@pytest.mark.slow
def test_mechanisms_without_a_pose_ahead_lay_no_polynomial() -> None:
    """A crank-rocker that comes near a change point and turns sharply there is integrated as it is."""
    lengths = (0.2, 0.4, 0.3, 0.499)
    table = cp.driven(cp.four_bar(1.5, 1.0, lengths, time={"end": 2.0}), "A", cp.steady(1.5, 4.0))
    run = integrate(Scene.model_validate(table), {}, lambda fraction, text: None)
    assert not run.trajectory.passes
    coupler = np.array([cp.elbow(x, 1.0, lengths) for x in 1.5 + 4.0 * run.trajectory.time])
    dataset = simulate(table)
    assert apart(np.column_stack([angle(dataset, "coupler"), angle(dataset, "rocker")]), coupler) < 1e-8


# Flexible links and clearance ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 4])
def test_a_coupler_that_bends_between_its_pins_passes_like_a_rigid_one(count: int) -> None:
    """Its modes move neither pin, so that crank and rocker are those of the rigid four-bar, however it vibrates."""
    lengths = (0.15, 0.3, 0.225, 0.375)
    table = cp.four_bar(1.5, 1.0, lengths, time={"end": 2.0})
    table["body"]["coupler"] = {
        "type": "flexible", "mesh": str(TREE / "meshes/checks/crank_rod.toml"),
        "modes": {"reference": "pinned-pinned", "count": count}, "pose": table["body"]["coupler"]["pose"],
    }  # fmt: skip
    table["joint"] |= {"B": cp.pin("crank.q", "coupler.crank"), "C": cp.pin("coupler.slider", "rocker.q")}
    scene = Scene.model_validate(cp.driven(table, "A", cp.steady(1.5, 4.0)))
    dataset = dynamics.simulate(scene, bundles(scene), silent)
    crank = 1.5 + 4.0 * dataset.time.values
    clear = np.abs((crank + 2.0 * np.pi) % (2.0 * np.pi) - np.pi) > 1e-5
    # loops are closed to 1e-10
    assert apart(angle(dataset, "rocker")[clear], cp.smooth(crank, 1.0, lengths)[clear, 1]) < 1e-9
    assert dataset.pass_time.values == pytest.approx([(np.pi - 1.5) / 4.0, (3.0 * np.pi - 1.5) / 4.0], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [{"rtol": 1e-8}, {"integrator": "radau", "rtol": 1e-6}])
def test_a_loop_with_a_loose_pin_next_to_it_passes(solver: Table) -> None:
    table = cp.four_bar(1.5, 1.0, time={"end": 0.6}, solver=solver)
    _, rocker = cp.elbow(1.5, 1.0, cp.FOUR_BAR)
    tip = np.array([0.5, 0.0]) + 0.3 * np.array([np.cos(rocker), np.sin(rocker)])
    table["body"]["bob"] = cp.bar(0.4, 0.15, tip, -0.5 * np.pi)
    table["joint"]["E"] = {
        "type": "clearance-revolute", "between": ["rocker.q", "bob.p"], "clearance": 2e-4, "pin_radius": 0.01,
        "length": 0.02, "normal": {"law": "flores", "restitution": 0.5, "stiffness": 1e8},
    }  # fmt: skip
    scene = Scene.model_validate(cp.driven(table, "A", cp.steady(1.5, 4.0)))
    dataset = dynamics.simulate(scene, {}, silent)
    assert four_bar_error(dataset, 1.5 + 4.0 * dataset.time.values, 1.0, cp.FOUR_BAR) < 1e2 * solver["rtol"]
    assert len(dataset.pass_time) == 1
    # the neighbour that tells how long the run can be believed starts next to it, though the crank turns
    assert float(dataset.separation[0]) < 1e-3


LOOSE_START, LOOSE_END = 1.4454684956268313, 0.05


def loose_four_bar(travel: float, edits: Table | None = None) -> Scene:
    """The four-bar with a loose pin whose rocker is turned by `travel` [rad] in 50 ms."""
    step = {"type": "step", "start": 0.0, "end": LOOSE_END, "change": travel}
    law = {"type": "sum", "laws": [{"type": "constant", "value": LOOSE_START}, step]}
    drive = {"drive": {"out": {"joint": "D", "law": law}}, "time.end": 2.0 * LOOSE_END}
    return load_scene(TREE / "scenes" / "checks" / "clearance_four_bar.toml", override=drive | (edits or {}))


def test_a_soft_contact_that_is_deep_within_the_drives_reach_is_no_end() -> None:
    """Impacts press it 2 mm deep, a fifth of the pin's radius; at the drive's position it could be open."""
    run = integrate(loose_four_bar(0.9, {"joint.C.normal.stiffness": 1e7}), {}, silent)
    assert run.trajectory.time[-1] == 2.0 * LOOSE_END
    assert -run.observed.touch["gap"].min() > 1.5e-3


def test_a_drive_that_leads_a_loose_loop_out_of_reach_is_refused_when_it_does() -> None:
    """Contacts give way where ideal joints do not; the rocker of the scene turns by 1.5 rad in 50 ms."""
    start, travel, end = LOOSE_START, 1.5, LOOSE_END
    texts: list[str] = []
    with pytest.raises(SolverError, match=r"joint C: .*drive out leads out of reach.*\[drive\.out\]") as caught:
        integrate(loose_four_bar(travel), {}, lambda fraction, text: texts.append(str(text)))
    # the second look, after 40 000 evaluations, is the first beyond the limit; it was reported after three millions
    assert int(re.findall(r"(\d+) evaluations", " ".join(texts))[-1]) < 400_000
    ((time, depth),) = np.array(
        re.findall(r"at t = (\S+) s the drive forces it to at least (\S+) m", str(caught.value)), float
    )
    # folded, crank and coupler keep the pin 0.2 m from A; the rocker's end comes nearer, and 0.2 mm are clearance
    angle = start + travel * (3.0 - 2.0 * time / end) * (time / end) ** 2
    near = np.hypot(0.3 + 0.2 * np.cos(angle), 0.2 * np.sin(angle))
    # times and depths are printed with six and three digits
    assert depth == pytest.approx(0.2 - near - 2e-4, rel=0.01)
    assert depth > 0.01
    # folded, crank and coupler are 0.2 m long together; the pin is 10 mm deep when the rocker, of 0.2 m, has gone on by
    # some 0.05 rad, a thirtieth of its travel
    folded = np.arccos((0.2**2 - 0.3**2 - 0.2**2) / (2 * 0.3 * 0.2))
    roots = np.roots([-2.0, 3.0, 0.0, -(folded - start) / travel])
    limit = end * next(r for r in roots.real if 0.0 < r < 1.0)
    assert limit < float(str(caught.value).split("t = ")[1].split(" s")[0]) < 1.2 * limit
