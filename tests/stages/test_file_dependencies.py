"""What a task opens is in its key, whatever opens it and whatever it is called."""

from __future__ import annotations

import shutil
import sys
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest

from flexclear.artifacts.store import Record, Store
from flexclear.scene.load import load_scene
from flexclear.stages import meshing, simulation
from flexclear.stages.graph import Graph
from flexclear.structure.fe.exchange import files
from flexclear.structure.kinds.kind import of_mesh
from flexclear.system.errors import InputError, ResourceError
from flexclear.system.external_files import companion_files, read_mesh
from flexclear.system.progress import silent
from flexclear.workflow.execute import execute, find, states
from flexclear.workflow.fingerprint import TREE, Sources
from flexclear.workflow.task import Task, facts
from tests.analytic.solid_models import block, build

SCENE = """
title = "A body given by files"
[time]
end = "1 ms"
[body.block]
type = "flexible"
mesh = "body.toml"
modes = { reference = "free-free", count = 6 }
pose = {}
"""
MATRICES = """
interfaces = ["end"]
[shape]
type = "matrices"
units = "m-kg-s"
stiffness = "stiffness.mtx"
mass = "mass.mtx"
unknowns = "unknowns.csv"
[frames.end]
nodes = [1, 2, 3, 4]
"""
TETRAHEDRA = """
interfaces = ["end"]
[shape]
type = "mesh-file"
file = "body.ele"
length_unit = "m"
[material]
density = 2700.0
youngs_modulus = 7e10
poisson = 0.3
[frames.end]
on = { plane = { point = [0.0, 0.0, 0.0], normal = [1.0, 0.0, 0.0] } }
tie = "mean"
"""


@pytest.fixture(scope="module")
def sources() -> Sources:
    return Sources(TREE)


def mesh_task(folder: Path) -> Task:
    """Stage 1 of the body in a folder."""
    (folder / "scene.toml").write_text(SCENE)
    return Graph(load_scene(folder / "scene.toml")).mesh["block"]


def matrices(folder: Path) -> Path:
    folder.mkdir()
    solid = build(block("hex8", (1, 1, 1), (0.1, 0.02, 0.03), "mean"))
    files.write_matrix_market(of_mesh(solid).assemble(solid), folder)
    (folder / "body.toml").write_text(MATRICES)
    return folder


def tetrahedra(folder: Path, length: float = 1.0) -> Path:
    folder.mkdir()
    points = np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1], [length, 0, 0], [1, 1, 1]])
    mesh = meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))])
    mesh.write(folder / "body.node", file_format="tetgen")
    (folder / "body.toml").write_text(TETRAHEDRA)
    return folder


def made(task: Task, store: Store, sources: Sources) -> Record:
    return execute(task, {}, store, sources, silent)


@pytest.mark.parametrize(
    "body, companion, old, new",
    [(matrices, "unknowns.csv", b"0.1,", b"0.2,"), (tetrahedra, "body.node", b"1.0", b"2.0")],
    ids=["table of unknowns", "second file of a format"],
)
def test_a_companion_file_counts(
    tmp_path: Path, sources: Sources, body: object, companion: str, old: bytes, new: bytes
) -> None:
    assert callable(body)
    folder, store = body(tmp_path / "body"), Store(tmp_path / "results")
    task = mesh_task(folder)
    first = made(task, store, sources)
    assert find(task, {}, store, sources) == first
    path = folder / companion
    whole = path.read_bytes()
    assert old in whole
    path.write_bytes(whole.replace(old, new))
    assert find(task, {}, store, sources) is None
    (state,) = states([task], store, sources)
    assert state.why == (f"file {companion} changed",)
    assert made(task, store, sources).digest != first.digest
    path.write_bytes(whole)
    assert find(task, {}, store, sources) == first


#: files of two bodies, and whether they are equal
FILES = {"file body.ele": True, "file body.node": False}


def test_equal_recipes_with_other_companions_have_different_keys(tmp_path: Path, sources: Sources) -> None:
    """As of one mesh that was morphed: the same cells, other nodes."""
    store = Store(tmp_path / "results")
    tasks = [mesh_task(tetrahedra(tmp_path / name, length)) for name, length in (("a", 1.0), ("b", 2.0))]
    assert {name: facts(tasks[0], {}, sources)[name] == facts(tasks[1], {}, sources)[name] for name in FILES} == FILES
    records = [made(task, store, sources) for task in tasks]
    assert records[0].digest != records[1].digest
    assert [find(task, {}, store, sources) for task in tasks] == records


