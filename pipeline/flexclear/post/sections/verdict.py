"""Verdict on a scene's sections: periodic, quasi-periodic or chaotic, with its evidence (schema VERDICT).

One rule for all:

- *periodic* when the states return, and the largest exponent is not positive;
- *chaotic* when the whole confidence interval of the largest exponent is above the apparent exponent of neutral
  freedoms, and the 0-1 test agrees;
- *quasi-periodic* when the exponent may be zero, the 0-1 test gives regular, and a few lines hold the spectrum;
- *undecided* otherwise.

A neutral freedom, on which nothing depends, such as the spin of a leg with balls at both ends, lets perturbed runs
diverge in proportion to time: after n periods its apparent exponent is ln(n) / n per period, and no smaller exponent
can be determined.

Diagnostics of a sequence of states, one per period: periodic, quasi-periodic or chaotic.

All take sections: states at equal phases, in any coordinates that distinguish states. None depends on mechanisms.

Sources: 0-1 test: Gottwald & Melbourne (2009), On the implementation of the 0-1 test for chaos, SIAM J. Appl. Dyn.
Syst. 8, 129-145. Batch means: Schmeiser (1982), Batch size effects in the analysis of simulation output, Operations
Research 30, 556-568.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from scipy import stats

from flexclear.artifacts.schema import Schema, conform
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.output import table

#: frequencies that the 0-1 test tries; close to 0 and pi it resonates with slow drifts and with motions of period two
FREQUENCIES, SEED = 100, 20190310
AWAY = np.pi / 5.0
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
    # 20: batches of the exponent's confidence interval: enough for a t distribution, few enough to be nearly
    # independent
    batches = np.array([batch.mean() for batch in np.array_split(growth, min(20, len(growth)))]) / period
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


Kind = Literal["periodic", "quasi-periodic", "chaotic", "undecided"]
#: K of the 0-1 test below which a motion is regular, and above which chaotic; in between a finite series cannot tell
REGULAR, CHAOTIC = 0.2, 0.8
#: number of states below which the 0-1 test and the spectrum show nothing
ENOUGH = 200

VERDICT: Schema = table("""
exponent | | s-1 | largest Lyapunov exponent
exponent_low | | s-1 | lower end of its 95 % confidence interval
exponent_high | | s-1 | upper end of its 95 % confidence interval
least_exponent | | s-1 | exponent that so many periods cannot distinguish from zero
zero_one? | | 1 | K of the 0-1 test, of the component that decides least for regular motion
returns_after | | 1 | periods after which the states return; 0 where they do not
return_distance | | 1 | largest distance of a return, as a fraction of the motion's size
contraction? | | 1 | factor per period by which successive returns come closer
few_lines? | | 1 | fraction of the variance in the sixteen largest lines of the spectrum
principal | section component | 1 | states along their directions of largest variance
power | frequency component | 1 | fraction of the variance at each frequency
impact_correlation? | lag contact | 1 | correlation of the first impact's phase with that of later periods
""")


@dataclass(frozen=True)
class Verdict:
    """Kind of a motion, and reasons in words.

    numbers: as in the schema VERDICT.  principal: states along their directions of largest variance, (n, components).
    """

    kind: Kind
    reasons: tuple[str, ...]
    numbers: dict[str, float]
    principal: np.ndarray


def judge(states: np.ndarray, growth: np.ndarray, period: float, size: float) -> Verdict:
    """Judge states at equal phases, shape (n, d), and logarithms of a perturbed run's growth per period, (k,).

    period [s].  size: of the whole motion, in the units of the states.
    """
    rate = exponent(growth, period)
    least = float(np.log(len(growth)) / len(growth) / period)
    after, distance = period_of(states, size)
    shown = principal(states)
    K = np.array([zero_one(component) for component in shown.T])
    lines = np.array([few_lines(component) for component in shown.T])
    largest_K = float(np.nanmax(K)) if np.isfinite(K).any() else float("nan")
    discrete = float(lines.min())
    kind, reasons = _apply_rules(rate, least, after, distance, largest_K, discrete)
    if len(states) < ENOUGH and kind != "periodic":
        kind, reasons = "undecided", (f"{len(states)} sections are too few, {ENOUGH} are needed", *reasons)
    numbers = {
        "exponent": rate.mean,
        "exponent_low": rate.low,
        "exponent_high": rate.high,
        "least_exponent": least,
        "zero_one": largest_K,
        "returns_after": after,
        "return_distance": distance,
        "contraction": contraction(states, after or 1),
        "few_lines": discrete,
    }
    return Verdict(kind, reasons, numbers, shown)


def _apply_rules(
    rate: Interval, least: float, after: int, distance: float, K: float, discrete: float
) -> tuple[Kind, tuple[str, ...]]:
    text = f"largest exponent {rate.mean:.3g} 1/s, 95 % between {rate.low:.3g} and {rate.high:.3g}"
    grows, still = rate.low > least, rate.low <= least
    if after and still:
        times = "one period" if after == 1 else f"{after} periods"
        return "periodic", (f"the states return after {times}, to {distance:.2g} of the motion", text)
    tested = f"0-1 test K = {K:.2f}"
    if grows and K > CHAOTIC:
        return "chaotic", (f"{text}, above the {least:.2g} of freedoms without influence", tested)
    lined = f"{100 * discrete:.0f} % of the variance in {LINES} lines of the spectrum"
    # 0.95: fraction of the variance that few lines hold in the spectrum of a motion with few frequencies
    if still and K < REGULAR and discrete > 0.95 and not after:
        return "quasi-periodic", (text, tested, lined)
    back = f"the states return to {distance:.2g} of the motion at best"
    return "undecided", (text, tested, lined, back)


def derive(sections: xr.Dataset) -> xr.Dataset:
    """Return verdict and evidence (schema VERDICT) of a scene's sections (schema SECTIONS)."""
    states, size = features(sections)
    period = float(sections.attrs["period"])
    verdict = judge(states, sections.growth.values, period, size)
    shown = verdict.principal
    lines = [spectrum(component) for component in shown.T]
    arrays = {name: np.array(value) for name, value in verdict.numbers.items() if np.isfinite(value)}
    arrays |= {"principal": shown, "power": np.stack([power for _, power in lines], axis=1)}
    coordinates = {"section": sections.section.values, "frequency": lines[0][0]}
    if "impact_phase" in sections:
        impacts = [first_impacts(sections, str(name)) for name in sections.contact.values]
        correlations = np.stack([autocorrelation(phase) for phase in impacts], axis=1)
        arrays["impact_correlation"] = np.nan_to_num(correlations)
        coordinates |= {"contact": sections.contact.values}
    attributes = {"verdict": verdict.kind, "reasons": "; ".join(verdict.reasons)}
    title = f"Verdict on the {str(sections.attrs.get('title', 'sections')).lower()}"
    data = {name: (VERDICT[name].dims, values) for name, values in arrays.items()}
    return conform(xr.Dataset(data, coords=coordinates), VERDICT, title=title, **attributes)


