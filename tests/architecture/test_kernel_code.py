"""Kernels are optimised and assembled with the function that Python calls, and nowhere else."""

import ast
from collections import defaultdict
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numba import carray, cfunc, njit
from numba.core.codegen import CPUCodeLibrary

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.lowering import Part, Whole, WholeCompiler

#: with other releases kernels compile as Numba does it, to the same results


def tower() -> tuple[Callable, Callable, Callable]:
    """Kernels that have never been compiled, each calling the one before."""

    @kernel
    def low(x):
        return 2.0 * x

    @kernel
    def middle(x):
        return low(x) + low(x + 1.0)

    @kernel
    def high(x):
        return middle(x) * low(x)

    return low, middle, high


def test_what_python_calls_is_optimised_once_however_deep_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    low, middle, high = tower()
    optimised: list[str] = []
    optimise = CPUCodeLibrary._optimize_final_module

    def listen(library: CPUCodeLibrary) -> None:
        optimised.append(library.name)
        optimise(library)

    monkeypatch.setattr(CPUCodeLibrary, "_optimize_final_module", listen)

    @njit
    def called(x):
        return high(x) - middle(x)

    assert called(3.0) == 14.0 * 6.0 - 14.0
    assert [name for name in optimised if "tower" in name] == []
    assert len([name for name in optimised if "called" in name]) == 1
    dispatchers = [k.dispatcher for k in (low, middle, high)]  # type: ignore[attr-defined]
    libraries = [next(iter(d.overloads.values())).library for d in dispatchers]
    assert all(isinstance(library, Part) for library in libraries)


def test_kernels_serve_several_functions() -> None:
    low, middle, _ = tower()

    @njit
    def one(x):
        return middle(x)

    @njit
    def other(x):
        return middle(x) - low(x)

    assert (one(1.0), other(1.0), one(2.0)) == (6.0, 4.0, 10.0)


def test_a_kernel_that_one_caller_names_in_vain_is_there_for_another() -> None:
    """The linker takes what is referred to; code that never runs is gone before."""
    low, middle, _ = tower()

    @kernel
    def never(x):
        return False

    @kernel
    def high(x):
        if never(x):
            return low(x)
        return middle(x)

    @njit
    def called(x):
        return high(x)

    assert called(1.0) == 6.0


def test_a_kernel_is_compiled_once_for_integers_that_are_written_out() -> None:
    @kernel
    def double(k):
        return 2 * k

    @kernel
    def sums(k):
        return double(1) + double(2) + double(k)

    @njit
    def called(k):
        return sums(k)

    assert called(3) == 12
    assert len(double.dispatcher.overloads) == 1


def test_loops_go_round_one_turn_at_a_time() -> None:
    """Those over bodies and modes are short: what takes several turns at once takes longer for what is left over."""

    @kernel
    def scaled(a, count, factor):
        for k in range(count):
            a[k] *= factor

    def function(a, count):
        scaled(carray(a, (count,)), count, 3.0)
        return count

    made = cfunc("int64(CPointer(float64), int64)", error_model="numpy", pipeline_class=WholeCompiler)(function)
    numbers = np.arange(7.0)
    assert made.ctypes(numbers.ctypes.data_as(made.ctypes.argtypes[0]), 6) == 6
    assert numbers.tolist() == [0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 6.0]
    assert isinstance(made._library, Whole)
    code = made._library.get_llvm_str()
    assert code.count("fmul") == 1
    assert "x double>" not in code


#: kernels that may be given one array twice, or `d` and a stretch of it, since they write into none
READERS = {"widest"}


@cache
def kernels_of(root: Path) -> tuple[tuple[str, ast.FunctionDef], ...]:
    """All kernels, with the paths of their modules."""
    return tuple(
        (str(path.relative_to(root)), found)
        for path in sorted((root / "pipeline" / "flexclear" / "dynamics").rglob("*.py"))
        for found in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(found, ast.FunctionDef) and "kernel" in map(ast.unparse, found.decorator_list)
    )


def test_no_kernel_that_writes_is_given_an_array_twice(root: Path) -> None:
    """What it writes into one argument changes nothing that it reads from another: the compiler relies on it."""
    pointers = {f"d.{name}" for name in {"h", "f", "w", "n"} | set(m.STRETCHES) | set(m.LISTS) | set(m.NAMED)}
    wrong = set[str]()
    for place, function in kernels_of(root):
        for call in (node for node in ast.walk(function) if isinstance(node, ast.Call)):
            called, given = ast.unparse(call.func), list(map(ast.unparse, call.args))
            twice = called != "data" and any(sum(one in (name, f"d.{name}") for one in given) > 1 for name in "hfwn")
            if called not in READERS and (twice or ("d" in given and pointers & set(given))):
                wrong.add(f"{place}: {function.name}: {ast.unparse(call)}")
    assert wrong == set()


def test_kernels_that_may_be_given_an_array_twice_write_into_none(root: Path) -> None:
    readers = [found for _, found in kernels_of(root) if found.name in READERS]
    assert {found.name for found in readers} == READERS
    targets = [node for found in readers for node in ast.walk(found) if isinstance(node, ast.Subscript | ast.Attribute)]
    assert all(isinstance(node.ctx, ast.Load) for node in targets)


def test_no_kernel_is_there_twice(root: Path) -> None:
    """What is there twice is compiled twice, and corrected once.

    Compared are arguments and statements without docstrings. A kernel that does nothing also counts by its name: in
    different places nothing has different reasons.
    """
    places = defaultdict(list)
    for place, found in kernels_of(root):
        begin = 1 if ast.get_docstring(found) is not None else 0
        body = "\n".join(map(ast.unparse, found.body[begin:]))
        places[f"({ast.unparse(found.args)}) {body or found.name}"].append(f"{place}: {found.name}")
    assert len(places) > 200  # there are 274
    assert {says: where for says, where in places.items() if len(where) > 1} == {}