def test_a_folder_that_was_moved_stays_fresh(tmp_path: Path, sources: Sources) -> None:
    store = Store(tmp_path / "results")
    here = tetrahedra(tmp_path / "here")
    record = made(mesh_task(here), store, sources)
    assert find(mesh_task(Path(shutil.move(here, tmp_path / "there"))), {}, store, sources) == record


ABAQUS = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n"
ELEMENT = "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
DOLFIN = """<dolfin><mesh celltype="tetrahedron" dim="3"><vertices size="4">
<vertex index="0" x="0" y="0" z="0"/><vertex index="1" x="1" y="0" z="0"/><vertex index="2" x="0" y="1" z="0"/>
<vertex index="3" x="0" y="0" z="1"/></vertices><cells size="1">
<tetrahedron index="0" v0="0" v1="1" v2="2" v3="3"/></cells></mesh></dolfin>"""
REGIONS = """<dolfin><mesh_function type="int" dim="3" size="1"><entity index="0" value="7"/>
</mesh_function></dolfin>"""


def several_files(folder: Path) -> dict[str, tuple[Path, set[str]]]:
    """For each format of several files the one to read, and the names of all.

    With what meshio takes as well: endings in capitals or of other formats, whatever blanks before a keyword and stars
    in it, no stars or no equals sign, longer names of DOLFIN's parts.
    """
    head = "*HEADING\n** INCLUDE, INPUT=no.inp\n**INCLUDED, INPUT=no.inp\n* INCLUDE, INPUT=no.inp\n"
    strange = " **INCLUDE, INPUT=e.ele\n\x0c*INCLUDE, INPUT=f.inp\n\xa0*INCLUDE, INPUT=g\n"
    bare = "*I*NCLUD*E*, INPUT=a=h.inp\ninclude\r"
    (folder / "a.INP").write_text(head + strange + bare + ABAQUS + "*INCLUDE, input=b.inp\n")
    (folder / "b.inp").write_text("*INCLUDE,INPUT=c.dat\r\n")
    (folder / "c.dat").write_text("*INCLUDE,INPUT=d.inp\r\n")
    (folder / "d.inp").write_text(ABAQUS + ELEMENT)
    for name in ("e.ele", "f.inp", "g", "h.inp", "include"):
        (folder / name).write_text("*HEADING\n")
    tetrahedra(folder / "t")
    (folder / "d.xml").write_text(DOLFIN)
    for name in ("d_part.xml", "d_other.xml.old"):
        (folder / name).write_text(REGIONS)
    return {
        "abaqus": (
            folder / "a.INP",
            {"a.INP", "b.inp", "c.dat", "d.inp", "e.ele", "f.inp", "g", "h.inp", "include"},
        ),
        "tetgen": (folder / "t" / "body.ele", {"t/body.ele", "t/body.node"}),
        "dolfin": (folder / "d.xml", {"d.xml", "d_part.xml", "d_other.xml.old"}),
    }


@pytest.mark.parametrize("name", ["abaqus", "tetgen", "dolfin"])
def test_companions_of_a_format_are_what_its_reader_opens(tmp_path: Path, name: str) -> None:
    """As Python reports it; only these formats of meshio have some."""
    path, names = several_files(tmp_path)[name]
    opened, listening = set[str](), [True]

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and listening and str(arguments[0]).startswith(str(tmp_path)):
            opened.add(Path(str(arguments[0])).relative_to(tmp_path).as_posix())

    sys.addaudithook(hook)
    meshio.read(path)
    listening.clear()
    read_mesh(path, "recipe", "cannot be read", "remedy")
    assert opened == {file.relative_to(tmp_path).as_posix() for file in (path, *companion_files(path))} == names


