"""A rod that rings in a lasting contact, by `exponential`, which follows the modes exactly and the contact by steps."""

from __future__ import annotations

from functools import cache

import numpy as np
import xarray as xr

from flexclear import load_scene
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles, impacts

#: sixteen impacts in 23 ms, then a contact that lasts, in which ball and rod vibrate at some 4 kHz
PRESSED = TREE / "scenes" / "sps4" / "variants" / "far_csj_cb_damped.toml"
SHORT = {"time.end": "40 ms", "output.interval": "1 ms"}


def without_friction(scene: Scene) -> Scene:
    loose = {name: joint.model_copy(update={"friction": None}) for name, joint in scene.joint.items() if name == "A1"}
    return scene.model_copy(update={"joint": scene.joint | loose})


@cache
def run(integrator: str, rtol: float) -> xr.Dataset:
    solver = {"integrator": integrator, "rtol": rtol}
    scene = without_friction(load_scene(PRESSED, {**SHORT, "solver": solver}))
    return dynamics.simulate(scene, bundles(scene), silent)


def error(integrator: str, rtol: float) -> float:
    """Largest error of the platform's velocity at the outputs, as a share of the largest velocity."""
    made, known = (
        one.velocity.sel(body="platform").values[np.searchsorted(one.time, 1e-3 * np.arange(41) - 1e-9)]
        for one in (run(integrator, rtol), run("dop853", 1e-12))
    )
    return float(np.abs(made - known).max() / np.abs(known).max())


def test_tighter_tolerances_give_smaller_errors_in_contact() -> None:
    errors = [error("exponential", rtol) for rtol in (1e-5, 1e-7, 1e-9)]
    # an estimate of fourth order: by 100^(4/5) per hundredth, which impacts magnify by chance
    assert errors[1] < errors[0] / 4.0
    assert errors[2] < errors[1] / 4.0
    assert errors[2] < 1e-5


def test_impacts_are_those_of_the_explicit_method() -> None:
    made, known = impacts(run("exponential", 1e-9), 1e-2), impacts(run("dop853", 1e-12), 1e-2)
    # a velocity error of 1e-6 that sixteen impacts have magnified
    assert np.allclose(made["start"], known["start"], rtol=0.0, atol=1e-7)
    assert np.allclose(made["peak_force"], known["peak_force"], rtol=1e-4)
