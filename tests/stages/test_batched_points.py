"""Points of a sweep whose evaluations are batched: each is what it is alone, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.artifacts.points import Point, join_points
from flexclear.dynamics.kernels import INTERPRETED
from flexclear.dynamics.record import point as points_of
from flexclear.dynamics.record.point import Runner
from flexclear.dynamics.run import run as running
from flexclear.dynamics.run.evaluation import batched_evaluation
from flexclear.scene.load import load_scene, with_numbers
from flexclear.scene.quantity import parse_recorded
from flexclear.scene.schema import Scene
from flexclear.stages.sweeps import sweep_engine, sweep_points

#: coefficients of a pin, from none to one that jams it on the way
FRICTION = (0.0, 3.0, 10.0, 13.0)
BALL = ("ball.velocity.largest", "contact.peak_force", "contact.impact_times.last", "ball.position.final")


def runner(scene: Scene, keep: Sequence[str] = BALL, **asked: Any) -> Runner:
    return Runner({}, [parse_recorded(name, scene.owners()) for name in keep], **asked)


def alone(scene: Scene, points: Sequence[Mapping[str, Any]], **asked: Any) -> list[Point]:
    """Each by a worker that has run nothing else."""
    return [sweep_points._point(runner(scene, **asked), scene, point) for point in points]


def batched(scene: Scene, points: Sequence[Mapping[str, Any]], **asked: Any) -> list[Point]:
    return sweep_points._run_together(runner(scene, **asked), scene, points)


def assert_same(found: Sequence[Point], known: Sequence[Point]) -> None:
    assert [(p.refused, p.evaluations) for p in found] == [(p.refused, p.evaluations) for p in known]
    for one, other in zip(found, known, strict=True):
        for mine, its in ((one.values, other.values), (one.error, other.error), (one.deviation, other.deviation)):
            assert mine.keys() == its.keys()
            assert all(np.array_equal(mine[name], its[name]) for name in mine)


@pytest.fixture
def batched_evaluations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The lanes of each group."""
    proper, made = batched_evaluation.LaneGroup, list[int]()

    def noted(rows: bytes, address: int, numbers: int, width: int) -> batched_evaluation.LaneGroup:
        made.append(width)
        return proper(rows, address, numbers, width)

    monkeypatch.setattr(batched_evaluation, "LaneGroup", noted)
    return made


def test_points_are_the_same_to_the_last_bit_whichever_are_evaluated_with_them(
    root: Path, batched_evaluations: list[int]
) -> None:
    """More of them than lanes, in each other numbers, also of the laws of time and of the method; of all lengths."""
    ball = load_scene(root / "scenes/checks/bounce.toml", override={"time.end": 0.5})
    points: list[dict[str, Any]] = [{"joint.contact.normal.restitution": e} for e in (0.5, 0.6, 0.7, 0.8)]
    points += [{"joint.contact.clearance": c, "time.end": 0.3 + 100.0 * c} for c in (1e-3, 1.5e-3, 2e-3)]
    points += [{"body.ball.mass": mass} for mass in (0.5, 2.0, 3.0)] + [{"solver.rtol": 1e-6}]
    known = alone(ball, points, error=True)
    assert len({float(p.values["contact.peak_force.largest"]) for p in known}) == len(points)
    assert_same(batched(ball, points, error=True), known)
    assert_same(batched(ball, points[::-1], error=True), known[::-1])
    assert_same(batched(ball, points[:3], error=True), known[:3])
    assert batched_evaluations == ([points_of.TOGETHER] * 3 if not INTERPRETED else [])


@pytest.mark.parametrize(
    "integrator", ["dop853", "dopri5", "exponential"]
)  # that evaluates with the kernels now and then
def test_points_of_a_closed_mechanism_with_friction_are_the_same_to_the_last_bit(
    root: Path, monkeypatch: pytest.MonkeyPatch, integrator: str
) -> None:
    monkeypatch.setattr(points_of, "TOGETHER", 4)  # as in a test of ensembles, whose code is on disk by then
    paper = load_scene(root / "scenes/sps4/csj.toml", override={"time.end": "60 ms", "solver.integrator": integrator})
    points = [{"joint.A1.clearance": c} for c in (3e-4, 4e-4, 5e-4)] + [{"joint.A1.normal.restitution": 0.7}]
    keep = ("platform.velocity.largest", "A1.peak_force", "A1.impact_times.count")
    known = alone(paper, points, keep=keep)
    assert all(p.values["A1.impact_times.count"] > 5 for p in known)
    assert_same(batched(paper, points, keep=keep), known)


def test_points_whose_friction_takes_different_numbers_of_turns_are_the_same_to_the_last_bit(
    root: Path, batched_evaluations: list[int]
) -> None:
    """Next to one without friction, and one that friction jams on the way."""
    crank = load_scene(root / "scenes/checks/rubbing_slider_crank.toml", override={"time.end": 0.06})
    points: list[dict[str, Any]] = [{"joint.A.friction.dynamic": mu, "joint.A.friction.static": mu} for mu in FRICTION]
    points += [{"body.slider.mass": 3.0}, {"joint.B.friction.preload": 20.0}]
    keep = ("crank.angular_velocity.final", "P.bearing_load.largest")
    known = alone(crank, points, keep=keep)
    assert [bool(p.refused) for p in known] == [False, False, False, True, False, False]
    assert_same(batched(crank, points, keep=keep), known)
    assert batched_evaluations == ([points_of.TOGETHER] if not INTERPRETED else [])