def test_numbers_next_to_xdmf_are_companions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its reader needs h5py, which is not required here. It searches for plain bytes where the process is."""
    monkeypatch.chdir(tmp_path.parent)
    items = "<DataItem Format='HDF'>\n  x&#46;h5:/data0\n</DataItem><DataItem Format='Binary'>b.bin</DataItem>"
    (tmp_path / "x.xdmf").write_text(f'<Xdmf><DataItem Format="XML">0 1</DataItem>{items}</Xdmf>')
    assert list(companion_files(tmp_path / "x.xdmf")) == [tmp_path / "x.h5", Path("b.bin")]
    (tmp_path / "x.xdmf").write_text("<Xdmf>")
    assert not list(companion_files(tmp_path / "x.xdmf"))


@pytest.mark.parametrize(
    "includes, words",
    [
        ({"a.inp": ["b.inp"], "b.inp": ["/dev/zero", "a.inp"]}, "in a circle"),
        ({"a.inp": ["s/../a.inp", "t/../a.inp"]}, "in a circle"),
        ({f"{name}.inp": 2 * [f"{other}.inp"] for name, other in pairwise("abcdefghijkl")}, "after 1000 others"),
    ],
    ids=["two files", "spellings that grow", "twice in twice"],
)
def test_includes_without_end_are_refused(tmp_path: Path, includes: dict[str, list[str]], words: str) -> None:
    """Before they are read, which meshio would do again and again."""
    for folder in ("s", "t"):
        (tmp_path / folder).mkdir()
    for name, others in includes.items():
        (tmp_path / name).write_text("".join(f"*INCLUDE, INPUT={other}\n" for other in others))
    with pytest.raises(InputError, match=words):
        list(companion_files(tmp_path / "a.inp"))
    (tmp_path / "body.toml").write_text(TETRAHEDRA.replace("body.ele", "a.inp"))
    with pytest.raises(InputError, match=words):
        mesh_task(tmp_path)


def test_a_name_that_is_a_pattern_is_refused(tmp_path: Path) -> None:
    """Of DOLFIN, whose reader may search with it without end."""
    (tmp_path / "(a+)+b.xml").write_text(DOLFIN)
    (tmp_path / ("a" * 40)).touch()
    with pytest.raises(InputError, match="its reader interprets as a pattern"):
        read_mesh(tmp_path / "(a+)+b.xml", "recipe", "cannot be read", "remedy")


def test_parts_of_hdf5_in_other_files_are_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    mesh = meshio.Mesh(np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))])
    mesh.write(tmp_path / "a.med")
    assert len(read_mesh(tmp_path / "a.med", "recipe", "cannot be read", "remedy").points) == 4
    with h5py.File(tmp_path / "a.med", "a") as file:
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/data")
        with h5py.File(tmp_path / "b.med", "w", userblock_size=1024) as copy:
            copy["elsewhere"] = h5py.ExternalLink("other.h5", "/data")
    for name in ("a.med", "b.med"):
        with pytest.raises(InputError, match=r"parts in other files, such as 'elsewhere'"):
            read_mesh(tmp_path / name, "recipe", "cannot be read", "remedy")


@pytest.mark.parametrize("start, needed", [(0, True), (512, True), (4096, True), (100, False)])
def test_hdf5_may_begin_after_a_block_of_the_users(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: int, needed: bool
) -> None:
    """Seen here by the library that it asks for."""
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "a.stl").write_bytes(bytes(start) + b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(InputError) as error:
        read_mesh(tmp_path / "a.stl", "recipe", "cannot be read", "remedy")
    assert ("h5py" in str(error.value)) == needed


def test_a_file_that_changes_while_it_is_read_stores_nothing(
    tmp_path: Path, sources: Sources, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, task = Store(tmp_path / "results"), mesh_task(tetrahedra(tmp_path / "body"))
    run = meshing.run

    def edited_meanwhile(*arguments: object) -> object:
        made = run(*arguments)
        with (tmp_path / "body" / "body.node").open("a") as file:
            file.write("# later\n")
        return made

    monkeypatch.setattr(meshing, "run", edited_meanwhile)
    with pytest.raises(ResourceError, match=r"file body\.node changed while it was read"):
        made(task, store, sources)
    assert not list((store.root / "cache" / "mesh").glob("*.json"))


def test_names_of_files_are_no_facts(tmp_path: Path, root: Path, sources: Sources) -> None:
    """A scene and its recipe under other names, in other folders, have equal keys."""
    scene = (root / "scenes" / "checks" / "clamped_rod.toml").read_text()
    (used,) = {line.split('"')[1] for line in scene.splitlines() if line.startswith("mesh = ")}
    other = tmp_path / "renamed.toml"
    other.write_text(scene.replace(used, "another.toml"))
    shutil.copy(next(p for p in (root / "scenes" / "checks" / used, root / used) if p.is_file()), tmp_path)
    (tmp_path / Path(used).name).rename(tmp_path / "another.toml")
    graphs = [Graph(load_scene(path)) for path in (root / "scenes" / "checks" / "clamped_rod.toml", other)]
    for one, renamed in zip(*(graph.up_to("post") for graph in graphs), strict=True):
        assert facts(one, {}, sources) == facts(renamed, {}, sources)
    assert "renamed" not in str(simulation.params(graphs[1].scene))


def test_libraries_that_write_and_draw_count(sources: Sources) -> None:
    plain = facts(Task("s", "scene", "flexclear.stages.reduction:run", {}, ""), {}, sources)
    assert plain["library netCDF4"][0].isdigit()
    post = ("flexclear.post",)
    drawn = facts(Task("s", "scene", "flexclear.stages.rendering:run", {}, "", code=post), {}, sources)
    assert drawn["library matplotlib"][0].isdigit()
    assert drawn["library vtkmodules"][0].isdigit()
