"""Lists of calls of routines: what they compute, what they share, and how they are stored."""

import ctypes
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.families.growth import four_bars, hinged
from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions
from flexclear.dynamics.mechanics.of_topology import list_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.routines import store
from flexclear.dynamics.routines.calls import RESULTS, SCENE, CallList, Cell, cells, routine
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.routines.store import load
from flexclear.dynamics.specialise.dual import seed_changes
from flexclear.dynamics.specialise.symbols import UndecidableError, branch, larger, smaller
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.schema import Scene
from tests.properties.articulated_chains import evaluated, rods, tabulated
from tests.properties.test_routines import _EVALUATE, GRAVITY, NO_LAWS, assert_alike, silent_text


# Routines -------------------------------------------------------------------------------------------------------------
@routine
def clipped(a: Any, b: Any) -> tuple[Any, Any, Any]:
    """Smaller and larger one, and a / b unless b is not positive."""
    return smaller(a, b), larger(a, b), branch(b > 0.0, lambda: a / b, lambda: 0.0 * a)


@routine
def undecided(a: Any) -> Any:
    if a > 0.0:
        return a
    return -a


def run(calls: CallList, f: np.ndarray) -> np.ndarray:
    """Results of a list after it has run."""
    h, n, w = np.zeros(m.HEADER, dtype=np.int64), np.zeros(m.INTEGERS, dtype=np.int64), np.zeros(1)
    found = load(calls, silent_text).instance(h)
    h[m.PRESCRIBE], h[m.CALLS] = ctypes.cast(NO_LAWS, ctypes.c_void_p).value, found.words.ctypes.data
    _EVALUATE(found.loaded.interpreter)(*(array.ctypes.data for array in (h, f, w, n)), 0.0, 0, 0)
    return found.results


def test_routines_calculate_on_numbers_as_in_lists() -> None:
    given = cells(SCENE, 0, 2)
    with CallList().building() as calls:
        results = clipped(*given)
    for a, b in ((1.0, 2.0), (3.0, -0.5), (-1.0, 0.25)):
        found = run(calls, np.array([a, b]))
        assert [found[cell.index] for cell in results] == list(clipped(a, b))


def test_products_with_sparse_matrices_are_those_of_full_ones() -> None:
    """Rows of 0, 3 and 20 entries, some with the same columns; by a list, and on numbers with changes."""
    random, n = np.random.default_rng(2), 24
    pattern = np.zeros((9, n), dtype=bool)
    pattern[:6, 2:22], pattern[6, [1, 5, 9]], pattern[8, 3:23] = True, True, True
    rows, columns = np.nonzero(pattern)
    entries, numbers = [rows, columns, np.arange(len(rows))], random.normal(size=2 * len(rows))
    full, x = np.zeros(pattern.shape), random.normal(size=(2, n))
    full[pattern] = numbers[1::2]
    f = np.concatenate([numbers, *x])
    vectors = [cells(SCENE, len(numbers) + k * n, n) for k in range(2)]
    calls = CallList()
    made = calls.products(Cell(SCENE, 1), 2, entries, vectors, len(full))
    found = run(calls, f)
    assert np.array([[found[one.index] for one in row] for row in made]) == pytest.approx(x @ full.T, rel=1e-13)
    assert len(calls.calls) == 2 * (1 + 2 + 1) + 1  # columns by 16; four rows together, three alone; short row

    changes = random.normal(size=(2, n))
    h, w, n_ = np.zeros(m.HEADER, dtype=np.int64), np.zeros(1), np.zeros(m.INTEGERS, dtype=np.int64)
    on_numbers = Numbers(h, f, w, n_, 0, 0)
    moved = on_numbers.products(Cell(SCENE, 1), 2, entries, [seed_changes(x[0], changes), vectors[1]], len(full))
    assert [one.value for one in moved[0]] == pytest.approx(full @ x[0])
    assert np.array([one.change for one in moved[0]]) == pytest.approx(full @ changes.T)
    assert moved[1] == pytest.approx(full @ x[1])


def test_conditions_of_python_on_symbols_are_refused_with_their_place() -> None:
    line = undecided.__wrapped__.__code__.co_firstlineno + 2
    told = rf"{re.escape(__file__)}:{line}: '>' .*write `branch` or `select`"
    with pytest.raises(UndecidableError, match=told), CallList().building():
        undecided(Cell(SCENE, 0))
    assert undecided(-2.0) == 2.0


