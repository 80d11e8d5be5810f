"""What kernels do with closure rows in threes is what dense algebra does with all of them at once."""

from typing import Any, cast

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import selection, tree
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.matrices import Matrices
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE
from tests.properties.articulated_chains import evaluated
from tests.properties.mechanisms import LEAN, frame, joint, two_loops

#: rows of closures that are solved for, per scene
SCENES = {
    "checks/gears": [1, 1, 1, 0, 1, 0, 0, 0, 1],
    "checks/andrews_squeezer": [2, 2, 2],
    "sps4/ideal": [3, 3, 3, 3],
    "checks/bricard": [4],
}
#: of the largest entry; sums of some ten products differ by some 1e-15
ROUNDING = 1e-11
#: accelerations come from multipliers, which lose the digits of the condition of J M^-1 J^T (1e-10 is left here)
SOLVED = 1e-8


def dense_factor(envelope: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """A Cholesky factor from its envelope, which has reciprocals on the diagonal."""
    L = np.zeros((len(envelope),) * 2)
    for i, (first, origin) in enumerate(envelope):
        L[i, first : i + 1] = entries[origin + first : origin + i + 1]
        L[i, i] = 1.0 / L[i, i]
    return L


def compare_with_dense_algebra(scene: Scene, rows: list[int]) -> None:
    """L^-1 J^T, the factor of J M^-1 J^T, and accelerations that keep the loops closed."""
    model = tabulate(build(scene, {}))
    found = evaluated(model, speeds=1.0)
    h, w = found.h, found.w
    assert found.report == m.OK
    assert model.arrays.table(m.CLOSURES, h)["n_kept"].tolist() == rows
    J, S = (selection.dense_rows(model, h, w[h[place] :][: h[m.JACOBIAN_SIZE]]) for place in (m.JACOBIAN, m.SPREAD))
    L = Matrices(cast("Engine", found)).factor
    C = dense_factor(model.arrays.table(m.CLOSURE_ENVELOPE, h)[: len(J)], w[h[m.SCHUR] :])
    bias = w[h[m.GAMMA] :][selection.selected_indices(model, h)]
    accelerations = w[h[m.DU] :][: model.nv]
    assert np.abs(S @ L.T - J).max() < ROUNDING * np.abs(J).max()
    assert np.abs(C @ C.T - S @ S.T).max() < ROUNDING * np.abs(S @ S.T).max()
    assert np.abs(J @ accelerations - bias).max() < SOLVED * np.abs(J).max() * np.abs(accelerations).max()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_rows_of_a_scene(name: str) -> None:
    compare_with_dense_algebra(load_scene(TREE / "scenes" / f"{name}.toml"), SCENES[name])


@pytest.mark.parametrize("cut, rows", [(("Y", "R"), [5, 4]), (("U", "R"), [5, 4]), (("S", "P"), [3, 3])])
def test_rows_of_two_loops_that_share_a_joint(
    monkeypatch: pytest.MonkeyPatch, cut: tuple[str, str], rows: list[int]
) -> None:
    """The second loop of `two_loops` begins on a body of the first one: threes meet of which the last are not full."""
    table: dict[str, Any] = two_loops()
    table["body"]["a"]["frames"]["P"] = frame((1.0, 0.0, 0.0), LEAN)
    table["joint"]["P"] = joint("planar", "a.P", "c.P")
    monkeypatch.setattr(tree, "_freedom", lambda edge: int(edge.name in cut))
    compare_with_dense_algebra(Scene.model_validate(table), rows)
