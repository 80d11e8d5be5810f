"""A pin on a flexible body in a journal: engine against modes of separately written beam elements."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic.mechanism_runs import of_kind, run
from tests.reference.cantilever_contact import Pin, rod, simulate

SCENE, COUNT = "checks/clearance_cantilever", 4
PIN = Pin(0.05, 2.5e-6, 0.01, 2e-5, 5e9, 0.8, 0.1, 0.08, 1e-3, 2e-2)


def test_contacts_of_the_bent_rod_begin_and_end_as_those_of_its_modes() -> None:
    # the scene's eight coordinates: three pairs of bending shapes, one of torsion, one axial
    known = simulate(rod(bending=3, axial=1), PIN, 100.0, 4e-3, COUNT)
    dataset = run(SCENE)
    begun, ended = (of_kind(dataset, kind)[:COUNT] for kind in ("closing", "opening"))
    time, speed = dataset.event_time.values, dataset.event_approach_speed.values
    # the rod's slopes of 1e-4 rad turn the pin by squares that the modes leave out, and 20 um are a ten-thousandth of
    # the rod, at whose size rtol is 1e-10
    assert time[begun] == pytest.approx([k[0] for k in known], abs=1e-9)
    assert time[ended] == pytest.approx([k[2] for k in known], abs=1e-9)
    assert speed[begun] == pytest.approx([k[1] for k in known], rel=1e-6)
    assert speed[ended] == pytest.approx([k[3] for k in known], rel=5e-6)


def test_energy_of_the_bent_rod_only_falls() -> None:
    dataset = run(SCENE)
    energy = (dataset.kinetic + dataset.potential + dataset.elastic).values
    assert np.diff(energy).max() <= 1e-7 * dataset.kinetic.max()  # the pin's place is known to 1e-7 of the clearance
    assert energy[0] - energy[-1] > 0.1 * dataset.kinetic.max()
