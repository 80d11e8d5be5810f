"""Guards on which steps end: what a step passes first, in closed form, and what a mechanism's table holds."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numba import njit

import flexclear.dynamics.compile.calls  # noqa: F401  (registers the types of named fields)
from flexclear.dynamics import memory as m
from flexclear.dynamics.fields import data
from flexclear.dynamics.integrate import guards
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE
from tests.analytic.test_joint_friction_kinks import COULOMB, brakes

RTOL = 1e-10
LEVEL = 0.1
#: so close to the level counts as there
THERE = 0.1 * np.sqrt(RTOL) * LEVEL


@cache
def _compiled() -> Any:
    first_passed = guards.first_passed

    def passed(h, f, w, n):
        return first_passed(data(h, f, w, n))

    return njit(passed)


def passed(start: tuple, end: tuple, level: float = LEVEL, contact: int = -1, closed: int = 1) -> tuple | None:
    """(fraction, a, b, fa, fb) of the passage of a guard that watches a vector, or None."""
    h, f, w = np.zeros(m.HEADER + m.GUARDS.size, np.int64), np.array([level, LEVEL]), np.zeros(60)
    n = np.zeros(m.INTEGERS + 1, np.int64)
    n[m.MODE], n[m.INTEGERS] = m.INTEGERS, closed
    h[m.N_GUARDS], h[m.GUARDS.at], h[m.GUARDED.at], h[m.CONTROL] = 1, m.HEADER, 0, 10
    h[m.HEADER :] = m.TOUCH.at, 0, 3, contact, -1
    w[:6], w[10 + m.RTOL] = (*start, *end), RTOL
    fraction, g, *rest = _compiled()(h, f, w, n)
    assert g in (-1, 0)
    return (fraction, *rest) if g == 0 else None


#: what a vector does between two ends -> its passage; of a load the level is zero
PASSAGES: dict[str, tuple[tuple, tuple, float, tuple | None]] = {
    "falls through the level": ((0.3, 0.0, 0.0), (0.05, 0.0, 0.0), LEVEL, (0.8, 0.0, 1.0, 0.2, -0.05)),
    "ends before it": ((0.3, 0.0, 0.0), (0.2, 0.0, 0.0), LEVEL, None),
    "ends on it from above": ((0.3, 0.0, 0.0), (LEVEL + 0.5 * THERE, 0.0, 0.0), LEVEL, None),
    "ends on it from below": ((0.3, 0.0, 0.0), (LEVEL - 0.5 * THERE, 0.0, 0.0), LEVEL, None),
    # from 0.3 to -0.3 it passes twice, first on its way in: the length is 0.1 after a third of the way
    "turns round": ((0.0, 0.3, 0.0), (0.0, -0.3, 0.0), LEVEL, (1.0 / 3.0, 0.0, 0.5, 0.2, -0.1)),
    # from 0.1, where the step before ended, to -0.3: out after half of the way
    "leaves it": ((0.0, 0.0, LEVEL), (0.0, 0.0, -0.3), LEVEL, (0.5, 0.25, 1.0, -0.1, 0.2)),
    "turns at a distance above it": ((0.3, 0.15, 0.0), (-0.3, 0.15, 0.0), LEVEL, None),
    "reverses": (
        (0.2, 0.1, 0.0), (-0.1, -0.05, 0.0), 0.0,
        (2.0 / 3.0, 0.0, 1.0, -np.hypot(0.2, 0.1), np.hypot(0.1, 0.05)),
    ),
    "passes by zero": ((0.2, 0.1, 0.0), (-0.1, 0.05, 0.0), 0.0, None),
    "does not reach zero": ((0.2, 0.0, 0.0), (0.1, 0.0, 0.0), 0.0, None),
}  # fmt: skip


@pytest.mark.parametrize("what", PASSAGES)
def test_a_vector_passes_a_level_where_its_length_does(what: str) -> None:
    start, end, level, known = PASSAGES[what]
    assert passed(start, end, level) == (None if known is None else pytest.approx(known))


def test_a_velocity_that_turns_near_the_level_passes_it() -> None:
    assert passed((0.3, 0.05, 0.0), (-0.3, 0.05, 0.0)) is not None


def test_guards_of_an_open_contact_rest() -> None:
    assert passed((0.3, 0.0, 0.0), (0.05, 0.0, 0.0), contact=0, closed=0) is None
    assert passed((0.3, 0.0, 0.0), (0.05, 0.0, 0.0), contact=0) is not None


@pytest.mark.parametrize("components", [1, 2, 3])
def test_what_is_watched_is_noted_as_a_vector_that_ends_with_zeros(components: int) -> None:
    note_start, note_end, accept = guards.note_start, guards.note_end, guards.accept

    @njit
    def noted(h, f, w, n, before, after):
        d = data(h, f, w, n)
        w[20:23] = before
        note_start(d)
        w[20:23] = after
        note_end(d)
        first = d.guarded[0].start, d.guarded[0].end
        accept(d)
        return first, d.guarded[0].start

    h, w = np.zeros(m.HEADER + m.GUARDS.size, np.int64), np.zeros(60)
    h[m.N_GUARDS], h[m.GUARDS.at], h[m.GUARDED.at], h[m.TOUCH.at] = 1, m.HEADER, 0, 17
    h[m.HEADER :] = m.TOUCH.at, 3, components, -1, -1
    before, after = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    (start, end), later = noted(h, np.zeros(2), w, np.zeros(m.INTEGERS, np.int64), before, after)
    kept = np.arange(3) < components
    assert np.array_equal([start, end, later], [before * kept, after * kept, after * kept])


def table(scene: Scene) -> tuple[np.ndarray, np.ndarray, Any]:
    """Rows of GUARDS and of GUARD_NUMBERS, and the arrays."""
    arrays = tabulate(build(scene, {})).arrays
    return arrays.table(m.GUARDS), arrays.table(m.GUARD_NUMBERS), arrays


def test_bearings_and_loads_have_the_guards_that_their_laws_name() -> None:
    rows, numbers, arrays = table(Scene.model_validate(brakes(1e-8)))
    speeds, of_loads = numbers["level"] > 0.0, rows["table"] == m.LOAD_BENDS.at
    # the load that brakes, at its two speeds; of the ideal joints one has bristles, all others two speeds
    assert sorted(numbers["level"][of_loads]) == [COULOMB["v_static"], COULOMB["v_dynamic"]]
    bearings = arrays.size(m.SIZES["n_bearings"])
    bristly = arrays.table(m.NAMED["bearings"])["bristle"] >= 0
    sliding = ~of_loads & (rows["components"] == 3)
    assert np.count_nonzero(sliding & speeds) == 2 * np.count_nonzero(~bristly)
    assert rows["offset"][sliding & ~speeds].tolist() == [m.NAMED["bends"].size * e for e in np.flatnonzero(bristly)]
    # the force along, the moment about, and the forces at both ends of each bearing, by its own load
    presses = rows["bearing"] >= 0
    assert np.bincount(rows["bearing"][presses]).tolist() == [4] * bearings
    offsets = [m.NAMED["bends"].size * e + k for e in range(bearings) for k in (3, 4, 5, 7)]
    assert rows["offset"][presses].tolist() == offsets
    assert np.array_equal(presses | speeds | sliding, np.full(len(rows), True))


def test_contacts_have_guards_while_they_are_closed() -> None:
    rows, numbers, _ = table(load_scene(TREE / "scenes/sps4/csj.toml"))
    assert set(rows["contact"]) == {0}
    assert set(rows["offset"]) == {m.TOUCH.slip}
    assert numbers["level"].tolist() == numbers["scale"].tolist()
    assert len(rows) == 2
    assert len(table(load_scene(TREE / "scenes/sps4/ideal.toml"))[0]) == 0
