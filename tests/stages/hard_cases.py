"""Work for the atlas's processes that ends well, hangs or dies; apart, since every process imports it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

from benchmarks.stability.mechanism import Parameters
from benchmarks.stability.outcome import FINISHED, Outcome


def work(parameters: Parameters, compiled: Callable[[], None]) -> Outcome:
    """What becomes of it the number of joints says."""
    compiled()
    if parameters.joints == 2:
        while True:
            time.process_time()
    if parameters.joints == 3:
        os._exit(7)
    return Outcome(FINISHED, evaluations=parameters.joints)
