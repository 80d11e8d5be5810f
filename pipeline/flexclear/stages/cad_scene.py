"""New scenes from CAD: bodies with mass and inertia, frames at holes and shafts, joints where these are coaxial."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from flexclear.structure.fe.solid.step import Round, Solid

#: steel, until the user says what the solids are made of
STEEL = 'youngs_modulus = "210 GPa"\npoisson = 0.3\ndensity = "7850 kg/m^3"'
DENSITY = 7850.0
#: cells per cube root of a solid's volume
CELLS = 12.0
#: a clearance below this fraction of the radius is rounding of the file
FIT = 1e-6


def files(source: Path, folder: Path) -> tuple[dict[str, bytes], list[str]]:
    """Return the files of a new scene by their names, the scene first, and what they do not take over, in sentences.

    source: a STEP file, to which recipes in the folder refer.  Raises InputError for one that cannot be read.
    """
    from flexclear.structure.fe.solid.step import solids

    found = solids(source, str(source))
    names = list(_names([solid.name for solid in found]))
    joints, frames = _joints(names, found)
    joined = {place for pair in joints for place, _ in pair}
    for name, mine in frames.items():  # of shafts only those in a joint: bosses and fillets are shafts, too
        frames[name] = {k: one for k, one in mine.items() if one.hole or f"{name}.{k}" in joined}
    made = {f"{_identifier(source.stem) or 'part'}.toml": _scene(source, names, found, joints, frames).encode()}
    path = Path(os.path.relpath(source.resolve(), folder.resolve())).as_posix()
    for k, (name, solid) in enumerate(zip(names, found, strict=True), start=1):
        made[f"{name}_mesh.toml"] = _recipe(path, k, solid, frames[name]).encode()
    lonely = [name for name in names if not frames[name]]
    return made, [f"{name} has no cylindrical hole or shaft: give it frames" for name in lonely]


def _identifier(text: str) -> str:
    return re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower()


def _names(given: list[str]) -> Iterator[str]:
    """Yield a name for each solid: that of its product, or part1, part2, ...; numbered where products are alike."""
    taken = {"ground"}
    for k, text in enumerate(given, start=1):
        word = _identifier(text.rpartition("/")[2])
        word = f"part{k}" if not word or word.startswith("open_cascade") or word[0].isdigit() else word
        name = f"{word}_{k}" if word in taken else word
        taken.add(name)
        yield name


Place = tuple[str, "Round"]


def _joints(names: list[str], found: list[Solid]) -> tuple[list[tuple[Place, Place]], dict[str, dict[str, Round]]]:
    """Return pairs of coaxial cylinders of two solids, as few per axis as connect them, and all frames."""
    frames: dict[str, dict[str, Round]] = {}
    for name, solid in zip(names, found, strict=True):
        several = {"hole": 0, "shaft": 0}
        frames[name] = {}
        for one in sorted(solid.rounds, key=lambda r: (not r.hole, tuple(r.centre.round(9)))):
            sort = "hole" if one.hole else "shaft"
            several[sort] += 1
            frames[name][f"{sort}{several[sort]}"] = one
    pairs = [
        ((f"{first}.{a}", one), (f"{second}.{b}", other))
        for first, second in combinations(names, 2)
        for a, one in frames[first].items()
        for b, other in frames[second].items()
        if _fits_hole(one, other)
    ]
    kept = list[int]()
    # shafts before holes without any, and those first that fit most closely
    for k in sorted(range(len(pairs)), key=lambda k: _looseness(*pairs[k])):
        first, second = _bodies(pairs[k])
        same_axis, reached = (
            [_bodies(pairs[n]) for n in kept if pairs[k][0][1].along(pairs[n][0][1], math.inf)],
            {first},
        )
        for _ in same_axis:
            reached.update(*(bodies for bodies in same_axis if reached & {*bodies}))
        if second not in reached:
            kept.append(k)
    kept.sort()
    # a joint's frames share a point of the axis, and so do those of other joints that one of them is in
    lead = {place: k for k in reversed(kept) for place, _ in pairs[k]}
    for first, second in [(pairs[k][0][0], pairs[k][1][0]) for k in kept] * len(kept):
        lead[first] = lead[second] = min(lead[first], lead[second])
    for (body, _, frame), k in ((place.partition("."), k) for place, k in lead.items()):
        centre = next(one.centre for _, one in pairs[k] if one.hole)
        frames[body][frame] = replace(frames[body][frame], centre=centre)
    return [pairs[k] for k in kept], frames


def _bodies(pair: tuple[Place, Place]) -> list[str]:
    return [place.partition(".")[0] for place, _ in pair]


def _looseness(first: Place, second: Place) -> tuple[bool, float]:
    return first[1].hole and second[1].hole, abs(first[1].radius - second[1].radius)


def _fits_hole(one: Round, other: Round) -> bool:
    """Return True for a shaft in a hole that is not smaller, and for two like holes next to each other."""
    if one.hole and other.hole:
        least, most = sorted((one.radius, other.radius))
        return most - least < 0.2 * most and one.along(other, least)
    hole, shaft = (one, other) if one.hole else (other, one)
    return hole.hole and 0.5 * hole.radius < shaft.radius < (1.0 + FIT) * hole.radius and one.along(other)


def _scene(
    source: Path,
    names: list[str],
    found: list[Solid],
    joints: list[tuple[Place, Place]],
    frames: dict[str, dict[str, Round]],
) -> str:
    held = max(range(len(names)), key=lambda k: found[k].volume) if joints else 0
    pivot = next(iter(frames[names[held]].items()), None) if not joints else None
    bound = {place.partition(".")[0] for pair in joints for place, _ in pair} | {names[held]}
    lines = [
        f"# The solids of {_printable(source.name)} as rigid bodies of steel; lengths in m, axes of the file.",
        "# For a flexible body replace mass, com, inertia and frames by",
        '#   type = "flexible"',
        '#   mesh = "NAME_mesh.toml"',
        '#   modes = { reference = "craig-bampton", up_to = "10 kHz" }',
        f"title = {_text(source.stem)}",
        "",
        'time.end = "1 s"',
        'output.interval = "1 ms"',
        "",
        "# The solid turns about its first hole." if pivot else "# What is fixed: the largest solid.",
        "[body.ground]",
        'type = "ground"',
        _frame("base", pivot[1]) if pivot else "frames.base = {}",
        "",
    ]
    for name, solid in zip(names, found, strict=True):
        lines += [f"[body.{name}]  # {1e6 * solid.volume:.6g} cm^3", 'type = "rigid"']
        lines += [f"mass = {DENSITY * solid.volume!r}", f"com = {_vector(solid.centre)}"]
        lines += [f"inertia = {_symmetric(solid)}", "pose = {}"]
        for frame, one in frames[name].items():
            lines += [f"{_frame(frame, one)}  # diameter {_in_millimetres(one)} mm, length {1e3 * one.length:.6g} mm"]
        lines += ["frames.base = {}", ""] if name not in bound or (name == names[held] and not pivot) else [""]
    ends, kind = ("base", "fixed") if pivot is None else (pivot[0], "revolute")
    lines += _part("base", kind, "ground.base", f"{names[held]}.{ends}")
    for name in (name for name in names if name not in bound):
        lines += ["", f"# Nothing holds {name}.", *_part(f"free_{name}", "free", "ground.base", f"{name}.base")]
    for k, ((a, one), (b, other)) in enumerate(joints, start=1):
        lines += ["", *_joint(k, a, one, b, other)]
    lines += ["", "[load.gravity]", 'type = "gravity"', "acceleration = [0, -9.81, 0]", ""]
    return "\n".join(lines)


def _part(name: str, kind: str, first: str, second: str) -> list[str]:
    return [f"[joint.{name}]", f'type = "{kind}"', f'between = ["{first}", "{second}"]']


def _joint(k: int, a: str, one: Round, b: str, other: Round) -> list[str]:
    """Return a proposed joint; with a clearance where hole and shaft are drawn with different diameters."""
    (hole, outer), (shaft, inner) = ((a, one), (b, other)) if one.hole else ((b, other), (a, one))
    clearance, sizes = outer.radius - inner.radius, f"of {_in_millimetres(outer)} and {_in_millimetres(inner)} mm"
    ideal = _part(f"pin{k}", "revolute", hole, shaft)
    if inner.hole:
        return [f"# Proposed: two coaxial holes, {sizes}; no pin is drawn.", *ideal]
    if clearance <= FIT * outer.radius:
        return ["# Proposed: a shaft in its hole, drawn without clearance.", *ideal]
    return [
        "# Proposed: a shaft in its hole; the clearance is half the difference of the diameters,",
        f'# {sizes}. Without clearance it is type = "revolute", with `between` alone.',
        *_part(f"pin{k}", "clearance-revolute", hole, shaft),
        f"clearance = {_number(clearance)}",
        f"pin_radius = {_number(inner.radius)}",
        f"length = {_number(min(outer.length, inner.length))}",
        'journal_material = { youngs_modulus = "210 GPa", poisson = 0.3 }',
        'pin_material = { youngs_modulus = "210 GPa", poisson = 0.3 }',
        'normal = { law = "flores", restitution = 0.8 }',
    ]


def _recipe(path: str, number: int, solid: Solid, frames: dict[str, Round]) -> str:
    size = float(f"{solid.volume ** (1.0 / 3.0) / CELLS:.2g}")
    smallest = min((one.radius for one in frames.values()), default=size)
    lines = [
        f"# Mesh of solid {number} by Gmsh: pip install 'flexclear[cad]'. Sizes in m; the material is assumed.",
        f"interfaces = {list(frames) if frames else []}  # frames that joints or loads hold".replace("'", '"'),
        "",
        "[shape]",
        'type = "step"',
        f"file = {_text(path)}",
        f"solid = {number}",
        f"size = {min(size, 2.0 * smallest)!r}  # m, the largest cell",
        "",
        "[material]",
        STEEL,
        "",
    ]
    for frame, one in frames.items():
        surface = f"{{ point = {_vector(one.centre)}, axis = {_vector(one.axis)}, radius = {_number(one.radius)} }}"
        lines += [f"[frames.{frame}]", 'tie = "rigid"', f"on.cylinder = {surface}", "on.tolerance = 1e-7"]
        lines += [f"position = {_vector(one.centre)}", f"axis = {_vector(one.axis)}", ""]
    return "\n".join(lines)


def _frame(name: str, one: Round) -> str:
    return f"frames.{name} = {{ position = {_vector(one.centre)}, axis = {_vector(one.axis)} }}"


def _vector(values: np.ndarray) -> list[float]:
    """Return three numbers as a scene writes them, without rounding of the kernel below 1 pm."""
    return [float(x) + 0.0 for x in values.round(12)]


def _symmetric(solid: Solid) -> list[list[float]]:
    """Return the inertia [kg m^2]; products below rounding are zero."""
    J = 0.5 * DENSITY * (solid.inertia + solid.inertia.T)
    return [[float(x) if abs(x) > 1e-12 * J.max() else 0.0 for x in row] for row in J]


def _in_millimetres(one: Round) -> str:
    return f"{2e3 * one.radius:.6g}"


def _text(text: str) -> str:
    """Return text as a string of TOML."""
    return json.dumps(text, ensure_ascii=True)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _number(value: float) -> str:
    return repr(float(f"{value:.9g}"))
