"""Bodies from files of other finite element programs, against the program itself, our own elements, and each other.

The files in `tests/reference/programs`: a block of one cell by CalculiX 2.20, and its matrices by pyNastran 1.4.1.
"""

import importlib.util
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse
import xarray as xr

import flexclear as fc
from flexclear.artifacts.compliance import table
from flexclear.commands.__main__ import main
from flexclear.structure.fe.exchange import ansys, files, nodes, programs
from flexclear.structure.kinds import kind
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.modes import bundle
from flexclear.structure.modes.basis import ModeRequest
from flexclear.structure.modes.imported import rigid_properties
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError
from tests.analytic.solid_models import ALUMINIUM, block, build

FILES = Path(__file__).parents[1] / "reference" / "programs"
CALCULIX = {"stiffness": "part.sti", "mass": "part.mas", "unknowns": "part.dof", "nodes": "part.inp"}
SMALL = {name: value.replace("part", "block") for name, value in CALCULIX.items()}
needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX: apt-get install calculix-ccx")


def has_reader() -> bool:
    try:
        return importlib.util.find_spec("ansys.mapdl.reader") is not None
    except ModuleNotFoundError:  # of a package above it
        return False


needs_ansys = pytest.mark.skipif(not has_reader(), reason="ansys-mapdl-reader: pip install -e '.[fe]'")


def recipe(shape: dict[str, Any], frames: dict[str, Any] | None = None, units: str = "mm-t-s") -> dict[str, Any]:
    frames = frames or {"start": {"set": "START"}, "end": {"set": "end"}}
    return {"shape": {"type": "matrices", "units": units} | shape, "frames": frames, "interfaces": list(frames)}


