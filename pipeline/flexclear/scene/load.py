"""Reading scenes: TOML, composition by `extends`, overrides, all errors reported at once."""

from __future__ import annotations

import contextlib
import copy
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import TypeAdapter, ValidationError

from flexclear.scene.fields import LONGEST_NAME
from flexclear.scene.limits import check_parts
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.segments import cut_segments
from flexclear.scene.solver import close_choice
from flexclear.scene.toml_files import read_toml
from flexclear.scene.units import any_quantity
from flexclear.scene.validation_errors import input_errors
from flexclear.system.errors import InputError, ResourceError, terminal_text

FAMILIES = ("body", "joint", "drive", "load", "stop", "gear", "event")
SETTINGS = ("time", "start", "solver", "output", "ensemble", "sections", "accuracy", "limits", "view")
#: largest number of scenes that extend each other in a row; each is read, and the extended ones are copied
LONGEST_CHAIN = 50
#: keys of parts that name files, which are searched for next to the scene
FILES = ("mesh", "file", "from", "profile")
EDITS = ("extends", "replace", "set", "remove")
#: kinds of TOML files, as messages name them
SCENE, SWEEP, RECIPE = "a scene", "a sweep of a scene", "a mesh recipe"
#: keys that only files of one kind have
TYPICAL_KEYS = {
    SCENE: {"body", "joint", "extends", "time"},
    SWEEP: {"vary", "keep", "scene"},
    RECIPE: {"shape", "material", "section", "interfaces", "elements"},
}
#: use of each kind of file, with its path
USE = {
    SCENE: "flexclear run {path}",
    SWEEP: "flexclear sweep {path}",
    RECIPE: 'flexclear check {path} checks it; bodies of scenes name it: mesh = "{path}"',
}


def load_scene(path: str | Path, override: Mapping[str, object] | None = None) -> Scene:
    """Load the scene in a TOML file, with all scenes that it extends.

    override: key path -> value, e.g. ``{"joint.A1.clearance": "0.2 mm"}``; the path's parent must exist. Raises
    InputError with all errors at once.
    """
    path = Path(path)
    name = scene_name(path)
    table = table_with_changes(path, override or {})
    check_parts(table, path, FAMILIES)
    scene = _validate_scene(table, path)
    scene._name = name
    scene._path = path
    return scene


def table_with_changes(path: Path, override: Mapping[str, object]) -> dict[str, Any]:
    """Return the plain table of a scene file (`compose`) with these values changed; files by their full paths."""
    table = compose(path)
    for where, value in override.items():
        _set_value(table, where, value, f"override of {path}")
    _absolute_files(table, path)
    return table


def scene_of(table: Mapping[str, Any], override: Mapping[str, object] | None = None) -> Scene:
    """Return the scene in a table with the keys of a scene file; files in it are relative to the current folder.

    override and errors: as in `load_scene`. The scene's name is derived from its title.
    """
    origin = Path("scene")
    copied = copy.deepcopy(dict(table))
    _require_tables(copied, origin)
    if any(key in copied for key in EDITS):
        raise InputError("scene", "edits another scene, which only files can do", "use edited(scene, changes)")
    _absolute_files(copied, Path.cwd() / origin)
    for key, value in (override or {}).items():
        _set_value(copied, key, value, "override of scene")
    check_parts(copied, origin, FAMILIES)
    scene = _validate_scene(copied, origin)
    scene._name = "-".join(re.findall(r"\w+", scene.title.lower()))[:LONGEST_NAME] or "scene"
    return scene


def edited(scene: Scene, override: Mapping[str, object]) -> Scene:
    """Return a copy of a scene with key paths changed, as in `load_scene`; None removes a setting, a part or a key.

    Raises InputError for a part or key that does not exist; a setting may be absent already.
    """
    parts = [where.split(".")[1] for where in override if where.startswith("body.")]
    # a rod in segments is edited as one body, unless one of its segments is named
    whole = scene._whole if all(name in (scene._whole or {}).get("body", {}) for name in parts) else None
    table = copy.deepcopy(whole or scene.model_dump(mode="json", exclude_none=True))
    for where, value in override.items():
        if value is not None:
            _set_value(table, where, value, f"edit of {scene.name}")
        elif "." in where:
            owner, last = _find_container(table, where, f"edit of {scene.name}")
            del owner[last]
        else:
            table.pop(where, None)
    _absolute_files(table, scene._path or Path.cwd() / "scene")
    result = _validate_scene(table, Path(scene.name))
    result._name, result._path = scene._name, scene._path
    return result


