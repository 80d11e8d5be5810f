"""Matrices in and out, also of lumped masses: a body that went through files is the body that it was."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.exchange import files
from flexclear.structure.fe.model import Model
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.kinds import kind
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError
from tests.analytic.beam_models import RECIPE
from tests.analytic.solid_models import block, build

MESHES = Path(__file__).parents[2] / "meshes"
THREE = {"stiffness": "stiffness.mtx", "mass": "mass.mtx", "unknowns": "unknowns.csv"}


def recipe(shape: dict[str, Any], frames: dict[str, Any], units: str = "m-kg-s") -> dict[str, Any]:
    shape = {"type": "matrices", "units": units} | shape
    return {"shape": shape, "frames": frames, "interfaces": list(frames)}


def model_of(mesh: xr.Dataset) -> Model:
    return of_mesh(mesh).assemble(mesh)


def same(found: xr.Dataset, expected: xr.Dataset) -> None:
    """Bundles that mean the same; signs of modes are left out by what is compared."""
    for name in ("mass", "first_moment", "second_moment", "frequency", "compliance_full", "compliance_share"):
        scale = np.abs(expected[name].values).max()
        # two assemblies of one model: eps times the condition of what is solved
        np.testing.assert_allclose(found[name].values, expected[name].values, rtol=1e-7, atol=1e-9 * scale)
    for name in ("modal_first_moment", "mode_mode_moment", "frame_translation_shape"):
        a, b = (np.abs(data[name].values) for data in (found, expected))
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-6 * b.max())


def test_a_beam_comes_back_from_an_npz(tmp_path: Path) -> None:
    """With its integrals, which a beam's mass matrix does not tell."""
    rod = kind.build(read_recipe(MESHES / "actuated_rod.toml"))
    files.write_npz(model_of(rod), tmp_path / "rod.npz")
    axes = {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}
    frames = {name: {"node": node, "axes": axes} for name, node in (("bottom", 1), ("top", 13))}
    again = build(recipe({"file": "rod.npz"}, frames), tmp_path)
    found = bundle.build(again, solve(again, "craig-bampton", 13))
    whole = bundle.build(rod, solve(rod, "craig-bampton", 13, ("bottom", "top")))
    same(found, whole.sel(frame=["bottom", "top"], frame_held=["bottom", "top"]))


@pytest.fixture(scope="module")
def solid() -> xr.Dataset:
    """Sides of three lengths: no equal frequencies."""
    return build(block("hex8", (4, 2, 2), (0.1, 0.02, 0.03), "mean"))


def faces(solid: xr.Dataset, table: files.Table) -> dict[str, Any]:
    """Frames on the means of both end faces, by the numbers of the table; equal weights."""
    return {
        name: {"nodes": np.unique(table.node[np.abs(table.position[:, 0] - x) < 1e-9]).tolist()}
        for name, x in (("bottom", 0.0), ("top", 0.1))
    }


@pytest.mark.parametrize(
    "units, length, mass, time",
    [
        ("m-kg-s", 1.0, 1.0, 1.0),
        ("mm-t-s", 1e3, 1e-3, 1.0),
        ("mm-kg-ms", 1e3, 1.0, 1e3),
        ("in-slinch-s", 1.0 / 0.0254, 0.0254 / 4.4482216152605, 1.0),
    ],
)
def test_a_solid_comes_back_from_matrix_market_in_any_units(
    tmp_path: Path, solid: xr.Dataset, units: str, length: float, mass: float, time: float
) -> None:
    """The volume integrals come from the mass matrix, which is the same along x, y and z."""
    model = model_of(solid)
    files.write_matrix_market(model, tmp_path)
    table = files.table(model)
    # SI numbers in other units: displacements only, so forces per length and masses
    for name, factor in (("stiffness", mass / time**2), ("mass", mass)):
        matrix = scipy.io.mmread(tmp_path / f"{name}.mtx")
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", factor * sp.coo_array(matrix), symmetry="symmetric", precision=17)
    lines = (tmp_path / "unknowns.csv").read_text().splitlines()
    scaled = [lines[0]]
    for line in lines[1:]:
        node, x, y, z, component = line.split(",")
        scaled.append(",".join([node, *(repr(length * float(v)) for v in (x, y, z)), component]))
    (tmp_path / "unknowns.csv").write_text("\n".join(scaled))
    again = build(recipe(THREE, faces(solid, table), units), tmp_path)
    found, whole = (bundle.build(mesh, solve(mesh, "free-free", 6)) for mesh in (again, solid))
    for name in ("mass", "first_moment", "second_moment", "frequency"):
        scale = np.abs(whole[name].values).max()
        np.testing.assert_allclose(found[name].values, whole[name].values, rtol=1e-9, atol=1e-12 * scale)
    pair = [np.abs(data["mode_mode_moment"].values) for data in (found, whole)]
    np.testing.assert_allclose(*pair, rtol=0.0, atol=1e-8)


