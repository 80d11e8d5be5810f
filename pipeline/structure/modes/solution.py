"""Stage 2: modes of a mesh under a reference condition, as a dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import MODES, conform
from pipeline.core.errors import InputError
from pipeline.core.registry import lookup, suggestion
from pipeline.structure.fe import beam as beams
from pipeline.structure.modes import eigen, exact, orient
from pipeline.structure.modes.basis import Basis

REFERENCES = "pipeline.structure.modes.reference"


def solve(
    mesh: xr.Dataset, reference: str, count: int | None = None, interfaces: Sequence[str] | None = None
) -> xr.Dataset:
    """Modes (schema MODES): mass-normalised, ascending, oriented and signed the same in every process.

    mesh: schema MESH.  reference: a name of `pipeline.structure.modes.reference`.
    count: number of elastic coordinates, constraint modes included; None for a complete basis.
    interfaces: named frames; None for the recipe's own list.
    Raises InputError for an unknown reference or frame, a count beyond the mesh, or one that cuts a cluster
    of equal frequencies (with the two nearest whole counts).
    """
    condition = lookup(REFERENCES, reference, where="modes.reference")
    names = tuple(mesh.attrs["interfaces"].split()) if interfaces is None else tuple(interfaces)
    beam = beams.assemble(mesh)
    basis: Basis = condition(beam, count, _nodes(mesh, names))
    values, vectors = eigen.rediagonalise(beam.stiffness, beam.mass, basis.vectors)
    vectors = orient.orient(beam, values, vectors)
    families = orient.family(beam, vectors)
    vectors = orient.signed(vectors, families)
    data: dict[str, Any] = {
        "frequency": (("mode",), eigen.frequency(values)),
        "shape": (("node", "dof", "mode"), vectors.reshape(-1, beams.N_DOFS, len(values))),
        "kind": (("mode",), np.array([name.partition("_")[0] for name in families])),
    }
    if basis.rigid_frequency.size:
        data["rigid_frequency"] = (("rigid_mode",), basis.rigid_frequency)
    for theory, hertz in exact.columns(mesh, reference, families).items():
        data[theory] = (("mode",), hertz)
    attributes = {name: mesh.attrs[name] for name in ("title", "section", "inertia_section", "source")}
    return conform(
        xr.Dataset(data, coords={"dof": list(beams.DOFS)}),
        MODES,
        reference=reference,
        count=len(values),
        interfaces=" ".join(names),
        **attributes,
    )


def _nodes(mesh: xr.Dataset, names: tuple[str, ...]) -> tuple[int, ...]:
    known = [str(name) for name in mesh["frame"].values]
    for name in names:
        if name not in known:
            raise InputError("modes.interfaces", f"the mesh has no frame called '{name}'", suggestion(name, known))
    return tuple(int(mesh["frame_node"].sel(frame=name)) for name in names)
