"""Watched quantities as curves over time: one component, magnitude or angle of each, in a readable unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.numerics.rotations import Turning, index_of_largest, rotation_since_start
from flexclear.scene.quantity import KINDS, Quantity

#: factors and units for smaller and larger values, largest first
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
    """A drawn quantity of one run: `values` over `time` [s], in SI units; `peaks` are (time, value) of impacts."""

    title: str
    unit: str
    time: np.ndarray
    values: np.ndarray
    peaks: np.ndarray


def curves(runs: Sequence[xr.Dataset], quantity: Quantity) -> list[Curve | None]:
    """Return the curve of a quantity in each run; None where a run lacks it.

    Quantities of a contact are drawn as its force; where the joint has no clearance, as the joint's force.
    """
    if not quantity.over_time:
        return [_force(run, quantity.owner) for run in runs]
    if quantity.kind == "orientation":
        return [_rotation_curve(run, quantity) if quantities.has_quantity(run, quantity) else None for run in runs]
    lines = [quantities.series(run, quantity) if quantities.has_quantity(run, quantity) else None for run in runs]
    present = [values for values in lines if values is not None]
    k, title = 0, _title(runs, quantity)
    if _by_component(quantity) and present:
        k = int(index_of_largest(np.max([np.ptp(values, axis=0) for values in present], axis=0)))
        title += f" {'about' if quantity.kind.startswith('angular') else 'along'} {'xyz'[k]}"
    return [
        None
        if values is None
        else Curve(
            title,
            quantities.unit(run, quantity),
            run["time"].values,
            without_noise(_component_values(values, quantity, k), _rounding_range(run, quantity)),
            NONE,
        )
        for run, values in zip(runs, lines, strict=True)
    ]


NONE = np.empty((0, 2))


def _rotation_curve(run: xr.Dataset, quantity: Quantity) -> Curve:
    turned = rotation_of_body(run, quantity.owner)
    return Curve(f"{quantity.owner}: {turned.title}", quantity.unit, run["time"].values, turned.angle, NONE)


def rotation_of_body(run: xr.Dataset, body: str) -> Turning:
    """Return the rotation of a body of a run since the start."""
    mine = run.sel(body=body)
    return rotation_since_start(run["time"].values, mine["quaternion"].values, mine["angular_velocity"].values)


def _by_component(quantity: Quantity) -> bool:
    """Return True when one component is drawn, that with the largest range; other vectors show the magnitude."""
    return quantity.dim == "axis" and KINDS[quantity.kind].owner in ("body", "frame")


def _title(runs: Sequence[xr.Dataset], quantity: Quantity) -> str:
    """Return the title of a quantity; the force of a drive about an axis is called torque."""
    if quantity.steps or not quantity.owner:
        return quantity.name.replace("_", " ") if not quantity.steps else quantity.name
    turns = any(quantities.has_quantity(run, quantity) and quantities.unit(run, quantity) == "N m" for run in runs)
    kind = quantity.kind.replace("force", "torque") if turns else quantity.kind
    words = kind.replace("_", " ").replace("von mises", "von Mises")
    return f"{quantity.owner}: {words}{f' along {c}' if (c := quantity.component) else ''}"


def _component_values(values: np.ndarray, quantity: Quantity, component: int) -> np.ndarray:
    if _by_component(quantity):
        return values[:, component]
    return values[:, 0] if values.shape[1] == 1 else np.linalg.norm(values, axis=1)


def _rounding_range(run: xr.Dataset, quantity: Quantity) -> float:
    """Return the range that rounding causes in a quantity, by the ranges of all bodies and axes; 0 for other kinds."""
    kind = KINDS[quantity.kind]
    return rounding_range(run, run[kind.variable].values, quantity.unit) if kind.owner in ("body", "frame") else 0.0


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
    """Return time and largest force of each contact so short that outputs may miss it."""
    mine = run["event_contact"].values == contact
    mine &= np.isfinite(run["event_peak_force"].values) & np.isfinite(run["event_duration"].values)
    # 4.0: a contact is short below so many output intervals
    mine &= run["event_duration"].values < 4.0 * float(np.median(np.diff(run["time"].values)))
    middle = run["event_time"].values + 0.5 * run["event_duration"].values
    return np.column_stack([middle[mine], run["event_peak_force"].values[mine]])


def readable_unit(largest: float, unit: str) -> tuple[float, str]:
    """Return factor and unit in which values up to `largest` [SI] have digits before the point."""
    choices = PREFIXES.get(unit, ((1.0, unit),))
    good = [pair for pair in choices if pair[0] * largest >= 1.0 - 1e-9]  # rounding may put a bar of 1 mm below 1
    return good[0] if good else choices[-1] if largest > 0.0 else choices[0]


def size_of(unit: str) -> str:
    """Return the words for the size of a quantity with this SI unit, which fractions refer to (`quantities.scale`)."""
    return {"m": "largest change", "rad": "largest change", "s": "last impact's time"}.get(unit, "largest value")


def format_to_digits(value: float, digits: int) -> str:
    """Format a number to so many significant digits; without exponent up to seven digits before the point."""
    written = float(f"{value:.{digits}g}")
    return f"{written:.0f}" if 10.0**digits <= abs(written) < 1e7 else f"{value:.{digits}g}"


def in_unit(value: float, unit: str, digits: int = 4) -> str:
    """Format a value [SI] in a readable unit, to so many significant digits."""
    factor, written = readable_unit(abs(value), unit)
    return f"{format_to_digits(factor * value, digits)} {written}"


def format_with_error(value: float, error: float, unit: str) -> str:
    """Format a value [SI] with its error, in a readable unit, to the second digit of the error.

    An error that is not known, or below the value's fourth digit, is left out.
    """
    if not np.isfinite(error) or error <= 1e-4 * abs(value):
        return in_unit(value, unit)
    factor, written = readable_unit(max(abs(value), error), unit)
    value, error = factor * value, factor * error
    decimals = 1 - int(np.floor(np.log10(error)))
    if decimals > 6:
        return f"{format_to_digits(value, 4)} ± {format_to_digits(error, 2)} {written}"
    shown = max(decimals, 0)
    return f"{round(value, decimals):.{shown}f} ± {round(error, decimals):.{shown}f} {written}"


#: a contact closed for this fraction of the time hardly opens: its force peaks without impacts
CLOSED = 0.9
#: rounding grows over a run, but stays below this fraction of the largest curve of its kind; integration errors do not
NOISE = 1e-9
#: and below these fractions of the motion's natural size (`quantities.natural_size`); a stage may move by 1e-11 of the
#: crane that holds it, and stiff rods magnify the rounding of positions into forces
ROUNDING = {"m": 1e-13, "m/s": 1e-13, "N": 1e-11, "N m": 1e-11}


def impacts_text(count: int, closed: float = 0.0) -> str:
    """Return the number of impacts in words; closed: fraction of the time in contact."""
    text = "no impact" if not count else "one impact" if count == 1 else f"{count} impacts"
    return f"{text}; the contact is closed most of the time ({closed:.0%})" if closed >= CLOSED else text


def rounding_range(run: xr.Dataset, values: np.ndarray, unit: str) -> float:
    """Return the largest range due to rounding in a run's values of one kind, shape (time, ...) [SI unit]."""
    largest = float(np.ptp(values, axis=0).max(initial=0.0))
    return max(NOISE * largest, ROUNDING[unit] * quantities.natural_size(run, unit) if unit in ROUNDING else 0.0)


def without_noise(values: np.ndarray, noise: float) -> np.ndarray:
    """Return the values, or constant ones where their range is within rounding."""
    if values.size and float(np.ptp(values)) > noise:
        return values
    return np.full_like(values, 0.0 if not values.size or abs(values[0]) <= noise else values[0])


def by_unit(values: Mapping[str, np.ndarray], unit: str) -> tuple[float, str]:
    """Return `readable_unit` for several series that share an axis."""
    return readable_unit(max((float(np.abs(v).max(initial=0.0)) for v in values.values()), default=0.0), unit)
