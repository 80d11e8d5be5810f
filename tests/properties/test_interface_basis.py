"""Shapes that move no frame are eliminated for themselves; accelerations are those of eigenmodes all coupled."""

from functools import cache
from typing import Any, cast

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import numbering
from flexclear.dynamics.model.interface_basis import InterfaceBasis, basis, modes_of
from flexclear.dynamics.model.mechanism import Mechanism, build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.matrices import Matrices
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.articulated_chains import evaluated
from tests.properties.mechanisms import joint, rigid
from tests.properties.mechanisms import scene as written

MODES = "body.rod1.modes"


def families() -> tuple[np.ndarray, np.ndarray]:
    """Motions (4) of frames per mode (9): two families, an empty mode; and stiffnesses."""
    random, motions = np.random.default_rng(0), np.zeros((4, 9))
    motions[:2, [0, 2, 4, 6]] = random.normal(size=(2, 4))
    motions[2, [1, 3, 5]] = random.normal(size=3)
    motions[3, 8] = 1.0  # alone in its family: nothing to mix
    return motions, np.linspace(1.0, 9.0, 9) ** 2


def test_held_shapes_move_no_frame_and_are_vibrations_between_held_frames() -> None:
    motions, stiffness = families()
    found = basis(motions, stiffness)
    T = found.matrix
    assert found.held == 2 + 2 + 1  # of 4, 3, 1 and 1 modes, 2, 1, 0 and 1 motions are asked for
    # sums of nine products of numbers of the size of one
    assert np.abs(T.T @ T - np.eye(9)).max() < 1e-14
    assert np.abs(motions @ T[:, : found.held]).max() < 1e-14
    mixed = T.T @ np.diag(stiffness) @ T
    still = mixed[: found.held, : found.held]
    assert np.abs(still - np.diag(np.diag(still))).max() < 1e-13 * stiffness.max()


@pytest.mark.parametrize("size, motions_used", [(1e-9, 2), (1e-14, 1)])
def test_a_small_motion_of_a_frame_is_a_motion_and_rounding_is_none(size: float, motions_used: int) -> None:
    """Next to motions of the size of one, whose rounding is some 1e-16: what moves a frame by 1e-9 of that is no
    vibration between held frames."""
    random = np.random.default_rng(1)
    motions = np.array([random.normal(size=6), size * random.normal(size=6)])
    found = basis(motions, np.arange(1.0, 7.0))
    assert found.held == 6 - motions_used
    assert np.abs(motions @ found.matrix[:, : found.held]).max(axis=1)[0] < 1e-13


def test_modes_that_move_frames_in_different_ways_are_not_mixed() -> None:
    found = basis(*families())
    of_first = np.any(found.matrix[[0, 2, 4, 6]] != 0.0, axis=0)
    assert not np.any(found.matrix[[1, 3, 5, 7, 8]][:, of_first])
    assert len(found.entries()) == 4 * 4 + 3 * 3 + 1 + 1


def chain() -> Scene:
    """A clamped rod that carries another one on a universal joint, with a heavy block on its end; 24 modes each."""
    modes = {"reference": "craig-bampton", "count": 24, "interfaces": ["bottom", "top"]}
    rod: dict[str, Any] = {"type": "flexible", "mesh": str(TREE / "meshes/actuated_rod.toml"), "modes": modes}
    along = {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}  # the rods lie along x
    bodies = {
        "ground": {"type": "ground", "frames": {"base": {"axes": along}}},
        "lower": rod | {"pose": {}},
        "upper": rod | {"pose": {"position": [0.24, 0.0, 0.0]}},
        "block": rigid(2.0, [1e-3, 2e-3, 3e-3], {"under": {"axes": along}}, pose={"position": [0.48, 0.0, 0.0]}),
    }
    joints = {
        "foot": joint("fixed", "ground.base", "lower.bottom"),
        "knee": joint("universal", "lower.top", "upper.bottom"),
        "top": joint("fixed", "upper.top", "block.under"),
    }
    load = {"gravity": {"type": "gravity", "acceleration": [1.0, 2.0, -9.81]}}
    return Scene.model_validate(written(bodies, joints, 0.01, load=load, output={"interval": 0.01}, solver={}))


@cache
def scene(name: str) -> Scene:
    if name == "two rods":
        return chain()
    known, _, what = name.partition(", ")
    edits = {
        "": {},
        "heavy ball": {"body.ball_A1.mass": 10.0},  # of a rod of 0.2 kg
        "30 free modes": {f"{MODES}.count": 30},
    }
    return edited(load_scene(TREE / "scenes" / f"{known}.toml"), edits[what])


def eigenmodes(mechanism: Mechanism, link: int) -> InterfaceBasis:
    """The basis that mixes nothing and holds nothing: all modes are coupled."""
    bundle = mechanism.links[link].bundle
    assert bundle is not None
    return InterfaceBasis(np.eye(bundle.sizes["mode"]), 0)


@pytest.mark.parametrize(
    "name, held, tolerance",
    # rounding times the condition of the mass matrix with a unit diagonal: of the two rods, where the lower one turns
    # the upper one's block about its light self, 7e6, of the others up to 2e3.  Measured 3e-10 and 4e-12
    [
        ("checks/flexible_slider_crank", [6], 1e-10),
        ("sps4/far_csj_cb, heavy ball", [7], 1e-10),
        ("sps4/far_csj_free, 30 free modes", [18], 1e-10),
        ("two rods", [18, 18], 1e-8),
    ],
)
def test_accelerations_are_those_of_coupled_eigenmodes(
    name: str, held: list[int], tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rod in a loop, one with a heavy ball, one whose modes move both its ends, and one that carries another."""
    made = scene(name)
    mechanism = build(made, bundles(made))
    mixed = tabulate(mechanism)
    assert mixed.arrays.table(m.FLEXES)["n_held"].tolist() == held
    monkeypatch.setattr(numbering, "interface_basis", eigenmodes)
    plain = tabulate(mechanism)
    one, other = evaluated(mixed).rates, evaluated(plain).rates
    speeds = mixed.speeds
    assert np.abs(one[: mixed.nq] - other[: mixed.nq]).max() < 1e-13 * np.abs(other[: mixed.nq]).max()
    assert np.abs(one[speeds] - other[speeds]).max() < tolerance * np.abs(other[speeds]).max()


def test_mass_of_held_shapes_is_diagonal_and_thin() -> None:
    """Of 24 modes a rod, 18 share entries with the joints on the way to the ground alone."""
    made = scene("two rods")
    model = tabulate(build(made, bundles(made)))
    L = Matrices(cast("Engine", evaluated(model))).factor
    for body in model.arrays.table(m.FLEXES):
        held = slice(body["c0"], body["c0"] + body["n_held"])
        block = L[held, : held.stop]
        assert np.count_nonzero(block) == body["n_held"] == np.count_nonzero(block[:, held].diagonal())
    T = modes_of(model.arrays)
    assert np.abs(T.T @ T - np.eye(model.nv)).max() < 1e-13
