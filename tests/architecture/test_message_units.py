"""In all messages and tables, the unit behind a number is that of the quantity which the number's name says."""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

#: unit -> names of numbers that have it, wherever they are printed: the last name of an attribute, or the name of the
#: array that an entry is taken of
NAMES = {
    "s": "time t start end period interval duration phase span seconds horizon step",
    "m": "depth radius inner_radius distance gap bent length gyration own whole change least away size",
    "mm": "clearance displacement side sizes",
    "m/s": "v0 v1 v_static v_dynamic moving IMPACT",
    "rad": "turned SECTION_ROTATION",
    "rad/s": "speed turning",
    "deg": "WORST_GUESS",
    "s/m": "bristle_damping most",
    "kg": "mass",
    "kg/m^3": "density",
    "kg m^2": "moments off",
    "m^4": "inertia product",
    "N": "residual force peak",
    "J": "exchanged error loss totals",
    "Hz": "hertz frequency excited first last resolved up_to where",
}
#: where a name stands for something else: places along rods, rates of bodies, shares in percent, angles in both units
ELSEWHERE = {
    ("pipeline/flexclear/structure", "start"): {"m"},
    ("pipeline/flexclear/structure", "end"): {"m"},
    ("pipeline/flexclear/dynamics/run/refusals/validity.py", "first"): {"rad/s"},
    ("pipeline/flexclear/dynamics/run/refusals/validity.py", "speeds"): {"rad/s"},
    ("pipeline/flexclear/dynamics/run/ledger.py", "speeds"): {"m/s"},
    ("pipeline/flexclear/dynamics/model/given_start.py", "turned"): {"rad", "deg"},
    ("pipeline/flexclear/dynamics/model/closing.py", "turned"): {"deg"},
    ("pipeline/flexclear/dynamics/model/contacts.py", "radius"): {"m", "mm"},
    ("pipeline/flexclear/dynamics/contact/normal/expression.py", "speed"): {"m/s"},
    ("pipeline/flexclear/dynamics/stepwise.py", "resolved"): {"s"},
    ("pipeline/flexclear/post/answers/plan.py", "frequency"): {"%"},
    ("papers/wang_wang_2019/figures/errors.py", "interval"): {"ms"},
}
EXPECTED = {name: {unit} for unit, names in NAMES.items() for name in names.split()}
_BASE = "kg|g|m|s|N|J|W|rad|deg|mm|cm|um|ms|min|kN|kJ|Hz|kHz|rpm|Pa|%"
UNIT = re.compile(rf" ((?:{_BASE})(?: m| s)?(?:\^\d)?(?:/(?:s|m|kg|rad)(?:\^\d)?)?)(?![\w^/])")


def name_of(number: ast.expr) -> str:
    """The name of a printed number; of sums and products, whose unit is another one, an empty text."""
    if isinstance(number, ast.Subscript):
        return name_of(number.value)
    if isinstance(number, ast.Call):
        of = name_of(number.func)
        return of if of in EXPECTED or not number.args else name_of(number.args[0])
    if isinstance(number, ast.Attribute):
        return number.attr
    return number.id if isinstance(number, ast.Name) else ""


def printed(root: Path) -> Iterator[tuple[str, str, str]]:
    """Place, name and unit of every number with a unit in the texts of the program."""
    for folder in ("pipeline", "stages", "pipeline/flexclear/commands", "papers"):
        for path in sorted((root / folder).rglob("*.py")):
            for text in ast.walk(ast.parse(path.read_text())):
                parts = text.values if isinstance(text, ast.JoinedStr) else []
                for number, after in pairwise(parts):
                    if not isinstance(number, ast.FormattedValue) or not isinstance(after, ast.Constant):
                        continue
                    unit = UNIT.match(str(after.value))
                    if unit is not None:
                        yield f"{path.relative_to(root).as_posix()}:{number.lineno}", name_of(number.value), unit[1]


def allowed(place: str, name: str) -> set[str]:
    """Units of a name at a place; empty where the table does not know it."""
    own = [units for (folder, other), units in ELSEWHERE.items() if place.startswith(folder) and other == name]
    return own[0] if own else EXPECTED.get(name, set())


def test_numbers_are_printed_with_the_unit_of_their_name(root: Path) -> None:
    found = list(printed(root))
    known = [(place, name, unit) for place, name, unit in found if allowed(place, name)]
    assert [one for one in known if one[2] not in allowed(*one[:2])] == []
    assert len(known) > 0.4 * len(found) > 80  # that the search finds them
