"""Files that somebody made to harm: meshes, matrices, surfaces, sweeps and whole folders of results.

Each is refused in words, or counts as absent, without endless work and without being read beyond its use.
"""

from __future__ import annotations

import gzip
import os
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from flexclear.artifacts import maintenance
from flexclear.artifacts.disk import encode_with_digest, read_checked, sha256
from flexclear.artifacts.store import Store, read_record
from flexclear.post.render import forms
from flexclear.scene.load import load_scene
from flexclear.scene.sweep import read_sweep
from flexclear.scene.tables import LookupTable
from flexclear.stages import scenes
from flexclear.stages.graph import Graph
from flexclear.structure.fe.exchange import files
from flexclear.structure.fe.recipe import Matrices
from flexclear.structure.fe.solid import imported
from flexclear.structure.fe.solid.recipe import MeshFile
from flexclear.system.errors import FlexclearError, InputError
from tests.properties.test_scene_words import BASE

#: processor time [s] after which work counts as endless: refusals take 0.3 s, and what they refuse takes hours
SECONDS = 60.0
DRIVE = '\n[drive.d]\njoint = "A"\nlaw = '
HARMONIC = '{ type = "harmonic", amplitude = 1, frequency = 1 }'


@contextmanager
def refused(words: str | None = None) -> Iterator[None]:
    begun = time.process_time()
    with pytest.raises(FlexclearError, match=words) as caught:
        yield
    assert time.process_time() - begun < SECONDS
    assert len(str(caught.value).encode()) < 4000
    assert "\x1b" not in str(caught.value)


