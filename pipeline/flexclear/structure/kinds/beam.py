"""Beams as models: the degrees of freedom are those of the nodes, and some inside the cells."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure import closed_form
from flexclear.structure.fe import beam as beams
from flexclear.structure.fe import beam_loads, beam_mesh
from flexclear.structure.fe.beam import N_DOFS, Beam
from flexclear.structure.fe.model import Drawn, Families, Interface, Kind, Model, SecondOrder, interfaces, selection
from flexclear.structure.fe.section import Section, shape
from flexclear.structure.fe.slices import integrate, slices

#: components along the rod's axes by family; the first one decides the sign
FAMILIES: dict[str, tuple[int, ...]] = {"bending_y": (1, 5), "bending_z": (2, 4), "torsion": (3,), "axial": (0,)}


def assemble(mesh: xr.Dataset) -> Model:
    """Build the model of a beam mesh (schema MESH)."""
    beam = beams.assemble(mesh)
    start = beam.node_position[0] - beam.along[0] * beam.axes[:, 0]
    return Model(
        stiffness=beam.stiffness,
        mass=beam.mass,
        rigid=beams.rigid_vectors(beam, beam.node_position.mean(axis=0)),
        position=start + np.outer(beam.along, beam.axes[:, 0]),
        interfaces=interfaces(mesh, lambda k: _node(beam, mesh["frame_node"].values[k])),
        ends=_ends(mesh, beam),
        integrate=lambda vectors: integrate(slices(mesh, beam), vectors),
        families=_families(beam),
        drawn=_line_to_draw(mesh, beam),
    )


def _ends(mesh: xr.Dataset, beam: Beam) -> tuple[Interface, ...]:
    x = mesh["abscissa"].values
    return tuple(
        Interface(name, beam.node_position[node], beam.axes, _node(beam, node))
        for name, node in (("start", int(np.argmin(x))), ("end", int(np.argmax(x))))
    )


def _node(beam: Beam, node: int) -> sp.csr_array:
    """Return the functionals of a node's six degrees of freedom, shape (6, ndof)."""
    return selection(beams.node_dofs(np.array([node])), beam.size)


def _families(beam: Beam) -> Families:
    member = np.empty(beam.size, dtype=np.int64)
    for rank, components in enumerate(FAMILIES.values()):
        member[np.isin(beam.component, components)] = rank
    # the sign follows from nodes only, because only they are drawn
    nodal = np.arange(beam.nodal_size).reshape(-1, N_DOFS)
    main = tuple(nodal[:, components[0]] for components in FAMILIES.values())
    along = (beam.along - beam.along.min()) / np.ptp(beam.along)
    local = sp.csr_array(beams.in_rod_axes(beam, sp.eye_array(beam.size, format="csr")))
    return Families(tuple(FAMILIES), local, member, main, along)


#: points of a drawn outline, including the corners of a rectangle
AROUND = 24
#: outlines of the square with corners at (+-1, +-1), anticlockwise and closed, and of the circle
_SQUARE = np.column_stack(
    [np.interp(np.arange(AROUND + 1), AROUND // 4 * np.arange(5), x) for x in ((1, 1, -1, -1, 1), (-1, 1, 1, -1, -1))]
)
_TURN = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])


def _line_to_draw(mesh: xr.Dataset, beam: Beam) -> Drawn:
    radius, outline = _sections(mesh, beam)
    motion = selection(np.arange(beam.nodal_size), beam.size)
    return Drawn(beam.node_position, mesh["cell_node"].values, radius, motion, outline)


def _sections(mesh: xr.Dataset, beam: Beam) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the radius of each cell, and outlines (cell, point, 3) where a section is a rectangle. A general section
    is drawn as a circle of equal area."""
    types, area = tuple(mesh.attrs["section"].split()), mesh["area"].values
    shapes = [shape(types, Section(*row)) for row in np.column_stack([area, mesh["second_moment"].values]).tolist()]
    radius = np.sqrt(area / np.pi)
    for k, (name, lengths) in enumerate(shapes):
        radius[k] = lengths[0] if name in ("circle", "tube") else radius[k]
    if "rectangle" not in types:
        return radius, None
    flat = [
        0.5 * np.array(lengths) * _SQUARE if name == "rectangle" else r * _CIRCLE
        for (name, lengths), r in zip(shapes, radius, strict=True)
    ]
    return radius, np.stack(flat) @ beam.axes[:, 1:].T


def _second_order(
    mesh: xr.Dataset, model: Model, vectors: np.ndarray, stiffening: bool, held: Interface | None
) -> SecondOrder | None:
    if not stiffening:
        return None  # the motion of the sections is a volume integral
    x = mesh["abscissa"].values
    node = dict(zip(mesh["frame"].values.tolist(), mesh["frame_node"].values, strict=True))
    return beam_loads.second_order(mesh, float(x.min() if held is None else x[node[held.name]]), vectors)


KIND = Kind(
    build=beam_mesh.build,
    vtu=beam_mesh.as_vtu,
    assemble=assemble,
    words=lambda model, families, vectors: [name.partition("_")[0] for name in families],
    cut=beam_mesh.cut_segment,
    exact=closed_form.exact_frequencies,
    second_order=_second_order,
)