def test_matrices_that_are_no_free_body_are_refused(tmp_path: Path, solid: xr.Dataset) -> None:
    model = model_of(solid)
    table = files.table(model)
    frames = faces(solid, table)
    held = sp.diags_array(np.where(np.arange(model.size) < 3, 1e9, 0.0))
    cases: dict[str, tuple[Any, Any, str]] = {
        "held": (model.stiffness + held, model.mass, "strains the body"),
        "massless": (model.stiffness, model.mass - 1.0 * sp.eye_array(model.size), "not positive definite"),
        "uneven": (
            model.stiffness,
            model.mass + sp.diags_array(np.where(table.component == 0, 1e-3, 0.0)),
            "differs for motion along x, y and z",
        ),
    }
    for name, (stiffness, mass, message) in cases.items():
        write(tmp_path, stiffness, mass, table)
        mesh = build(recipe(THREE, frames), tmp_path)
        with pytest.raises(InputError, match=message):
            model_of(mesh)
        assert name
    both = files.Table(
        np.concatenate([table.node, table.node + 1000]),
        np.tile(table.component, 2),
        np.vstack([table.position, table.position + 1.0]),
    )
    write(tmp_path, sp.block_diag([model.stiffness] * 2), sp.block_diag([model.mass] * 2), both)
    twice = build(recipe(THREE, frames), tmp_path)
    with pytest.raises(InputError, match="2 bodies without common nodes"):
        model_of(twice)
    write(tmp_path, sp.triu(model.stiffness), model.mass, table)
    with pytest.raises(InputError, match="stiffness matrix is not symmetric"):
        build(recipe(THREE, frames), tmp_path)


def write(folder: Path, stiffness: Any, mass: Any, table: files.Table) -> None:
    scipy.io.mmwrite(folder / "stiffness.mtx", sp.coo_array(stiffness), symmetry="general", precision=17)
    scipy.io.mmwrite(folder / "mass.mtx", sp.coo_array(mass), symmetry="general", precision=17)
    rows = [
        f"{n},{x!r},{y!r},{z!r},{files.COMPONENTS[c]}"
        for n, (x, y, z), c in zip(table.node, table.position.tolist(), table.component, strict=True)
    ]
    (folder / "unknowns.csv").write_text("\n".join([",".join(files.COLUMNS), *rows]) + "\n")


