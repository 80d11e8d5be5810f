"""One thread in BLAS and OpenMP: matrices are small, and sums in an order that cores decide would give other bytes.

To be imported before NumPy, which reads these variables when it is loaded.
"""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_LOADED_BEFORE = "numpy" in sys.modules
for _variable in VARIABLES:
    os.environ[_variable] = "1"  # also where somebody asked for more: that would change the bytes


def one() -> AbstractContextManager[Any]:
    """Meanwhile there is one, also where NumPy was loaded before this program or somebody has set another number since.

    Elsewhere the variables have seen to it, and looking through all libraries that are loaded would take 5 ms.
    """
    changed = any(os.environ.get(variable) != "1" for variable in VARIABLES)
    if not (_LOADED_BEFORE or changed or "threadpoolctl" in sys.modules):
        return nullcontext()
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
