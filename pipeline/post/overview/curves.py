"""Watched quantities as curves over time: one component, magnitude or angle of each, in a unit that reads well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.numerics.rotations import Turning, first_largest, turning
from flexclear.pipeline.core.scene.quantity import KINDS, Quantity

#: factor and unit of smaller and larger values, largest first
PREFIXES = {
    "m": ((1.0, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm")),
    "m/s": ((1.0, "m/s"), (1e3, "mm/s"), (1e6, "µm/s")),
    "rad": ((180.0 / np.pi, "°"), (1e3, "mrad"), (1e6, "µrad")),
    "N": ((1e-3, "kN"), (1.0, "N"), (1e3, "mN")),
    "s": ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")),
    "Pa": ((1e-6, "MPa"), (1e-3, "kPa"), (1.0, "Pa")),
    "J": ((1e-3, "kJ"), (1.0, "J"), (1e3, "mJ"), (1e6, "µJ"), (1e9, "nJ"), (1e12, "pJ")),
}


@dataclass(frozen=True, slots=True)
class Curve:
    """What is drawn of a quantity in one run: `values` over `time` [s], in SI; `peaks` are (time, value) of impacts."""

    title: str
    unit: str
    time: np.ndarray
    values: np.ndarray
    peaks: np.ndarray


def curves(runs: Sequence[xr.Dataset], quantity: Quantity) -> list[Curve | None]:
    """The curve of a quantity in each run; None where a run does not have it.

    A contact's quantities are drawn as its force; where the joint has no clearance, as the joint's.
    """
    if not quantity.over_time:
        return [_force(run, quantity.owner) for run in runs]
    if quantity.kind == "orientation":
        return [_turned(run, quantity) if quantities.has(run, quantity) else None for run in runs]
    lines = [quantities.series(run, quantity) if quantities.has(run, quantity) else None for run in runs]
    there = [values for values in lines if values is not None]
    k, title = 0, _title(runs, quantity)
    if _by_component(quantity) and there:
        k = int(first_largest(np.max([np.ptp(values, axis=0) for values in there], axis=0)))
        title += f" {'about' if quantity.kind.startswith('angular') else 'along'} {'xyz'[k]}"
    return [
        None
        if values is None
        else Curve(
            title,
            quantities.unit(run, quantity),
            run["time"].values,
            without_noise(_drawn(values, quantity, k), _noise(run, quantity)),
            NONE,
        )
        for run, values in zip(runs, lines, strict=True)
    ]


NONE = np.empty((0, 2))
#: contacts are short that last less than so many outputs
SHORT = 4.0


def _turned(run: xr.Dataset, quantity: Quantity) -> Curve:
    turned = turned_by(run, quantity.owner)
    return Curve(f"{quantity.owner}: {turned.title}", quantity.unit, run["time"].values, turned.angle, NONE)


def turned_by(run: xr.Dataset, body: str) -> Turning:
    """How far a body of a run has turned since the start."""
    mine = run.sel(body=body)
    return turning(run["time"].values, mine["quaternion"].values, mine["angular_velocity"].values)


def _by_component(quantity: Quantity) -> bool:
    """Whether one component is drawn, that with the largest range; of other vectors the magnitude."""
    return quantity.dim == "axis" and KINDS[quantity.kind].owner in ("body", "frame")


def _title(runs: Sequence[xr.Dataset], quantity: Quantity) -> str:
    """What the quantity is called: what a drive supplies about an axis is a torque."""
    if quantity.steps or not quantity.owner:
        return quantity.name.replace("_", " ") if not quantity.steps else quantity.name
    turns = any(quantities.has(run, quantity) and quantities.unit(run, quantity) == "N m" for run in runs)
    kind = quantity.kind.replace("force", "torque") if turns else quantity.kind
    words = kind.replace("_", " ").replace("von mises", "von Mises")
    return f"{quantity.owner}: {words}{f' along {c}' if (c := quantity.component) else ''}"


def _drawn(values: np.ndarray, quantity: Quantity, component: int) -> np.ndarray:
    if _by_component(quantity):
        return values[:, component]
    return values[:, 0] if values.shape[1] == 1 else np.linalg.norm(values, axis=1)


def _noise(run: xr.Dataset, quantity: Quantity) -> float:
    """What is rounding of such a quantity, by the ranges of all bodies along all axes; 0 of other kinds."""
    kind = KINDS[quantity.kind]
    return noise(run, run[kind.variable].values, quantity.unit) if kind.owner in ("body", "frame") else 0.0


def _force(run: xr.Dataset, joint: str) -> Curve | None:
    time = run["time"].values
    if "contact" in run.coords and joint in run["contact"].values:
        force = np.linalg.norm(run["contact_force"].sel(contact=joint).values, axis=-1)
        unit = quantities.unit(run, Quantity(joint, "peak_force"))
        return Curve(f"{joint}: {'torque' if unit == 'N m' else 'force'}", unit, time, force, _peaks(run, joint))
    if "joint" in run.coords and joint in run["joint"].values:
        force = np.linalg.norm(run["joint_force"].sel(joint=joint).values, axis=-1)
        return Curve(f"{joint}: force", "N", time, force, NONE)
    return None


def _peaks(run: xr.Dataset, contact: str) -> np.ndarray:
    """Time and largest force of each contact so short that outputs may miss it."""
    mine = run["event_contact"].values == contact
    mine &= np.isfinite(run["event_peak_force"].values) & np.isfinite(run["event_duration"].values)
    mine &= run["event_duration"].values < SHORT * float(np.median(np.diff(run["time"].values)))
    middle = run["event_time"].values + 0.5 * run["event_duration"].values
    return np.column_stack([middle[mine], run["event_peak_force"].values[mine]])


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which values up to `largest` [SI] have digits before the point."""
    choices = PREFIXES.get(unit, ((1.0, unit),))
    good = [pair for pair in choices if pair[0] * largest >= 1.0 - 1e-9]  # a bar of 1 mm may be less by rounding
    return good[0] if good else choices[-1] if largest > 0.0 else choices[0]


