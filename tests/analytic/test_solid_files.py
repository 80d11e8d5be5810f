"""Meshes from files: regions by name in several formats, units as declared, and refusals."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr

from flexclear.structure.fe.solid import geometry
from flexclear.structure.fe.solid.elements import ELEMENTS
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError
from tests.analytic.solid_models import ALUMINIUM, build

STEEL = {"density": 7800.0, "youngs_modulus": 2.1e11, "poisson": 0.3}
SIZE = (0.1, 0.02, 0.03)


def box(element: str) -> tuple[np.ndarray, np.ndarray]:
    """A box of 4 x 1 x 1 cells, or 24 tetrahedra for each."""
    return geometry.cut_cells(*geometry.box_cells(SIZE, (4, 1, 1)), element)


def recipe(file: str, unit: str = "mm", **changes: Any) -> dict[str, Any]:
    planes = {name: {"point": [x, 0, 0], "normal": [1, 0, 0]} for name, x in (("bottom", 0.0), ("top", 0.1))}
    material = {} if "materials" in changes else {"material": ALUMINIUM}
    return {
        "interfaces": ["bottom", "top"],
        "shape": {"type": "mesh-file", "file": file, "length_unit": unit},
        "frames": {name: {"on": {"plane": plane}, "tie": "rigid"} for name, plane in planes.items()},
        **material,
        **changes,
    }


@cache
def reference(element: str) -> xr.Dataset:
    """The same box, made here."""
    made = recipe("")
    made["shape"] = {"type": "block", "size": list(SIZE), "cells": [4, 1, 1], "element": element}
    return solve(build(made), "craig-bampton", 6)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("suffix", ["vtu", "inp", "msh"])
def test_a_mesh_in_a_file_is_the_mesh_made_here(tmp_path: Path, element: str, suffix: str) -> None:
    if suffix == "inp" and element == "hex27":
        suffix = "vtk"  # Abaqus has no such element
    nodes, cells = box(element)
    mesh = meshio.Mesh(1e3 * nodes, [(ELEMENTS[element].cell, cells)])
    options = {"file_format": "gmsh", "binary": True} if suffix == "msh" else {}
    mesh.write(tmp_path / f"box.{suffix}", **options)
    found = solve(build(recipe(f"box.{suffix}"), tmp_path), "craig-bampton", 6)
    # text formats keep 16 digits; conditions of the stiffness are about 1e4
    np.testing.assert_allclose(found["frequency"], reference(element)["frequency"], rtol=1e-9)


def two_halves(path: Path, **options: Any) -> None:
    """A Gmsh file with physical names: volumes `left` and `right`, the face `foot` with the tag of a volume."""
    nodes, cells = box("hex8")
    left = nodes[cells].mean(axis=1)[:, 0] < 0.05
    foot = cells[np.argmin(nodes[cells].mean(axis=1)[:, 0])][[0, 4, 7, 3]]
    mesh = meshio.Mesh(
        1e3 * nodes,
        [("hexahedron", cells), ("quad", foot[None])],
        cell_data={
            "gmsh:physical": [np.where(left, 1, 2), np.array([1])],
            "gmsh:geometrical": [np.where(left, 1, 2), np.array([1])],
        },
        field_data={"left": np.array([1, 3]), "right": np.array([2, 3]), "foot": np.array([1, 2])},
    )
    mesh.write(path, file_format="gmsh22", **options)


def test_materials_and_frames_by_physical_names(tmp_path: Path) -> None:
    two_halves(tmp_path / "box.msh", binary=True)
    frames = {"bottom": {"on": {"region": "foot"}, "tie": "mean"}}
    table = recipe("box.msh", frames=frames, interfaces=["bottom"], materials={"left": STEEL, "right": ALUMINIUM})
    mesh = build(table, tmp_path)
    assert mesh.sizes["tie"] == 4
    np.testing.assert_allclose(mesh["frame_position"].values, [[0.0, 0.0, 0.0]], atol=1e-15)
    density = mesh["density"].values[mesh["cell_region"].values]
    x = mesh["node_position"].values[mesh["cell_node"].values].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(density, np.where(x < 0.05, 7800.0, 2740.0))


def test_gmsh_4_names_curves_and_points_as_well_as_regions(tmp_path: Path) -> None:
    """A file as Gmsh 4.15 writes it, whose volume is bounded by surfaces with higher numbers than it has cells."""
    nodes, cells = geometry.cut_cells(*geometry.box_cells(SIZE, (1, 1, 1)), "hex8")
    foot = np.flatnonzero(nodes[:, 0] < 1e-9)[[0, 1, 3, 2]]
    entities = ["0 0 1 1", "5 0 -10 -15 0 10 15 1 1 0", "1 0 -10 -15 100 10 15 1 2 2 5 -26"]
    places = [f"{k + 1}" for k in range(8)] + [" ".join(map(repr, (1e3 * x).tolist())) for x in nodes]
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 1 "foot"', '3 2 "body"']
    lines += ["$EndPhysicalNames", "$Entities", *entities, "$EndEntities"]
    lines += ["$Nodes", "1 8 1 8", "3 1 0 8", *places, "$EndNodes", "$Elements", "2 2 1 2"]
    for entity, tag, cell in (("2 5 3 1", 1, foot), ("3 1 5 1", 2, cells[0])):
        lines += [entity, " ".join(map(str, [tag, *(cell + 1)]))]
    (tmp_path / "box.msh").write_text("\n".join([*lines, "$EndElements", ""]))
    frames = {"bottom": {"on": {"region": "foot"}, "tie": "mean"}}
    mesh = build(recipe("box.msh", frames=frames, interfaces=["bottom"]), tmp_path)
    np.testing.assert_allclose(mesh["node_position"].values[mesh["tie_node"].values], nodes[np.sort(foot)], atol=1e-15)


def test_a_number_of_faces_and_of_cells_names_the_faces_to_a_frame(tmp_path: Path) -> None:
    """Nastran files without names: shells and solids may have the same property number."""
    nodes, cells = box("hex8")
    foot = cells[np.argmin(nodes[cells].mean(axis=1)[:, 0])][[0, 4, 7, 3]]
    ref = {"nastran:ref": [np.ones(4, dtype=int), np.ones(1, dtype=int)]}
    meshio.Mesh(1e3 * nodes, [("hexahedron", cells), ("quad", foot[None])], cell_data=ref).write(tmp_path / "box.bdf")
    frames = {"bottom": {"on": {"region": "nastran:ref=1"}, "tie": "rigid"}}
    table = recipe("box.bdf", frames=frames, interfaces=["bottom"], materials={"nastran:ref=1": STEEL})
    mesh = build(table, tmp_path)
    assert sorted(mesh["tie_node"].values) == sorted(foot)
    # the four cells alone: every node belongs to the region, and none is left to deform
    meshio.Mesh(1e3 * nodes, [("hexahedron", cells)], cell_data={"nastran:ref": ref["nastran:ref"][:1]}).write(
        tmp_path / "box.bdf"
    )
    with pytest.raises(InputError, match="rigid ties take every node"):
        build(table, tmp_path)


def test_a_number_of_each_cell_is_no_region(tmp_path: Path) -> None:
    nodes, cells = geometry.cut_cells(*geometry.box_cells(SIZE, (11, 10, 10)), "hex8")
    data = {"id": [np.arange(len(cells))], "part": [np.arange(len(cells)) // 550]}
    meshio.Mesh(1e3 * nodes, [("hexahedron", cells)], cell_data=data).write(tmp_path / "box.vtu")
    frames = {"bottom": {"on": {"region": "id=5"}, "tie": "mean"}}
    with pytest.raises(InputError, match=r"no region is called 'id=5'\n.*known: part=0, part=1$"):
        build(recipe("box.vtu", frames=frames, interfaces=["bottom"]), tmp_path)


def test_materials_must_cover_every_cell_once(tmp_path: Path) -> None:
    two_halves(tmp_path / "box.msh", binary=True)
    table = recipe("box.msh", materials={"left": STEEL})
    with pytest.raises(InputError, match="2 of 4 cells belong to none of"):
        build(table, tmp_path)
    table["materials"] = {"left": STEEL, "right": STEEL, "gmsh:physical=1": ALUMINIUM}
    with pytest.raises(InputError, match="the regions 'left' and 'gmsh:physical=1' share cells"):
        build(table, tmp_path)


def test_node_and_element_sets_of_abaqus(tmp_path: Path) -> None:
    nodes, cells = box("tet10")
    lines = ["*NODE"] + [f"{k + 1}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(1e3 * nodes)]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=ALL"]
    lines += [", ".join(map(str, [k + 1, *(cell + 1)])) for k, cell in enumerate(cells)]
    foot = np.flatnonzero(nodes[:, 0] < 1e-9) + 1
    lines += ["*NSET, NSET=FOOT", ", ".join(map(str, foot[:8])) + ",", ", ".join(map(str, foot[8:]))]
    (tmp_path / "box.inp").write_text("\n".join(lines) + "\n")
    frames = {"bottom": {"on": {"region": "FOOT"}, "tie": "rigid"}, "top": recipe("")["frames"]["top"]}
    table = recipe("box.inp", frames=frames, materials={"ALL": ALUMINIUM})
    found = solve(build(table, tmp_path), "craig-bampton", 6)
    np.testing.assert_allclose(found["frequency"], reference("tet10")["frequency"], rtol=1e-9)


def test_units_are_those_declared(tmp_path: Path) -> None:
    nodes, cells = box("hex8")
    meshio.Mesh(nodes / 0.0254, [("hexahedron", cells)]).write(tmp_path / "box.vtu")
    mesh = build(recipe("box.vtu", "in"), tmp_path)
    np.testing.assert_allclose(np.ptp(mesh["node_position"].values, axis=0), SIZE, rtol=1e-14)


#: a cube, as VTK's text format has it
ONE_CELL = "\n".join(
    [
        "# vtk DataFile Version 3.0",
        "cube",
        "ASCII",
        "DATASET UNSTRUCTURED_GRID",
        "POINTS 8 double",
        "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1",
        "CELLS 1 9",
        "8 0 1 2 3 4 5 6 7",
        "CELL_TYPES 1",
        "12\n",
    ]
)


def write(path: Path, cells: list[tuple[str, np.ndarray]], nodes: np.ndarray) -> None:
    meshio.Mesh(1e3 * nodes, cells).write(path)


def test_files_that_hold_no_body_are_refused(tmp_path: Path) -> None:
    nodes, cells = box("hex8")
    tets = geometry.cut_cells(*geometry.box_cells(SIZE, (1, 1, 1)), "tet4")
    write(tmp_path / "mixed.vtu", [("hexahedron", cells), ("tetra", tets[1])], np.vstack([nodes, tets[0]]))
    write(tmp_path / "shell.vtu", [("quad", cells[:, :4])], nodes)
    write(tmp_path / "wedge.vtu", [("wedge", cells[:, :6])], nodes)
    write(tmp_path / "twice.vtu", [("hexahedron", np.vstack([cells, cells[:1]]))], nodes)
    write(tmp_path / "hole.vtu", [("hexahedron", cells)], np.where(nodes == nodes.max(), np.nan, nodes))
    (tmp_path / "beyond.vtk").write_text(ONE_CELL.replace("8 0 1", "8 9 1"))
    (tmp_path / "membrane.inp").write_text("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=M3D9\n1, 1\n")
    (tmp_path / "torn.vtu").write_text("<VTKFile")
    (tmp_path / "what.ever").write_text("")
    for name, message in (
        ("mixed.vtu", r"mixes solid cells: 4 hexahedron, 24 tetra"),
        ("shell.vtu", r"no solid cells but 4 quad"),
        ("wedge.vtu", r"cells of type wedge are not supported"),
        ("twice.vtu", r"cells overlap: 1 duplicate cells"),
        ("hole.vtu", r"not three finite numbers"),
        ("beyond.vtk", r"refer to nodes beyond the 8 of"),
        ("membrane.inp", r"cannot read 'membrane.inp': .*M3D9"),
        ("torn.vtu", r"meshio cannot read 'torn.vtu'"),
        ("what.ever", r"meshio cannot read 'what.ever'"),
        ("nowhere.vtu", r"there is no file .*nowhere.vtu"),
    ):
        with pytest.raises(InputError, match=message):
            build(recipe(name), tmp_path)


@pytest.mark.skipif(find_spec("h5py") is not None, reason="with h5py MED is read")
def test_a_format_in_hdf5_names_the_library_that_it_needs(tmp_path: Path) -> None:
    (tmp_path / "code_aster.med").write_bytes(b"\x89HDF")
    with pytest.raises(InputError, match=r"No module named 'h5py'\n.*pip install 'flexclear\[med\]'"):
        build(recipe("code_aster.med"), tmp_path)


def test_a_unit_must_be_declared() -> None:
    table = recipe("box.vtu")
    del table["shape"]["length_unit"]
    with pytest.raises(InputError, match=r"\[shape.length_unit\]: is missing"):
        build(table)
    with pytest.raises(InputError, match=r"\[shape.length_unit\]"):
        build(recipe("box.vtu", "furlong"))
