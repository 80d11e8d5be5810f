"""A run says when the modes of a body lack what its joints need."""

from pathlib import Path

from flexclear import load_scene
from flexclear.stages.simulation import missing_compliance
from tests.analytic.mechanism_runs import bundles

SPS4 = Path(__file__).parents[2] / "scenes" / "sps4"


def reported(name: str) -> list[str]:
    scene = load_scene(SPS4 / f"{name}.toml")
    return missing_compliance(scene, bundles(scene))


def test_fixed_normal_modes_leave_the_ends_rigid_and_the_run_says_so():
    (text,) = reported("far_fixed")
    assert "rod1: its fixed-fixed modes have too little of the static compliance" in text
    assert "craig-bampton" in text


def test_a_statically_complete_basis_has_nothing_to_say():
    assert reported("far_cb") == []


def test_a_rigid_scene_has_nothing_to_say():
    assert reported("ideal") == []