def _validate_scene(table: dict[str, Any], where: Path) -> Scene:
    """Return the scene in a table; validation errors, and requests beyond `[limits]`, are reported with this path."""
    try:
        scene = Scene.model_validate(pieces := cut_segments(table, str(where)))
        scene._whole = None if pieces.get("body") == table.get("body") else table
        return scene
    except ValidationError as error:
        raise input_errors(where, error, Scene) from None
    except ResourceError as error:
        raise ResourceError(f"{where} {error}") from None


def with_numbers(scene: Scene, override: Mapping[str, object]) -> Scene:
    """Return the result of `edited` in a tenth of the time: only changed parts and settings are read again.

    For many edits of one scene. Raises InputError as `edited` does.
    """
    changed: dict[tuple[str, str], dict[str, object]] = {}
    for where, value in override.items():
        family, _, rest = where.partition(".")
        name, _, key = rest.partition(".") if family in FAMILIES else ("", "", rest)
        names_file = key.rpartition(".")[2] in FILES or any(_tables(value))
        if value is None or not key or names_file or (family not in FAMILIES and family not in SETTINGS):
            return edited(scene, override)
        changed.setdefault((family, name), {})[key] = value
    if scene._whole is not None:
        return edited(scene, override)
    result = scene
    for (family, name), values in changed.items():
        part = getattr(result, family).get(name) if name else getattr(result, family)
        if part is None:
            return edited(scene, override)
        table = part.model_dump(mode="json", exclude_none=True)
        try:
            for key, value in values.items():
                _set_value(table, key, value, "")
            if family == "solver":
                close_choice(table, values)
            read = _reader(family).validate_python({name: table} if name else table)
            whole = {**getattr(result, family), **read} if name else read
            result = result.model_copy(update={family: whole})
            result.check()
        except (ValidationError, InputError, ResourceError, ValueError):
            return edited(scene, override)  # raises the error with its location
    return result


def number_at(scene: Scene, path: str) -> tuple[float, str]:
    """Return the number of a scene at a key path, in SI, and its unit if it is written with one.

    Raises InputError for a value that is no number.
    """
    return number_in(scene.model_dump(mode="json", exclude_none=True), path, path)


def number_in(table: Mapping[str, Any], path: str, where: str) -> tuple[float, str]:
    """Return a table's number at a key path, as `number_at` does; where: name of the path in errors."""
    parent, key = _find_container(table, path, where)
    if isinstance(parent[key], (int, float, str)) and not isinstance(parent[key], bool):
        with contextlib.suppress(ValueError):
            number, _, unit = str(any_quantity(parent[key])).partition(" ")
            return float(number), unit
    raise InputError(where, f"is not a number but {parent[key]!r}", "name one number, of a list by index: com.0")


def with_number(table: Mapping[str, Any], path: str, value: object) -> dict[str, Any]:
    """Return a copy of a table with the value at a key path changed."""
    changed = copy.deepcopy(dict(table))
    _set_value(changed, path, value, path)
    return changed


@cache
def _reader(family: str) -> Any:
    """Return the reader of a setting, or of the parts of a family by name, which works as `Scene` does."""
    info = Scene.model_fields[family]
    kind: Any = info.annotation
    return TypeAdapter(Annotated[kind, *info.metadata] if info.metadata else kind)


def scene_name(path: Path) -> str:
    """Return the path without suffix below the last folder ``scenes``, or below the current folder, or the stem.

    Raises InputError where that cannot be the name of a folder.
    """
    whole = _absolute_path(path).with_suffix("")
    if not whole.name.strip(".") or not whole.name.isprintable():
        raise InputError(
            terminal_text(str(path)), "cannot name a scene: results go into a folder of that name", "rename it"
        )
    if "scenes" in whole.parts[:-1]:
        last = len(whole.parts) - 1 - whole.parts[::-1].index("scenes")
        parts = whole.parts[last + 1 :]
    else:
        here = Path.cwd()
        parts = whole.relative_to(here).parts if whole.is_relative_to(here) else (whole.name,)
    return "/".join(parts)