def dense(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    model = of_mesh(data).assemble(data)
    return model.stiffness.toarray(), model.mass.toarray()


# The program itself ------------------------------------------------------------------------------------------------


def deck(solid: xr.Dataset, step: str) -> str:
    """The mesh of quadratic bricks as an input file in mm, t and s: the nodes' order is VTK's."""
    X = solid["node_position"].values * 1e3
    rows = (", ".join(map(str, [k, *cell])) for k, cell in enumerate((solid["cell_node"].values + 1).tolist(), 1))
    cells = [", ".join(row.split(", ")[:10]) + ",\n" + ", ".join(row.split(", ")[10:]) for row in rows]
    lines = ["*NODE, NSET=ALL", *(f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(X.tolist(), 1))]
    lines += ["*ELEMENT, TYPE=C3D20, ELSET=BLOCK", *cells]
    for name, x in (("START", 0.0), ("END", 100.0)):
        lines += [f"*NSET, NSET={name}", *(f"{k}," for k in np.flatnonzero(np.abs(X[:, 0] - x) < 1e-6) + 1)]
    E, rho = ALUMINIUM["youngs_modulus"] * 1e-6, ALUMINIUM["density"] * 1e-12
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{E!r}, {ALUMINIUM['poisson']}", "*DENSITY", repr(rho)]
    lines += ["*SOLID SECTION, ELSET=BLOCK, MATERIAL=M", "*STEP", step, "16", "*END STEP"]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def solid() -> xr.Dataset:
    """A box with sides of three lengths, in quadratic bricks."""
    return build(block("hex20", (4, 2, 2), (0.1, 0.02, 0.03), "mean"))


@pytest.fixture(scope="module")
def part(solid: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which CalculiX wrote matrices of that mesh, and the frequencies that it computes itself."""
    folder = tmp_path_factory.mktemp("calculix")
    for name, step in (("part", "*FREQUENCY, SOLVER=MATRIXSTORAGE"), ("free", "*FREQUENCY")):
        (folder / f"{name}.inp").write_text(deck(solid, step))
        subprocess.run(["ccx", name], cwd=folder, check=True, capture_output=True, timeout=300)
    return folder


@needs_ccx
def test_calculix_and_this_program_have_the_same_body(part: Path, solid: xr.Dataset) -> None:
    found = kind.build(recipe(CALCULIX | {"listing": "free.dat"}), part)
    modes = solve(found, "free-free", 10)
    # its listing has seven digits, and its iteration varies by 2.4e-6 with the number of its threads (1, 2, 4)
    np.testing.assert_allclose(modes["frequency"], modes["listed_frequency"], rtol=3e-5)
    # quadratic bricks with straight sides: both programs integrate them exactly; fourteen digits in its files
    np.testing.assert_allclose(modes["frequency"], solve(solid, "free-free", 10)["frequency"], rtol=1e-9)
    data = bundle.build(found, modes)
    whole = bundle.build(solid, solve(solid, "free-free", 10))
    for name in ("mass", "first_moment", "second_moment"):
        scale = np.abs(whole[name].values).max()
        np.testing.assert_allclose(data[name], whole[name], rtol=0.0, atol=1e-11 * scale)
    np.testing.assert_allclose(data["mass"], 2740.0 * 0.1 * 0.02 * 0.03, rtol=1e-12)
    text = table(data)
    assert "mass 0.1644 kg (0.1644 kg in the program's file)" in text
    assert "symmetric to 0" in text
    assert "frequencies in the listing, Hz: " in text


@needs_ccx
@pytest.mark.parametrize("units", ["m-kg-s", "mm-kg-ms", "in-slinch-s"])
def test_files_in_other_units_are_refused(part: Path, units: str) -> None:
    with pytest.raises(InputError, match=r'kg/m3 and a speed of sound.*\n.*units = "mm-t-s"'):
        kind.build(recipe(CALCULIX, units=units), part)


@needs_ccx
def test_a_listing_of_another_model_is_refused(part: Path, tmp_path: Path) -> None:
    text = (part / "free.dat").read_text().split("P A R T")[0]
    lines = text.splitlines()
    row = next(k for k, line in enumerate(lines) if line.split()[:1] == ["7"])
    words = lines[row].split()
    lines[row] = "  ".join([*words[:3], f"{1.05 * float(words[3]):.7E}", words[4]])
    (tmp_path / "free.dat").write_text("\n".join(lines))
    mesh = kind.build(recipe(CALCULIX | {"listing": str(tmp_path / "free.dat")}), part)
    with pytest.raises(InputError, match=r"by the matrices and .* by the program's file"):
        solve(mesh, "free-free", 4)


def craig_bampton(K: np.ndarray, M: np.ndarray, held: np.ndarray, count: int) -> np.ndarray:
    """Constraint modes of the held unknowns and the lowest modes with these held, shapes (n, held + count)."""
    inner = np.setdiff1d(np.arange(len(K)), held)
    shapes = np.zeros((len(K), len(held) + count))
    shapes[held, range(len(held))] = 1.0
    shapes[inner, : len(held)] = -np.linalg.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, held)])
    _, modes = scipy.linalg.eigh(K[np.ix_(inner, inner)], M[np.ix_(inner, inner)], subset_by_index=[0, count - 1])
    shapes[inner, len(held) :] = modes
    return shapes


def test_a_given_craig_bampton_basis_is_taken_as_it_is(tmp_path: Path) -> None:
    """The free body's frequencies in the basis are those of the matrices that SciPy reduces with it."""
    data = build(block("hex8", (4, 2, 2), (0.1, 0.02, 0.03), "mean"))
    model = of_mesh(data).assemble(data)
    files.write_matrix_market(model, tmp_path)
    rows = files.table(model)
    ends = {name: np.unique(rows.node[np.abs(rows.position[:, 0] - x) < 1e-9]) for name, x in (("a", 0.0), ("b", 0.1))}
    held = np.flatnonzero(np.isin(rows.node, np.concatenate(list(ends.values()))))
    K, M = model.stiffness.toarray(), model.mass.toarray()
    T = craig_bampton(K, M, held, 6)
    scipy.io.mmwrite(tmp_path / "basis.mtx", T, precision=17)
    shape = {"stiffness": "stiffness.mtx", "mass": "mass.mtx", "unknowns": "unknowns.csv", "basis": "basis.mtx"}
    frames = {name: {"nodes": numbers.tolist()} for name, numbers in ends.items()}
    found = kind.build(recipe(shape, frames, "m-kg-s"), tmp_path)
    modes = solve(found, "given")
    assert modes.sizes["mode"] == T.shape[1] - 6
    reduced = bundle.build(found, modes)
    # with the six rigid motions the coordinates span the given shapes again: the same free body
    rigid, vectors = of_mesh(found).assemble(found).rigid, modes["vector"].values
    again = np.hstack([rigid / np.linalg.norm(rigid, axis=0), vectors / np.linalg.norm(vectors, axis=0)])
    free = [np.sqrt(np.abs(scipy.linalg.eigvalsh(B.T @ K @ B, B.T @ M @ B))[6:]) for B in (T, again)]
    np.testing.assert_allclose(free[1], free[0], rtol=1e-8)
    moved = np.abs(reduced["frame_translation_shape"].values).max(axis=(1, 2))
    assert moved[0] < 1e-9 * moved[1]
    with pytest.raises(InputError, match="taken as they are"):
        solve(found, "given", requested=ModeRequest(up_to=1e4))
    with pytest.raises(InputError, match="the recipe gives no shapes"):
        solve(data, "given")


def test_a_stiffness_of_negative_energy_is_refused(tmp_path: Path) -> None:
    """Symmetric, and rigid motions do not strain it."""
    model = of_mesh(data := build(block("hex8", (2, 1, 1), (0.1, 0.02, 0.03), "mean"))).assemble(data)
    files.write_matrix_market(model, tmp_path)
    K, M = model.stiffness.toarray(), model.mass.toarray()
    values, modes = scipy.linalg.eigh(K, M)
    push = M @ modes[:, 8]
    changed = scipy.sparse.coo_array(K - 2.0 * values[8] * np.outer(push, push))
    scipy.io.mmwrite(tmp_path / "stiffness.mtx", changed, symmetry="symmetric", precision=17)
    shape = {"stiffness": "stiffness.mtx", "mass": "mass.mtx", "unknowns": "unknowns.csv"}
    frames = {"all": {"nodes": np.unique(files.table(model).node).tolist()}}
    with pytest.raises(InputError, match="no or negative energy"):
        solve(kind.build(recipe(shape, frames, "m-kg-s"), tmp_path), "free-free", 2)


LISTINGS = {
    "part.dat": (
        "                              E I G E N V A L U E    O U T P U T\n\n"
        " MODE NO      EIGENVALUE              FREQUENCY         GENERALIZED MASS   COMPOSITE MODAL DAMPING\n"
        "                             (RAD/TIME)   (CYCLES/TIME)\n\n"
        "       1      3.94784E+05   628.32        100.00        1.0000        0.0000\n"
        "       2      1.57914E+06   1256.6        200.00        1.0000        0.0000\n\n"
        "                              P A R T I C I P A T I O N   F A C T O R S\n       3  1. 2. 3. 4.\n"
    ),
    "part.f06": (
        "                                              R E A L   E I G E N V A L U E S\n"
        "   MODE    EXTRACTION      EIGENVALUE            RADIANS             CYCLES            GENERALIZED\n"
        "    NO.       ORDER                                                                       MASS\n"
        "        1         1        3.947842E+05        6.283185E+02        1.000000E+02        1.000000E+00\n"
        "        2         2        1.579137E+06        1.256637E+03        2.000000E+02        1.000000E+00\n"
    ),
}


@pytest.mark.parametrize("name", LISTINGS)
def test_listings_of_abaqus_and_nastran_state_cycles(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(LISTINGS[name])
    found, mass = programs.read_listing(tmp_path / name, "recipe")
    assert (found.tolist(), mass) == ([100.0, 200.0], None)
    (tmp_path / name).write_text(LISTINGS[name][:60])
    with pytest.raises(InputError, match="no table of finite frequencies"):
        programs.read_listing(tmp_path / name, "recipe")


# Files of all programs hold the same block ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small() -> xr.Dataset:
    """The block of one cell in the files of CalculiX."""
    return kind.build(recipe(SMALL), FILES)


def unknowns(folder: Path) -> str:
    """A table of unknowns of the block's files, in its folder."""
    deck = nodes.read(FILES / "block.inp", "deck")
    rows = [line.split(".") for line in (FILES / "block.dof").read_text().split()]
    lines = [",".join([n, *map(repr, deck.position[int(n)]), ("ux", "uy", "uz")[int(k) - 1]]) for n, k in rows]
    (folder / "unknowns.csv").write_text("\n".join(["node,x,y,z,component", *lines]))
    return str(folder / "unknowns.csv")


def abaqus(folder: Path, labelled: bool, triangle: Callable[[np.ndarray], np.ndarray] | None) -> dict[str, str]:
    """Files as `*MATRIX OUTPUT` writes them: labels and directions (one triangle), or numbers of rows (both)."""
    shape = (
        {"nodes": str(FILES / "block.inp")}
        if labelled
        else {"unknowns": unknowns(folder), "nodes": str(FILES / "block.inp")}
    )
    rows = [line.replace(".", ",") for line in (FILES / "block.dof").read_text().split()]
    for name, file in (("stiffness", "block.sti"), ("mass", "block.mas")):
        entries = np.loadtxt(FILES / file)
        matrix = np.zeros((24, 24))
        i, j = entries[:, :2].astype(int).T - 1
        matrix[i, j] = matrix[j, i] = entries[:, 2]
        matrix = matrix if triangle is None else triangle(matrix)
        label = rows if labelled else [str(k + 1) for k in range(24)]
        sep = "," if labelled else " "
        lines = [f"{label[r]}{sep}{label[c]}{sep} {matrix[r, c]:.15e}" for r, c in np.argwhere(matrix)]
        (folder / f"{name}.mtx").write_text("\n".join(lines) + "\n")
        shape[name] = str(folder / f"{name}.mtx")
    return shape


FORMS: dict[str, Callable[[Path], dict[str, str]]] = {
    "punch": lambda folder: {"file": "block.pch", "nodes": "block.inp"},
    "output4": lambda folder: {
        "stiffness": "stiffness.op4",
        "mass": "mass.op4",
        "unknowns": unknowns(folder),
        "nodes": "block.inp",
    },
    "abaqus lower": lambda folder: abaqus(folder, True, np.tril),
    "abaqus upper": lambda folder: abaqus(folder, True, np.triu),
    "abaqus coordinate": lambda folder: abaqus(folder, False, None),
    "abaqus coordinate lower": lambda folder: abaqus(folder, False, np.tril),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_holds_the_same_matrices(form: str, small: xr.Dataset, tmp_path: Path) -> None:
    found = kind.build(recipe(FORMS[form](tmp_path)), FILES)
    for a, b in zip(dense(found), dense(small), strict=True):
        # pyNastran writes ten digits of negative numbers in a punch file
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9 * np.abs(b).max())
    mass, centre, inertia = rigid_properties(of_mesh(found).assemble(found))
    m, (a, b, c) = 7800.0 * 0.06 * 0.015 * 0.01, (0.06, 0.015, 0.01)
    np.testing.assert_allclose(mass, m, rtol=1e-10)
    np.testing.assert_allclose(centre, [0.03, 0.0075, 0.005], rtol=1e-9)
    # a cell of eight nodes bends no side: its inertia is the box's
    exact = m / 12.0 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    np.testing.assert_allclose(np.diag(inertia), exact, rtol=1e-9)


def test_hdf5_holds_the_arrays_of_an_npz_in_either_byte_order(small: xr.Dataset, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    model = of_mesh(small).assemble(small)
    files.write_npz(model, tmp_path / "body.npz")
    ends = ("body.npz", "body.h5", "swapped.h5")
    for name, order in zip(ends[1:], "=>", strict=True):
        with np.load(tmp_path / "body.npz") as data, h5py.File(tmp_path / name, "w") as file:
            for key in data.files:
                file[key] = data[key].astype(data[key].dtype.newbyteorder(order))
    frames = {"all": {"nodes": np.unique(files.table(model).node).tolist()}}
    made = [kind.build(recipe({"file": name}, frames, "m-kg-s"), tmp_path) for name in ends]
    xr.testing.assert_identical(made[0], made[1])
    xr.testing.assert_identical(made[0], made[2])


GRIDS = (
    "$ a comment",
    "GRID".ljust(8) + "1".rjust(8) + " " * 8 + "0.".rjust(8) + "0.".rjust(8) + "1.5-3".rjust(8),
    "GRID*".ljust(8) + "2".rjust(16) + " " * 16 + "1.000000D+01".rjust(16) + "0.".rjust(16),
    "*".ljust(8) + "-2.".rjust(16),
    "GRID,3,,4.,5.,6.",
    "SET1,7,3,1",
    "SET1".ljust(8) + "8".rjust(8) + "2".rjust(8) + "THRU".rjust(8) + "9".rjust(8),
)


def test_grids_are_read_in_all_three_forms(tmp_path: Path) -> None:
    (tmp_path / "m.bdf").write_text("\n".join(GRIDS))
    found = nodes.read(tmp_path / "m.bdf", "deck")
    assert {name: numbers.tolist() for name, numbers in found.sets.items()} == {"7": [1, 3], "8": [2, 3]}
    assert found.position == {1: (0.0, 0.0, 1.5e-3), 2: (10.0, 0.0, -2.0), 3: (4.0, 5.0, 6.0)}


@needs_ansys
def test_files_of_ansys_that_the_reader_ships() -> None:
    """Its bar is clamped: away from the clamp no rigid motion strains the rows, in positions of its deck."""
    from ansys.mapdl.reader import examples

    deck = nodes.read(Path(examples.hexarchivefile), "deck")
    assert (len(deck.position), len(deck.sets["NCOMP2"])) == (321, 98)
    data = ansys.arrays(Path(examples.fullfile), "full")
    K = scipy.sparse.coo_array(
        (data["stiffness_value"], (data["stiffness_row"], data["stiffness_column"])), shape=(963, 963)
    )
    K = (K + scipy.sparse.triu(K, 1).T).tocsr()
    rigid = np.zeros((963, 6))
    for row, (node, k) in enumerate(zip(data["node"], data["component"], strict=True)):
        rigid[row, k] = 1.0
        rigid[row, 3:] = np.cross(np.eye(3), deck.position[int(node)])[:, k]
    z = np.array([deck.position[int(node)][2] for node in data["node"]])
    left = np.abs(K @ rigid).max(axis=1) / np.abs(K).max()
    assert left[np.abs(z - z.min()) > 2.0].max() < 1e-12 or left[np.abs(z - z.max()) > 2.0].max() < 1e-12
    with pytest.raises(InputError, match="constraints hold 63 unknowns"):
        programs.read(Path(examples.fullfile), "K", "recipe")


def text(name: str) -> str:
    return (FILES / name).read_text()


def cut(name: str) -> str:
    return text(name)[: len(text(name)) * 2 // 3]


# The command ----------------------------------------------------------------------------------------------------------


SCENE = """title = "A block from another program"
time.end = 1e-3
[body.block]
type = "flexible"
mesh = "block.toml"
modes = { reference = "free-free", count = 4 }
"""
RECIPE = """interfaces = ["start", "end"]
[shape]
type = "matrices"
units = "mm-t-s"
stiffness = "block.sti"
mass = "block.mas"
unknowns = "block.dof"
nodes = "block.inp"
[frames.start]
set = "START"
[frames.end]
set = "END"
"""


def test_the_command_prints_the_body_and_refuses_damage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    for file in SMALL.values():
        shutil.copy(FILES / file, tmp_path / file)
    (tmp_path / "s.toml").write_text(SCENE)
    (tmp_path / "block.toml").write_text(RECIPE)
    assert main(["run", str(tmp_path / "s.toml"), "--to", "bundle"]) == 0
    assert "mass 0.0702 kg" in capsys.readouterr().out
    (tmp_path / "block.mas").write_text(cut("block.mas"))
    assert main(["run", str(tmp_path / "s.toml"), "--to", "bundle"]) == 2
    told = capsys.readouterr().err
    assert "'block.mas' has no diagonal entry in row" in told or "'block.mas' holds no matrix" in told


# Loads for the program ---------------------------------------------------------------------------------------------

CLAMPED = """title = "clamped block"
time.end = "1 s"
start.at = "equilibrium"
output.interval = "0.5 s"
body.ground = { type = "ground", frames.wall = {} }
body.part = { type = "flexible", mesh = "part.toml", modes = { reference = "craig-bampton", up_to = "20 kHz" } }
joint.wall = { type = "fixed", between = ["ground.wall", "part.start"] }
load.push = { type = "point-force", frame = "part.end", force = ["-5 N", "3 N", "-2 N"] }
load.twist = { type = "point-torque", frame = "part.end", torque = ["0.2 N m", 0, "0.1 N m"] }
"""


@needs_ccx
def test_calculix_bends_the_body_under_exported_loads_as_this_program_does(
    part: Path, solid: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Loads on both ends balance, so a statically determinate support has no reaction; START's mean motion is zero."""
    monkeypatch.chdir(tmp_path)
    lines = [f'{name} = "{part / value}"' for name, value in CALCULIX.items()]
    frames = "".join(f'[frames.{name}]\nset = "{name.upper()}"\n' for name in ("start", "end"))
    head = 'interfaces = ["start", "end"]\n[shape]\ntype = "matrices"\nunits = "mm-t-s"\n'
    Path("part.toml").write_text("\n".join([head, *lines, frames]))
    Path("clamped.toml").write_text(CLAMPED)
    assert main(["export", "-q", "clamped.toml", "--format", "loads", "--at", "0", "--out", "loads.inp"]) == 0
    assert "loads on start, end of part at 0 s, in mm-t-s" in capsys.readouterr().out
    X = solid["node_position"].values * 1e3
    nodes = {name: np.flatnonzero(np.abs(X[:, 0] - x) < 1e-6) for name, x in (("START", 0.0), ("END", 100.0))}
    places = ((50.0, 0.0, 0.0), (50.0, 20.0, 0.0), (50.0, 0.0, 30.0))  # away from the loads
    corner, along, across = (int(np.argmin(np.abs(X - at).sum(axis=1))) + 1 for at in places)
    held = f"*NSET, NSET=HELD\n{corner}, {along}, {across}\n"
    held += f"*BOUNDARY\n{corner}, 1, 3\n{along}, 1\n{along}, 3\n{across}, 1\n"
    text = deck(solid, "*STATIC").partition("*STEP")[0]
    prints = "".join(f"*NODE PRINT, NSET={name}\nU\n" for name in nodes) + "*NODE PRINT, NSET=HELD\nRF\n"
    Path("static.inp").write_text(f"{text}{held}*STEP\n*STATIC\n*INCLUDE, INPUT=loads.inp\n{prints}*END STEP\n")
    subprocess.run(["ccx", "static"], check=True, capture_output=True, timeout=300)
    found = [block.splitlines()[2:] for block in Path("static.dat").read_text().split("for set")[1:]]
    rows = [[line.split() for line in block if len(line.split()) == 4] for block in found]
    start, end, reactions = ({int(k): np.array(values, float) for k, *values in block} for block in rows)
    assert max(np.abs(r).max() for r in reactions.values()) < 2e-3 * 5.0  # moments of loads on displaced ends

    def motion(moved: dict[int, np.ndarray], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Centre, mean displacement and rotation of a set of nodes, by least squares."""
        x, u = X[nodes[name]], np.array([moved[k + 1] for k in nodes[name]])
        r, shift = x - x.mean(axis=0), u.mean(axis=0)
        spin = np.vstack([[[0.0, c, -b], [-c, 0.0, a], [b, -a, 0.0]] for a, b, c in r])
        return x.mean(axis=0), shift, np.linalg.lstsq(spin, (u - shift).ravel(), rcond=None)[0]

    (at, shift, turn), (tip, moved, _) = motion(start, "START"), motion(end, "END")
    theirs = moved - shift - np.cross(turn, tip - at)
    ends = fc.run("clamped.toml")["frame_position"].sel(frame=["part.start", "part.end"]).values[0]
    ours = 1e3 * (ends[1] - ends[0]) - (tip - at)
    # seven digits in its listing; loads act on the displaced end here, by 1e-4 of the length
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=3e-4 * np.abs(ours).max())
