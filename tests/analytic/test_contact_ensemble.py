"""Ensembles from scene to statistics: members that start a known distance apart, falling in closed form."""

import itertools
import threading
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.adaptive import LEAST_NORM
from flexclear.dynamics.kernels import INTERPRETED
from flexclear.dynamics.model.contacts import arms
from flexclear.dynamics.record import ensemble
from flexclear.dynamics.record.ensemble import difference_of_starts
from flexclear.dynamics.run import trajectory
from flexclear.dynamics.run.evaluation import batched_evaluation
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of, engines
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress, silent
from flexclear.workflow import cores
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import Table, frame, ground, joint, rigid, simulated
from tests.properties.mechanisms import scene as written
from tests.reference import contact_solutions as exact

END, SEPARATION, MEMBERS = 0.3, 1e-6, 4
ALONG_X = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}


def scene(members: int = MEMBERS) -> Scene:
    asked = {"members": members, "perturbation": "1 um"}
    return load_scene(TREE / "scenes/checks/bounce.toml", override={"ensemble": asked, "time.end": END})


@cache
def members() -> xr.Dataset:
    return analyses.ensemble(scene(), {}, silent)


def test_members_start_at_the_requested_distance_and_fall_alike() -> None:
    position = members().position.sel(body="ball").values
    offset = position[:, 0]
    # a displacement from a solution of linear equations, of rounding size here
    assert np.linalg.norm(offset, axis=1) == pytest.approx(np.full(MEMBERS, SEPARATION), rel=1e-6)
    assert np.linalg.norm(offset[0] - offset[1]) > 0.1 * SEPARATION
    time = members().time.values
    k = int(np.searchsorted(time, 0.1))
    assert position[:, k, 2] - offset[:, 2] == pytest.approx(np.full(MEMBERS, -0.5 * 9.81 * time[k] ** 2), abs=1e-10)


def test_members_record_their_impacts_and_the_fraction_of_time_in_contact() -> None:
    (known,) = (b for b in exact.bounces(1.0, 1e8, 0.7, 9.81, 0.1, END))
    assert members().impact_count.values.tolist() == [[1]] * MEMBERS
    # a micrometre more or less to fall changes the speed by 5e-6 of it, the duration by a fifth of that
    fraction = (known.end - known.start) / END
    assert members().contact_time_share.values == pytest.approx(np.full((MEMBERS, 1), fraction), rel=1e-5)
    assert np.ptp(members().peak_force.values) > 0.0


def test_a_contact_that_is_closed_at_the_end_counts_until_then() -> None:
    """Half of the impact's duration is left out of the run, so the contact lasts for the other half."""
    (known,) = (b for b in exact.bounces(1.0, 1e8, 0.7, 9.81, 0.1, END))
    end = 0.5 * (known.start + known.end)
    cut = analyses.ensemble(edited(scene(2), {"time.end": end}), {}, silent)
    # a micrometre more or less to fall moves the start by 0.7 us, of some 100 us
    assert cut.contact_time_share.values == pytest.approx(np.full((2, 1), (end - known.start) / end), rel=0.05)
    assert cut.impact_count.values.tolist() == [[1]] * 2


