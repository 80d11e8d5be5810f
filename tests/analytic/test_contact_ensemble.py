"""Ensembles from scene to statistics: members that start a known distance apart, falling in closed form."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import xarray as xr

from pipeline import dynamics
from pipeline.core.scene.load import load_scene
from pipeline.core.scene.schema import Scene
from pipeline.post import derive
from tests.analytic.mechanism_runs import TREE, run
from tests.reference import contact_solutions as exact

END, APART, MEMBERS = 0.3, 1e-6, 4


def scene() -> Scene:
    asked = {"members": MEMBERS, "perturbation": "1 um"}
    return load_scene(TREE / "scenes/checks/bounce.toml", override={"ensemble": asked, "time.end": END})


def _quiet(share: float | None, text: str) -> None:
    """Nobody watches."""


@cache
def members() -> xr.Dataset:
    return dynamics.ensemble(scene(), {}, _quiet)


def test_members_start_the_asked_distance_apart_and_fall_alike() -> None:
    position = members().position.sel(body="ball").values
    offset = position[:, 0]
    # a displacement from a solution of linear equations, of rounding size here
    assert np.linalg.norm(offset, axis=1) == pytest.approx(np.full(MEMBERS, APART), rel=1e-6)
    assert np.linalg.norm(offset[0] - offset[1]) > 0.1 * APART
    time = members().time.values
    k = int(np.searchsorted(time, 0.1))
    assert position[:, k, 2] - offset[:, 2] == pytest.approx(np.full(MEMBERS, -0.5 * 9.81 * time[k] ** 2), abs=1e-10)


def test_members_tell_impacts_and_their_share_of_the_time() -> None:
    (known,) = (b for b in exact.bounces(1.0, 1e8, 0.7, 9.81, 0.1, END))
    assert members().impact_count.values.tolist() == [[1]] * MEMBERS
    # a micrometre more or less to fall changes the speed by 5e-6 of it, the duration by a fifth of that
    share = (known.end - known.start) / END
    assert members().contact_time_share.values == pytest.approx(np.full((MEMBERS, 1), share), rel=1e-5)
    assert np.ptp(members().peak_force.values) > 0.0


def test_statistics_of_the_members_are_in_the_post_artifact() -> None:
    post = derive(run("checks/bounce", (("time.end", END),)), members())
    peaks = members().peak_force.sel(contact="contact").values
    found = post.peak_force_quantile.sel(contact="contact").values
    assert found == pytest.approx(np.quantile(peaks, post["quantile"].values), rel=1e-14)
    assert (np.diff(found) > 0.0).all()
    assert float(post.impact_count_mean.sel(contact="contact")) == 1.0
    assert float(post.contact_time_share_mean.sel(contact="contact")) > 0.0
    speed = members().velocity.sel(body="ball", axis="z").values
    assert post.velocity_mean.sel(kept="ball", axis="z").values == pytest.approx(speed.mean(axis=0), abs=1e-12)