def features(sections: xr.Dataset) -> tuple[np.ndarray, float]:
    """Return states at the sections, each kind of coordinate in units of its change over a period, and their size then.

    Shape (section, ...): positions, rotation matrices (which have no sign to choose), velocities, offsets.
    """
    columns = list[np.ndarray]()
    kinds = {"position": None, "quaternion": quaternion_to_matrix, "velocity": None, "contact_offset": None}
    for name, form in kinds.items():
        if name not in sections:
            continue
        values, orbit = (sections[which].values for which in (name, f"orbit_{name}"))
        for k in range(values.shape[1]):
            here, path = (x[:, k] if form is None else form(x[:, k]).reshape(len(x), 9) for x in (values, orbit))
            size = float(np.linalg.norm(path - path.mean(axis=0), axis=1).max())
            if size > STANDING * max(float(np.abs(path).max()), 1e-300):
                columns.append(here / size)
    if not columns:
        return np.zeros((sections.sizes["section"], 1)), 1.0
    return np.concatenate(columns, axis=1), float(np.sqrt(len(columns)))


def first_impacts(sections: xr.Dataset, contact: str) -> np.ndarray:
    """Return the phase of the first impact in each period that has one [s]."""
    mine = sections.impact_contact.values == contact
    _, first = np.unique(sections.impact_section.values[mine], return_index=True)
    phases: np.ndarray = sections.impact_phase.values[mine][first]
    return phases if len(phases) > 1 else np.zeros(2)
