"""Quantities as users write them, converted to SI once, at the edge."""

from __future__ import annotations

import math
import re

#: factor to SI and physical dimension of every unit that a scene or recipe may use
UNITS: dict[str, tuple[float, str]] = {
    "m": (1.0, "length"),
    "mm": (1e-3, "length"),
    "um": (1e-6, "length"),
    "nm": (1e-9, "length"),
    "cm": (1e-2, "length"),
    "in": (0.0254, "length"),
    "s": (1.0, "time"),
    "ms": (1e-3, "time"),
    "us": (1e-6, "time"),
    "kg": (1.0, "mass"),
    "g": (1e-3, "mass"),
    "t": (1e3, "mass"),
    "rad": (1.0, "angle"),
    "mrad": (1e-3, "angle"),
    "urad": (1e-6, "angle"),
    "deg": (math.pi / 180.0, "angle"),
    "N": (1.0, "force"),
    "kN": (1e3, "force"),
    "N m": (1.0, "torque"),
    "N mm": (1e-3, "torque"),
    "N s": (1.0, "impulse"),
    "Pa": (1.0, "pressure"),
    "MPa": (1e6, "pressure"),
    "GPa": (1e9, "pressure"),
    "Hz": (2.0 * math.pi, "angular velocity"),
    "rpm": (math.pi / 30.0, "angular velocity"),
    "rad/s": (1.0, "angular velocity"),
    "deg/s": (math.pi / 180.0, "angular velocity"),
    "m/s": (1.0, "velocity"),
    "mm/s": (1e-3, "velocity"),
    "m/s^2": (1.0, "acceleration"),
    "mm/s^2": (1e-3, "acceleration"),
    "kg/m^3": (1.0, "density"),
    "g/cm^3": (1e3, "density"),
    "kg m^2": (1.0, "inertia"),
    "kg mm^2": (1e-6, "inertia"),
    "g mm^2": (1e-9, "inertia"),
    "m^2": (1.0, "area"),
    "mm^2": (1e-6, "area"),
    "m^4": (1.0, "second moment of area"),
    "mm^4": (1e-12, "second moment of area"),
    "N/m": (1.0, "stiffness"),
    "N/mm": (1e3, "stiffness"),
    "N/m^1.5": (1.0, "Hertz stiffness"),
    "kN/m": (1e3, "stiffness"),
    "N s/m": (1.0, "damping"),
    "N s/mm": (1e3, "damping"),
    "N m/rad": (1.0, "torsional stiffness"),
    "N m/deg": (180.0 / math.pi, "torsional stiffness"),
    "N m s/rad": (1.0, "torsional damping"),
    "%": (1e-2, "number"),
}

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*$")


def quantity(value: object, dimension: str) -> float:
    """SI value of a bare number or a string like ``"20.5 mm"``.

    Raises ValueError, in words, when the text is no quantity, the unit is unknown, the unit
    belongs to another dimension, or the number is not finite.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"expected {_a(dimension)}, a number or text like '1 {_example(dimension)}'")
    if isinstance(value, str):
        match = _QUANTITY.match(value)
        if match is None:
            raise ValueError(f"'{value}' is not a number with a unit")
        number, unit = float(match[1]), match[2]
        if unit is None:
            factor = 1.0
        elif unit not in UNITS:
            raise ValueError(f"unknown unit '{unit}'; {_a(dimension)} is written in {_known(dimension)}")
        else:
            factor, found = UNITS[unit]
            if found != dimension:
                raise ValueError(f"'{value}' is {_a(found)}, but {_a(dimension)} belongs here, in {_known(dimension)}")
        result = number * factor
    else:
        result = float(value)
    if not math.isfinite(result):
        raise ValueError(f"{value!r} is not a finite number")
    return result


def any_quantity(value: object) -> float | str:
    """A bare number, or a quantity in words in its SI unit (``"60 mm"`` -> ``"0.06 m"``), whatever it measures.

    For places whose dimension another part of the scene decides; `quantity` reads the result.
    Raises ValueError as `quantity` does.
    """
    match = _QUANTITY.match(value) if isinstance(value, str) else None
    unit = match[2] if match is not None else None
    if unit is None or unit == "%":
        return quantity(value, "number")
    if unit not in UNITS:
        raise ValueError(f"unknown unit '{unit}'; known: {', '.join(UNITS)}")
    dimension = UNITS[unit][1]
    return f"{quantity(value, dimension)!r} {_example(dimension, factor=1.0)}"


def _a(dimension: str) -> str:
    return f"{'an' if dimension[0] in 'aeiou' else 'a'} {dimension}"


def _known(dimension: str) -> str:
    return ", ".join(unit for unit, (_, found) in UNITS.items() if found == dimension) or "SI"


def _example(dimension: str, factor: float | None = None) -> str:
    """A unit of this dimension; with `factor`, the one that is so many SI units."""
    return next((u for u, (f, found) in UNITS.items() if found == dimension and factor in (None, f)), "")
