"""Stage 2: the dataset of modes of a mesh under a reference condition."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import MODES, conform
from flexclear.scene.registry import lookup, suggestion
from flexclear.structure.fe.model import DOFS, Interface, Model
from flexclear.structure.fe.statics import Flexibility, factorise_supported
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.modes import basis, deficits, imported, normal
from flexclear.structure.modes.basis import ModeRequest
from flexclear.structure.modes.reference import CONDITIONS, Condition, Given, require_definite_condition
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress, silent

if TYPE_CHECKING:
    from flexclear.scene.parts import Modes

CARRIED = ("title", "section", "inertia_section")


def solve(
    mesh: xr.Dataset,
    reference: str,
    count: int | None = None,
    interfaces: Sequence[str] | None = None,
    *,
    requested: ModeRequest | None = None,
    held: Sequence[str] = (),
    of: str | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Compute modes (schema MODES): mass-normalised, ascending, oriented and signed the same in every process.

    mesh: dataset of any kind of body.  reference: a name of `structure.modes.reference`.
    count: number of elastic coordinates, static ones included; None for a complete basis.
    requested: other rules for the number of modes.
    interfaces: named frames; None for the recipe's own list.  held, of: see `condition.Given`.
    Raises InputError for an unknown reference or frame, a count beyond the mesh, or one that cuts a cluster
    of equal frequencies (with the two nearest whole counts).
    """
    kind = of_mesh(mesh)
    progress(None, "assembling")
    model = kind.assemble(mesh)
    names = tuple(mesh.attrs["interfaces"].split()) if interfaces is None else tuple(interfaces)
    given, condition = _given_and_condition(model, reference, names, held, of)

    @cache
    def flexibility() -> Flexibility:
        return factorise_supported(model, lambda fraction: progress(fraction, f"factorising {model.size} coordinates"))

    imported.require_definite(mesh, flexibility)
    body = basis.Body(model, condition, given.interfaces, flexibility, progress)
    shapes, rigid_frequency = basis.build(body, requested or ModeRequest(count=count))
    values, vectors = normal.rediagonalise(model.stiffness, model.mass, shapes)
    vectors = normal.orient(model, values, vectors)
    families = normal.dominant_families(model, vectors)
    vectors = normal.fix_signs(model, vectors, families)
    data = _variables(model, values, vectors)
    data["kind"] = (("mode",), np.array(kind.words(model, families, vectors)))
    exact = kind.exact(mesh, reference, families, names) if kind.exact is not None else {}
    data |= {theory: (("mode",), hertz) for theory, hertz in exact.items()}
    if rigid_frequency.size:
        data["rigid_frequency"] = (("rigid_mode",), rigid_frequency)
    lacks, attributes = deficits.measure(flexibility(), vectors, progress)
    checked, remarks = imported.measure(mesh, flexibility(), progress)
    data, attributes = data | checked, attributes | remarks
    attributes |= {name: mesh.attrs[name] for name in CARRIED}
    attributes |= {"reference": reference, "count": len(values), "interfaces": " ".join(names)}
    attributes["rigid_motion"] = condition.note
    return conform(xr.Dataset(data | lacks), MODES, **attributes)


def _given_and_condition(
    model: Model, reference: str, names: Sequence[str], held: Sequence[str], of: str | None
) -> tuple[Given, Condition]:
    """Return the scene's data of a reference condition, and the condition; raise InputError as `solve` does."""
    given = Given(tuple(_frame(model, name) for name in names), tuple(held), of)
    condition: Condition = lookup(CONDITIONS, reference, kind="reference condition", where="modes.reference")(
        model, given
    )
    require_definite_condition(model, condition)
    return given, condition


def require_possible(model: Model, modes: Modes, names: Sequence[str]) -> None:
    """Raise InputError for modes that `solve` would refuse, without a factorisation.

    names: interfaces of the mesh, for modes without their own.
    """
    _, condition = _given_and_condition(model, modes.reference, modes.interfaces or names, modes.held, modes.of)
    if isinstance(modes.count, int) and modes.count:
        basis.count_required_modes(modes.count, basis.count_normal_modes(model, condition), condition.static)


def _frame(model: Model, name: str) -> Interface:
    known = {frame.name: frame for frame in model.interfaces}
    if name not in known:
        raise InputError("modes.interfaces", f"the mesh has no frame called '{name}'", suggestion(name, known))
    return known[name]


def _variables(model: Model, values: np.ndarray, vectors: np.ndarray) -> dict[str, Any]:
    return {
        "frequency": (("mode",), normal.eigenvalues_to_hz(values)),
        "shape": (("node", "dof", "mode"), model.drawn.nodal_motion(vectors)),
        "vector": (("unknown", "mode"), vectors),
        "node_position": (("node", "axis"), model.drawn.position),
        "cell_node": (("cell", "corner"), model.drawn.cell),
        "dof": (("dof",), list(DOFS)),
        "frame": (("frame",), [frame.name for frame in model.interfaces]),
    }
