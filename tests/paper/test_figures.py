"""Every figure and table is there, is made of what it asks for, and has bytes that depend on nothing else."""

from __future__ import annotations

import struct
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flexclear.system.progress import silent
from papers.wang_wang_2019 import figures
from papers.wang_wang_2019.figures import joint
from tests.paper.material import everything

TREE = Path(__file__).resolve().parents[2]
ARTIFACTS = {"run", "mesh", "tight", "post", "ensemble", "modes", "fine-modes", "bundle", "timing"}


@cache
def made(name):
    """Files of one figure or table from the made-up artifacts, and nothing but those it asks for."""
    asked = {reference: everything()[reference] for reference in figures.figure(name).needs}
    return figures.draw({"figure": name}, asked, silent)


def test_all_figures_and_tables_of_the_paper_are_listed():
    # all but the paper's figures 2 and 7, a beam element and a leg, which figures 1 and 10 have
    plots = {f"fig{n:02d}" for n in (1, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17)}
    assert set(figures.NAMES) == plots | {f"table{n:02d}" for n in range(1, 11)} | {"table_verdicts"}


@pytest.mark.parametrize("name", figures.NAMES)
def test_needs_name_scenes_and_artifacts_that_exist(name):
    needs = figures.figure(name).needs
    assert needs
    assert len(set(needs)) == len(needs)
    for reference in needs:
        scene, _, artifact = reference.partition(":")
        assert artifact.partition("/")[0] in ARTIFACTS
        assert (TREE / "scenes" / f"{scene}.toml").is_file() or (
            artifact == "timing" and (TREE / "scenes" / scene).is_dir()
        )


@pytest.mark.parametrize("name", figures.NAMES)
def test_makes_the_files_of_its_name(name):
    found = made(name)
    suffixes = {"csv", "md"} if name.startswith("table") else {"png", "svg"}
    assert set(found) == {f"{name}.{suffix}" for suffix in suffixes}
    assert all(found.values())


@pytest.mark.parametrize("name", ["fig08", "table09"])
def test_equal_artifacts_give_equal_bytes(name):
    assert made(name) == made.__wrapped__(name)


@pytest.mark.parametrize("name", ["fig06", "fig17"])
def test_pictures_hold_no_date_and_are_wide_enough_to_read(name):
    found = made(name)
    assert b"<dc:date>" not in found[f"{name}.svg"]
    assert b"tIME" not in found[f"{name}.png"]
    width, height = struct.unpack(">II", found[f"{name}.png"][16:24])
    assert width >= 1200
    assert height >= 400


def test_friction_curve_goes_through_its_corners_and_is_odd():
    law = (2e-4, 1e-2, 0.15, 0.1)
    v = np.array([-1.0, -1e-2, -2e-4, 0.0, 2e-4, 1e-2, 1.0])
    # corners of the law, exact up to rounding
    np.testing.assert_allclose(joint.coefficient(v, *law), [-0.1, -0.1, -0.15, 0.0, 0.15, 0.1, 0.1], atol=1e-15)


def test_observed_friction_is_read_from_force_and_power():
    run = everything()["sps4/csj:run"].sel(contact="A1")
    speed, mu = joint.observed(run)
    # the made-up run slides at 20 mm/s with a tangential force of a tenth of the normal one
    np.testing.assert_allclose(mu, 0.1, rtol=1e-9)
    np.testing.assert_allclose(speed, 0.02, rtol=1e-9)
    assert mu.size > 10


def test_an_unknown_figure_is_an_error_that_names_the_nearest():
    with pytest.raises(Exception, match="fig16"):
        figures.figure("fig1666")
