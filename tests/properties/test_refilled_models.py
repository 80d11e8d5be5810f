"""A model that is refilled with the numbers of an edited scene is the one that would be made from scratch."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.core.scene.load import edited, load_scene, with_numbers
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.mobility import analyse
from flexclear.pipeline.dynamics.model.model import tabulate
from flexclear.pipeline.dynamics.model.refill import refilled

STROKE = {"type": "step", "start": [0.0], "end": [0.1], "change": ["20 mm"]}
#: scene, its changes, and whether refilling must do
CASES: list[tuple[str, dict[str, Any], bool]] = [
    ("sps4/csj", {"joint.A1.clearance": "0.3 mm"}, True),
    ("sps4/csj", {"joint.A1.normal.restitution": 0.5, "joint.A1.friction.dynamic": 0.05}, True),
    ("sps4/csj", {"time.end": "0.1 s", "solver.rtol": 1e-6, "output.interval": "1 ms"}, True),
    ("sps4/csj", {"drive.P1.law": STROKE}, True),
    ("sps4/csj", {"drive.P1.law.change.0": "50 mm", "drive.P1.law.change.1": "-50 mm"}, True),
    ("checks/oscillator", {"load.spring.stiffness": 150.0, "load.spring.damping": 1.0}, True),
    ("checks/pendulum", {"load.gravity.acceleration.1": -1.62}, True),
    ("checks/clearance_slider_crank", {"joint.pin.friction.static": 0.2}, True),
    ("checks/oscillator", {"body.mass.mass": 2.0}, True),
    ("checks/oscillator", {"body.mass.frames.centre.position.2": "1 mm"}, False),
    ("sps4/ideal", {"body.platform.mass": 0.4, "body.platform.com.2": "1 mm"}, True),
    ("sps4/csj", {"body.rod1.inertia.0.0": 0.000998, "body.socket_A2.mass": 0.2, "joint.A1.clearance": "0.3 mm"}, True),
    # what is another structure, start or kernel
    ("sps4/csj", {"joint.A1.clearance": "2 m"}, False),
    ("sps4/csj", {"drive.P3.law.value": "1 mm"}, False),
    ("sps4/csj", {"drive.P3.law": STROKE}, False),
    ("sps4/csj", {"joint.A1.friction": {"law": "ambrosio", "dynamic": 0.1, "v0": 1e-4, "v1": 1e-3}}, False),
    ("checks/pendulum", {"body.bob.mass": 2.0}, False),
    ("checks/oscillator", {"body.mass.inertia.0.0": 0.0}, False),
]


@pytest.mark.parametrize("name, change, serves", CASES)
def test_a_refilled_model_is_the_same_to_the_last_bit(root: Path, name: str, change: dict[str, Any], serves: bool):
    scene = load_scene(root / "scenes" / f"{name}.toml")
    other = with_numbers(scene, change)
    assert other == edited(scene, change)
    model, whole = tabulate(build(scene, {})), tabulate(build(other, {}))
    found = refilled(model, other)
    assert (found is not None) == serves
    if found is None:
        return
    assert np.array_equal(found.arrays.h, whole.arrays.h)
    assert np.array_equal(found.arrays.f, whole.arrays.f)
    assert (found.parts, found.scene, found.length) == (whole.parts, whole.scene, whole.length)
    assert analyse(whole) == analyse(model)


@pytest.mark.parametrize("change", [{"joint.A1.clearance": "-1 mm"}, {"joint.A9.clearance": 1.0}, {"time.end": -1.0}])
def test_a_quick_edit_refuses_what_a_whole_one_does(root: Path, change: dict[str, Any]):
    scene, said = load_scene(root / "scenes/sps4/csj.toml"), []
    for edit in (edited, with_numbers):
        with pytest.raises(InputError) as refused:
            edit(scene, change)
        said.append(str(refused.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("edit", [edited, with_numbers, lambda scene, change: load_scene(scene.path, change)])
def test_a_recipe_in_an_edit_is_looked_for_where_the_scene_is(root: Path, edit: Callable[..., Scene]):
    scene = edit(load_scene(root / "scenes/sps4/far_cb.toml"), {"body.rod1.mesh": "meshes/rods/steel.toml"})
    assert Path(scene.recipes()["rod1"]).resolve() == (root / "meshes/rods/steel.toml").resolve()
