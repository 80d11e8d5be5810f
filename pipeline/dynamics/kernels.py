"""The decorator of every compiled function, `kernel`: IEEE division (no exceptions), fused multiply-add and reordered
sums allowed, NaN and infinity honoured.

Kernels become code without being optimised: the function that Python calls is, once, with all that it reaches.

Left to itself Numba optimises each function together with copies of all that it calls, and makes machine code of it,
before it compiles the next one up: what lies n calls deep is optimised n times. But only compiled code calls kernels
(`lowering`).
"""

from __future__ import annotations

from typing import Any

import numba
from numba import njit

#: releases of Numba with which `lowering` has been looked at
LOOKED_AT = ("0.67.", "0.68.")


def lowering() -> dict[str, Any]:
    """Options of the decorator: the step of `lowering`, where the release of Numba is known to take it."""
    if not numba.__version__.startswith(LOOKED_AT):
        return {}
    from flexclear.pipeline.dynamics.lowering import KernelCompiler

    return {"pipeline_class": KernelCompiler}


# No kernel allocates, so none counts references; and none is called but by compiled code: wrappers for Python and C
# took a fifth of the compilation. To call one from Python, as tests do: njit(kernel.py_func).
kernel = njit(
    error_model="numpy",
    fastmath={"contract", "reassoc", "nsz"},
    _nrt=False,
    no_cfunc_wrapper=True,
    no_cpython_wrapper=True,
    **lowering(),
)