def _absolute_path(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # the path loops, is too long, or contains a NUL
        raise InputError(str(path), f"is not a path: {error}", "name a TOML file") from None


def is_file(path: Path) -> bool:
    """Return True when a path is that of an ordinary file; False also for an impossible path."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def compose(path: Path, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Return the plain table of a scene file after `extends`, `replace`, `set` and `remove`."""
    path = _absolute_path(path)
    if path in above:
        chain = " -> ".join(p.name for p in (*above, path))
        raise InputError(str(path), f"extends itself: {chain}", "break the circle")
    if len(above) == LONGEST_CHAIN:
        raise InputError(str(above[0]), f"extends more than {LONGEST_CHAIN} scenes in a row", "leave some out")
    table = read_toml(path)
    require_kind(table, path, SCENE)
    _require_tables(table, path)
    if "extends" not in table:
        extra = [key for key in EDITS if key in table]
        if extra:
            raise InputError(f"{path} [{extra[0]}]", "edits another scene, but none is extended", 'add extends = "..."')
        _absolute_files(table, path)
        return table
    if not isinstance(table["extends"], str):
        raise InputError(
            f"{path} [extends]", f"is the name of one file, not {table['extends']!r}", 'write "other.toml"'
        )
    return _apply_edits(compose(path.parent / table["extends"], (*above, path)), table, path)


def files_read(path: Path) -> list[Path]:
    """Return the file of a scene, those that it extends, and those that its parts name, as far as these can be read."""
    files = [path]
    with contextlib.suppress(InputError):
        while len(files) <= LONGEST_CHAIN and isinstance(below := read_toml(files[-1]).get("extends"), str):
            files.append(files[-1].parent / below)
    with contextlib.suppress(InputError):
        files += map(Path, _named_files(compose(path)))
    return list(dict.fromkeys(files))


def _named_files(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        yield from (node[key] for key in FILES if isinstance(node.get(key), str))
        node = list(node.values())
    for item in node if isinstance(node, list) else ():
        yield from _named_files(item)


def _require_tables(table: dict[str, Any], path: Path) -> None:
    """Raise InputError unless the data that is edited before validation consists of tables of tables."""
    wholes = [("", table), *((f"{edit}.", table[edit]) for edit in ("replace", "set") if edit in table)]
    for prefix, whole in wholes:
        if not isinstance(whole, dict):
            raise InputError(f"{path} [{prefix[:-1]}]", f"expected a table, not {whole!r}", "write [set.body.NAME]")
        for family in FAMILIES:
            parts = whole.get(family, {})
            wrong = (
                parts
                if not isinstance(parts, dict)
                else next((p for p in parts.values() if not isinstance(p, dict)), {})
            )
            if not isinstance(wrong, dict):
                raise InputError(
                    f"{path} [{prefix}{family}]",
                    f"expected a table of named parts, not {wrong!r}",
                    f"write [{prefix}{family}.NAME]",
                )
    removed = table.get("remove", [])
    if not isinstance(removed, list) or not all(isinstance(where, str) for where in removed):
        raise InputError(f"{path} [remove]", f"is a list of paths, not {removed!r}", 'write remove = ["joint.A1"]')


def kind_of_file(table: Mapping[str, Any]) -> str:
    """Return SCENE, SWEEP or RECIPE: the kind to which most keys of a file belong; SCENE where none decides."""
    matches = {kind: len(keys & set(table)) for kind, keys in TYPICAL_KEYS.items()}
    return max(matches, key=lambda kind: matches[kind])


def require_kind(table: Mapping[str, Any], path: Path, requested: str) -> None:
    """Raise InputError when the table in a file is of another kind than requested."""
    kind = kind_of_file(table)
    if kind != requested and (kind != SCENE or TYPICAL_KEYS[SCENE] & set(table)):
        raise InputError(str(path), f"is {kind}, not {requested}", USE[kind].format(path=path))


def _apply_edits(result: dict[str, Any], table: dict[str, Any], path: Path) -> dict[str, Any]:
    """Apply a table's edits to the table that it extends, in place, and return that."""
    for where in table.get("remove", []):
        parent, key = _find_container(result, where, f"{path} [remove]")
        del parent[key]
    for edit in ("replace", "set"):
        for family, parts in table.get(edit, {}).items():
            _edit_family(result, family, parts, edit, path)
    own = {key: value for key, value in table.items() if key not in EDITS}
    _absolute_files(own, path)
    for key, value in own.items():
        if key in FAMILIES:
            _add_parts(result, key, value, path)
        else:
            result[key] = value
    return result


def _edit_family(result: dict[str, Any], family: str, parts: object, edit: str, path: Path) -> None:
    where = f"{path} [{edit}.{family}"
    if family not in FAMILIES:
        if edit == "set" and isinstance(result.get(family), dict) and isinstance(parts, dict):
            result[family] = {**result[family], **parts}
            return
        raise InputError(f"{where}]", f"there is no '{family}' to {edit}", suggestion(family, list(FAMILIES)))
    if not isinstance(parts, dict):
        raise InputError(f"{where}]", "expected a table of named parts")
    _absolute_files({family: parts}, path)
    existing = result.get(family, {})
    for name, part in parts.items():
        if name not in existing:
            raise InputError(
                f"{where}.{name}]", f"there is no {family} called '{name}' to {edit}", suggestion(name, existing)
            )
        existing[name] = part if edit == "replace" else _merge_tables(existing[name], part)


def _merge_tables(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """Return `old` with the named keys changed, tables key by key."""
    result = dict(old)
    for key, value in new.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merge_tables(result[key], value) if both else value
    return result


def _add_parts(result: dict[str, Any], family: str, parts: dict[str, Any], path: Path) -> None:
    existing = result.setdefault(family, {})
    for name, part in parts.items():
        if name in existing:
            raise InputError(
                f"{path} [{family}.{name}]",
                f"the extended scene already has a {family} called '{name}'",
                f"write [replace.{family}.{name}] or [set.{family}.{name}]",
            )
        existing[name] = part


def _find_container(table: Any, path: object, where: str) -> tuple[Any, Any]:
    """Return the table or list that contains a key path, and its last key; entries of lists count from 0."""
    keys = str(path).split(".")
    for depth, name in enumerate(keys):
        key = _key_of_entry(table, name)
        if key is None:
            known = table if isinstance(table, dict) else {}
            raise InputError(
                where, f"there is no '{'.'.join(keys[: depth + 1])}'", suggestion(name, known) if known else None
            )
        if depth < len(keys) - 1:
            table = table[key]
    return table, key


def _key_of_entry(table: Any, name: str) -> str | int | None:
    """Return a table's key, or the index of a list's entry; None when it does not exist."""
    if isinstance(table, dict):
        return name if name in table else None
    return int(name) if isinstance(table, list) and name.isdecimal() and int(name) < len(table) else None


def _set_value(table: dict[str, Any], path: str, value: object, where: str) -> None:
    parent, _, key = path.rpartition(".")
    if parent in SETTINGS:
        table.setdefault(parent, {})
    owner: Any = table
    if parent:
        above, last = _find_container(table, parent, where)
        owner = above[last]
    if isinstance(owner, list):
        owner, last = _find_container(table, path, where)
        owner[last] = value
    elif isinstance(owner, dict):
        owner[key] = value
        if parent == "solver":
            close_choice(owner, [key])
    else:
        raise InputError(where, f"'{parent}' is a value, not a table")


def _absolute_files(table: dict[str, Any], path: Path) -> None:
    """Make paths of recipes, tables and shapes absolute: next to the scene, else in the nearest folder above."""

    def absolute(name: str) -> str:
        return str(next((p for p in (folder / name for folder in path.parents) if is_file(p)), path.parent / name))

    for body in table.get("body", {}).values():
        mesh = body.get("mesh") if isinstance(body, dict) else None
        if isinstance(mesh, str) and not Path(mesh).is_absolute():
            body["mesh"] = absolute(mesh)
        for shape in body.get("geometry") or () if isinstance(body, dict) else ():
            file = shape.get("file") if isinstance(shape, dict) else None
            if isinstance(file, str) and not Path(file).is_absolute():
                shape["file"] = absolute(file)
    start = table.get("start")
    if isinstance(start, dict) and isinstance(start.get("from"), str) and not start.get("recorded"):
        start["from"] = str(start["from"] if Path(start["from"]).is_absolute() else absolute(start["from"]))
    for joint in table.get("joint", {}).values():
        wear = joint.get("wear") if isinstance(joint, dict) else None
        if isinstance(wear, dict) and isinstance(wear.get("profile"), str) and not wear.get("shapes"):
            wear["profile"] = str(wear["profile"] if Path(wear["profile"]).is_absolute() else absolute(wear["profile"]))
    for law in _tables([table.get(family) for family in ("drive", "load", "event", "joint", "stop")]):
        if not Path(law["file"]).is_absolute():
            law["file"] = absolute(law["file"])


def _tables(node: object) -> Iterator[dict[str, Any]]:
    """Yield the laws and tables that are read from a file, at any depth."""
    if isinstance(node, dict):
        if isinstance(node.get("file"), str) and "points" not in node:
            yield node
        node = list(node.values())
    if isinstance(node, list):
        for item in node:
            yield from _tables(item)
