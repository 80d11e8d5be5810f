"""One thread in BLAS and OpenMP: matrices are small, and sums in an order that cores decide would give other bytes.

To be imported before NumPy, which reads these variables when it is loaded.
"""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
for _variable in VARIABLES:
    os.environ[_variable] = "1"  # also where somebody asked for more: that would change the bytes


def one() -> AbstractContextManager[Any]:
    """Meanwhile there is one, also where NumPy was loaded before this program or somebody has set another number."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
