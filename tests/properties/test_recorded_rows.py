"""What is recorded of a row: the same whatever rows stand next to it, and as independent formulas have it."""

from dataclasses import fields, replace

import numpy as np
import pytest

from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.topology import topology
from flexclear.dynamics.run.evaluation.observation import observe
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.ledger import speeds_of_bodies
from flexclear.dynamics.run.run import engine_of, observe_run
from flexclear.dynamics.run.run import integrate as whole
from flexclear.dynamics.run.trajectory import integrate
from flexclear.numerics.rotations import matrix_to_quaternion, quaternion_to_matrix, without_sign_jumps
from flexclear.scene.load import load_scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE


def four_bar():
    """A four-bar of 501 rows, 11 to a step, of which five sixths have to be closed, and its engine."""
    engine = engine_of(load_scene(TREE / "scenes/gallery/four_bar.toml"), {}, silent)
    return engine, integrate(engine, consistent_start(engine), silent)


def test_a_row_is_recorded_alike_alone_and_between_others_from_which_its_closing_starts():
    engine, trajectory = four_bar()
    together = observe(engine, trajectory.rows)
    assert np.all(together.status == 0)
    # each to a ten thousandth of a billionth of its size, the share of it at which rows are closed (rtol 1e-10)
    assert together.residual.max() < 1e-12 * engine.model.length
    for k in range(8, 501, 29):
        alone = observe(engine, trajectory.rows[k : k + 1])
        for field in fields(alone):
            here, there = (np.asarray(getattr(seen, field.name)) for seen in (alone, together))
            if field.name in ("residual", "status", "jacobian") or here.dtype.names:
                continue
            size = np.abs(there).max(initial=0.0)
            # 1e-13 by how rows are closed, times what accelerations feel of that, and a factor ten
            assert np.abs(here[0] - there[k]).max(initial=0.0) <= 1e-11 * size, (field.name, k)


def test_closure_rows_may_be_chosen_twice_between_two_rows():
    """Then a part of the record has no row, as of a redundant mechanism of which outputs are rare."""
    scene = load_scene(TREE / "scenes/gallery/four_bar.toml", {"time.end": "20 ms"})
    run = whole(scene, {}, silent)
    (begun, kept), at = run.trajectory.selections[0], run.trajectory.time[2:4].mean()
    chosen = ((begun, kept), (at, kept), (1.0001 * at, kept))
    twice = replace(run, trajectory=replace(run.trajectory, selections=chosen))
    assert [part.stop - part.start for part, _ in twice.trajectory.parts()] == [3, 0, len(run.trajectory.rows) - 3]
    again = observe_run(run.engine, twice.trajectory)
    assert np.array_equal(again.state[:3], run.observed.state[:3])
    assert np.array_equal(topology(twice)[0]["condition"][1], topology(run)[0]["condition"][1])


def test_bodies_and_frames_are_recorded_where_their_links_carry_them():
    engine, trajectory = four_bar()
    model, seen = engine.model, observe(engine, trajectory.rows)
    motions, bodies = Motions(model, seen), model.scene.rigid()
    every, names = motions.every_body, list(model.mechanism.frames)
    turns = quaternion_to_matrix(without_sign_jumps(every.quaternion))
    speeds = np.linalg.norm(every.velocity, axis=2)
    assert np.abs(speeds_of_bodies(model, seen) - speeds).max() <= 1e-13 * speeds.max()
    for k, name in enumerate(motions.moving_bodies):
        link = model.mechanism.link_of[name]
        there, here = seen.links[:, link], model.links[link].placements[name]
        arm = np.einsum("tij,j->ti", there["axes"], here.point(np.array(bodies[name].com)))
        swing = np.cross(there["omega"], arm)
        a = there["acceleration"] + model.gravity + np.cross(there["alpha"], arm) + np.cross(there["omega"], swing)
        known = {"position": there["origin"] + arm, "velocity": there["velocity"] + swing, "acceleration": a}
        for field, values in {**known, "omega": there["omega"], "alpha": there["alpha"]}.items():
            # sums of a few terms of their own size, in another order: rounding
            assert np.abs(getattr(every, field)[:, k] - values).max() <= 1e-13 * max(1.0, np.abs(values).max())
        assert np.abs(turns[:, k] - there["axes"] @ here.R).max() < 1e-13
    for k, (name, frame) in enumerate(model.mechanism.frames.items()):
        link = model.mechanism.link_of[frame.body]
        place = model.links[link].placements[frame.body].of(frame.placement)
        there = seen.links[:, link]
        known = there["origin"] + np.einsum("tij,j->ti", there["axes"], place.p)
        assert np.abs(motions.positions(names)[:, k] - known).max() < 1e-14, name


@pytest.mark.parametrize("largest", range(4))
def test_quaternions_of_the_record_are_those_of_their_matrices(largest: int):
    generator = np.random.default_rng(largest)
    known = generator.normal(size=(20, 4))
    known[:, largest] += 5.0 * np.sign(known[:, largest])
    known[0] = np.eye(4)[largest]  # no turn, or half a turn about an axis
    known /= np.linalg.norm(known, axis=1, keepdims=True)
    found = matrix_to_quaternion(quaternion_to_matrix(known))
    assert np.all(found[:, 0] >= 0.0)
    # the same rotations: rounding of some products
    assert np.abs(np.abs(np.sum(found * known, axis=1)) - 1.0).max() < 1e-14
