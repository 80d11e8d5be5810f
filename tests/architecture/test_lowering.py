"""The compiler's step in another form is a gain of time, and no need."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

RUN = """
import numba
numba.__version__ = "0.99.0"
from flexclear.pipeline.dynamics.vectors import cross
from numba import njit
@njit
def probe(a, b):
    return cross(a, b)
print(probe((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "flexclear.pipeline.dynamics.lowering" in __import__("sys").modules)
"""


def test_with_an_unknown_release_of_numba_kernels_are_compiled_as_it_does(root: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN], cwd=root, env={**os.environ}, capture_output=True, text=True, check=False
    )
    assert done.stdout.split("\n")[0] == "(0.0, 0.0, 1.0) False", done.stderr