SCENES = {
    "no number of metres": (BASE.replace("mass = 1.0", 'mass = "1 mm^-99999"'), "unknown unit"),
    "more pieces than there is memory for": (
        f'{BASE}{DRIVE}{{ type = "repeated", period = 1e-9, times = 1000000000, law = {HARMONIC} }}',
        "2e\\+09 pieces",
    ),
    "each piece many pieces": (
        BASE + DRIVE + '{ type = "repeated", period = 1, times = 1000000, law = ' * 20 + HARMONIC + "}" * 20,
        "pieces",
    ),
    "more steps than are compared with each other": (
        f"{BASE}{DRIVE}{{ type = 'step', start = {list(range(20000))}, end = 1, change = 1 }}",
        "at most 5000 entries",
    ),
    "a sum of many laws of many pieces": (
        BASE + DRIVE + '{ type = "sum", laws = [' + '{ type = "step", start = 0, end = 1, change = 1 },' * 600 + "] }",
        "a sum of 600 laws",
    ),
    "keys of many parts in quotation marks": ('"a".' * 200_000 + "b = 1", "more than 50 parts"),
    "a million unknown keys": ("".join(f"k{i}=1\n" for i in range(90_000)), "unknown key"),
    "more text than any scene": ("#\n" * 600_000, "larger than 1 MB"),
    "a key of many parts": ("a." * 300_000 + "b = 1", "more than 50 parts"),
    "a quantity with much white space": (f'time.end = "1 a{" " * 60_000}"', "unknown unit"),
    "a number of 5000 digits": (f"time.end = {'9' * 5000}", "Exceeds the limit"),
    "a number of 400 digits": (f"time.end = {'9' * 400}", r"\[time.end\]"),
    "a part called source": ('[body.source]\ntype = "ground"', "source"),
    "a frame called source": ('[body.a]\ntype = "ground"\nframes.source = {}', "source"),
    "control characters": ('[body."\\u001b[31m"]\ntype = "ground"', "is not a name"),
    "a long key": (f"{'k' * 60_000} = 1", "unknown key"),
    "a line of many numbers": ("x = " + "1 m " * 30_000, "is not TOML"),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_asks_for_endless_work_is_refused_at_once(name: str, tmp_path: Path) -> None:
    text, words = SCENES[name]
    (tmp_path / "scene.toml").write_text(text)
    with refused(words):
        load_scene(tmp_path / "scene.toml")


def test_paths_that_are_no_files_are_refused(tmp_path: Path) -> None:
    """Reading the first of them would never end, the second would wait for a writer."""
    pipe, loop, dots = (tmp_path / f"{name}.toml" for name in ("pipe", "loop", ".."))
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    dots.write_text('title = "a"')
    paths = {"/dev/zero": "not an ordinary file", pipe: "not an ordinary file", loop: None, dots: "cannot name a scene"}
    for path, words in {**paths, "a\0b.toml": None, "x" * 5000 + ".toml": None}.items():
        with refused(words):
            load_scene(path)
    body = 'title = "a"\ntime.end = 1\n[body.b]\ntype = "flexible"\nmodes = { reference = "x", count = 1 }\nmesh = '
    for mesh in ("/dev/zero", str(pipe), "x" * 5000, "a\\u0000b"):
        (tmp_path / "scene.toml").write_text(f'{body}"{mesh}"')
        with refused():
            Graph(load_scene(tmp_path / "scene.toml")).up_to("mesh")


def test_a_long_row_of_scenes_that_extend_each_other_is_refused(tmp_path: Path) -> None:
    for k in range(60):
        (tmp_path / f"{k}.toml").write_text(f'extends = "{k + 1}.toml"')
    (tmp_path / "60.toml").write_text(BASE)
    with refused("more than 50 scenes in a row"):
        load_scene(tmp_path / "0.toml")


@pytest.mark.parametrize("value", ["[" * 20_000, "{a=" * 5_000, "9" * 5_000], ids=["lists", "tables", "digits"])
def test_values_of_the_command_line_are_refused_as_those_of_files(value: str, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(BASE)
    with refused(r"too deeply|is not a number|\[body.crank.mass\]"):
        scenes.load_by_name(str(tmp_path / "s.toml"), [f"body.crank.mass={value}"])


def test_many_changes_give_a_name_that_a_folder_can_have(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(BASE)
    names = {scenes.load_by_name(str(tmp_path / "s.toml"), [f"title={'a' * 300}{k}"]).name for k in range(2)}
    assert len(names) == 2
    assert max(map(len, names)) < 255  # bytes of a name on all usual file systems


def test_results_take_the_place_of_no_device() -> None:
    """A new file of that name would be put there, and the device be gone."""
    for target in ("/dev/null", "/" + "x" * 5000):
        with refused("not an ordinary file|cannot be a file"):
            scenes.check_target(Path(target))


SWEEP: dict[str, Any] = {"scene": "s", "keep": ["b.position.final"], "vary": {}}
MASS = {"values": [1, 2], "places": ["body.b.mass"]}


@pytest.mark.parametrize("name", ["", "a/b", "a\nb", "status", "key", "b.position.final", "b.position.final.error"])
def test_parameters_are_called_as_dimensions_may_be(name: str) -> None:
    with refused(r"vary\."):
        read_sweep({**SWEEP, "vary": {name: MASS}}, "sweep.toml")


def test_samples_of_more_values_than_there_is_memory_for_are_refused() -> None:
    for count, points in ((900, 1_000_000), (2, 10_000_000)):
        vary = {f"body.b{k}.mass": {"from": 1, "to": 2} for k in range(count)}
        with refused("more than 10000000 values|less than or equal to 1000000"):
            read_sweep({**SWEEP, "sample": {"method": "sobol", "points": points}, "vary": vary}, "sweep.toml")


GRID = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 300 300 300\n"
POINTS = "ply\nformat binary_little_endian 1.0\nelement vertex 10000000000\nproperty double x\nend_header\n"
MESHES: dict[str, tuple[bytes | None, str]] = {
    "mesh.vtk": (GRID.encode(), "declares a grid of 2.7e\\+07 points"),
    "mesh.inp": (b"*INCLUDE, INPUT=/dev/zero\n", "not an ordinary file"),
    "mesh.xdmf": (b"<a>" + b"a" * 1_000_000, "cannot read|not a surface"),
    "mesh.stl": (b"\0" * 80 + struct.pack("<I", 0xFFFFFFFF) + b"\0" * 100, "cannot read|no solid cells|no triangles"),
    "mesh.vtu": (b"<VTKFile type='UnstructuredGrid'>" + b"<a>" * 200_000, "cannot read|not a surface"),
    "mesh.ply": (POINTS.encode(), "is damaged, or needs more memory than available"),
    "pipe.vtu": (None, "not an ordinary file"),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_that_would_never_end_is_refused(name: str, tmp_path: Path) -> None:
    content, words = MESHES[name]
    if content is None:
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).write_bytes(content)
    import meshio  # noqa: F401 - its import is none of the refusal

    with refused(words):
        imported.read_geometry(MeshFile(type="mesh-file", file=name, length_unit="mm"), tmp_path, "recipe")
    with refused(words):
        forms.read(tmp_path / name, 1.0)


@pytest.mark.parametrize("faces", ["f 1 2 1000000000000", "f -7 1 2", "f 1 2 3\nv nan 1 1"])
def test_a_surface_with_faces_or_points_nowhere_is_refused(faces: str, tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 1 1\nv 0 0 1\n{faces}\n")
    with refused("points"):
        forms.read(tmp_path / "a.obj", 1.0)


SIX = np.arange(6)
SOUND = {
    **{f"{name}_{part}": SIX for name in ("stiffness", "mass") for part in ("row", "column")},
    **{f"{name}_value": np.ones(6) for name in ("stiffness", "mass")},
    **{"node": np.ones(6, dtype=int), "component": SIX, "position": np.zeros((6, 3))},
}
ARRAYS: dict[str, dict[str, Any]] = {
    "no component": {"component": np.full(6, 10**9)},
    "pickled objects": {"node": np.array([print] * 6, dtype=object)},
    "text": {"position": np.full((6, 3), "a")},
    "complex": {"stiffness_value": 1j * np.ones(6)},
    "records": {"node": np.zeros(6, dtype=[("a", "i4")])},
    "dates": {"position": np.zeros((6, 3), dtype="M8[s]")},
    "flat": {"position": np.zeros(18)},
    "shorter": {"node": np.ones(5, dtype=int)},
    "nothing": {name: values[:0] for name, values in SOUND.items()},
    "not finite": {"position": np.full((6, 3), np.nan)},
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_other_kinds_are_no_matrices(name: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "sound.npz", **SOUND)
    assert files.read_npz(tmp_path / "sound.npz", "recipe").mass.nnz == 6
    np.savez(tmp_path / "a.npz", **{**SOUND, **ARRAYS[name]})
    with refused("holds no matrices"):
        files.read_npz(tmp_path / "a.npz", "recipe")


def test_a_packed_matrix_is_not_read_beyond_what_its_header_says(tmp_path: Path) -> None:
    """A file of 1 MB may hold 1 GB."""
    header = b"%%MatrixMarket matrix coordinate real general\n1 1 1\n"
    with gzip.open(tmp_path / "k.mtx.gz", "wb", compresslevel=1) as file:
        file.write(header)
        for _ in range(100):
            file.write(b"1 1 1\n" * 100_000)
    (tmp_path / "m.mtx").write_bytes(header + b"1 1 1\n")
    (tmp_path / "u.csv").write_text("node,x,y,z,component\n1,0,0,0,ux\n" + "1,0,0,0,ux\n" * 300_000)
    for stiffness, words in (("k.mtx.gz", "2 entries where its header says 1"), ("m.mtx", "does not match the lines")):
        shape = Matrices(type="matrices", units="m-kg-s", stiffness=stiffness, mass="m.mtx", unknowns="u.csv")
        with refused(words):
            files.read(shape, tmp_path, "recipe")


def test_a_matrix_that_announces_a_billion_rows_takes_no_memory_for_them(tmp_path: Path) -> None:
    """Rows without entries would take 19 GB for a file of 80 bytes."""
    (tmp_path / "k.mtx").write_text(f"%%MatrixMarket matrix coordinate real symmetric\n{10**9} {10**9} 1\n1 1 1\n")
    with refused("1 entries for 1000000000 rows"):
        files._matrix(tmp_path / "k.mtx", "recipe")
    (tmp_path / "k.mtx").write_text(f"%%MatrixMarket matrix coordinate real general\n{10**9} {10**9} 1\n1 1 1\n")
    (tmp_path / "u.csv").write_text("node,x,y,z,component\n1,0,0,0,ux\n")
    named = {"stiffness": "k.mtx", "mass": "k.mtx", "unknowns": "u.csv"}
    with refused("does not match the lines"):
        files.read(Matrices(type="matrices", units="m-kg-s", **named), tmp_path, "recipe")
    np.savez(tmp_path / "sound.npz", **SOUND)
    shape = Matrices(type="matrices", units="m-kg-s", file="sound.npz", basis="k.mtx")
    with refused("no basis of finite numbers for 6 unknowns"):
        files.read(shape, tmp_path, "recipe")


# Folders of results that somebody else sent ----------------------------------------------------------------------


def stored(root: Path) -> tuple[Store, Path]:
    store = Store(root / "results")
    store.put("stage", "key", {"txt": b"content"}, {"a": "b"})
    return store, store.path("stage", "key", "json")


def altered(path: Path, **changes: Any) -> None:
    """With a sum that is right: a digest is no signature."""
    path.write_bytes(encode_with_digest({**(read_checked(path) or {}), **changes}))


def test_what_is_pruned_lies_in_the_cache(tmp_path: Path) -> None:
    store, record = stored(tmp_path)
    (tmp_path / "precious.txt").write_text("precious")
    (record.parent / "key.x").mkdir()
    altered(record, files={"x/../../../../precious.txt": sha256(b"other")})
    assert read_record(record) is None
    assert maintenance.inventory(store, whole=True).unreadable == (record,)
    for stage in ("../stage", "stage/../..", "/stage", ""):
        altered(record, stage=stage, files={"txt": sha256(b"content")})
        assert read_record(record) is None
    for artifact in maintenance.list_prunable(store, maintenance.inventory(store, whole=True), -1.0):
        maintenance.remove(store, artifact)
    assert (tmp_path / "precious.txt").read_text() == "precious"


REPLACED: dict[str, Callable[[Path], Any]] = {
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "loop": lambda path: path.symlink_to(path.name),
    "folder": Path.mkdir,
}


@pytest.mark.parametrize("kind", REPLACED)
@pytest.mark.parametrize("file", ["json", "txt"])
def test_what_is_no_file_counts_as_absent(file: str, kind: str, tmp_path: Path) -> None:
    store, _ = stored(tmp_path)
    store.path("stage", "key", file).unlink(missing_ok=True)
    REPLACED[kind](store.path("stage", "key", file))
    begun = time.process_time()
    assert store.find("stage", "key") is None
    assert time.process_time() - begun < SECONDS


def test_strange_tables_with_right_sums_are_read_as_texts(tmp_path: Path) -> None:
    store, record = stored(tmp_path)
    altered(record, facts={"a": {"b": [1]}, "c": 3}, said={"warnings": 5})
    found = store.find("stage", "key")
    assert found is not None
    assert found.facts == {"a": "{'b': [1]}", "c": "3"}
    for strange in ([], 3, None):
        altered(record, files=strange)
        assert store.find("stage", "key") is None


def test_a_result_that_is_no_dataset_is_refused(tmp_path: Path) -> None:
    store = Store(tmp_path / "results")
    found = store.put("stage", "key", {"nc": b"no netcdf"}, {})
    with pytest.raises(FlexclearError, match="is not a dataset") as caught:
        store.load(found)
    assert not isinstance(caught.value, InputError)


@pytest.mark.parametrize(
    "text, words",
    [
        ("v,F\n0,0\n1,nan\n", "values that are no finite numbers"),
        ("v,F\n0,0\n1e999,1\n", "values that are no finite numbers"),
        ("v,F\n0,0\n1\n", "row 3 of damper.csv has no numbers in columns 1 and 2"),
        ("v,F\n0,0\n2,1\n1,2\n", r"'v' of damper.csv must increase from point to point; point 3 does not"),
        ("v,F\n0,0\n0,1\n", "1 values of 'v'; a table needs at least two"),
        ("v;F\n0,5;1,5\n1,5;2,5\n", "no column 'v'"),
        ("v,F\n", "0 values of 'v'"),
        ("", "no column 'v'"),
        ("v,F\n" + "".join(f"{k},{k}\n" for k in range(5001)), "has 5001 points; a table has at most 5000"),
        ("v,F\n" + "1,1\n" * 4_200_000, "larger than 16 MB"),
        ("v,F\n0,0\n1," + "9" * 200_000 + "\n", "cannot be read|no finite numbers"),
        ("\x00\x00\x00\x00", "cannot be read|no column"),
    ],
    ids=["nan", "overflow", "ragged", "falls", "twice", "locale", "header", "empty", "many", "huge", "long", "binary"],
)
def test_a_damaged_table_of_a_load_is_refused_in_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "damper.csv").write_text(text)
    columns = {"of": {"column": "v", "unit": "m/s"}, "value": {"column": "F", "unit": "N"}}
    with pytest.raises(ValidationError, match=words) as refused:
        LookupTable.model_validate({"file": str(tmp_path / "damper.csv"), **columns})
    assert len(refused.value.errors()) == 1
    assert len(str(refused.value)) < 1000


def test_a_grid_with_a_missing_pair_is_refused_and_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path, columns = tmp_path / "map.csv", [{"column": name, "unit": "m"} for name in ("x", "y")]
    rows = [f"{x},{y},1" for x in range(3) for y in range(2)]
    given = {"file": str(path), "of": columns, "value": {"column": "z", "unit": "N"}}
    path.write_text("\n".join(["x,y,z", *rows]), encoding="utf-8-sig")
    assert LookupTable.model_validate(given).halvings() == (1, 0)
    for text in (rows[:-1], [*rows[:-1], rows[0]]):
        path.write_text("\n".join(["x,y,z", *text]))
        with pytest.raises(ValidationError, match=r"rows for 3 x 2 values of 'x' and 'y'; give every pair one row"):
            LookupTable.model_validate(given)
