"""Ensembles of chaotic runs: how well they know their means, from made-up members."""

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.artifacts.quantities import standard_error
from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.post.cost import statistics

POSITION = Quantity("slider", "position")
TIMES = Quantity("pin", "impact_times")


def test_larger_ensembles_know_their_mean_better():
    values = np.random.default_rng(3).normal(10.0, 1.0, size=64)
    errors = [statistics.relative_error(values[:size]) for size in statistics.growing(64)]
    assert statistics.growing(64) == [8, 16, 32, 64]
    # 1.96 standard deviations of 0.1 over the root of 64, from one draw of them
    assert errors[-1] == pytest.approx(1.96 * 0.1 / 8.0, rel=0.2)
    assert errors[-1] < errors[1]


def test_the_figure_of_ensembles_is_drawn():
    random = np.random.default_rng(1)
    data = {name: (("member", "contact"), random.uniform(1, 2, (16, 1))) for name in statistics.STATISTICS}
    one = xr.Dataset(data, {"contact": ["pin"]}, {"cpu_seconds": 0.5})
    assert set(statistics.make("s", {"rtol 1e-06": one, "rtol 1e-08": one}, "t")) == {"s.png", "s.svg"}


def test_the_standard_error_of_a_series_is_that_of_its_members_mean():
    random = np.random.default_rng(5)
    values = random.normal(0.0, 1.0, (400, 3, 1, 3)) * np.array([0.0, 1.0, 2.0])[:, None, None]
    ensemble = xr.Dataset({"position": (("member", "time", "body", "axis"), values)}, {"body": ["slider"]})
    # the last time: deviation 2 on each of three axes, over the root of 400
    assert standard_error(ensemble, POSITION) == pytest.approx(2.0 * np.sqrt(3.0) / 20.0, rel=0.1)
    assert standard_error(ensemble, Quantity("other", "position")) is None
    assert standard_error(ensemble, Quantity("slider", "orientation")) is None
    assert standard_error(ensemble, TIMES) is None


def test_bootstrap_intervals_hold_the_mean_of_the_population_as_often_as_they_say():
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        found = statistics.estimate(random.normal(size=16))
        hits += found.low < 0.0 < found.high
    # 95 % intervals of the percentile kind from 16 members cover 88 to 96 %
    assert 0.85 < hits / 200 < 0.98
