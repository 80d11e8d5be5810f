"""Pages on datasets, quantities and Python functions, written from schemas and docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Iterable

import flexclear as fc
from benchmarks.page import DOCS
from flexclear.artifacts import schema as artifacts
from flexclear.artifacts.coordinates import COORDINATES
from flexclear.artifacts.schema import Schema
from flexclear.post.plotting.table import Table, as_csv
from flexclear.post.sections.verdict import VERDICT
from flexclear.post.single_run.series import POST
from flexclear.scene.quantity import CONTACT_REDUCTIONS, KINDS, OWNERS, SERIES, WORDS, Kind

RECIPES = DOCS / "examples" / "datasets"
#: datasets in the order in which they are computed: heading, location of the file, schema
DATASETS: dict[str, tuple[str, Schema]] = {
    "Run": ("`run.nc`, from `flexclear run` and `flexclear.run`", artifacts.RUN),
    "What follows from a run": ("`post.nc`", POST),
    "Ensemble": ("`ensemble.nc`, of scenes with `[ensemble]`", artifacts.ENSEMBLE),
    "Equilibrium": ("from `flexclear.equilibrium`", artifacts.EQUILIBRIUM),
    "Vibrations": (
        "from `flexclear frequencies`; it has the variables of an equilibrium as well, and as attribute `growth` the "
        "largest rate [1/s] at which a small motion grows, 0 where the state is stable",
        artifacts.LINEAR,
    ),
    "State space": ("from `flexclear export --format state-space` and `flexclear.state_space`", artifacts.STATE_SPACE),
    "Campbell diagram": ("from `flexclear frequencies --speeds`", artifacts.CAMPBELL),
    "Wear over many cycles": ("`wear.nc`, from `flexclear wear` and `flexclear.wear`", artifacts.WEAR),
    "Sections": ("from `flexclear sections`", artifacts.SECTIONS),
    "Verdict": ("from `flexclear sections`", VERDICT),
}
#: datasets of stages 1 to 3, whose variables are in the CSV file alone
STRUCTURE: dict[str, tuple[str, Schema]] = {
    "Reduced body": ("`bundle/<body>.nc`", artifacts.BUNDLE),
    "Modes": ("`modes/<body>.nc`", artifacts.MODES),
    "Mesh of a beam": ("`mesh/<body>.nc`", artifacts.MESH),
    "Mesh of a solid": ("`mesh/<body>.nc`", artifacts.SOLID),
    "Matrices of another program": ("`mesh/<body>.nc`", artifacts.MATRICES),
    "Rigid body of a mesh": ("kept in the cache alone, for bodies of the type rigid with a mesh", artifacts.RIGID),
}
DATASETS_HEAD = """# Datasets

After this page you can open results, select values and know their units. Results are NetCDF-4 files that follow the CF
conventions, and xarray datasets in Python. Values are selected by the name of a body, joint, mode or contact. Units are
SI, as UDUNITS reads them. **[All variables and coordinates](datasets/variables.csv)** have dimensions, units and
meanings there, and as attributes of their own: `print(run["joint_force"])`. `python -m benchmarks.site` writes this
page from the schemas that every dataset is checked against; the recipes run as tests.

- **Two units** (`N; N m`): the second belongs to entries that turn. Where a variable has both kinds, the coordinate
  `<variable>_units` gives the unit of each entry, and `<dimension>_motion` its kind; else the attribute `units` does.
- **Modal coordinates** belong to shapes with a modal mass of 1 kg, so that their unit is m.
- **Rows** of a run: the regular outputs, breaks of drives, events, and the deepest points of contacts.
- **Coordinates** of one name mean the same in all datasets.
- **Attributes**: `title`; `source`, the version that made the file; `references`, publications of the methods;
  `parameters` of the scene as JSON; `versions` of libraries; `warnings`. post.nc, and what `flexclear.run` returns,
  have `sources` and `assumptions` of the scene's values as well. No file names its time or machine: equal inputs give
  equal bytes.

"""
VARIABLES = """## Variables

Names only, each where it comes first; of parts that a scene lacks there are none. Variables over time are
[quantities](reference/quantities.md), which have their meanings there. A variable that ends in `_mean` has a standard
deviation (`_std`) and quantiles (`_quantile`) over the members, too.

"""
STRUCTURE_TEXT = """### Mesh, modes, reduced body

`mesh/<body>.nc`, `modes/<body>.nc` and `bundle/<body>.nc`: their variables are in the file alone.
"""


def datasets() -> str:
    """Return docs/datasets.md: recipes for reading datasets, and the names of the variables of each."""
    recipes = [_recipe(path.read_text(encoding="utf-8")) for path in sorted(RECIPES.glob("*.py"))]
    parts, known = [DATASETS_HEAD, "## Recipes\n\n", *recipes, VARIABLES], set[tuple[str, str]]()
    for heading, (where, schema) in DATASETS.items():
        own = [(name, v.long_name) for name, v in schema.items() if not name.endswith(STATISTICS)]
        names = ", ".join(f"`{name}`" for name, meaning in own if (name, meaning) not in known)
        parts.append(f"### {heading}\n\n{where[0].upper()}{where[1:]}. {names}.\n\n".replace(". .", "."))
        known |= set(own)
    return "".join(parts) + STRUCTURE_TEXT


def _recipe(source: str) -> str:
    title, _, code = source.removeprefix('"""').partition('"""\n')
    return f"### {title.removesuffix('.')}\n\n```python\n{code.strip()}\n```\n\n"


#: endings of the further statistics of a variable over the members of an ensemble
STATISTICS = ("_std", "_quantile")


def variables() -> str:
    """Return docs/datasets/variables.csv: every variable of every dataset, then the coordinates."""
    heads = ("dataset", "file", "variable", "optional", "dimensions", "unit", "unit where it turns", "meaning")
    of: dict[str, tuple[str, Schema]] = {**DATASETS, **STRUCTURE, "Coordinates": ("", COORDINATES)}
    rows = tuple(
        (
            *(heading, where.replace("`", ""), name, "yes" if v.optional else ""),
            *(", ".join(v.dims), v.units, v.turning, v.long_name),
        )
        for heading, (where, schema) in of.items()
        for name, v in schema.items()
    )
    return as_csv(Table("", heads, rows))


QUANTITIES = """# Quantities

