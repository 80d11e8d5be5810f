"""Times that mean something on a machine whose speed drifts: interleaved, repeated, given with their spread."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from benchmarks import processes

T = TypeVar("T")
K = TypeVar("K")
#: of times in the log, per second
UNITS = {"s": 1.0, "us": 1e6}


@dataclass(frozen=True)
class Times:
    """Repeats of one measurement [s]; those of equal index in two measurements were made side by side."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median [s]."""
        return float(np.median(self.seconds))

    @property
    def spread(self) -> float:
        """Half the range of the middle half of the repeats, as a share of the median."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(0.5 * (high - low) / self.median)

    def record(self, unit: str) -> dict[str, float]:
        """Median, in the unit that it is called by, and spread, as the log has them."""
        return {unit: UNITS[unit] * self.median, "spread": self.spread}

    def over(self, other: Times) -> float:
        """Median of the ratios to another measurement, pair by pair: a slow moment of the machine slows both."""
        return float(np.median(np.array(self.seconds) / np.array(other.seconds)))


def once(task: Callable[[], object]) -> float:
    """Processor time of one call [s]: on one thread that is the time it takes on a machine without other work."""
    begun = time.process_time()
    task()
    return time.process_time() - begun


def of_children(task: Callable[[], object]) -> float:
    """Processor time of the processes that one call starts and waits for, with those that they start [s]."""
    before = processes.seconds_of_children()
    task()
    return processes.seconds_of_children() - before


def interleaved(tasks: Mapping[K, Callable[[], float]], rounds: int) -> dict[K, Times]:
    """Each task, which returns its own time [s], once per round, one after the other; a first round does not count."""
    return {name: Times(seconds) for name, seconds in in_turn(tasks, rounds).items()}


def in_turn(tasks: Mapping[K, Callable[[], T]], rounds: int) -> dict[K, tuple[T, ...]]:
    """What each task returns, once per round, one after the other; a first round, which compiles, does not count."""
    results: dict[K, list[T]] = {name: [] for name in tasks}
    for number in range(rounds + 1):
        for name, task in tasks.items():
            made = task()
            if number:
                results[name].append(made)
    return {name: tuple(made) for name, made in results.items()}


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Exponent p of the best fit y = C x^p."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
