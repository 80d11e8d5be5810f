"""Diagnostics of a sequence of states, one per period: periodic, quasi-periodic or chaotic.

All take sections: states at equal phases, in any coordinates that distinguish states. None depends on mechanisms.

Sources: 0-1 test: Gottwald & Melbourne (2009), On the implementation of the 0-1 test for chaos, SIAM J. Appl. Dyn.
Syst. 8, 129-145. Batch means: Schmeiser (1982), Batch size effects in the analysis of simulation output, Operations
Research 30, 556-568.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

#: frequencies that the 0-1 test tries; close to 0 and pi it resonates with slow drifts and with motions of period two
FREQUENCIES, SEED = 100, 20190310
AWAY = np.pi / 5.0
#: batches of the exponent's confidence interval: enough for a t distribution, few enough to be nearly independent
BATCHES = 20
#: longest period that is searched for, in periods of the drive
LONGEST = 32
#: number of lines that hold nearly the whole spectrum of a motion with few frequencies
LINES = 16
#: a state returns within this fraction of the motion's size: the rest is invisible in any picture
RETURNED = 1e-4
#: returns from which a contraction is reported
FEWEST = 4
#: an observable is constant when it changes by less than this fraction of its size: rounding and integration errors
STANDING = 1e-9


@dataclass(frozen=True)
class Interval:
    """A mean with its 95 % confidence interval."""

    mean: float
    low: float
    high: float


def exponent(growth: np.ndarray, period: float) -> Interval:
    """Return the largest Lyapunov exponent [1/s] from logarithms of a perturbed run's growth per period, shape (n,).

    The interval is that of batch means, since growths of neighbouring periods are correlated.
    """
    batches = np.array([batch.mean() for batch in np.array_split(growth, min(BATCHES, len(growth)))]) / period
    mean = float(growth.mean() / period)
    if len(batches) < 2:
        return Interval(mean, -np.inf, np.inf)
    half = float(stats.t.ppf(0.975, len(batches) - 1) * batches.std(ddof=1) / np.sqrt(len(batches)))
    return Interval(mean, mean - half, mean + half)


def zero_one(series: np.ndarray) -> float:
    """Return K of the 0-1 test, close to 0 for regular and close to 1 for chaotic motion; NaN for a constant series.

    series: one observable, shape (n,), of some hundreds at least.  The mean is subtracted, so that the mean square
    displacement of the translation variables has no oscillating term; K is its correlation with time, up to n / 10. The
    median of K over random frequencies is returned.
    """
    n = len(series)
    x = series - series.mean()
    if not x.std() > STANDING * max(float(np.abs(series).max()), 1e-300):
        return float("nan")
    j, cut = np.arange(1, n + 1), n // 10
    lags = np.arange(1, cut + 1)
    correlations = list[float]()
    for c in np.random.default_rng(SEED).uniform(AWAY, np.pi - AWAY, FREQUENCIES):
        path = np.cumsum(x * np.exp(1j * c * j))
        displacement = [float(np.mean(np.abs(path[k : k + n - cut] - path[: n - cut]) ** 2)) for k in lags]
        correlations.append(float(np.corrcoef(lags, displacement)[0, 1]))
    return float(np.median(correlations))


def period_of(states: np.ndarray, size: float) -> tuple[int, float]:
    """Return the number of periods after which the last quarter of the states returns; 0 if none up to LONGEST.

    states: shape (n, d).  size: of the whole motion, of which RETURNED counts as nothing. Also returns the largest
    distance of a return as a fraction of the size, for that number or for the best.
    """
    last = states[-max(len(states) // 4, 4) :]
    best = np.inf
    for p in range(1, min(LONGEST, len(last) // 2) + 1):
        distance = float(np.linalg.norm(last[p:] - last[:-p], axis=1).max()) / size
        best = min(best, distance)
        if distance <= RETURNED:
            return p, distance
    return 0, best


def contraction(states: np.ndarray, period: int = 1) -> float:
    """Return the factor per period by which successive returns come closer, fitted while they do; else NaN.

    states: shape (n, d), with some of the transient.  Distances count until they are within tenfold of the final ones.
    """
    distance = np.linalg.norm(states[period:] - states[:-period], axis=1)
    settled = 10.0 * float(np.median(distance[-max(len(distance) // 4, 1) :]))
    count = int(np.argmax(distance <= settled)) if np.any(distance <= settled) else len(distance)
    if count < FEWEST or distance[0] == 0.0:
        return float("nan")
    return float(np.exp(np.polyfit(np.arange(count), np.log(distance[:count]), 1)[0]))


def spectrum(series: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the fraction of the variance at each frequency (cycles per period), Hann window; shapes (n // 2 + 1,)."""
    x = (series - series.mean()) * np.hanning(len(series))
    power = np.abs(np.fft.rfft(x)) ** 2
    total = power.sum()
    return np.fft.rfftfreq(len(series)), power / total if total > 0.0 else power


def few_lines(series: np.ndarray) -> float:
    """Return the fraction of the variance in the LINES largest lines of the spectrum, with two neighbours on each
    side."""
    _, power = spectrum(series)
    left, fraction = power.copy(), 0.0
    for _ in range(LINES):
        k = int(np.argmax(left))
        around = slice(max(k - 2, 0), k + 3)
        fraction += float(left[around].sum())
        left[around] = 0.0
    return fraction


def principal(states: np.ndarray) -> np.ndarray:
    """Return the states along their directions of largest variance, each component scaled before; (n, <= 3)."""
    centred = states - states.mean(axis=0)
    scale = centred.std(axis=0)
    moving = scale > STANDING * max(float(np.abs(states).max()), 1e-300)
    if not np.any(moving):
        return np.zeros((len(states), 1))
    U, S, _ = np.linalg.svd(centred[:, moving] / scale[moving], full_matrices=False)
    return (U * S)[:, :3]


def autocorrelation(series: np.ndarray, lags: int = 20) -> np.ndarray:
    """Return the correlation of a series with itself, 0 to `lags` periods later; NaN for a constant series."""
    x = series - series.mean()
    total = float(x @ x)
    if total == 0.0:
        return np.full(lags + 1, np.nan)
    return np.array([float(x[: len(x) - k] @ x[k:]) / total for k in range(lags + 1)])
