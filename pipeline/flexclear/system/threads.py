"""One thread in BLAS and OpenMP: matrices are small, and sums in an order set by the cores would change the bytes.

Import this module before NumPy, which reads these variables when it is loaded.
"""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
for _variable in VARIABLES:
    os.environ[_variable] = "1"  # also where the user set more, which would change the bytes


def limit_to_one() -> AbstractContextManager[Any]:
    """Limit BLAS and OpenMP to one thread inside this context, also where NumPy was loaded earlier or with more."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
