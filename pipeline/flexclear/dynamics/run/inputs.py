"""Inputs of a motion in steps: the laws that a scene gives as numbers, replaced between two steps.

Every force, torque, set point and prescribed motion is a law of time, a row of coefficients in the engine's memory. One
that the scene writes as a number can be given anew whenever a step begins: nothing is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.driving import prescribed_coordinates
from flexclear.dynamics.model.loads import describe
from flexclear.dynamics.model.model import Model
from flexclear.scene.laws import Constant
from flexclear.scene.registry import suggestion
from flexclear.scene.units import LARGEST_NUMBER, coefficient, exponents, quantity, si_unit
from flexclear.system.errors import InputError


@dataclass(frozen=True)
class Input:
    """An input. piece: of its law; sign: of its value there; dimension: of its value; moves: True for a motion."""

    piece: int
    sign: float
    dimension: str
    moves: bool


def inputs_of(model: Model) -> dict[str, Input]:
    """Return the inputs of a model by their paths in the scene: ``load.push.force``, ``drive.crank.law``."""
    listed = list[tuple[str, Any, int, Callable[[int], Input]]]()
    for k, (one, sign) in enumerate(zip(prescribed_coordinates(model.scene), model.drive_signs, strict=True)):
        made = partial(Input, sign=float(sign), dimension=one.dimension, moves=True)
        listed.append((one.place, one.law, k, made))
    for (name, _), row in zip(model.loads, model.arrays.table(m.LOADS), strict=True):
        laws = describe(model.scene, name).row.laws
        for k, (law, dimension, place) in enumerate(laws):
            component = f".{k}" if len(laws) > 1 else ""
            made = partial(Input, sign=1.0, dimension=dimension, moves=False)
            listed.append((place + component, law, int(row["law0"]) + k, made))
    table = model.arrays.table(m.LAWS)  # actuators of a path follow laws of several pieces
    return {
        place.replace("[", "").replace("]", ""): made(int(table["piece0"][k]))
        for place, law, k, made in listed
        if isinstance(law, Constant) and table["n_pieces"][k] == 1
    }


class Inputs(MutableMapping[str, float]):
    """Values of the inputs [SI] by name; setting one takes effect when the next step begins.

    A number, or text with a unit, is held; a motion goes there by a cubic until the step ends. A pair (value, rate) is
    reached so by any input, which then continues at that rate.
    """

    def __init__(self, model: Model, time: float) -> None:
        self.model, self.time, self.known = model, time, inputs_of(model)
        #: value and rate at the end of the next step, by name; rate: NaN where none is given
        self.targets = dict[str, tuple[float, float]]()
        self._ends = dict[str, tuple[float, float]]()

    def name(self, given: str) -> str:
        """Return the name of an input that is given in full, or by its part where that has no other.

        Raises InputError that names what could have been meant.
        """
        found = [name for name in self.known if name == given or name.startswith(f"{given}.")]
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(f"input '{given}'", f"is not one input but {len(found)}", f"name {' or '.join(found)}")
        family, _, part = given.partition(".")
        tables: dict[str, Any] = {"load": self.model.scene.load, "drive": self.model.scene.drive}
        if (part := part.partition(".")[0]) in tables.get(family, {}):
            rule = "an input is a force, torque, set point or motion that the scene gives as a number"
            raise InputError(f"input '{given}'", f"[{family}.{part}] has no such input; {rule}", self._hint(given))
        raise InputError(f"input '{given}'", "there is no such input", self._hint(given))

    def _hint(self, given: str) -> str:
        return suggestion(given, [*self.known]) if self.known else "write a number in place of a law in the scene"

    def unit(self, name: str) -> str:
        """Return the SI unit of an input."""
        return si_unit(exponents(self.known[self.name(name)].dimension))

    def __getitem__(self, name: str) -> float:
        one = self.known[name := self.name(name)]
        if name in self.targets and not one.moves and math.isnan(self.targets[name][1]):
            return self.targets[name][0]
        return one.sign * self._now(one)[0]

    def __setitem__(self, name: str, value: Any) -> None:
        one = self.known[name := self.name(name)]
        pair = tuple(value) if isinstance(value, (tuple, list, np.ndarray)) else (value,)
        if not 1 <= len(pair) <= 2:
            raise InputError(f"input '{name}'", f"{len(pair)} numbers are given", "give a value, or value and rate")
        numbers = [_number(f"input '{name}'", entry, one.dimension, order) for order, entry in enumerate(pair)]
        self.targets[name] = numbers[0], numbers[1] if len(pair) == 2 else math.nan

    def __delitem__(self, name: str) -> None:
        raise InputError(f"input '{name}'", "an input cannot be removed", "set it to another value")

    def __iter__(self) -> Iterator[str]:
        return iter(self.known)

    def __len__(self) -> int:
        return len(self.known)

    def begin(self, until: float) -> bool:
        """Store the laws of the step from the present time to `until` [s]; return True when one of them changes."""
        pieces, changed, duration = self.model.arrays.table(m.PIECES), False, until - self.time
        for name, (target, rate) in [*self.targets.items()]:
            one, straight = self.known[name], math.isnan(rate)
            x, v = self._now(one)
            if not straight:
                del self.targets[name]
            wanted: tuple[float, ...] = (one.sign * target,)
            if one.moves or not straight:
                way = one.sign * target - x
                end = way if straight else one.sign * rate * duration
                self._ends[name] = one.sign * target, end / duration
                wanted = (x, v, (3.0 * way - 2.0 * v * duration - end) / duration**2)
                wanted += ((v * duration + end - 2.0 * way) / duration**3,)
            row = pieces[one.piece : one.piece + 1]
            if np.any(row["coefficients"][..., 1:]) or any(wanted[1:]) or row["coefficients"][..., 0] != wanted[0]:
                row["start"], row["coefficients"] = self.time, 0.0
                row["coefficients"][..., : len(wanted)] = wanted
                changed = True
        return changed

    def end(self, until: float) -> None:
        """Set the present time to the end of a step; inputs that a cubic has brought there continue at their rates."""
        self.time, pieces = until, self.model.arrays.table(m.PIECES)
        for name, straight in self._ends.items():
            row = pieces[self.known[name].piece : self.known[name].piece + 1]
            row["start"], row["coefficients"] = until, 0.0
            row["coefficients"][..., :2] = straight
        self._ends.clear()

    def _now(self, one: Input) -> tuple[float, float]:
        """Return value and rate of an input's law at the present time, in the sense of the law."""
        row = self.model.arrays.table(m.PIECES)[one.piece : one.piece + 1]
        s, (a, b, c, d) = self.time - float(row["start"][0]), row["coefficients"].ravel()[:4].tolist()
        return a + s * (b + s * (c + s * d)), b + s * (2.0 * c + s * 3.0 * d)


def _number(place: str, value: Any, dimension: str, order: int) -> float:
    """Return the SI value of an input or of its rate; raise InputError."""
    try:
        if isinstance(value, str):
            return coefficient(value, dimension, order) if order else quantity(value, dimension)
        number = float(value)
    except ValueError as error:
        raise InputError(place, str(error)) from None
    except TypeError:
        number = math.nan
    if not abs(number) <= LARGEST_NUMBER:
        raise InputError(place, f"{value!r} is not a number of at most {LARGEST_NUMBER:g}", "check what computes it")
    return number
