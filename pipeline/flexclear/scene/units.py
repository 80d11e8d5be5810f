"""Conversion of quantities in users' units to SI, once, when they are read.

Pint is not used: it treats radians as numbers, so that torques, energies and torsional stiffnesses are the same; its
import and first quantity take 0.3 s of processor time in every command.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from difflib import get_close_matches
from functools import lru_cache

from flexclear.system.errors import InputError

#: units that messages list
COMMON = ("m", "mm", "s", "kg", "N", "N m", "rad", "deg", "rpm", "Hz", "Pa", "J")
#: a quotient of two numbers
_FRACTION = re.compile(r"([-+]?[\d.]+) */ *([\d.]+)")
#: a number that is written with a comma
_COMMA = re.compile(r"\s*[-+]?\d+,\d")

Exponents = tuple[float, float, float, float]

#: exponents of kg, m, s and rad of each physical dimension, which distinguish products of units (`unit`); its units in
#: scenes and recipes, with their factors to SI
_DIMENSIONS: dict[str, tuple[Exponents, dict[str, float]]] = {
    "number": ((0, 0, 0, 0), {"%": 1e-2}),
    "length": (
        (0, 1, 0, 0),
        {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "cm": 1e-2, "km": 1e3, "in": 0.0254, "ft": 0.3048},
    ),
    "time": ((0, 0, 1, 0), {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}),
    "mass": ((1, 0, 0, 0), {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "lb": 0.45359237}),
    "angle": (
        (0, 0, 0, 1),
        {
            "rad": 1.0,
            "mrad": 1e-3,
            "urad": 1e-6,
            "deg": math.pi / 180.0,
            "rev": 2.0 * math.pi,
            "arcmin": math.pi / 10800.0,
            "arcsec": math.pi / 648000.0,
        },
    ),
    "force": ((1, 1, -2, 0), {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "lbf": 4.4482216152605}),
    "torque": ((1, 2, -2, 0), {"N m": 1.0, "N mm": 1e-3, "kN m": 1e3, "Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3}),
    "energy": ((1, 2, -2, 0), {"J": 1.0, "mJ": 1e-3, "kJ": 1e3}),
    "power": ((1, 2, -3, 0), {"W": 1.0, "kW": 1e3}),
    "impulse": ((1, 1, -1, 0), {"N s": 1.0}),
    "angular impulse": ((1, 2, -1, 0), {"N m s": 1.0}),
    "pressure": ((1, -1, -2, 0), {"Pa": 1.0, "kPa": 1e3, "bar": 1e5, "MPa": 1e6, "GPa": 1e9}),
    "viscosity": ((1, -1, -1, 0), {"Pa s": 1.0, "mPa s": 1e-3}),
    "angular velocity": (
        (0, 0, -1, 1),
        {
            "Hz": 2.0 * math.pi,
            "kHz": 2e3 * math.pi,
            "MHz": 2e6 * math.pi,
            "rpm": math.pi / 30.0,
            "rad/s": 1.0,
            "deg/s": math.pi / 180.0,
        },
    ),
    "angular acceleration": ((0, 0, -2, 1), {"rad/s^2": 1.0, "deg/s^2": math.pi / 180.0}),
    "velocity": ((0, 1, -1, 0), {"m/s": 1.0, "mm/s": 1e-3}),
    "acceleration": ((0, 1, -2, 0), {"m/s^2": 1.0, "mm/s^2": 1e-3}),
    "density": ((1, -3, 0, 0), {"kg/m^3": 1.0, "g/cm^3": 1e3}),
    "inertia": ((1, 2, 0, 0), {"kg m^2": 1.0, "kg mm^2": 1e-6, "g mm^2": 1e-9}),
    "area": ((0, 2, 0, 0), {"m^2": 1.0, "mm^2": 1e-6}),
    "second moment of area": ((0, 4, 0, 0), {"m^4": 1.0, "mm^4": 1e-12}),
    "stiffness": ((1, 0, -2, 0), {"N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3}),
    "Hertz stiffness": ((1, -0.5, -2, 0), {"N/m^1.5": 1.0}),
    "damping": ((1, 0, -1, 0), {"N s/m": 1.0, "N s/mm": 1e3}),
    "torsional stiffness": ((1, 2, -2, -1), {"N m/rad": 1.0, "N m/deg": 180.0 / math.pi}),
    "torsional damping": ((1, 2, -1, -1), {"N m s/rad": 1.0}),
    "stiffness per time": ((1, 0, -3, 0), {"N/m s": 1.0}),
    "torsional stiffness per time": ((1, 2, -3, -1), {"N m/rad s": 1.0}),
    "force per time": ((1, 1, -3, 0), {"N/s": 1.0}),
    "force per angle and time": ((1, 1, -3, -1), {"N/rad s": 1.0}),
    "length per angle": ((0, 1, 0, -1), {"m/rad": 1.0}),
    "angle per length": ((0, -1, 0, 1), {"rad/m": 1.0}),
    "force per angle": ((1, 1, -2, -1), {"N/rad": 1.0}),
    "force per angular velocity": ((1, 1, -1, -1), {"N s/rad": 1.0}),
}
_EXPONENTS = {dimension: exponents for dimension, (exponents, _) in _DIMENSIONS.items()}
#: factor to SI and physical dimension of every unit
UNITS = {name: (factor, of) for of, (_, known) in _DIMENSIONS.items() for name, factor in known.items()}

#: largest number, and reciprocal of the least: squares of products such as m l^2 must not overflow or underflow
LARGEST_NUMBER = 1e50
#: units of the exponents
_BASE = ("kg", "m", "s", "rad")
#: a unit and its power; powers with more digits have no physical meaning and would overflow
_FACTOR = re.compile(r"([A-Za-z]+)(?:\^(-?\d(?:\.\d{1,3})?))?")
_SPELLINGS = str.maketrans({"²": "^2", "³": "^3", "·": " ", "*": " ", "µ": "u", "μ": "u", "°": "deg", "º": "deg"})
#: signs for degrees
DEGREES = re.compile(r"\s*[°º]")

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*$")


@lru_cache(maxsize=4096)
def unit(text: str) -> tuple[float, str] | None:
    """Return the factor to SI and the dimension of a unit, or of a product such as ``"N mm/deg"``; None for other text.

    Units after a slash divide; powers are written ``^2``, factors separated by spaces, dots or stars.
    """
    text = _plain_spelling(text)
    if text in UNITS:
        return UNITS[text]
    product = _product(text)
    dimension = product and next((name for name, known in _EXPONENTS.items() if known == product[1]), None)
    return (product[0], dimension) if product and dimension else None


def _plain_spelling(text: str) -> str:
    return " ".join(text.translate(_SPELLINGS).split())


def _product(text: str) -> tuple[float, Exponents] | None:
    """Return the factor to SI and the exponents of kg, m, s and rad; None when a factor is no unit."""
    if text in UNITS:
        return UNITS[text][0], _EXPONENTS[UNITS[text][1]]
    factor, total = 1.0, [0.0] * 4
    for k, side in enumerate(text.split("/")):
        for part in side.split() or [""]:
            match = _FACTOR.fullmatch(part)
            if part == "1" and text.startswith("1/"):
                continue
            if match is None or match[1] not in UNITS:
                return None
            power = float(match[2] or 1.0) * (-1.0 if k else 1.0)
            factor *= UNITS[match[1]][0] ** power
            total = [known + power * one for known, one in zip(total, _EXPONENTS[UNITS[match[1]][1]], strict=True)]
    kg, m, s, rad = total
    return factor, (kg, m, s, rad)


def udunits(text: str) -> str:
    """Return a unit in the notation of UDUNITS, ``N m-1 s-1`` for ``N/m s``; empty for broken powers, unknown there."""
    if text == "1":
        return text
    factors = []
    for k, side in enumerate(_plain_spelling(text).split("/")):
        for part in side.split():
            match = _FACTOR.fullmatch(part)
            power = float(match[2] or 1.0) * (-1.0 if k else 1.0) if match is not None else 0.5
            if power != int(power):
                return ""
            factors.append(f"{match[1] if match else part}{int(power) if power != 1.0 else ''}")
    return " ".join(factors)


def unit_exponents(text: str) -> Exponents:
    """Return the exponents of kg, m, s and rad of a product of known units, or of "1"; raise ValueError for others."""
    product = (1.0, _EXPONENTS["number"]) if text == "1" else _product(_plain_spelling(text))
    if product is None:
        raise ValueError(f"'{text}' is not a unit")
    return product[1]


def exponents(dimension: str) -> Exponents:
    """Return the exponents of kg, m, s and rad of a dimension."""
    return _EXPONENTS[dimension]


def si_unit(exponents: Exponents) -> str:
    """Return the SI unit with these exponents of kg, m, s and rad: by its name if it has one, "1" for a number."""
    name = next((name for name, known in _EXPONENTS.items() if known == exponents), "")
    if one := _example(name, factor=1.0):
        return one
    over, under = (
        [f"{u}^{n:g}" if n != 1 else u for u, e in zip(_BASE, exponents, strict=True) if (n := sign * e) > 0]
        for sign in (1, -1)
    )
    return (" ".join(over) or "1") + (f"/{' '.join(under)}" if under else "")


def coefficient(value: object, dimension: str, order: int) -> float:
    """Return the SI value of the coefficient of t^order in a law of a dimension; raise ValueError in words.

    A bare number is in SI; text must have the unit of the value over seconds to that power.
    """
    match = _parts(value) if isinstance(value, str) else None
    if match is None or match[2] is None:
        return quantity(value, "number")
    kg, m, s, rad = _EXPONENTS[dimension]
    product = _product(_plain_spelling(match[2]))
    if product is None or product[1] != (kg, m, s - order, rad):
        example = f"{_example(dimension)}/s^{order}".removesuffix("^1") if order else _example(dimension)
        raise ValueError(
            f"'{value}' is the coefficient of t^{order} of {with_article(dimension)}: it has a unit such as {example}"
        )
    return quantity(float(match[1]) * product[0], "number")


def quantity(value: object, dimension: str) -> float:
    """Return the SI value of a bare number or a string like ``"20.5 mm"``.

    Raises ValueError, in words, when the text is no quantity, the unit is unknown or belongs to another dimension, or
    the number is not finite, too large or too small.
    """
    return _check_finite(_read_quantity(value, dimension), value)


def quantity_at(place: str, value: object, dimension: str) -> float:
    """Return `quantity` of a value; raise InputError at `place` where that raises ValueError."""
    try:
        return quantity(value, dimension)
    except ValueError as error:
        raise InputError(place, str(error)) from None


def components(values: Iterable[object], dimension: str) -> list[float]:
    """Return the SI values of the entries of one vector or matrix; raise ValueError as `quantity`, for the largest.

    The others may be arbitrarily small: a rotation turns an entry that is zero into 1e-17, two turn it into 1e-34.
    """
    given = list(values)
    numbers = [_read_quantity(value, dimension) for value in given]
    if numbers:
        largest = max(range(len(numbers)), key=lambda k: abs(numbers[k]))
        _check_finite(numbers[largest], given[largest])
    return numbers


def _check_finite(number: float, written: object) -> float:
    if number != 0.0 and not 1.0 / LARGEST_NUMBER <= abs(number) <= LARGEST_NUMBER:
        bounds = f"{1.0 / LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}"
        raise ValueError(f"{written!r} is outside of the supported range, {bounds} in SI units")
    return number


def _read_quantity(value: object, dimension: str) -> float:
    if type(value) is float and math.isfinite(value):  # nearly all values of a scene that is read again
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"expected {with_article(dimension)}, a number or text like '1 {_example(dimension)}'")
    if isinstance(value, str):
        match = _parts(value)
        if match is None:
            what = "a number" if dimension == "number" else f"a number with a unit, as '1 {_example(dimension)}'"
            raise ValueError(f"'{value}' is not {what}")
        if _COMMA.match(value):
            raise ValueError(f"'{value}' has a decimal comma; numbers have a decimal point")
        number, written = float(match[1]), match[2]
        factor, factor_and_dimension = (1.0, dimension) if written is None else _known_unit(written, dimension, value)
        if factor_and_dimension != dimension:
            rule = f"{with_article(dimension)} is expected, in {_known_units(dimension)}"
            rule = "a number without a unit is expected" if dimension == "number" else rule
            raise ValueError(f"'{value}' is {with_article(factor_and_dimension)}, but {rule}")
        result = number * factor
    else:
        result = float(value) if abs(value) <= sys.float_info.max else math.inf
    if not math.isfinite(result):
        raise ValueError(f"{value!r} is not a finite number")
    return result


def _parts(text: str) -> re.Match[str] | None:
    """Match number and unit; white space is stripped first, since the expression would try it in many ways."""
    text = text.strip()
    # largest number of characters of a quantity
    return _QUANTITY.fullmatch(text) if len(text) <= 200 else None


def any_quantity(value: object) -> float | str:
    """Return a bare number, or a quantity in its SI unit (``"60 mm"`` -> ``"0.06 m"``), of any dimension.

    For keys whose dimension depends on another part of the scene; `quantity` reads the result. Raises ValueError as
    `quantity` does.
    """
    match = _parts(value) if isinstance(value, str) else None
    written = match[2] if match is not None else None
    if written is None or written == "%":
        return quantity(value, "number")
    known, product = unit(written), _product(_plain_spelling(written))
    if known is not None:
        return f"{quantity(value, known[1])!r} {_example(known[1], factor=1.0)}"
    if match is None or product is None:
        raise ValueError(unknown_unit_message(written, str(value)))
    return f"{_check_finite(float(match[1]) * product[0], value)!r} {si_unit(product[1])}"


def unknown_unit_message(written: str, value: str = "") -> str:
    """Return the message about a text that is no unit; value: the quantity that contains the text."""
    fraction = _FRACTION.fullmatch(value.strip())
    if fraction is not None and float(fraction[2]):
        return f"'{value}' is a fraction; write one number: {float(fraction[1]) / float(fraction[2]):.12g}"
    near = get_close_matches(written, list(UNITS), n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(COMMON)} and products of these"
    return f"unknown unit '{written}'; {hint}"


def _known_unit(written: str, dimension: str, value: str) -> tuple[float, str]:
    known = unit(written)
    if known is None:
        if _FRACTION.fullmatch(value.strip()):
            raise ValueError(unknown_unit_message(written, value))
        raise ValueError(f"unknown unit '{written}'; {with_article(dimension)} is written in {_known_units(dimension)}")
    return known


def with_article(dimension: str) -> str:
    """Return the dimension with its article."""
    return f"{'an' if dimension[0] in 'aeiou' else 'a'} {dimension}"


def _known_units(dimension: str) -> str:
    return ", ".join(unit for unit, (_, of_unit) in UNITS.items() if of_unit == dimension) or "SI"


def _example(dimension: str, factor: float | None = None) -> str:
    """Return a unit of this dimension; with `factor`, the one with this factor to SI."""
    return next((u for u, (f, of_unit) in UNITS.items() if of_unit == dimension and factor in (None, f)), "")
