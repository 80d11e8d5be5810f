"""Validation errors of a scene file in words: pydantic's errors as input errors with location, value, rule and
remedy."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from flexclear.scene.registry import suggestion
from flexclear.system.errors import InputError, InputErrors

#: types of errors about a value that is no whole number
WHOLE = ("int_type", "int_parsing", "int_from_float")
#: type of error -> what was expected
EXPECTED = {
    **dict.fromkeys(("tuple_type", "list_type"), "expected a list [...]"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "expected a table { key = value }"),
    "string_type": "expected text",
    "missing": "is missing",
    "extra_forbidden": "unknown key",
    "union_tag_not_found": "is missing",
    **dict.fromkeys(WHOLE, "expected a whole number"),
}
#: types of errors that one alternative of several does not fit the kind of value: another alternative may fit better
OTHER_KIND = (
    *("literal_error", "model_type", "dict_type", "tuple_type", "list_type", "string_type", "float_type"),
    *WHOLE,
)
#: keys that select a part's model
CHOOSING = ("type", "law")
#: bounds of numbers, whose messages hold the bound
BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")

#: a message about a whole scene that opens with the key path of the error
_NAMED = re.compile(r"([a-z_]+(?:\.[^.:\n]+)+): ")

#: prefixes of pydantic's names, in an error's location, for alternatives that a validator reads from number or text
VALIDATORS = ("function-", "constrained-", "literal[")

#: models that are not selected by their type -> pydantic's name for them in an error's location
TAGS = {
    "MeshedRigidBody": ("meshed",),
    "JointDrive": ("joint-drive",),
    "PathDrive": ("path-drive",),
    "RatioPerMode": ("RatioPerMode",),
    "Rayleigh": ("Rayleigh",),
}


def input_errors(path: Path | str, error: ValidationError, model: type[BaseModel]) -> InputErrors:
    """Return all validation errors of a file that should be a `model`."""
    places: dict[str, list[tuple[str, InputError]]] = {}
    # 500: largest number of errors that are reported: nobody reads more, and each takes a search for what could have
    # been meant
    for e in error.errors(include_url=False)[:500]:
        invalid = _input_error(path, e, model)
        places.setdefault(invalid.place, []).append((e["type"], invalid))
    unique = {str(e): e for candidates in places.values() for e in _nearest_errors(candidates)}
    return InputErrors(list(unique.values()))


def _nearest_errors(candidates: list[tuple[str, InputError]]) -> list[InputError]:
    """Return the errors at one location: of several alternatives, only those that fit the value's kind."""
    fitting = [candidate for kind, candidate in candidates if kind not in OTHER_KIND]
    others = {candidate.problem: candidate for kind, candidate in candidates if kind in OTHER_KIND}
    if fitting or len(others) < 2:
        return fitting or list(others.values())
    problems = [problem.partition(" (got ") for problem in others]
    rules = list(dict.fromkeys(rule.removeprefix("must be ").removeprefix("expected ") for rule, _, _ in problems))
    return [InputError(candidates[0][1].place, f"expected {' or '.join(rules)}{''.join(problems[0][1:])}")]


def _input_error(path: Path | str, error: Any, model: type[BaseModel]) -> InputError:
    kind, context, value = error["type"], error.get("ctx", {}), error.get("input")
    keys, known, types = _place(model, error["loc"])
    message, remedy = EXPECTED.get(kind) or _reword(error), None
    if kind == "extra_forbidden":
        candidates = [key for key in known if key != keys[-1]]
        if len(keys) == 1 and isinstance(value, dict):
            candidates = [key for key in candidates if key not in ("title", "description", "source")]  # not tables
        remedy = suggestion(str(keys[-1]), candidates)
    elif not keys and kind == "value_error" and (named := _NAMED.match(message)):
        keys, message = [named[1]], message[named.end() :]
    elif kind == "union_tag_not_found":
        keys, remedy = [*keys, _selecting_key(context)], f"one of: {', '.join(types)}"
    elif kind == "union_tag_invalid":
        keys, value = [*keys, _selecting_key(context)], context["tag"]
        message, remedy = f"there is no such {keys[-1]}", suggestion(str(value), types)
    if kind == "missing" and keys and isinstance(keys[-1], int):
        keys, message = keys[:-1], f"has {_count_of_entries(keys[-1])}, and needs at least {keys[-1] + 1}"
    where = ".".join(str(key) for key in keys if key != "[key]")
    shows_value = isinstance(value, (str, int, float)) and kind not in ("missing", "union_tag_not_found")
    shown = f" (got {value!r})" if shows_value and (kind in BOUNDS or repr(value) not in message) else ""
    return InputError(f"{path} [{where}]" if where else str(path), f"{message}{shown}", remedy)


