"""A run says when the modes of a body lack what its joints need."""

from pathlib import Path

import pytest

from flexclear import edited, load_scene
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


BEAM = SPS4.parent / "checks" / "rotating_beam.toml"


@pytest.mark.parametrize("reference", ["craig-bampton", "cantilever"])
def test_the_support_of_a_clamped_body_is_no_lack_of_compliance(reference: str):
    """The body frame moves with the clamped frame, where all shapes vanish: only other frames can show a lack."""
    modes = {"reference": reference, "count": 8, "interfaces": ["root"]}
    scene = load_scene(BEAM, {"body.beam.modes": modes})
    (bundle,) = bundles(scene).values()
    assert float(bundle.compliance_share.sel(frame="root", frame_held="root").min()) < 0.9
    assert missing_compliance(scene, {"beam": bundle}) == []
    push = {"type": "point-force", "frame": "beam.tip", "force": [0.0, 0.0, 1.0]}
    (text,) = missing_compliance(edited(scene, {"load": {"push": push}}), {"beam": bundle})
    assert "static compliance between 'root' and 'tip'" in text or "static compliance between 'tip' and 'root'" in text
