"""Files of other finite element programs that are cut, damaged or made to harm: each is refused in one sentence."""

import importlib.util
import shutil
from pathlib import Path

import numpy as np
import pytest

from flexclear.structure.fe.exchange import programs
from flexclear.structure.kinds import kind
from flexclear.system.errors import FlexclearError, InputError
from tests.analytic.test_program_files import FILES, FORMS, SMALL, cut, needs_ansys, recipe, text

DAMAGED: dict[str, tuple[dict[str, str | bytes], str]] = {
    "cut in a line": ({"block.sti": text("block.sti")[:-35]}, "'block.sti'"),
    "cut after a line": ({"block.sti": "".join(text("block.sti").splitlines(True)[:-30])}, "no diagonal entry in row"),
    "lines twice": ({"block.mas": text("block.mas") + text("block.mas").splitlines()[-1]}, r"column \d+ twice"),
    "cut list of rows": ({"block.dof": text("block.dof")[:40]}, "there are 10 unknowns"),
    "no number": ({"block.mas": text("block.mas").replace("1 1 ", "1 x ", 1)}, "'block.mas'"),
    "not a number": ({"block.mas": "1 1 nan\n" + text("block.mas")}, "entry 1 is nan"),
    "a huge row": ({"block.sti": text("block.sti") + "1000000000 1000000000 1.0\n"}, "row or column 1000000000"),
    "other bytes": ({"block.sti": np.arange(3000.0).byteswap().tobytes()}, "'block.sti'"),
    "a node missing": (
        {"block.inp": text("block.inp").replace("8, 60, 15, 10\n", "")},
        "node 8, row 22 of 'block.dof'",
    ),
    "a node twice": ({"block.inp": text("block.inp").replace("8, 60,", "7, 60,")}, "line 11 of 'block.inp': node 7"),
    "a node at NaN": ({"block.inp": text("block.inp").replace("8, 60,", "8, nan,")}, "finite"),
    "huge sets": (
        {"block.inp": text("block.inp").replace("1, 4, 1", "1, 1000000000, 1").replace("START", "REST")},
        "unknown set of nodes 'START'",
    ),
    "sets of themselves": (
        {"block.inp": text("block.inp") + "*NSET, NSET=A\n1\n" + "A, A, A, A, A, A, A, A\n" * 1000 + "*TRANSFORM\n"},
        "TRANSFORM",
    ),
    "axes of nodes": ({"block.inp": text("block.inp") + "*TRANSFORM, NSET=ALL\n1,0,0,0,1,0\n"}, r"line 28 .*TRANSFORM"),
    "an include of itself": ({"block.inp": "*INCLUDE, INPUT=block.inp\n"}, "in a circle"),
    "no rows at all": ({"block.dof": ""}, "'block.dof'|there are 0 unknowns"),
    "an empty matrix": ({"block.sti": ""}, "'block.sti'"),
    "a row cut": ({"block.dof": text("block.dof").rpartition(".")[0]}, "line 24 is none"),
    "a row twice": ({"block.dof": text("block.dof").replace("8.3", "8.2")}, r"it has 8\.2 more than once"),
    "an endless include": ({"block.inp": "*INCLUDE, INPUT=/dev/zero\n"}, "'/dev/zero' is not an ordinary file|no file"),
    "a direction of heat": ({"block.dof": text("block.dof").replace("8.3", "8.0")}, "is no motion of a node"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_of_calculix_are_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    changes, words = DAMAGED[name]
    for file in SMALL.values():
        shutil.copy(FILES / file, tmp_path / file)
    for file, content in changes.items():
        (tmp_path / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FlexclearError, match=words) as caught:
        kind.build(recipe(SMALL), tmp_path)
    assert len(str(caught.value)) < 400


OTHERS: dict[str, tuple[str, str, str]] = {
    "cut punch": ("block.pch", cut("block.pch"), "'block.pch'"),
    "no matrix": ("block.pch", text("block.pch").replace("KAAX", "VAAX"), "name begins with K"),
    "complex": ("block.pch", text("block.pch").replace("6               2", "6               4", 1), "square and real"),
    "scalar points": ("block.pch", text("block.pch").replace("8               3", "8               0"), "of a node"),
    "cut output4": ("stiffness.op4", cut("stiffness.op4"), "before column 25"),
    "announced rows": ("mass.op4", text("mass.op4").replace("      24      24", "99999999 9999999", 1), "'mass.op4'"),
    "a row before the first": (
        "stiffness.op4",
        text("stiffness.op4").replace("\n       1       1", "\n       1      -7", 1),
        "row or column -7",
    ),
    "binary output4": ("mass.op4", "\x18\x00\x00\x00" * 50, "'mass.op4'"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_damaged_files_of_nastran_are_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    file, content, words = OTHERS[name]
    for other in ("block.inp", "block.pch", "stiffness.op4", "mass.op4"):
        shutil.copy(FILES / other, tmp_path / other)
    (tmp_path / file).write_text(content)
    with pytest.raises(FlexclearError, match=words) as caught:
        kind.build(recipe(FORMS["punch" if file.endswith("pch") else "output4"](tmp_path)), tmp_path)
    assert len(str(caught.value)) < 400


def test_the_reader_of_ansys_is_asked_for_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (tmp_path / "a.full").write_bytes(b"")
    with pytest.raises(InputError, match=r"ansys-mapdl-reader is not installed\n.*pip install 'flexclear\[fe\]'"):
        programs.read(tmp_path / "a.full", "K", "recipe")
    with pytest.raises(InputError, match=r"superelements are not read\n.*as \.full"):
        programs.read((tmp_path / "a.full").rename(tmp_path / "a.sub"), "K", "recipe")


@needs_ansys
@pytest.mark.parametrize("damage", ["cut", "swapped"])
def test_damaged_files_of_ansys_end_no_process(damage: str, tmp_path: Path) -> None:
    from ansys.mapdl.reader import examples

    data = Path(examples.fullfile).read_bytes()
    changed = data[:40_000] if damage == "cut" else np.frombuffer(data, "<i4").byteswap().tobytes()
    (tmp_path / "a.full").write_bytes(changed)
    with pytest.raises(FlexclearError, match=r"'a\.full'"):
        programs.read(tmp_path / "a.full", "K", "recipe")
