"""Quantities by name: the one grammar of `watch`, `keep`, `[accuracy]` and sections.

A quantity is ``<owner>.<word>``, as ``platform.position`` or ``A1.peak_force``; ``slider.position.x`` is a component,
and ``kinetic`` belongs to the whole mechanism. The words are the names of the run's variables over time, as
``slider.acceleration`` or ``hinge.joint_velocity``; without the kind of component in front (``hinge.velocity``) the
first of `OWNERS` with this variable is meant. ``force(A1)`` is another way to write ``A1.force``. Expressions combine
quantities and numbers with units (`scene.expression`): ``force(A1) - force(A2)``,
``max(0, slider.position.x - 10 mm)``; ``t`` is the time, ``norm(...)`` the magnitude.

`artifacts.quantities` reads quantities from runs. It needs NumPy; commands with up-to-date results do
not.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from flexclear.scene import units
from flexclear.scene.expression import FUNCTIONS, SEVERAL, measure, postfix
from flexclear.scene.registry import suggestion
from flexclear.scene.run_schema import RUN

#: dimension of a run -> its entries; a word of several dimensions means the first. Sections have the names of bodies
OWNERS = {
    "body": "body",
    "frame": "frame, `body.frame`",
    "joint": "joint",
    "coordinate": "joint, or `joint.coordinate` where it has several",
    "drive": "drive",
    "controller": "controller",
    "gear": "gear",
    "load": "load",
    "bushing": "bushing",
    "contact": "joint with clearance, or end of a stop or of teeth with backlash",
    "film": "joint with a film",
    "rubbing": "joint with friction",
    "worn": "joint with wear",
    "mode": "mode, `body.number`",
    "section": "rod whose stresses are recorded",
    "gauge": "body whose stresses are recorded, or `body.gauge`",
    "": "the whole mechanism",
}
#: prefixes of variables' names that name the kind of component
_FRONTS = ("frame_", "joint_", "drive_", "controller_", "gear_", "load_", "bushing_", "contact_", "wear_")
#: variables whose quantity has another name
_RENAMED = {"quaternion": "orientation", "joint_force": "force", "joint_moment": "moment", "contact_impulse": "impulse"}
#: other words for a quantity
_ALSO = {"von_mises_stress": {"von_mises", "peak_von_mises"}}
#: indicators of how well the equations are posed, which are no quantities
_INDICATORS = ("mobility", "rank", "condition")
#: quantities that contacts have once per run or event, not over time
OF_CONTACTS = ("peak_force", "impulse", "impact_times")
#: owners that a scene without clearance does not have
OF_CLEARANCE = ("contact", "worn", "film")
EXPRESSION = "expression"
COMPONENTS = ("x", "y", "z")


class Kind(NamedTuple):
    """Dimension of the run that owns a kind of quantity, its variable, SI units of entries that slide and that turn,
    the dimension of its components or an empty text, and its meaning."""

    owner: str
    variable: str
    units: tuple[str, str]
    dim: str
    meaning: str


def as_written(text: str) -> str:
    """Return a unit of the datasets in the notation of scenes: ``m s-2`` as ``m/s^2``."""
    over, under = list[str](), list[str]()
    for name, power in re.findall(r"([A-Za-z]+|1)(-?\d*)", text):
        (under if power.startswith("-") else over).append(
            f"{name}^{p}" if (p := power.lstrip("-")) not in "1" else name
        )
    return " ".join(over) + (f"/{' '.join(under)}" if under else "")


def _kinds() -> dict[str, Kind]:
    known = {}
    for name, variable in RUN.items():
        owner = variable.dims[1] if len(variable.dims) > 1 else ""
        dim = variable.dims[2] if len(variable.dims) > 2 else ""
        named = variable.dims[:1] == ("time",) and owner in OWNERS and dim != "tensor"
        if named and name not in _INDICATORS:
            both = (as_written(variable.units), as_written(variable.turning or variable.units))
            known[_RENAMED.get(name, name)] = Kind(owner, name, both, dim, variable.long_name)
    known["orientation"] = known["orientation"]._replace(units=("rad", "rad"))
    known["peak_force"] = Kind("contact", "event_peak_force", ("N", "N m"), "", "largest normal force of the contact")
    known["t"] = Kind("", "time", ("s", "s"), "", "time of the run")
    known["impact_times"] = Kind("contact", "event_time", ("s", "s"), "", "times of impacts faster than 1e-4 m/s")
    return dict(sorted(known.items(), key=lambda item: list(OWNERS).index(item[1].owner)))


#: kinds of quantities by their full words
KINDS = _kinds() | {EXPRESSION: Kind("", "", ("", ""), "", "")}


def _kinds_by_word() -> dict[str, list[str]]:
    """Return the kinds that each word may mean: their keys, variables and synonyms."""
    words: dict[str, list[str]] = {}
    for key, kind in KINDS.items():
        front = next((front for front in _FRONTS if kind.variable.startswith(front)), "")
        every = {key, kind.variable.removeprefix(front)} | ({kind.variable} if key not in OF_CONTACTS[::2] else set())
        for word in (every | _ALSO.get(key, set())) - {EXPRESSION, ""}:
            words.setdefault(word, []).append(key)
    return words


#: word -> the kinds that it may mean
WORDS = _kinds_by_word()


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity of one component, of the whole mechanism, or an expression of several.

    owner: name of the component, else empty. kind: one of `KINDS`. component: of a vector, or empty for the whole
    vector. turns: whether it acts about an axis. text: as written, where that is not ``<owner>.<kind>``. steps: of an
    expression, in postfix order: quantities, numbers with their SI units, and operators.
    """

    owner: str
    kind: str
    component: str = ""
    turns: bool = False
    text: str = ""
    steps: tuple[Quantity | tuple[float, str] | str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the quantity as the scene writes it."""
        return self.text or f"{self.owner}.{self.kind}"

    @property
    def unit(self) -> str:
        """SI unit of values and errors; for an expression that of a term with the same dimension, if any: J or N m."""
        if not self.steps:
            return KINDS[self.kind].units[self.turns]
        measured = measure(self.steps)[0]
        return next((t.unit for t in self.terms() if units.unit_exponents(t.unit) == measured), units.si_unit(measured))

    @property
    def dim(self) -> str:
        """Dimension of the components: axis, quat, or none."""
        return measure(self.steps)[1] if self.steps else "" if self.component else KINDS[self.kind].dim

    @property
    def over_time(self) -> bool:
        """True when the quantity has a value at every time."""
        return self.kind not in OF_CONTACTS

    @property
    def of_place(self) -> bool:
        """True when the quantity is a position or angle, so that its size is its largest change from the start."""
        return self.over_time and self.unit in ("m", "rad")

    def terms(self) -> list[Quantity]:
        """Return the quantities of an expression; for a plain quantity the quantity itself."""
        return [step for step in self.steps if isinstance(step, Quantity)] if self.steps else [self]

    def is_there(self, owners: Mapping[str, Collection[str]]) -> bool:
        """Return True when a scene has the quantity; owners as in `parse`."""
        return all((term.owner or term.kind) in owners.get(KINDS[term.kind].owner, ()) for term in self.terms())

    def to_json(self) -> list[Any]:
        """Return the quantity as JSON, which `read_expression` parses."""
        steps = [step.to_json() if isinstance(step, Quantity) else step for step in self.steps]
        return [self.owner, self.kind, self.component, self.turns, self.text, steps]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Quantity:
        """Return the quantity from the JSON that `to_json` returned."""
        owner, kind, component, turns, text, steps = data
        return cls(owner, kind, component, turns, text, tuple(_read_step(step) for step in steps))


def _read_step(step: Any) -> Any:
    """Return one step of an expression from its JSON: operator, nested quantity or number with its exponents."""
    if isinstance(step, str):
        return step
    return Quantity.from_json(step) if len(step) > 2 else tuple(step)


_CALL = re.compile(rf"(?<![\w.-])(?!(?:{'|'.join((*FUNCTIONS, *SEVERAL))})\b)(\w+)\(\s*([\w.-]+)\s*\)")
_PLAIN = re.compile(r"\w[\w.-]*")


def parse(text: str, owners: Mapping[str, Collection[str]]) -> Quantity:
    """Return the quantity called `text`.

    owners: names of the scene's components by `OWNERS`; a mapping also states whether each acts about an axis
    (`owners.owners`). Raises ValueError that names what could have been meant.
    """
    plain = _as_owned(text)
    if _PLAIN.fullmatch(plain):
        quantity = _term(plain, owners)
    else:
        quantity = Quantity("", EXPRESSION, steps=tuple(read_expression(plain, owners)))
        if not quantity.terms():
            raise ValueError(f"'{text}' is a number, not a quantity")
        _ = quantity.dim
    return quantity if quantity.name == text else replace(quantity, text=text)


def parse_condition(text: str, owners: Mapping[str, Collection[str]]) -> Quantity:
    """Return the quantity that is positive where a comparison, as ``force(A1) > 200 N``, is true; vectors by magnitude.

    owners: as in `parse`. Raises ValueError for text that is no comparison of quantities.
    """
    sides = re.split("([<>])", text)
    if len(sides) != 3:
        raise ValueError(f"'{text}' is not a comparison: write one < or >, as in 'force(A1) > 200 N'")
    left, right = (_magnitude(side, owners) for side in sides[::2])
    measure([*left, *right, "max"])
    larger, smaller = (left, right) if sides[1] == ">" else (right, left)
    difference = Quantity("", EXPRESSION, text=text, steps=(*larger, *smaller, "-"))
    if not difference.terms():
        raise ValueError(f"'{text}' compares numbers: name a quantity")
    return difference


def _magnitude(text: str, owners: Mapping[str, Collection[str]]) -> list[Any]:
    """Return one side of a comparison in postfix order, a vector as its magnitude."""
    steps = read_expression(text, owners)
    return [*steps, "norm"] if measure(steps)[1] else steps


def read_expression(
    text: str,
    owners: Mapping[str, Collection[str]],
    constants: Mapping[str, tuple[float, str]] | None = None,
    local: Mapping[str, Any] | None = None,
    tables: Mapping[str, Any] | None = None,
) -> list[Any]:
    """Return an expression in postfix order (`scene.expression`); raise ValueError as `parse` does.

    constants: value and SI unit of each. local: meanings of further names. tables: as of `postfix`.
    """
    known = local or {}
    return postfix(
        _as_owned(text), lambda name: known[name] if name in known else _term(name, owners), constants, tables
    )


def _as_owned(text: str) -> str:
    """Return the text with ``force(A1)`` written as ``A1.force``."""
    return _CALL.sub(r"\2.\1", text.strip())


def _term(name: str, owners: Mapping[str, Collection[str]]) -> Quantity:
    head, _, component = name.rpartition(".")
    whole = head if len(component) == 1 and head.rpartition(".")[2] in WORDS else name
    owner, _, word = whole.rpartition(".")
    for key in WORDS.get(word, ()):
        kind, known = KINDS[key], owners.get(KINDS[key].owner, ())
        part = owner if kind.owner else key
        if part not in known or bool(owner) != bool(kind.owner):
            continue
        if whole != name and (kind.dim != "axis" or component not in COMPONENTS):
            raise ValueError(f"'{whole}' has no component '{component}'; vectors have x, y and z")
        turns = isinstance(known, Mapping) and bool(known[part])
        return Quantity(owner, key, component if whole != name else "", turns, "" if owner else word)
    on_segment = _on_segment(owner, owners.get("frame", ()))
    if on_segment != owner:
        return _term(on_segment + name.removeprefix(owner), owners)
    raise ValueError(f"there is no quantity '{name}' in this scene ({_nearest(owner, word, owners)})")


def _on_segment(frame: str, known: Collection[str]) -> str:
    """Return ``rod_3.tip`` for the frame ``rod.tip`` of a rod in segments; other names as they are."""
    body, _, own = frame.partition(".")
    pattern = re.compile(rf"{re.escape(body)}_\d+\.{re.escape(own)}") if own else None
    return next((name for name in known if pattern is not None and pattern.fullmatch(name)), frame)


def _nearest(owner: str, word: str, owners: Mapping[str, Collection[str]]) -> str:
    """Return a hint: another owner of the same word, if there is one, else another word of the owner."""
    every = [
        (part if KINDS[key].owner else "", w)
        for w, keys in WORDS.items()
        for key in keys
        for part in owners.get(KINDS[key].owner, ())
        if KINDS[key].owner or part == key
    ]
    same = {o: f"{o}.{w}" for o, w in every if w == word and o}
    pieces = same if owner and same else {w: f"{o}.{w}".lstrip(".") for o, w in every if o == owner}
    near = suggestion(owner if pieces is same else word, list(pieces)) if pieces else ""
    if "did you mean" in near:
        return re.sub("'(.+?)'", lambda match: f"'{pieces[match[1]]}'", near, count=1)
    return suggestion("", list(pieces.values()) or [f"{o}.{w}".lstrip(".") for o, w in every])


def default_quantities(joints: Mapping[str, Collection[str]], contacts: Collection[str]) -> list[Quantity]:
    """Return default quantities of a scene: motion of the body with most joints, a reaction, and the contacts.

    joints: the bodies that each joint connects, in the scene's order; contacts: the joints with clearance.
    """
    bodies = [body for pair in joints.values() for body in pair]
    if not bodies:
        return []
    central = max(dict.fromkeys(bodies), key=bodies.count)
    chosen = [Quantity(central, kind) for kind in ("position", "orientation", "velocity")]
    ideal = [name for name, pair in joints.items() if central in pair and name not in contacts]
    chosen += [Quantity(name, "force") for name in ideal[:1]]
    return chosen + [Quantity(name, kind) for name in contacts for kind in OF_CONTACTS]


#: reduction -> its meaning for a series
SERIES = {
    "largest": "largest magnitude over the run",
    "rms": "root of the mean square magnitude over the time",
    "mean": "mean over the time",
    "final": "value at the end",
    "series": "values at the regular output times",
    "sections": "values once in each period of the laws",
}
#: reductions of quantities of contacts, with their meanings
CONTACT_REDUCTIONS = {
    "peak_force": {"largest": "largest normal force of the contact"},
    "impulse": {"final": "impulse of the normal force over the run"},
    "impact_times": {
        "count": "number of impacts faster than 1e-4 m/s",
        "first": "time of the first such impact",
        "last": "time of the last such impact",
    },
}
_REDUCTIONS = (*SERIES, "count", "first", "last")
#: reductions that need the quantity at all output times, and those whose value has no direction
THROUGHOUT, MAGNITUDES = ("largest", "rms", "mean", "series"), ("largest", "rms")


@dataclass(frozen=True, slots=True)
class Recorded:
    """A quantity and its recorded reduction, as ``platform.velocity.largest``."""

    quantity: Quantity
    reduction: str

    @property
    def name(self) -> str:
        """Full name, as in a sweep."""
        return f"{self.quantity.name}.{self.reduction}"

    @property
    def meaning(self) -> str:
        """Meaning in words."""
        return f"{self.quantity.name}: {reductions(self.quantity)[self.reduction]}"

    @property
    def unit(self) -> str:
        """SI unit of the recorded number."""
        return "1" if self.reduction == "count" or self.quantity.kind == "orientation" else self.quantity.unit

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the value at one point."""
        time = {"series": ("time",), "sections": ("section",)}.get(self.reduction, ())
        inner = "" if self.reduction in MAGNITUDES else self.quantity.dim
        return (*time, inner) if inner else time

    @property
    def needs_regular_times(self) -> bool:
        """True when the reduction needs the regular output times."""
        return self.reduction == "series" or (self.quantity.over_time and self.reduction in THROUGHOUT)


def reductions(quantity: Quantity) -> dict[str, str]:
    """Return the reductions of a quantity, with their meanings."""
    if quantity.kind == "orientation":
        # a mean of quaternions is no rotation, and their magnitude is one
        return {name: SERIES[name] for name in ("final", "series", "sections")}
    return CONTACT_REDUCTIONS.get(quantity.kind, SERIES)


def parse_recorded(text: str, owners: Mapping[str, Collection[str]]) -> Recorded:
    """Return the recorded quantity called `text`; a reduction may be omitted where the quantity has only one.

    owners: as in `parse`. Raises ValueError that names what could have been meant.
    """
    head, _, last = text.rpartition(".")
    quantity = parse(head if last in _REDUCTIONS else text, owners)
    known = list(reductions(quantity))
    if quantity.steps and not head.endswith(")"):
        raise ValueError(f"'{text}' has no reduction; write ({text if last not in _REDUCTIONS else head}).largest")
    if last in known:
        return Recorded(quantity, last)
    if last in _REDUCTIONS:
        raise ValueError(f"'{quantity.name}' has no '{last}' ({suggestion(last, known)})")
    if len(known) > 1:
        raise ValueError(f"'{text}' has no reduction; write {' or '.join(f'{text}.{name}' for name in known)}")
    return Recorded(quantity, known[0])
