"""Timing on a machine whose speed drifts: tasks take turns, are repeated, and are reported with their spread."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from benchmarks import processes

T = TypeVar("T")
K = TypeVar("K")
#: units of times in the log, per second
UNITS = {"s": 1.0, "us": 1e6}


@dataclass(frozen=True)
class Times:
    """Repeats of one measurement [s]; repeats with equal index in two measurements follow each other directly."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median [s]."""
        return float(np.median(self.seconds))

    @property
    def spread(self) -> float:
        """Half the interquartile range of the repeats, as a fraction of the median."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(0.5 * (high - low) / self.median)

    def record(self, unit: str) -> dict[str, float]:
        """Return the median under the name of its unit, and the spread, as the log stores them."""
        return {unit: UNITS[unit] * self.median, "spread": self.spread}

    def over(self, other: Times) -> float:
        """Return the median of the pairwise ratios to another measurement; a slow moment of the machine slows both."""
        return float(np.median(np.array(self.seconds) / np.array(other.seconds)))


def once(task: Callable[[], object]) -> float:
    """Return the processor time of one call [s]: on one thread, the wall time on a machine without other work."""
    begun = time.process_time()
    task()
    return time.process_time() - begun


def of_children(task: Callable[[], object]) -> float:
    """Return the processor time of the processes that one call starts and waits for, descendants included [s]."""
    before = processes.seconds_of_children()
    task()
    return processes.seconds_of_children() - before


def interleaved(tasks: Mapping[K, Callable[[], float]], rounds: int) -> dict[K, Times]:
    """Call the tasks in turn, once per round, and return their times [s]; a first round does not count."""
    return {name: Times(seconds) for name, seconds in in_turn(tasks, rounds).items()}


def in_turn(tasks: Mapping[K, Callable[[], T]], rounds: int) -> dict[K, tuple[T, ...]]:
    """Call the tasks in turn, once per round, and return their results; a first round compiles and does not count."""
    results: dict[K, list[T]] = {name: [] for name in tasks}
    for number in range(rounds + 1):
        for name, task in tasks.items():
            made = task()
            if number:
                results[name].append(made)
    return {name: tuple(made) for name, made in results.items()}


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Return the exponent p of the best fit y = C x^p."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