def test_files_that_do_not_fit_together_are_refused(tmp_path: Path, solid: xr.Dataset) -> None:
    model = model_of(solid)
    table = files.table(model)
    frames = faces(solid, table)
    write(tmp_path, model.stiffness, model.mass, table)
    for change, message in (
        ({"bottom": {"node": 1}}, "node 1 has no rx, ry, rz"),
        ({"bottom": {"node": 10**6}}, "unknown node 1000000"),
        ({"bottom": {"nodes": [1, 2]}}, "2 nodes cannot carry"),
        ({"bottom": {"node": 1, "nodes": [1]}}, "either `node` or `nodes`"),
    ):
        with pytest.raises(InputError, match=message):
            build(recipe(THREE, frames | change), tmp_path)
    with pytest.raises(InputError, match="either `file`, or both of"):
        build(recipe({"stiffness": "stiffness.mtx"}, frames), tmp_path)
    bare = recipe(THREE, frames)
    del bare["shape"]["units"]
    with pytest.raises(InputError, match=r"\[shape.units\]: is missing"):
        build(bare, tmp_path)
    lines = (tmp_path / "unknowns.csv").read_text().splitlines()
    # two nodes of one number
    (tmp_path / "unknowns.csv").write_text(
        "\n".join("1," + line[2:] if line.startswith("2,") else line for line in lines)
    )
    with pytest.raises(InputError, match="node 1 has 2 unknowns ux"):
        build(recipe(THREE, frames | {"bottom": {"nodes": [1, 3, 4]}}), tmp_path)
    (tmp_path / "unknowns.csv").write_text("\n".join(lines[:-1]))
    with pytest.raises(InputError, match=r"'stiffness.mtx' has the shape .* lines"):
        build(recipe(THREE, frames), tmp_path)
    for line, words in (("1,0,nan,0,ux", "line 2 has a position that is not finite"), ("1,0", "line 2 has too few")):
        (tmp_path / "unknowns.csv").write_text("\n".join([lines[0], line, *lines[2:]]))
        with pytest.raises(InputError, match=words):
            build(recipe(THREE, frames), tmp_path)
    (tmp_path / "unknowns.csv").write_text("node,x,y\n1,0,0\n")
    with pytest.raises(InputError, match="is not a table of unknowns"):
        build(recipe(THREE, frames), tmp_path)
    (tmp_path / "torn.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match="holds no matrices"):
        build(recipe({"file": "torn.npz"}, frames), tmp_path)


# Masses that are lumped at nodes that turn ---------------------------------------------------------------------------

NODES = 13
COMPONENTS = ("UX", "UY", "UZ", "RX", "RY", "RZ")
TABLE = {
    "interfaces": ["bottom", "top"],
    "shape": {
        "type": "matrices",
        "units": "m-kg-s",
        "stiffness": "k.mtx",
        "mass": "m.mtx",
        "unknowns": "u.csv",
    },
    "frames": {"bottom": {"node": 1}, "top": {"node": NODES}},
}


def points() -> tuple[np.ndarray, np.ndarray]:
    """Six mass points about a centre next to each node: masses (nodes, 6) and places from the node (nodes, 6, 3)."""
    random = np.random.default_rng(20190702)
    mass = np.repeat(random.uniform(0.01, 0.03, (NODES, 1)) / 6.0, 6, axis=1)
    axes = np.linalg.qr(random.normal(size=(NODES, 3, 3)))[0] * random.uniform(0.002, 0.01, (NODES, 1, 3))
    spokes = np.concatenate([axes, -axes], axis=2).transpose(0, 2, 1)
    return mass, 0.004 * random.normal(size=(NODES, 1, 3)) + spokes


def moved(r: np.ndarray) -> np.ndarray:
    """Motion of points at r from a node by the node's six unknowns, shape (..., 3, 6)."""
    x, y, z = np.moveaxis(r, -1, 0)
    zero = np.zeros_like(x)
    turn = np.stack([[zero, z, -y], [-z, zero, x], [y, -x, zero]])  # theta x r
    return np.concatenate([np.broadcast_to(np.eye(3), (*x.shape, 3, 3)), np.moveaxis(turn, (0, 1), (-2, -1))], axis=-1)


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """A rod's stiffness with these masses, through files."""
    folder = tmp_path_factory.mktemp("lumped")
    mass, r = points()
    motion = moved(r)
    write_rod(folder, sp.block_diag(list(np.einsum("np,npki,npkj->nij", mass, motion, motion))))
    return build(TABLE, folder)


def write_rod(folder: Path, mass: Any) -> None:
    rod = kind.build(RECIPE | {"elements": NODES - 1})
    model = of_mesh(rod).assemble(rod)
    scipy.io.mmwrite(folder / "k.mtx", sp.coo_array(model.stiffness), symmetry="symmetric", precision=17)
    scipy.io.mmwrite(folder / "m.mtx", sp.coo_array(mass), symmetry="general", precision=17)
    rows = [f"{n + 1},{x!r},0,0,{c}" for n, x in enumerate(place()[:, 0].tolist()) for c in COMPONENTS]
    (folder / "u.csv").write_text("\n".join(["node,x,y,z,component", *rows]))


def place() -> np.ndarray:
    """Nodes of the rod [m], shape (nodes, 3)."""
    return np.linspace(0.0, 0.24, NODES)[:, None] * [1.0, 0.0, 0.0]


def test_invariants_are_those_of_the_points(body: xr.Dataset) -> None:
    modes = solve(body, "craig-bampton", 14)
    data = bundle.build(body, modes)
    mass, r = points()
    m, X = mass.ravel(), (place()[:, None, :] + r).reshape(-1, 3)
    S = np.einsum("npki,nij->npkj", moved(r), modes["vector"].values.reshape(NODES, 6, -1)).reshape(len(m), 3, -1)
    expected = {
        "mass": m.sum(),
        "first_moment": m @ X,
        "second_moment": np.einsum("p,pk,pl->kl", m, X, X),
        "modal_first_moment": np.einsum("p,pkj->kj", m, S),
        "position_mode_moment": np.einsum("p,pk,plj->klj", m, X, S),
        "mode_mode_moment": np.einsum("p,pki,plj->klij", m, S, S, optimize=True),
    }
    for name, values in expected.items():
        # what is left of an offset in a matrix of 17 digits: 1e-16 of a mass next to 1e-3 of it
        np.testing.assert_allclose(data[name].values, values, rtol=0.0, atol=1e-12 * np.abs(values).max(), err_msg=name)
    np.testing.assert_allclose(data["modal_mass"].values, np.eye(14), atol=1e-11)


def test_a_consistent_mass_of_nodes_that_turn_is_refused(tmp_path: Path) -> None:
    rod = kind.build(RECIPE | {"elements": NODES - 1})
    write_rod(tmp_path, of_mesh(rod).assemble(rod).mass)
    given = build(TABLE, tmp_path)
    with pytest.raises(InputError, match=r"not lumped at the nodes.*\n.*lump the mass"):
        of_mesh(given).assemble(given)
