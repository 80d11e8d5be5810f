"""The horizon of pointwise validity: growth of a hair's breadth between a run and its twin."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.progress import silent
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.dynamics.run.observation import frames
from flexclear.pipeline.dynamics.run.run import engine_of, observed
from flexclear.pipeline.dynamics.run.start import consistent_start
from flexclear.pipeline.dynamics.run.trajectory import integrate
from tests.analytic.mechanism_runs import TREE, run


def test_rigid_clearance_converges_over_the_whole_stroke():
    """Perturbations grow 2 to 10 times over 0.18 s (28 impacts), measured independently with DOP853 at 1e-13."""
    csj = run("sps4/variants/first_csj")
    assert float(csj.horizon) == csj.time.values[-1]
    assert csj.twin_separation.values.max() < 1e-5 * np.abs(csj.velocity.values).max()


def test_frames_by_which_twins_are_compared_are_those_of_full_rows_but_for_open_loops():
    engine = engine_of(load_scene(TREE / "scenes/sps4/variants/first_csj.toml"), {}, silent)
    trajectory = integrate(engine, consistent_start(engine), silent)
    seen, alone = observed(engine, trajectory), frames(engine, trajectory.rows)
    for what in ("links", "sites"):
        for field in ("origin", "axes", "omega", "velocity"):
            here, known = getattr(alone, what)[field], getattr(seen, what)[field]
            # rtol is 1e-10, at which loops drift; rates count per second, so that they are open by more
            assert np.abs(here - known).max() < 1e-7 * np.abs(known).max(), (what, field)


def test_a_twin_of_a_motion_that_does_not_return_starts_where_the_run_does():
    """Two lifts, one after the other: at the end other pieces of the law are in force than at the start."""
    law = (("type", "step"), ("start", (0.0, 0.01)), ("end", (0.01, 0.02)), ("change", (1e-3, 1e-3)))
    lifted = run("sps4/csj", (("drive.P1.law", law), ("drive.P2.law", law), ("time.end", 0.02)))
    assert float(lifted.horizon) == lifted.time.values[-1]
    # 3e-11 m apart at the start; impacts of 20 ms make it grow less than those of a whole stroke do
    assert lifted.twin_separation.values.max() < 1e-5 * np.abs(lifted.velocity.values).max()


def test_the_undamped_flexible_mechanism_is_believed_for_a_part_of_the_stroke_only():
    """Perturbations grow by 1e6 to 1e7 within 0.1 s there; pointwise claims end at 12 to 70 ms."""
    far = run("sps4/far_csj_cb")
    # before the first impact, at 4.6 ms, nothing parts
    assert 0.0046 < float(far.horizon) < 0.12
    after = far.twin_time.values > float(far.horizon)
    assert far.twin_separation.values[after].max() > 1e3 * far.twin_separation.values[1:4].max()


def test_rare_outputs_do_not_hide_that_motions_part():
    """Impacts part them; a twin that is looked at once per stroke would be believed for a whole one."""
    often = run("sps4/far_csj_cb")
    rarely = run("sps4/far_csj_cb", (("output.interval", 0.18),))
    assert len(rarely.time.values) < len(often.time.values) - 1500
    # looked at where contacts end, at most some milliseconds apart once they come in rows
    assert abs(float(rarely.horizon) - float(often.horizon)) < 0.01


def test_damping_of_the_modes_moves_the_horizon():
    free, damped = run("sps4/far_csj_cb"), run("sps4/far_csj_cb", (("body.rod1.damping", 0.05),))
    assert float(damped.horizon) > float(free.horizon)


def test_a_tighter_tolerance_moves_the_horizon():
    loose, tight = (run("sps4/far_csj_cb", (("solver.rtol", rtol),)) for rtol in (1e-8, 1e-12))
    assert float(tight.horizon) > float(loose.horizon)


def test_a_run_without_contacts_has_no_twin():
    ideal = run("sps4/ideal")
    assert "horizon" not in ideal
    assert "twin_separation" not in ideal
