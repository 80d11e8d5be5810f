"""A run says when the modes of a body lack what its joints need."""

from pathlib import Path

import pytest

from flexclear import load_scene
from flexclear.stages.simulation import missing_compliance
from tests.analytic.mechanism_runs import bundles

SPS4 = Path(__file__).parents[2] / "scenes" / "sps4"


@pytest.mark.parametrize("name, count", [("far_fixed", 1), ("far_cb", 0), ("ideal", 0)])
def test_a_run_reports_a_basis_that_lacks_compliance_and_no_other(name: str, count: int):
    """Fixed normal modes leave the ends rigid; Craig-Bampton modes are statically complete."""
    scene = load_scene(SPS4 / f"{name}.toml")
    texts = missing_compliance(scene, bundles(scene))
    assert len(texts) == count
    for text in texts:
        assert "rod1: its fixed-fixed modes have too little of the static compliance" in text
        assert "craig-bampton" in text
