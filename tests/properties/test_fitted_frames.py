"""Frames known to a tolerance, as those of meshed bodies, are moved so that joints fit which nearly do."""

from random import Random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear.dynamics.model.assembly import assembled, residuals
from flexclear.dynamics.model.constraints import constraints
from flexclear.dynamics.model.mechanism import build
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
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
    fits = assembled(build(four_bar(random, miss, 2.0 * miss), {}))
    left = residuals(constraints(fits), [link.start for link in fits.links])
    assert max(left.values()) < 1e-11 * fits.length  # what a closing may leave
    assert "frame_tolerance" in fits.choice
    assert "coupler by up to" in fits.choice


@pytest.mark.parametrize("tolerance", [0.0, 1e-9])
def test_frames_that_are_exact_or_known_better_are_refused(tolerance: float) -> None:
    with pytest.raises(InputError, match="nearly equal conditions"):
        assembled(build(four_bar(Random(1), 1e-6, tolerance), {}))