def test_a_point_that_fails_fails_alone_and_in_the_same_words(root: Path) -> None:
    """Refused before it is run, out of evaluations in the middle, and when its surfaces have passed each other."""
    ball = load_scene(root / "scenes/checks/bounce.toml", override={"time.end": 0.5})
    points: list[dict[str, Any]] = [{"joint.contact.normal.restitution": 0.5 + 0.1 * k} for k in range(4)]
    failing = [{"solver.evaluations": 900}, {"joint.contact.clearance": -1.0}, {"joint.contact.normal.stiffness": 1.0}]
    points[1:1], points[3:3] = failing[:2], failing[2:]
    known = alone(ball, points)
    assert [bool(p.refused) for p in known] == [False, True, True, True, False, False, False]
    assert len({p.refused for p in known}) == 4
    assert_same(batched(ball, points), known)


def test_sections_and_members_of_points_are_the_same_to_the_last_bit(root: Path) -> None:
    pendulum = load_scene(
        root / "scenes/checks/driven_pendulum.toml", override={"sections.transient": 1, "sections.periods": 20}
    )
    points = [{"load.torque.force.amplitude": value} for value in (0.9, 1.2, 1.5)]
    keep = ("bob.angular_velocity.sections",)
    assert_same(batched(pendulum, points, keep=keep), alone(pendulum, points, keep=keep))
    ball = load_scene(root / "scenes/checks/bounce.toml", override={"time.end": 0.3})
    points = [{"joint.contact.normal.restitution": e} for e in (0.5, 0.6, 0.7)]
    known = alone(ball, points, members=2)
    assert all(p.deviation["contact.peak_force.largest"] > 0.0 for p in known)
    assert_same(batched(ball, points, members=2), known)


def test_points_are_handed_out_as_many_as_step_side_by_side_where_that_pays() -> None:
    """Where they take many evaluations and there are many of them; they still end together."""

    def handed_out(evaluations: int, count: int = 200) -> tuple[list[int], list[bool], float]:
        busy, sizes, reported = [0.0, 0.0], list[int](), list[bool]()

        def submit(family: str, packed: bytes, points: list[Any], alone: bool, abreast: bool) -> Any:
            from concurrent.futures import Future

            seconds = 0.1 * len(points)
            busy[busy.index(min(busy))] += seconds
            sizes.append(len(points))
            reported.append(abreast)
            future: Future[Any] = Future()
            future.set_result(([Point({}, {}, {}, evaluations) for _ in points], seconds))
            return future

        jobs = [sweep_engine.Job(str(n), "family", {}) for n in range(count)]
        sweep_engine.Engine(submit, lambda: 2).run(jobs, {"family": b""}, lambda *_: None)
        assert sum(sizes) == count
        return sizes, reported, sum(busy) / max(busy)

    sizes, reported, together = handed_out(evaluations=100_000)
    assert reported == [False] + [True] * (len(sizes) - 1)  # the first tells how many it takes
    assert all(size % sweep_engine.POINTS_TOGETHER == 0 for size in sizes[1:-4])
    assert max(sizes) >= 4 * sweep_engine.POINTS_TOGETHER
    assert together >= 1.85  # found 2.00
    assert not any(handed_out(evaluations=1_000)[1])
    assert not any(handed_out(evaluations=100_000, count=20)[1])
    assert not any(handed_out(evaluations=10_000_000, count=16)[1])  # eight for each of two, but for the first


def test_the_run_for_a_points_error_reuses_its_model(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One model is made from scratch, for the first run of the first point."""
    paper = load_scene(root / "scenes/sps4/csj.toml", override={"time.end": "2 ms"})
    proper, made = running.build, list[float]()

    def noted(scene: Scene, *rest: Any) -> Any:
        made.append(scene.solver.rtol)
        return proper(scene, *rest)

    monkeypatch.setattr(running, "build", noted)
    worker = runner(paper, keep=("platform.velocity.largest",), error=True)
    for clearance in (3e-4, 4e-4):
        assert not worker.run(with_numbers(paper, {"joint.A1.clearance": clearance})).refused
    assert made == [paper.solver.rtol]


def test_members_in_batches_are_those_of_one_point(root: Path):
    """Of equal seeds the first starts are the same, so that more members need only those that are missing."""
    scene = load_scene(root / "scenes/checks/bounce.toml", override={"time.end": 0.3})
    whole = runner(scene, members=6).run(scene)
    parts = [runner(scene, members=4).run(scene), runner(scene, members=2, first=4).run(scene)]
    found = join_points([(parts[0], 4), (parts[1], 2)])
    assert found.evaluations == whole.evaluations
    for mine, its in ((found.values, whole.values), (found.deviation, whole.deviation)):
        assert mine.keys() == its.keys()
        for name in mine:  # sums in another order
            np.testing.assert_allclose(mine[name], its[name], rtol=1e-9, atol=1e-12)
