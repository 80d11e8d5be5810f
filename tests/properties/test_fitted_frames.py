"""Frames known to a tolerance, as those of meshed bodies, are moved so that joints fit which nearly do."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear.artifacts.labelled import label_dataset
from flexclear.dynamics.model.assembly import assemble, residuals
from flexclear.dynamics.model.constraints import constraints
from flexclear.dynamics.model.mechanism import build
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import Table, joint, rigid, scene


def four_bar(random: Random, miss: float, tolerance: float) -> Scene:
    """A turned planar four-bar whose coupler's frames miss their places by `miss` [m] in random directions."""
    turn = Rotation.from_rotvec([random.uniform(-2.0, 2.0) for _ in range(3)]).as_matrix()
    axes = {"x": turn[:, 0].tolist(), "z": turn[:, 2].tolist()}
    corners = [turn @ p for p in ([0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.2, 0.15, 0.0], [0.2, 0.0, 0.0])]

    def body(k: int, off: float) -> dict[str, object]:
        frames = {}
        for name, p in (("a", np.zeros(3)), ("b", turn.T @ (corners[k + 1] - corners[k]))):
            wrong = np.array([random.gauss(0.0, 1.0) for _ in range(3)])
            frames[name] = {"position": (p + off * wrong / np.linalg.norm(wrong)).tolist()}
        tolerances = {"frame_tolerance": tolerance} if off else {}
        return rigid(1.0, 0.01, frames, pose={"position": corners[k].tolist(), "axes": axes}, **tolerances)

    bodies: Table = {
        "ground": {
            "type": "ground",
            "frames": {f"o{k}": {"position": corners[k].tolist(), "axes": axes} for k in (0, 3)},
        }
    }
    bodies |= {name: body(k, miss if k == 1 else 0.0) for k, name in enumerate(("crank", "coupler", "rocker"))}
    pins = (("o0", "ground.o0", "crank.a"), ("A", "crank.b", "coupler.a"), ("B", "coupler.b", "rocker.a"))
    joints = {name: joint("revolute", *pair) for name, *pair in (*pins, ("o3", "ground.o3", "rocker.b"))}
    return Scene.model_validate(scene(bodies, joints))


@pytest.mark.parametrize("seed", range(8))
def test_a_loop_with_frames_that_nearly_fit_closes(seed: int) -> None:
    random = Random(seed)
    miss = 10.0 ** random.uniform(-9.0, -5.0)
    fits = assemble(build(four_bar(random, miss, 2.0 * miss), {}))
    left = residuals(constraints(fits), [link.start for link in fits.links])
    assert max(left.values()) < 1e-11 * fits.length  # what a closing may leave
    assert "frame_tolerance" in fits.choice
    assert "coupler by up to" in fits.choice


@pytest.mark.parametrize("seed", range(4))
def test_a_loop_without_poses_closes_as_well(seed: int) -> None:
    random = Random(seed)
    miss = 10.0 ** random.uniform(-9.0, -5.0)
    table = four_bar(random, miss, 2.0 * miss).model_dump(mode="json", exclude_none=True)
    for name in ("crank", "coupler", "rocker"):
        del table["body"][name]["pose"]
    table["start"] = {"joint": {"o0": {"position": 0.1}}}
    fits = assemble(build(Scene.model_validate(table), {}))
    left = residuals(constraints(fits), [link.start for link in fits.links])
    assert max(left.values()) < 1e-11 * fits.length  # what a closing may leave
    assert "coupler by up to" in fits.choice


@pytest.mark.parametrize("miss", [8.6e-9, 1e-4])
def test_frames_of_flexible_bodies_fit_too(miss: float) -> None:
    """The rod of a planar loop, with one end out of the plane; its bundle has no other inaccuracy."""
    scene = load_scene(TREE / "scenes/checks/flexible_slider_crank.toml")
    changes = {f"body.{name}.pose": None for name in ("crank", "rod", "slider")}
    posed = edited(scene, changes | {"start": {"joint": {"guide": {"near": 0.45}}}})
    bundle = label_dataset(bundles(scene)["rod"])
    array = bundle["frame_position"]
    bent = replace(array, values=array.values + miss * np.array([[0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3]))
    off = {"rod": replace(bundle, variables={**bundle.variables, "frame_position": bent})}
    fits = assemble(build(posed, off))
    left = residuals(constraints(fits), [link.start for link in fits.links])
    assert max(left.values()) < 1e-11 * fits.length
    # the slider is where the rod and the crank, in line, put it
    assert fits.links[fits.link_of["slider"]].start.p[0] + fits.origin[0] == pytest.approx(0.45, abs=miss)
    far = replace(array, values=array.values + 2e-3 * np.array([[0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3]))
    with pytest.raises(InputError, match="cannot be assembled"):  # a thousandth of 300 mm is less
        assemble(build(posed, {"rod": replace(bundle, variables={**bundle.variables, "frame_position": far})}))


def test_fixed_joints_of_bodies_whose_frames_are_known_to_a_tolerance_fit_poses() -> None:
    """Two bodies in one piece, both with poses, 5 nm apart."""

    def pieces(tolerance: float) -> Scene:
        bodies: Table = {
            "ground": {"type": "ground", "frames": {"o": {}}},
            "a": rigid(1.0, 0.01, {"o": {}, "end": {"position": [0.1, 0.0, 0.0]}}, pose={}),
            "b": rigid(1.0, 0.01, {"o": {}}, pose={"position": [0.1, 0.0, 5e-9]}, **{"frame_tolerance": tolerance}),
        }
        joints = {"hinge": joint("revolute", "ground.o", "a.o"), "weld": joint("fixed", "a.end", "b.o")}
        return Scene.model_validate(scene(bodies, joints))

    assert assemble(build(pieces(1e-5), {})).links[-1].mass == 2.0
    with pytest.raises(InputError, match="contradicts the poses"):
        build(pieces(0.0), {})


@pytest.mark.parametrize("tolerance", [0.0, 1e-9])
def test_frames_that_are_exact_or_known_better_are_refused(tolerance: float) -> None:
    with pytest.raises(InputError, match="nearly equal conditions"):
        assemble(build(four_bar(Random(1), 1e-6, tolerance), {}))
