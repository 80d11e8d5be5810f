"""Work for the atlas's processes that ends well, hangs or dies; apart, since every process imports it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

from benchmarks.atlas import Parameters
from benchmarks.family import FINISHED, Record


def work(parameters: Parameters, compiled: Callable[[], None]) -> Record:
    """What becomes of it the number of joints says."""
    compiled()
    if parameters.joints == 2:
        while True:
            time.process_time()
    if parameters.joints == 3:
        os._exit(7)
    if parameters.joints == 4:
        os.kill(os.getpid(), signal.SIGSEGV)
    return {"verdict": FINISHED, "evaluations": parameters.joints}