def size_of(unit: str) -> str:
    """What fractions of the size of a quantity with this SI unit refer to (`quantities.scale`)."""
    return {"m": "largest change", "rad": "largest change", "s": "last impact's time"}.get(unit, "largest value")


def rounded(value: float, digits: int) -> str:
    """A number to so many significant digits; no exponent where up to seven digits before the point do without it."""
    written = float(f"{value:.{digits}g}")
    return f"{written:.0f}" if 10.0**digits <= abs(written) < 1e7 else f"{value:.{digits}g}"


def in_unit(value: float, unit: str, digits: int = 4) -> str:
    """A value [SI] in a unit that reads well, to so many significant digits."""
    factor, written = scaled(value, unit)
    return f"{rounded(factor * value, digits)} {written}"


def measured(value: float, error: float, unit: str) -> str:
    """A value [SI] with its error, in a unit that reads well, to the second digit of the error.

    The error is left out where it is nan; where it is far below the value's fourth digit, it does not set the
    digits.
    """
    if np.isnan(error):
        return in_unit(value, unit)
    factor, written = scaled(max(value, error) if np.isfinite(error) else value, unit)
    value, error = factor * value, factor * error
    if error <= 0.0 or np.isinf(error):
        return f"{rounded(value, 4)} ± {error:g} {written}"
    decimals = 1 - int(np.floor(np.log10(error)))
    if decimals > 6 or error < 1e-4 * abs(value):
        return f"{rounded(value, 4)} ± {rounded(error, 2)} {written}"
    shown = max(decimals, 0)
    return f"{round(value, decimals):.{shown}f} ± {round(error, decimals):.{shown}f} {written}"


#: a contact that is closed for so much of the time hardly opens: its force peaks without impacts
CLOSED = 0.9
#: rounding grows over a run, but stays below this fraction of the largest curve of its kind; integration errors do not
NOISE = 1e-9
#: and below these fractions of what the whole motion makes of it (`quantities.natural_size`); a stage may move by 1e-11
#: of the crane that holds it, and stiff rods magnify the rounding of places into forces
ROUNDING = {"m": 1e-13, "m/s": 1e-13, "N": 1e-11, "N m": 1e-11}


def impacts(count: int, closed: float = 0.0) -> str:
    """How many impacts, in words; closed: fraction of the time in contact."""
    said = "no impact" if not count else "one impact" if count == 1 else f"{count} impacts"
    return f"{said}; the contact hardly opens ({closed:.0%} of the time closed)" if closed >= CLOSED else said


def noise(run: xr.Dataset, values: np.ndarray, unit: str) -> float:
    """Largest range that is rounding, of a run's values of one kind over time, shape (time, ...) [SI unit]."""
    largest = float(np.ptp(values, axis=0).max(initial=0.0))
    return max(NOISE * largest, ROUNDING[unit] * quantities.natural_size(run, unit) if unit in ROUNDING else 0.0)


def without_noise(values: np.ndarray, noise: float) -> np.ndarray:
    """The values, or their first one where they have no larger range than rounding gives them."""
    if values.size and float(np.ptp(values)) > noise:
        return values
    return np.full_like(values, 0.0 if not values.size or abs(values[0]) <= noise else values[0])


def by_unit(values: Mapping[str, np.ndarray], unit: str) -> tuple[float, str]:
    """`scaled` for several series that share an axis."""
    return scaled(max((float(np.abs(v).max(initial=0.0)) for v in values.values()), default=0.0), unit)