What a run holds over time has a name. The same name is watched (`[view] watch`), compared, planned, filmed,
asked for in `[accuracy]` and read from a run. Sweeps record it with a reduction behind it (`keep`), also once in each
period:

```python
import flexclear as fc

run = fc.run("slider_crank.toml")
fc.quantity(run, "slider.acceleration.x")  # over time, with its unit
fc.quantity(run, "force(pin) - force(main)")
```

- `<owner>.<word>` as in `slider.position`; `slider.position.x` is a component along x, y or z of the world.
- Where a part is a body and a joint at the same time, the word means the first of the owners below that has it.
  The second word of a line says which one is meant: `guide.joint_position`.
- `force(A1)` is another way to write `A1.force`.
- What belongs to the whole mechanism has no owner: `kinetic`.
- Expressions have `+ - * / ^`, parentheses, numbers with units, the time `t` and the functions `max`, `min`, `abs`,
  `sqrt`, `sin`, `cos`, `tan`, `exp`, `log`, `sign`, `step` (1 from zero on) and `norm`, the magnitude, with spaces
  around + and -: `max(0, slider.position.x - 10 mm)^1.5`. Units are checked; a bare 0 fits every unit.
  As keys of `[accuracy]` they are quoted.
- A relative accuracy refers to the largest change since the start (lengths and angles) or to the largest magnitude (all
  others). An absolute one has the unit of the quantity.

This page is written from the schema of runs (`python -m benchmarks.site`).

"""


def quantities() -> str:
    """Return docs/reference/quantities.md: every quantity with its unit, and the reductions of sweeps."""
    parts = [QUANTITIES]
    for dim, owner in OWNERS.items():
        shown = _lines(_quantity(key, kind) for key, kind in KINDS.items() if kind.owner == dim and kind.variable)
        parts.append(f"## {owner[0].upper()}{owner[1:]}\n\n{shown}\n\n")
    reductions = [(name, meaning) for name, meaning in SERIES.items()]
    for kind, few in CONTACT_REDUCTIONS.items():
        reductions += [(f"{kind}.{name}", meaning) for name, meaning in few.items()]
    shown = _lines(f"- `{name}`: {meaning}" for name, meaning in reductions)
    parts.append(f"## Reductions, of sweeps\n\n{shown}\n")
    return "".join(parts)


def _quantity(key: str, kind: Kind) -> str:
    words = ", ".join(f"`{word}`" for word in _words(key))
    return f"- {words} [{' or '.join(dict.fromkeys(kind.units))}]: {_meaning(kind)}"


def _lines(rows: Iterable[str]) -> str:
    return "\n".join(rows)


def _words(key: str) -> list[str]:
    return sorted((word for word, keys in WORDS.items() if key in keys), key=lambda word: (len(word), word))


def _meaning(kind: Kind) -> str:
    parts = {"axis": "; x, y, z", "quat": "; a rotation, in radians"}
    most = "; of all sections the one where it is largest" if kind.owner == "section" else ""
    return f"{kind.meaning}{parts.get(kind.dim, '')}{most}"


PYTHON = """# Python

`import flexclear as fc` brings the functions below. All but `load_scene`, `edited` and `open` bring results up to date
first: what is fresh comes from the cache. A `scene` (`AnyScene`) is what `load_scene` returns, a path, a name below
`scenes/`, or a table with the keys of a scene file. Examples run as tests. What the datasets hold is in
[datasets.md](../datasets.md), which errors there are at the end of this page.

"""
PROMISES = """## What stays

Public are the names in `fc.__all__`, the keys of scene files, recipes and sweeps, the commands with their options and
exit codes, and the variables of [datasets.md](../datasets.md). A release that breaks one of them has a new first
number. Before that the old name works for at least one release and warns (`DeprecationWarning`, or one line of the
command), and CHANGELOG.md names what replaces it. Everything else may change with each release, the modules below
`flexclear` included.

## Errors

All are `fc.FlexclearError`: `fc.InputError` where something given is wrong (the message names the place, the value, the
rule and the remedy), `fc.SolverError` where a computation refuses or gives up (with the time, the part and the reason),
and `fc.ResourceError` where the machine lacks memory or disk. The command ends with the exit codes 2, 3 and 4 for them.
"""


def python() -> str:
    """Return docs/reference/python.md: every public function with its signature, docstring and example."""
    names = [name for name in fc.__all__ if inspect.isfunction(getattr(fc, name, None))]
    return PYTHON + "".join(_section(name) for name in names) + PROMISES


def _section(name: str) -> str:
    function = getattr(fc, name)
    signature = str(inspect.signature(function)).replace("'", "")
    text, _, example = (inspect.getdoc(function) or "").partition("\n\n>>> ")
    shown = f"```python\n>>> {example}\n```\n\n" if example else ""
    return f"## {name}\n\n```python\nfc.{name}{signature}\n```\n\n{text}\n\n{shown}"