def test_only_routines_calculate_with_numbers_in_memory() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        Cell(SCENE, 0) + 1.0  # type: ignore[operator]


def test_constant_results_and_arguments_stay_what_they_are() -> None:
    """They need no memory, and the same call is made once."""

    @routine
    def parts(a: Any, b: Any) -> tuple[Any, Any, Any]:
        return b, 2.0, a + b

    a, b = cells(SCENE, 0, 2)
    with CallList().building() as calls:
        first, again = parts(a, b), parts(a, b)
    assert first[:2] == (b, 2.0)
    assert (first[2].array, first == again, len(calls.calls), calls.size) == (RESULTS, True, 1, 2)
    assert run(calls, np.array([3.0, 4.0]))[first[2].index] == 7.0


@cache
def codes(loops: int, links: int) -> tuple[set[str], int]:
    """Digests of the codes of a chain and of loops, and the number of calls."""
    found, calls = set[str](), 0
    for scene in (four_bars(loops, 0.3), hinged(links)):
        model = tabulate(build(scene, {}))
        made = list_of(model.parts, topology_of(model.arrays, model.arrays.h))
        found |= {code.digest for code in made.codes}
        calls += len(made.calls)
    return found, calls


def test_another_length_has_no_other_code() -> None:
    short, long = codes(5, 10), codes(12, 30)
    assert long[0] == short[0]
    assert long[1] > 2 * short[1]


def test_numbers_of_a_scene_are_inputs() -> None:
    """A list runs with other masses, and gravity, as one that is made for them."""
    models = [tabulated(Scene.model_validate(rods(5) | more)) for more in ({}, {"load": GRAVITY})]
    models[1].arrays.f[models[1].arrays.h[m.LINK_NUMBERS.at] + m.LINK_NUMBERS.size] *= 3.0
    lists = [list_of(model.parts, topology_of(model.arrays, model.arrays.h)) for model in models]
    assert [call.offsets for call in lists[0].calls] == [call.offsets for call in lists[1].calls]
    assert [call.code.digest for call in lists[0].calls] == [call.code.digest for call in lists[1].calls]
    assert_alike(evaluated(models[1]))


def spoilt(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-9] + b"otherwise")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of compiled code."""
    for module in (functions, store):
        monkeypatch.setattr(module, "writable", lambda root, report: tmp_path)
    return tmp_path


def test_code_is_compiled_once_and_again_when_damaged(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with CallList().building() as calls:
        clipped(*cells(SCENE, 0, 2))
    told: list[str] = []

    def compiled_anew() -> bool:
        told.clear()
        monkeypatch.setattr(functions, "loaded", {})
        load(calls, told.append)
        return bool(told)

    assert [compiled_anew(), compiled_anew()] == [True, False]
    stored = sorted(folder.iterdir())
    assert len(stored) == 2  # and the interpreter
    for path in stored:
        spoilt(path)
    assert [compiled_anew(), compiled_anew()] == [True, False]


def test_a_list_is_built_once_and_again_when_damaged(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Or when a code that it calls is."""
    built: list[CallList] = []

    def build() -> CallList:
        with CallList().building() as calls:
            clipped(*cells(SCENE, 0, 2))
        built.append(calls)
        return calls

    def counts(topology: bytes = b"one") -> int:
        """Lists built so far, after a new process has asked for one."""
        for module in (functions, store):
            monkeypatch.setattr(module, "loaded", {})
        found = store.stored_list(topology, build, silent_text)
        assert (len(found.codes), len(found.offsets), found.size) == (1, 2, 4)
        return len(built)

    assert [counts(), counts(), counts(b"other"), counts(b"other")] == [1, 1, 2, 2]
    lists, codes = ([path for path in folder.iterdir() if ("list" in path.name) == kind] for kind in (True, False))
    assert (len(lists), len(codes)) == (2, 2)
    for path in lists:
        spoilt(path)
    assert [counts(), counts(), counts(b"other")] == [3, 3, 4]
    spoilt(codes[0])
    assert [counts(), counts(), counts(b"other")] == [5, 5, 5]
