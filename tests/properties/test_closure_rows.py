"""What routines do with closure rows is what dense algebra does with all of them at once."""

from typing import Any, cast

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import selection, tree
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.matrices import Matrices
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE
from tests.properties.articulated_chains import evaluated, known_accelerations
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


def compare_with_dense_algebra(scene: Scene, rows: list[int]) -> None:
    """L^-1 J^T, the factor of J M^-1 J^T, and accelerations that keep the loops closed."""
    model = tabulate(build(scene, {}))
    found = evaluated(model, speeds=1.0)
    h, w = found.h, found.w
    assert found.report == m.OK
    assert model.arrays.table(m.CLOSURES, h)["n_kept"].tolist() == rows
    J = selection.dense_rows(model, h, w[h[m.JACOBIAN] :][: h[m.JACOBIAN_SIZE]])
    made = Matrices(cast("Engine", found))
    S = made.dense({k: by.V for k, by in made.loops.found.items()})[:, : model.nv]
    independent = 1.0 / np.abs(w[h[m.ROOTS] :][: len(J)])
    accelerations = modes_of(model.arrays).T @ found.rates[model.speeds]
    assert np.abs(S @ made.factor.T - J).max() < ROUNDING * np.abs(J).max()
    assert np.abs(made.jacobian[:, : model.nv] - J).max() < ROUNDING * np.abs(J).max()
    assert independent == pytest.approx(np.linalg.cholesky(S @ S.T).diagonal(), rel=ROUNDING)
    gamma = known_accelerations(found)
    assert np.abs(J @ accelerations - gamma).max() < SOLVED * np.abs(J).max() * np.abs(accelerations).max()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_rows_of_a_scene(name: str) -> None:
    compare_with_dense_algebra(load_scene(TREE / "scenes" / f"{name}.toml"), SCENES[name])


@pytest.mark.parametrize("cut, rows", [(("Y", "R"), [5, 4]), (("U", "R"), [5, 4]), (("S", "P"), [3, 3])])
def test_rows_of_two_loops_that_share_a_joint(
    monkeypatch: pytest.MonkeyPatch, cut: tuple[str, str], rows: list[int]
) -> None:
    """The second loop of `two_loops` begins on a body of the first one: rows of both meet."""
    table: dict[str, Any] = two_loops()
    table["body"]["a"]["frames"]["P"] = frame((1.0, 0.0, 0.0), LEAN)
    table["joint"]["P"] = joint("planar", "a.P", "c.P")
    monkeypatch.setattr(tree, "_freedom", lambda edge: int(edge.name in cut))
    compare_with_dense_algebra(Scene.model_validate(table), rows)