def _count_of_entries(number: int) -> str:
    return "1 entry" if number == 1 else f"{number or 'no'} entries"


def _selecting_key(context: dict[str, Any]) -> str:
    """Return the key by which pydantic selects the model; "type" where several keys select it."""
    key = str(context.get("discriminator", "")).strip("'")
    return key if key in CHOOSING else "type"


def _reword(error: Any) -> str:
    context = error.get("ctx", {})
    if error["type"] in ("too_long", "too_short"):
        bound, rule = ("max_length", "at most") if error["type"] == "too_long" else ("min_length", "at least")
        return f"takes {rule} {context[bound]} entries, not {context['actual_length']}"
    text: str = error["msg"].removeprefix("Value error, ")
    return text.replace("Input should be a valid ", "expected a ").replace("Input should be ", "must be ")


def _place(model: type[BaseModel], loc: tuple[Any, ...]) -> tuple[list[Any], list[str], list[str]]:
    """Return the keys of a location as in the file, the known keys next to the last one, and its possible types.

    pydantic inserts the type that selected a part's model into the location; the file has no such key.
    """
    keys, alternatives, known_keys = list[Any](), [model], list[str]()
    for key in loc:
        inner = [candidate for a in alternatives for candidate in _types_below(a, key)]
        if inner:
            keys.append(key)
            known_keys, alternatives = _keys(alternatives), inner
        elif any(_chosen_by(a, key) for a in alternatives):
            alternatives = [a for a in alternatives if _chosen_by(a, key)]
        elif any(_is_model(a) for a in alternatives) and not str(key).startswith(VALIDATORS):
            keys.append(key)
            known_keys, alternatives = _keys(alternatives), []
    return keys, known_keys, list(dict.fromkeys(kind for a in alternatives for kind in _types(a)))


def _alternatives(annotation: Any) -> Iterator[Any]:
    """Yield the types that a field may hold, without wrappers."""
    if get_origin(annotation) is Annotated:
        yield from _alternatives(get_args(annotation)[0])
    elif get_origin(annotation) in (Union, UnionType):
        for one in get_args(annotation):
            yield from _alternatives(one)
    else:
        yield annotation


def _types_below(alternative: Any, key: Any) -> list[Any]:
    """Return the types that may be under a key of a table or list."""
    if _is_model(alternative):
        alternative.model_rebuild()  # resolves the types of laws that contain laws
        info = alternative.model_fields.get(key) if isinstance(key, str) else None
        return [] if info is None else list(_alternatives(info.annotation))
    if get_origin(alternative) is dict and isinstance(key, str):
        return list(_alternatives(get_args(alternative)[1]))
    if get_origin(alternative) is tuple and isinstance(key, int):
        return list(_alternatives(get_args(alternative)[0]))
    return []


def _is_model(alternative: Any) -> bool:
    return isinstance(alternative, type) and issubclass(alternative, BaseModel)


def _keys(alternatives: list[Any]) -> list[str]:
    fields = (item for a in alternatives if _is_model(a) for item in a.model_fields.items())
    return sorted({info.alias or name for name, info in fields})


def _types(alternative: Any) -> tuple[str, ...]:
    """Return the names that select this model."""
    fields = alternative.model_fields if _is_model(alternative) else {}
    kinds = (fields[key].annotation for key in CHOOSING if key in fields)
    return tuple(name for annotation in kinds if get_origin(annotation) is Literal for name in get_args(annotation))


def _chosen_by(alternative: Any, tag: Any) -> bool:
    """Return True when pydantic's tag, or its name of a model, selects this alternative."""
    return _is_model(alternative) and (tag in _types(alternative) or tag in TAGS.get(alternative.__name__, ()))
