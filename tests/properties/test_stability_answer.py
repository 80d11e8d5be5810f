"""Is a run stable: each check against a made-up run that fails just that one."""

import numpy as np
import pytest
import xarray as xr

from flexclear.post.answers import stability


def run(energy_error=1e-9, loops=1e-12, condition=5.0, rejected=1, stiff=0.0, horizon=1.0) -> xr.Dataset:
    """A slider-crank's outline: extent 1 m, largest energy 2 J, 100 steps, 1 s."""
    time = np.linspace(0.0, 1.0, 11)
    position = np.zeros((11, 1, 3))
    position[:, 0, 0] = time
    return xr.Dataset(
        {
            "kinetic": (("time",), 2.0 * time),
            "energy_error": (("time",), energy_error * time),
            "constraint_error": (("time",), loops * time),
            "condition": (("time",), condition * (1.0 + time)),
            "position": (("time", "body", "axis"), position),
            "horizon": ((), horizon),
        },
        {"time": time, "body": ["slider"]},
        {"steps": 100, "rejected_steps": rejected, "stiff_share": stiff},
    )


def failing(found: list[stability.Check]) -> list[str]:
    return [check.name for check in found if not check.good]


def test_a_good_run_passes_every_check():
    found = stability.checks(run(), None)
    assert failing(found) == []
    assert stability.answer(run(), found).startswith(f"Yes: all {len(found)} checks hold.")


@pytest.mark.parametrize(
    "changed, name",
    [
        ({"energy_error": 1e-2}, "energy balance"),
        ({"loops": 1e-5}, "drift of closed loops"),
        ({"condition": 1e7}, "distance from singular poses"),
        ({"rejected": 80}, "rejected steps"),
        ({"stiff": 0.5}, "steps limited by stability"),
        ({"horizon": 0.3}, "predictability"),
    ],
)
def test_each_check_fails_where_its_value_exceeds_its_limit(changed: dict[str, float], name: str):
    made = run(**changed)
    found = stability.checks(made, None)
    assert failing(found) == [name]
    text = stability.answer(made, found)
    if name == "predictability":  # a chaotic motion is no fault of the integration
        assert "The integration is stable" in text
    else:
        assert name in text
        assert next(c for c in found if c.name == name).advice in text


def test_the_figure_needs_no_loops_and_no_contacts():
    bare = run().drop_vars(["constraint_error", "condition", "horizon"])
    assert set(stability.figure(bare)) == {"stability.png", "stability.svg"}


def test_no_sentence_says_less_than_the_ensemble():
    """Members start further from the run than its perturbed run: where they differ, it is no comfort."""
    made = run(horizon=1.0)
    assert failing(stability.checks(made, None, 1.0)) == []
    found = stability.checks(made, None, 0.25)
    assert failing(found) == ["predictability"]
    text = stability.answer(made, found, 0.25)
    assert "The members of its ensemble differ by 0.1 % from 250 ms on." in text
    assert not text.startswith("Yes")
    assert "members" not in stability.answer(made, found, 1.0)
