"""What is taken from inside Numba is a gain of time, and no need: hidden, the same comes out of its public ways."""

from typing import Any

import numpy as np
import pytest
from numba import cfunc

from flexclear.dynamics import kernels
from flexclear.dynamics.compile import machine_code
from tests.processes import printed

#: each in a process of its own that begins where Numba has compiled once
RUN = """
import os, sys
from numba import njit
@njit
def double(a):
    return 2.0 * a
double(1.0)
for hide in sys.argv[1:]:
    if os.fork():
        os.wait()
        continue
    try:
        exec(hide)
        from flexclear.dynamics import kernels
        from flexclear.dynamics.vectors import cross
        @njit
        def probe(a, b):
            return cross(a, b)
        print(probe((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), kernels.lowering() is not None, flush=True)
    finally:
        os._exit(0)
"""
#: hidden from `lowering` alone: Numba itself needs it
HERE = """
import flexclear.dynamics.lowering as lowering
@property
def hidden(self):
    raise AttributeError
"""
#: another release, and this one with something that `lowering` needs hidden or of another shape
HIDDEN = (
    "import numba; numba.__version__ = '0.99.0'",
    "from numba.core import codegen; del codegen.JITCodeLibrary",
    *(f"{HERE}lowering.Part.{name} = hidden" for name in ("_codegen", "_linking_libraries", "_raise_if_finalized")),
    f"{HERE}lowering._function_passes = lambda: 0",
    f"{HERE}lowering.DefaultPassBuilder = None",
    f"{HERE}lowering.normalize_ir_text = lambda text: ''",
    f"{HERE}lowering.Whole._optimize_final_module = hidden",
    f"{HERE}lowering.works = lambda: False",
)


def test_with_another_numba_kernels_are_compiled_as_it_does() -> None:
    assert printed(RUN, *HIDDEN, "").splitlines() == [
        *("(0.0, 0.0, 1.0) False" for _ in HIDDEN),
        "(0.0, 0.0, 1.0) True",
    ]


def test_with_a_release_is_tested_they_are_compiled_in_parts() -> None:
    """So that what is hidden above is what makes the difference."""
    made = kernels.lowering()
    assert (made is not None) == kernels.release_is_tested()
    assert made is None or made.works()


class Hidden:
    """A compiled function of which only what Numba documents is there, or a library of another shape."""

    def __init__(self, function: Any, **private: Any) -> None:
        self.native_name, self.inspect_llvm = function.native_name, function.inspect_llvm
        for name, value in private.items():
            setattr(self, name, value)


class Other:
    """A library that names its module alike, and keeps nothing else."""

    def __init__(self, library: Any) -> None:
        self._final_module = library._final_module


@pytest.mark.parametrize("shape", ["hidden", "without code", "with other code"])
def test_code_is_stored_without_what_numba_keeps_to_itself(shape: str) -> None:
    """From the text of LLVM that it shows, to the same values; what is called by it is called."""

    def function(x, y):
        return np.sin(x) * y + np.exp(x)

    made = cfunc("float64(float64, float64)", error_model="numpy")(function)
    private: dict[str, Any] = {"hidden": {}, "without code": {"_library": Other(made._library)}}.get(shape, {})
    if shape == "with other code":
        private = {"_library": Other(made._library)}
        private["_library"]._get_compiled_object = lambda: "text"
    stored = machine_code.image(Hidden(made, **private))
    known = machine_code.image(made)
    assert stored.partition(b"\n")[2] != b""
    for image in (stored, known):
        code = machine_code.load(image)
        loaded = type(made.ctypes)(code.address)
        assert [loaded(x, 3.0) for x in (0.1, 0.7, 40.0)] == [made.ctypes(x, 3.0) for x in (0.1, 0.7, 40.0)]
