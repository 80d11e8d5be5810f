"""What is asked of the factors besides accelerations: changes that close loops, displacements, and springs of modes."""

import ctypes
from functools import cache
from typing import Any

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile.files import PART
from flexclear.dynamics.mechanics import modes, trees
from flexclear.dynamics.mechanics.of_topology import list_of
from flexclear.dynamics.mechanics.responses import CLOSING, LISTS
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.routines.store import load
from flexclear.dynamics.run.evaluation.specialised_code import lists_in_python
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.schema import Scene
from tests.properties.articulated_chains import Evaluated, evaluated, reduced
from tests.properties.mechanisms import two_loops
from tests.properties.test_articulated import BENT, apart, mass_by_energy
from tests.properties.test_routines import silent_text

#: of the largest number; masses by energies have some 1e-12, times the condition of the closures
ROUNDING = 1e-9
LOOPS = ("loop", "held shapes in a loop", "driven loop", "redundant rows")
_RUN = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 4, ctypes.c_double, *[ctypes.c_int64] * 3)


@cache
def found_of(name: str) -> Evaluated:
    """A mechanism of flexible rods, evaluated where its loops are open; nobody writes into it."""
    scene = Scene.model_validate(BENT[name])
    return evaluated(tabulate(build(scene, reduced(scene))))


class Listed:
    """Lists of a mechanism as Python runs them, on a copy of what is evaluated. dy: where rates are."""

    def __init__(self, found: Evaluated) -> None:
        self.found, self.w, self.n = found, found.w.copy(), found.space.n.copy()
        self.y, self.dy = int(found.h[m.Y]), int(found.h[m.SLOPES])
        self._run = lists_in_python(found.model)

    def __call__(self, where: int, part: int = 0) -> np.ndarray:
        """Rates of the state after a part of a list."""
        given = self.found.h, self.found.model.arrays.f, self.w, self.n, 0.1, self.y, self.dy
        self._run(*given, 2 * PART * where + PART * part)
        assert self.n[m.EVALUATION] == m.OK
        return self.rates

    @property
    def rates(self) -> np.ndarray:
        return self.w[self.dy : self.dy + self.found.model.ny]


def in_modes(found: Evaluated) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass matrix of all speeds by energies; closures' Jacobian by the free ones; which closure rows are solved for."""
    J = selection.dense_rows(found.model, found.h, found.stretch(m.JACOBIAN)) @ modes_of(found.model.arrays).T
    return mass_by_energy(found), J, selection.selected_indices(found.model, found.h)


def modal_stiffness(found: Evaluated) -> np.ndarray:
    """Diagonal, zero at joints' coordinates."""
    K, data = np.zeros(found.model.nv), found.model.arrays.table(m.FLEX_DATA)["value"]
    for body in found.model.arrays.table(m.FLEXES):
        n = int(body["n_modes"])
        begin = body["data0"] + 12 * n + n * n
        K[body["c0"] : body["c0"] + n] = data[begin : begin + n]
    return K


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_loops_stop_opening_by_the_least_change_in_the_metric(name: str) -> None:
    """Of mass by energies and a share of stiffness: what dense algebra gives, orthogonal to all that keeps loops."""
    found = found_of(name)
    (M, J, kept), nv = in_modes(found), found.model.nv
    N = M[:nv, :nv] + CLOSING**2 * np.diag(modal_stiffness(found))
    by = np.linalg.solve(N, J.T)
    expected = -by @ np.linalg.solve(J @ by, found.stretch(m.RESIDUAL_RATE)[kept])
    change = Listed(found)(m.CLOSE)[found.model.speeds]
    assert apart(change, expected) < ROUNDING
    free = np.linalg.svd(J)[2][len(J) :]  # motions that keep the loops
    assert np.abs(free @ N @ change).max() < ROUNDING * np.abs(N @ change).max()


