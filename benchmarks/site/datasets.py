"""docs/datasets.md: every dataset, variable and coordinate as their schemas say, and recipes for reading them."""

from __future__ import annotations

from benchmarks.page import DOCS
from benchmarks.site.text import table
from flexclear.pipeline.core.artifacts import schema as artifacts
from flexclear.pipeline.core.artifacts.coordinates import COORDINATES
from flexclear.pipeline.core.artifacts.schema import Schema
from flexclear.pipeline.core.scene.output import Variable
from flexclear.pipeline.post.sections.verdict import VERDICT
from flexclear.pipeline.post.single_run.schema import POST

RECIPES = DOCS / "examples" / "datasets"
#: datasets in the order of their making: heading, where the file is, schema
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
    "Campbell diagram": ("from `flexclear frequencies --speeds`", artifacts.CAMPBELL),
    "Sections": ("from `flexclear sections`", artifacts.SECTIONS),
    "Verdict": ("from `flexclear sections`", VERDICT),
    "Reduced body": ("`bundle/<body>.nc`", artifacts.BUNDLE),
    "Modes": ("`modes/<body>.nc`", artifacts.MODES),
    "Mesh of a beam": ("`mesh/<body>.nc`", artifacts.MESH),
    "Mesh of a solid": ("`mesh/<body>.nc`", artifacts.SOLID),
    "Matrices of another program": ("`mesh/<body>.nc`", artifacts.MATRICES),
    "Rigid body of a mesh": ("kept in the cache alone, for bodies of the type rigid with a mesh", artifacts.RIGID),
}
HEAD = """# Datasets

Results are NetCDF-4 files that follow the CF conventions, and xarray datasets in Python. Dimensions have coordinates
with names, so that values are selected by the name of a body, joint, mode or contact. Units are SI, written as UDUNITS
reads them. This page is written from the schemas that every dataset is checked against (`python -m benchmarks.site`);
the recipes run as tests.

- **Units of entries.** Where some entries of a variable slide and others turn, as drives do, the variable has no
  attribute `units`; the coordinate `<variable>_units` then gives the unit of each entry. Where all are of one kind, the
  attribute is there and the coordinate is not. The coordinate `<dimension>_motion` says which are which.
- **Modal coordinates** belong to shapes with a modal mass of 1 kg, so that they have the unit m. (Texts that write
  sqrt(kg) m for mass-normalised modes mean the same numbers.)
- **Times.** The rows of a run are the regular outputs, and besides them breaks of drives, events and the deepest points
  of contacts.
- **Attributes.** `title`; `source`, the version that made the file; `references`, publications of the methods that
  the scene's parts represent; `parameters` of the scene as JSON; `versions` of libraries; `warnings`. `sources` and
  `assumptions`, where the values of the scene and of its recipes come from, are attributes of post.nc and of what
  `flexclear.run` returns, so that another sentence there runs nothing again. No file holds the time or the machine of
  its making: equal inputs give equal bytes.
- **Marked `*`:** variables that are there only when the scene has such a part.
"""


def text() -> str:
    """The page."""
    parts = [
        HEAD,
        "## Recipes\n\n",
        *(_recipe(path.read_text(encoding="utf-8")) for path in sorted(RECIPES.glob("*.py"))),
    ]
    known: set[str] = set()
    for heading, (where, schema) in DATASETS.items():
        own = {name: v for name, v in schema.items() if heading != "Vibrations" or name not in artifacts.EQUILIBRIUM}
        parts.append(f"## {heading}\n\n{where[0].upper()}{where[1:]}.\n\n{_table(own)}\n\n")
        known |= set(schema)
    parts.append(
        f"## Coordinates\n\nThe same names mean the same in all datasets.\n\n{_table(COORDINATES, marks=False)}\n"
    )
    return "".join(parts)


def _recipe(source: str) -> str:
    title, _, code = source.removeprefix('"""').partition('"""\n')
    return f"### {title.removesuffix('.')}\n\n```python\n{code.strip()}\n```\n\n"


def _table(schema: Schema, *, marks: bool = True) -> str:
    rows = [
        (f"`{name}`{'*' if marks and v.optional else ''}", ", ".join(v.dims) or "-", _units(v), v.long_name)
        for name, v in schema.items()
    ]
    return table(("name", "dimensions", "unit", "meaning"), rows)


def _units(variable: Variable) -> str:
    if not variable.units:
        return "words"
    return f"{variable.units}; {variable.turning} where it turns" if variable.turning else variable.units
