"""Table 10: cost of the models relative to the ideal model, at equal error, and by the paper's step and tolerance."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.publishing import Table
from papers.comparison import ABSENT, Data, drawn
from papers.wang_wang_2019.published import TABLE4_NORMAL_MODE, TABLE6, TABLE10

REFERENCE = "sps4/ideal"
#: settings as the timing calls them, and their names in column heads
SETTINGS = {"equal": "equal error", "step": "paper's step", "tolerance": "paper's tolerance"}
#: factor within which a ratio has the same magnitude as the paper's
NEAR = 1.5


@drawn(
    "Table 10: cost of the models, the ideal model's being 1: at equal error, at the paper's step, at its tolerance",
    "sps4:timing",
)
def costs(data: Data) -> Table:
    """Tabulate the costs; times are medians of warm repeats, +- half their range."""
    timing = data["sps4:timing"]
    rows = tuple(_row(timing, str(name)) for name in timing.scene.values)
    return Table("Table 10: cost relative to the ideal model", _heads(), rows, _notes(timing))


def _heads() -> tuple[str, ...]:
    heads = ["model", "CPU time, paper (ideal = 1)"]
    for setting, words in SETTINGS.items():
        heads += [f"{words}: integration (ideal = 1)", f"{words}: integration (ms)", f"{words}: evaluations"]
        if setting == "tolerance":
            heads += [f"{words}: steps", f"{words}: steps (ideal = 1)"]
    return (*heads, "equal error: rtol", "recording (ms)")


def _row(timing: xr.Dataset, name: str) -> tuple[str, ...]:
    one = timing.sel(scene=name)
    cells = [name, f"{TABLE10[name]:.2f}" if name in TABLE10 else ABSENT]
    for setting in SETTINGS:
        cells += [_ratio(timing, setting, name), _milliseconds(one[f"{setting}_integration_seconds"])]
        cells.append(_count(one[f"{setting}_evaluations"]))
        if setting == "tolerance":
            cells += [_count(one.tolerance_steps), _number(_steps(timing, name))]
    return (*cells, f"{float(one.equal_rtol):.0e}", _milliseconds(one.equal_recording_seconds))


def _steps(timing: xr.Dataset, name: str, reading: str = "tolerance") -> float:
    """Return steps at the paper's tolerance over the ideal model's. reading: tolerance relative to stroke or `size`."""
    steps = timing[f"{reading}_steps"]
    return float(steps.sel(scene=name) / steps.sel(scene=REFERENCE))


def _count(value: xr.DataArray) -> str:
    return f"{float(value):.0f}" if np.isfinite(value) else ABSENT


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else ABSENT


def _milliseconds(repeats: xr.DataArray) -> str:
    values = 1e3 * made(repeats)
    if not values.size:
        return ABSENT
    return f"{np.median(values):.3g} ± {_to_digits(0.5 * (values.max() - values.min()), 1)}"


def _to_digits(value: float, digits: int) -> str:
    """Format a number to so many significant digits, without an exponent."""
    return np.format_float_positional(value, digits, unique=False, fractional=False, trim="-")


def made(repeats: xr.DataArray) -> np.ndarray:
    """Return the repeats that exist; short runs are repeated more often than long ones."""
    values: np.ndarray = repeats.values
    return values[np.isfinite(values)]


def _ratio(timing: xr.Dataset, setting: str, name: str) -> str:
    """Format the ratio of the medians, +- half the range that follows from the repeats of both."""
    own, base = _repeats(timing, setting, name), _repeats(timing, setting, REFERENCE)
    if not own.size or not base.size:
        return ABSENT
    half = 0.0 if name == REFERENCE else 0.5 * (own.max() / base.min() - own.min() / base.max())
    return f"{np.median(own) / np.median(base):.3g} ± {_to_digits(half, 1)}"


def _repeats(timing: xr.Dataset, setting: str, name: str) -> np.ndarray:
    """Return times of the integration [s]; none for a scene that was not timed."""
    return made(timing[f"{setting}_integration_seconds"].sel(scene=timing.scene == name))


def ratios(timing: xr.Dataset, setting: str) -> dict[str, float]:
    """Return CPU times of the integration over the ideal model's, for the models in the paper's table."""
    base = _repeats(timing, setting, REFERENCE)
    times = {scene: _repeats(timing, setting, scene) for scene in TABLE10 if scene != REFERENCE and base.size}
    return {scene: float(np.median(own) / np.median(base)) for scene, own in times.items() if own.size}


def evaluations(timing: xr.Dataset, setting: str) -> dict[str, float]:
    """Return evaluations over the ideal model's, for the models in the paper's table; on every machine the same."""
    counts = timing[f"{setting}_evaluations"]
    known = [scene for scene in TABLE10 if scene in timing.scene.values]
    return {scene: float(counts.sel(scene=scene) / counts.sel(scene=REFERENCE)) for scene in known}


def _notes(timing: xr.Dataset) -> tuple[str, ...]:
    facts = timing.attrs
    notes = [
        "Times are processor time of the integration alone; recording (evaluating the rows of the output, and the "
        "dataset) costs the same whatever the way, is in a column of its own and is in no ratio. Medians of warm "
        "repeats in one process, with other programs running, ± half their range; a ratio's "
        "± is half of what the ranges of both times leave it.",
        "Equal error: each model runs at the tolerance that gives the platform's velocity a relative error of "
        f"{facts['equal_error']:g} at most over the first {100 * facts['share']:.0f} % of the stroke, where all models "
        "can be predicted point by point (the smooth ideal stroke has far less at any tolerance); one whose energy "
        "ledger does not close at it, at the next decade at which it does. Paper's step: a predictor-corrector at "
        f"Table 6's step of {facts['step']:g} s, contacts noticed at the ends of steps, whatever the error. Paper's "
        f"tolerance: {facts['damped']}, a damped implicit method of variable step, at Table 6's integration tolerance "
        f"of {1e3 * facts['tolerance']:g} mm as a fraction of the drives' stroke (rtol "
        f"{float(timing.tolerance_rtol.median()):.1e}), whatever becomes of the energy (up to "
        f"{float(timing.tolerance_energy_error.max()):.1g} J).",
        *(_verdict(timing, setting) for setting in SETTINGS),
        _step_ratios(timing),
        "The paper prints a step of the integration and a tolerance, and no error of any run; which of the two its "
        "times were taken with, and by which program, it does not say. At equal error a smooth ideal stroke needs few "
        "steps, the fastest mode of a flexible rod limits the step of an explicit method even where nothing happens, "
        "and every impact is located and resolved.",
    ]
    if facts["refused"]:
        notes += [f"What could not be integrated: {facts['refused']}.", _unstable(float(facts["step"]))]
    return tuple(notes)


def _unstable(step: float) -> str:
    """Return a note on the growth of a vibration per step, which makes the predictor-corrector fail at that step."""
    highest, steps = max(TABLE4_NORMAL_MODE), TABLE6["time_span"] / step
    more = growth(2.0 * np.pi * highest * step) - 1.0
    return (
        f"At {step:g} s the predictor-corrector makes an undamped vibration of {1e-3 * highest:.3g} kHz, the sixth of "
        f"Table 4, larger by {100.0 * more:.2g} % in each step: by a factor of 1e{steps * np.log10(1.0 + more):.0f} "
        "over the stroke. So it is the method that ends runs of a flexible rod at this step, whatever the reason given."
    )


def growth(angle: float) -> float:
    """Return the factor by which a step of Adams, Bashforth and Moulton's method multiplies an undamped vibration.

    angle: circular frequency times step.  Order 4: predicted, evaluated, corrected, evaluated, so that y' = zy gives
    y[n+1] = y[n] + z (9 p + 19 y[n] - 5 y[n-1] + y[n-2]) / 24, p = y[n] + z (55 y[n] - 59 y[n-1] + 37 y[n-2] - 9
    y[n-3]) / 24 (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, sec. III.1).
    """
    z = 1j * angle
    predicted = np.array([1.0, 0.0, 0.0, 0.0]) + z / 24.0 * np.array([55.0, -59.0, 37.0, -9.0])
    corrected = np.array([1.0, 0.0, 0.0, 0.0]) + z / 24.0 * (9.0 * predicted + np.array([19.0, -5.0, 1.0, 0.0]))
    return float(np.abs(np.roots([1.0, *-corrected])).max())


def _verdict(timing: xr.Dataset, setting: str) -> str:
    """Compare our ratios at one setting with the paper's, as one range."""
    deviations = {scene: ratio / TABLE10[scene] for scene, ratio in ratios(timing, setting).items()}
    if not deviations:
        return f"{SETTINGS[setting].capitalize()}: no model of the paper's table besides the ideal one could be timed."
    least, most = min(deviations, key=deviations.__getitem__), max(deviations, key=deviations.__getitem__)
    return (
        f"{SETTINGS[setting].capitalize()}: our ratios are {_to_digits(deviations[least], 2)} ({least}) to "
        f"{_to_digits(deviations[most], 2)} ({most}) times the paper's."
    )


def _step_ratios(timing: xr.Dataset) -> str:
    """Compare ratios of step counts of a damped method at the paper's tolerance with the paper's ratios."""
    steps = {s: _steps(timing, s) for s in TABLE10 if s in timing.scene.values and s != REFERENCE}
    text = ", ".join(f"{scene} {_number(ratio)} (paper {TABLE10[scene]:g})" for scene, ratio in steps.items())
    similar = [s for s, ratio in steps.items() if 1.0 / NEAR < ratio / TABLE10[s] < NEAR]
    other = ", ".join(f"{scene} {_number(_steps(timing, scene, 'size'))}" for scene in steps)
    return (
        f"Steps at the paper's tolerance over the ideal model's: {text}. Within a factor of {NEAR:g} of the paper's "
        f"ratio: {', '.join(similar) or 'none'}. Read as a fraction of the mechanism's size (rtol "
        f"{float(timing.size_rtol.median()):.1e}) the same tolerance gives {other}: where the method begins to follow "
        "the rod's vibrations, these ratios are a matter of the reading."
    )
