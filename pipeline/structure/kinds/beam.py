"""Beams as models: the degrees of freedom are those of the nodes, and some inside the cells."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.pipeline.structure import closed_form
from flexclear.pipeline.structure.fe import beam as beams
from flexclear.pipeline.structure.fe import beam_mesh
from flexclear.pipeline.structure.fe.beam import N_DOFS, Beam
from flexclear.pipeline.structure.fe.model import Drawn, Families, Interface, Model
from flexclear.pipeline.structure.fe.section import rectangle_torsion
from flexclear.pipeline.structure.fe.slices import integrate, slices
from flexclear.pipeline.structure.kinds.kind import Kind

#: components along the rod's axes by family, the one that decides the sign first
FAMILIES: dict[str, tuple[int, ...]] = {"bending_y": (1, 5), "bending_z": (2, 4), "torsion": (3,), "axial": (0,)}


def assemble(mesh: xr.Dataset) -> Model:
    """The model of a beam mesh (schema MESH)."""
    beam = beams.assemble(mesh)
    return Model(
        stiffness=beam.stiffness,
        mass=beam.mass,
        rigid=beams.rigid_vectors(beam, beam.node_position.mean(axis=0)),
        position=_place(beam),
        interfaces=_interfaces(mesh, beam),
        ends=_ends(mesh, beam),
        integrate=lambda vectors: integrate(slices(mesh, beam), vectors),
        families=_families(beam),
        drawn=_drawn(mesh, beam),
    )


def _place(beam: Beam) -> np.ndarray:
    start = beam.node_position[0] - beam.along[0] * beam.axes[:, 0]
    return start + np.outer(beam.along, beam.axes[:, 0])


def _interfaces(mesh: xr.Dataset, beam: Beam) -> tuple[Interface, ...]:
    columns = ("frame", "frame_node", "frame_position", "frame_rotation")
    rows = zip(*(mesh[name].values for name in columns), strict=True)
    return tuple(Interface(str(name), x, R, _node(beam, int(node))) for name, node, x, R in rows)


def _ends(mesh: xr.Dataset, beam: Beam) -> tuple[Interface, ...]:
    x = mesh["abscissa"].values
    return tuple(
        Interface(name, beam.node_position[node], beam.axes, _node(beam, node))
        for name, node in (("start", int(np.argmin(x))), ("end", int(np.argmax(x))))
    )


def _node(beam: Beam, node: int) -> sp.csr_array:
    """The six degrees of freedom of a node, shape (6, ndof)."""
    dofs = beams.node_dofs(np.array([node]))
    return sp.csr_array((np.ones(N_DOFS), (np.arange(N_DOFS), dofs)), shape=(N_DOFS, beam.size))


def _families(beam: Beam) -> Families:
    member = np.empty(beam.size, dtype=np.int64)
    for rank, components in enumerate(FAMILIES.values()):
        member[np.isin(beam.component, components)] = rank
    # nodes alone decide a sign: they are what is drawn
    nodal = np.arange(beam.nodal_size).reshape(-1, N_DOFS)
    main = tuple(nodal[:, components[0]] for components in FAMILIES.values())
    along = (beam.along - beam.along.min()) / np.ptp(beam.along)
    local = sp.csr_array(beams.in_rod_axes(beam, sp.eye_array(beam.size, format="csr")))
    return Families(tuple(FAMILIES), local, member, main, along)


#: points of a drawn outline, corners of a rectangle among them; how near to a type's torsion constant one is of it
AROUND, SAME = 24, 1e-6
_SIDE = np.linspace(-1.0, 1.0, AROUND // 4, endpoint=False)
_ONE = np.ones_like(_SIDE)
#: around the square with corners at (+-1, +-1), anticlockwise, the first point again last
_SQUARE = np.concatenate(
    [
        np.column_stack(side)
        for side in ((_ONE, _SIDE), (-_SIDE, _ONE), (-_ONE, -_SIDE), (_SIDE, -_ONE), (_ONE[:1], _SIDE[:1]))
    ]
)


def _drawn(mesh: xr.Dataset, beam: Beam) -> Drawn:
    nodal = np.arange(beam.nodal_size).reshape(-1, N_DOFS)
    unit = sp.eye_array(beam.size, format="csr")
    translation, rotation = (sp.csr_array(unit[nodal[:, part].ravel()]) for part in (slice(0, 3), slice(3, 6)))
    cells = mesh["cell_node"].values
    radius, outline = _sections(mesh, beam)
    return Drawn(beam.node_position, cells, radius, translation, rotation, outline)


def _sections(mesh: xr.Dataset, beam: Beam) -> tuple[np.ndarray, np.ndarray | None]:
    """Radius of each cell, and outlines (cell, point, 3) where one is a rectangle: the section's own, as its constants
    say; a general section as a circle of its area."""
    types = set(mesh.attrs["section"].split())
    area, (torsion, about_y, about_z) = mesh["area"].values, mesh["second_moment"].values.T
    full = np.sqrt(area / np.pi)
    # of a tube, and of a circle: A = pi (R^2 - r^2) and I = A (R^2 + r^2) / 4
    radius = (
        np.sqrt(2.0 * about_y / area + 0.5 * area / np.pi) if "tube" in types and types <= {"circle", "tube"} else full
    )
    if "rectangle" not in types:
        return radius, None
    ratio = np.sqrt(about_z / about_y)
    width, height = np.sqrt(area * ratio), np.sqrt(area / ratio)
    square = np.isclose(rectangle_torsion(width, height), torsion, rtol=SAME) if len(types) > 1 else np.ones(len(area))
    half = 0.5 * np.stack([width, height], axis=1)
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    ring = full[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    flat = np.where(square[:, None, None].astype(bool), half[:, None, :] * _SQUARE, ring)
    return radius, flat @ beam.axes[:, 1:].T


KIND = Kind(
    build=beam_mesh.build,
    vtu=beam_mesh.as_vtu,
    assemble=assemble,
    words=lambda model, families, vectors: [name.partition("_")[0] for name in families],
    exact=closed_form.columns,
)
