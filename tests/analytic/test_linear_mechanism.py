"""Vibrations of the paper's mechanism with a flexible rod, against its own equations of motion run in time."""

from __future__ import annotations

import numpy as np
import pytest

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import analyses
from flexclear.pipeline.dynamics.linear.bench import state
from flexclear.pipeline.dynamics.linear.equilibrium import balanced
from flexclear.pipeline.dynamics.linear.vibrations import vibrations
from flexclear.pipeline.dynamics.run.trajectory import integrate
from tests.analytic.mechanism_runs import TREE, bundles


@pytest.mark.slow
@pytest.mark.parametrize("number", [4, 6, 7, 9, 12])
def test_a_vibration_let_loose_swings_as_its_frequency_and_shape_say(number: int) -> None:
    """Started with the speeds e w, a quarter period later it stands at e w / omega: for loops, balls and the rod."""
    path = TREE / "scenes" / "sps4" / "far_cb.toml"
    scene = load_scene(path)
    bench, found, _ = balanced(scene, bundles(scene), silent, 0.09)
    small = vibrations(bench, found.at)
    omega, w = small.value[number].imag, small.shape[:, number].real
    brief = load_scene(path, {"time.end": 0.5 * np.pi / omega, "output.interval": 0.1 * np.pi / omega})
    bench, found, _ = balanced(brief, bundles(brief), silent, 0.09)
    # far below where the rod's rotations, some 100 rad per unit, or the legs' swing would be of second order
    speed = 1e-6 * omega
    done = integrate(bench.engine, state(bench, found.at.q, speed * w), silent)
    nq, nv = len(found.at.q), len(w)
    moved = done.rows[-1, 1 : 1 + nq] - found.at.q
    known = found.at.moves @ w * speed / omega
    assert moved == pytest.approx(known, abs=1e-4 * np.abs(known).max())
    stopped = done.rows[-1, 1 + nq : 1 + nq + nv]
    # what is of second order in the swing shakes the stiff rod: some 1e-4 of the speed in the slowest vibration
    assert np.abs(stopped).max() < 1e-3 * speed * np.abs(w).max()


def test_the_four_legs_spin_freely_and_nothing_else_does() -> None:
    """A leg turns about the line through its two balls; its flexible rod follows without bending."""
    scene = load_scene(TREE / "scenes" / "sps4" / "far_cb.toml")
    found = analyses.frequencies(scene, bundles(scene), silent, 0.09)
    # 13 modes of the rod, 4 spins; the platform is held by the four drives and the central joints
    assert found.attrs["mobility"] == 17
    assert found.attrs["motions_without_stiffness"] == 4
    free, bound = found.isel(vibration=slice(0, 4)), found.isel(vibration=slice(4, None))
    still = free.frame_translation.sel(frame=[f"platform.A{k}" for k in range(1, 5)])
    assert np.abs(still).max() < 1e-9 * np.abs(free.frame_rotation).max()
    assert float(bound.frequency.min()) > 10.0
    assert found.energy_share.sum("moving_body").values == pytest.approx(np.ones(17), abs=1e-9)