@pytest.mark.parametrize("threads", [1, 3])
def test_members_are_the_same_to_the_last_bit_whoever_makes_them(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    monkeypatch.setattr(cores, "count_cores", lambda: threads)
    assert analyses.ensemble(scene(), {}, silent).identical(members())


@pytest.mark.parametrize("lanes", [4, 8])
def test_members_are_the_same_to_the_last_bit_however_many_are_evaluated_at_once(
    monkeypatch: pytest.MonkeyPatch, lanes: int
) -> None:
    """Also with fewer lanes than members, and with fewer members than lanes; that lanes are used is looked at."""
    monkeypatch.setattr(cores, "count_cores", lambda: 1)
    monkeypatch.setattr(ensemble, "LANES", (lanes,))
    known, made = six(), listened(monkeypatch)
    assert analyses.ensemble(scene(members=6), {}, silent).identical(known)
    assert [len(group._words) for group in made] == ([] if INTERPRETED else [lanes])


def listened(monkeypatch: pytest.MonkeyPatch) -> list[batched_evaluation.LaneGroup]:
    """The groups that will be made."""
    proper, made = batched_evaluation.LaneGroup, list[batched_evaluation.LaneGroup]()

    def noted(*given: Any) -> batched_evaluation.LaneGroup:
        made.append(proper(*given))
        return made[-1]

    monkeypatch.setattr(batched_evaluation, "LaneGroup", noted)
    return made


@cache
def six() -> xr.Dataset:
    """Six members, each of which takes its own steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble, "FEW", 7)
        patch.setattr(cores, "count_cores", lambda: 1)
        return analyses.ensemble(scene(members=6), {}, silent)


def test_impacts_with_friction_in_a_closed_mechanism_are_the_same_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Four members at once, and one after the other: impacts, sticking, rejected steps, loops that are closed."""
    asked = {"members": 4, "perturbation": "1 um"}
    paper = load_scene(TREE / "scenes/sps4/csj.toml", override={"ensemble": asked, "time.end": "60 ms"})
    monkeypatch.setattr(cores, "count_cores", lambda: 1)
    made = listened(monkeypatch)
    together = analyses.ensemble(paper, {}, silent)
    assert [bool(group._places.any()) for group in made] == ([] if INTERPRETED else [True])  # several at once
    assert (together.impact_count.values > 5).all()
    assert not np.array_equal(together.position[0], together.position[1])
    monkeypatch.setattr(ensemble, "FEW", 5)
    assert analyses.ensemble(paper, {}, silent).identical(together)


def test_members_together_end_when_one_of_them_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others end at their next pause; nobody waits for ever."""
    monkeypatch.setattr(cores, "count_cores", lambda: 1)
    proper, begun, threads = trajectory._begin_closed, itertools.count(), threading.active_count()

    def fails(engine: Engine, y: np.ndarray, events: np.ndarray) -> None:
        if next(begun) == 2:  # whichever thread it is in: one that is done with a member takes another
            raise SolverError("the third")
        proper(engine, y, events)

    monkeypatch.setattr(trajectory, "_begin_closed", fails)
    with pytest.raises(SolverError, match="the third"):
        analyses.ensemble(scene(), {}, silent)
    assert threading.active_count() <= threads  # those of other tests may end meanwhile


def test_of_concurrent_members_the_first_that_fails_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "count_cores", lambda: 2)
    ended = []

    def work(k: int, alive: Progress) -> None:
        if k in (1, 3):
            raise SolverError(f"member {k}")
        while k == 2:  # until another one has failed
            try:
                alive(None, "")
            except BaseException:
                ended.append(k)
                raise

    with pytest.raises(SolverError, match="member 1"):
        cores.side_by_side(work, 4, lambda _: None)
    assert ended in ([], [2])  # it may not have begun


def carried(**path: Any) -> Scene:
    """A ball in the socket of a block that swings along a rail on a path, for which the rail's force is asked."""
    swing = {"type": "harmonic", "amplitude": 0.01, "frequency": 10.0}
    bodies = {
        "ground": {"type": "ground", "frames": {"rail": ALONG_X}},
        "block": rigid(1.0, 1e-3, {"rail": ALONG_X, "cup": {}}),
        "ball": rigid(0.1, 1e-5, {"centre": {}}),
    }
    normal = {"law": "lankarani-nikravesh", "restitution": 0.9, "stiffness": 1e9}
    cup = joint("clearance-spherical", "block.cup", "ball.centre", clearance=1e-3, ball_radius=0.01, normal=normal)
    more = {"output": {"interval": 1e-3}, "solver": {}, "ensemble": {"members": 2, "perturbation": 1e-9}}
    more["drive"] = {"path": {"frame": "block.cup", "position": {"x": swing}} | path}
    joints = {"rail": joint("prismatic", "ground.rail", "block.rail"), "cup": cup}
    return Scene.model_validate(written(bodies, joints, 0.06, **more))


def test_members_of_an_actuated_scene_are_driven_like_its_run() -> None:
    """Nanometres apart, after a few impacts: what members and run differ by is the sensitivity of the impacts."""
    asked = carried(actuators=["rail"])
    known, members = simulated(asked), analyses.ensemble(asked, {}, silent)
    closings = known.event_kind.values == "closing"
    assert 2 <= closings.sum() < 20
    assert members.impact_count.values.tolist() == [[closings.sum()]] * 2
    peak = float(np.nanmax(known.event_peak_force.values[closings]))
    # they are 3e-5 apart: nanometres, magnified by a few impacts, and by more if these come in another way
    assert members.peak_force.values == pytest.approx(np.full((2, 1), peak), rel=1e-3)


def test_members_whose_actuators_cannot_do_it_are_refused_like_the_run() -> None:
    asked = carried(actuators=["rail.spin"])
    for made in (dynamics.simulate, analyses.ensemble):
        with pytest.raises(InputError, match="spin"):
            made(asked, {}, silent)


def test_the_next_step_knows_the_error_of_the_last_one() -> None:
    """It is kept while the rates at the step's end are awaited."""
    asked = load_scene(TREE / "scenes/sps4/csj.toml", override={"time.end": "10 ms"})
    engine, _ = engines(asked, {}, silent)
    trajectory.integrate(engine, consistent_start(engine), silent)
    assert 0.0 < engine.control[m.NORM] <= 1.0
    assert engine.control[m.LAST_NORM] == max(engine.control[m.NORM], LEAST_NORM)


# By how much members start apart where the scene does not say --------------------------------------------------------


def swinging_bar(size: float) -> Table:
    """A bar of 0.4 sizes on a hinge, whose swing ends at a stop."""
    bar = rigid(1.0, 0.01 * size**2, {"p": {}, "e": frame((0.4 * size, 0.0, 0.0))}, com=[0.2 * size, 0.0, 0.0], pose={})
    normal = {"law": "hunt-crossley", "restitution": 0.8, "stiffness": 1e3 * size**2}
    return written(
        {"ground": ground(o=(0, 0, 0)), "bar": bar},
        {"A": joint("revolute", "ground.o", "bar.p")},
        end=0.1,
        stop={"A": {"joint": "A", "lower": -0.5, "normal": normal}},
        load={"gravity": {"type": "gravity", "acceleration": [0.0, -9.81 * size, 0.0]}},
    )


def made(scene: Scene) -> tuple[Engine, float]:
    engine = engine_of(scene, {}, silent)
    return engine, difference_of_starts(engine, consistent_start(engine)).perturbation


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e3])
def test_an_angle_differs_by_as_much_whatever_the_size(size: float) -> None:
    engine, difference = made(Scene.model_validate(swinging_bar(size)))
    # 2.5e-8 of the size, in rad
    assert difference / arms(engine.model.mechanism)[0] == pytest.approx(2.5e-8, rel=1e-12)


def test_a_ball_differs_by_a_thousandth_of_its_clearance() -> None:
    scene = load_scene(TREE / "scenes/checks/clearance_pendulum.toml")
    _, difference = made(scene)
    clearance = min(joint.clearance for joint in scene.contacts().values())
    assert difference == pytest.approx(1e-3 * clearance, rel=1e-12)