@pytest.mark.parametrize("name", ["loop", "driven loop", "redundant rows", "several coordinates"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_repeated_changes_close_loops(name: str) -> None:
    """Newton's method, from residuals of centimetres: to rounding, positions and speeds."""
    found = found_of(name) if name in BENT else evaluated(tabulate(build(Scene.model_validate(two_loops()), {})))
    run, count = Listed(found), found.model.nq + found.model.nv
    kept = selection.selected_indices(found.model, found.h)
    for _ in range(8):
        run.w[run.y : run.y + count] += run(m.CLOSE)[:count]
    run(m.CLOSE)
    for stretch, rounding in ((m.RESIDUAL, 1e-14), (m.RESIDUAL_RATE, 1e-12)):
        left = run.w[found.h[stretch] :][: found.lengths[stretch]][kept]
        assert np.abs(left).max() < rounding * max(1.0, np.abs(found.stretch(stretch)).max())


def test_displacements_compose_rotations() -> None:
    """A quaternion at a constant angular velocity: the product of exp(omega/2) with it; sums of single angles."""
    q, omega = np.array([0.8, 0.0, 0.6, 0.0]), np.array([0.02, -0.05, 0.08])
    angle = float(np.linalg.norm(omega))
    w, v = np.cos(0.5 * angle), np.sin(0.5 * angle) / angle * omega
    expected = [w * q[0] - v @ q[1:], *(w * q[1:] + q[0] * v + np.cross(v, q[1:]))]
    # 3e-4 of the fifth power of the angle
    assert trees.move_positions("spherical", q.tolist(), omega.tolist()) == pytest.approx(expected, abs=3e-4 * angle**5)
    moved = trees.move_positions("free", [*q, 1.0, 2.0, 3.0], [*omega, 0.1, 0.2, 0.3])
    assert moved == pytest.approx([*expected, 1.1, 2.2, 3.3], abs=3e-4 * angle**5)
    assert trees.move_positions("cylindrical", [0.5, 0.2], [3.0, -1.0]) == pytest.approx([3.5, -0.8], rel=1e-15)


@pytest.mark.parametrize("name", ["driven", "driven loop", "held shapes in a loop", "stiffened"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_springs_accelerate_as_dense_algebra_says(name: str) -> None:
    """And the drives supply what the kinetic energy gains beyond the work of spring and closures."""
    found = found_of(name)
    (M, J, kept), run, nv = in_modes(found), Listed(found), found.model.nv
    mode = int(np.argmax(modal_stiffness(found)))
    force, u, du = np.eye(nv)[mode], found.stretch(m.U), found.stretch(m.DU)[nv:]
    solved = np.linalg.solve(np.block([[M[:nv, :nv], J.T], [J, np.zeros((len(J),) * 2)]]), [*force, *np.zeros(len(J))])
    a, wrenches = np.array([*solved[:nv], *np.zeros(len(u) - nv)]), -solved[nv:]
    run(m.SPRINGS)
    run.rates[:] = 0.0
    run.rates[found.model.speeds] = force
    rates = run(m.SPRINGS, 1)
    assert apart(rates[found.model.speeds], a[:nv]) < ROUNDING
    power = u @ M @ a - u[mode] - wrenches @ found.stretch(m.RESIDUAL_RATE)[kept]
    drive, growth = rates[found.model.speeds.stop :][:2]
    assert drive == pytest.approx(power, abs=ROUNDING * np.abs(u * (M @ a)).max())
    if not len(J):
        assert growth == pytest.approx(float(du @ M[nv:] @ a), abs=ROUNDING)
    assert (drive != 0.0) == ("driven" in name)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_shapes_in_blocks_respond_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modes, "FEW", 1)
    monkeypatch.setattr(modes, "SIZE", 2)
    for name in ("held shapes in a loop", "stiffened"):
        test_springs_accelerate_as_dense_algebra_says(name)
    test_loops_stop_opening_by_the_least_change_in_the_metric("held shapes in a loop")


@pytest.mark.parametrize("where", LISTS)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_compiled_lists_do_what_python_does(where: int) -> None:
    found = found_of("driven loop")
    model, run, (w, n) = found.model, Listed(found), (found.w.copy(), found.space.n.copy())
    calls = load(list_of(model.parts, topology_of(model.arrays, found.h), where), silent_text, None).instance(found.h)
    for part in range(len(LISTS[where])):
        run.rates[:] = w[run.dy : run.dy + model.ny] = np.linspace(0.01, 0.02, model.ny)
        run(where, part)
        given: Any = (array.ctypes.data for array in (found.h, model.arrays.f, w, n))
        _RUN(calls.loaded.interpreter)(*given, 0.1, run.y, run.dy, calls.words[part].ctypes.data)
    for begin in (run.y, run.dy):
        assert apart(w[begin : begin + model.ny], run.w[begin : begin + model.ny]) < ROUNDING
