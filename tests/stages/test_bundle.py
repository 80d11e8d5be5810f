"""One file repeats elsewhere what a scene does here, and tells nothing of this machine."""

import io
import json
import shutil
import zipfile
from pathlib import Path

import pytest

from flexclear.commands import reproduction
from flexclear.system.errors import InputError
from tests.stages.conftest import Command

ROD = """
title = "A rod"
time.end = "1 ms"
[body.ground]
type = "ground"
frames.O = {}
[body.rod]
type = "flexible"
mesh = "MESH"
modes = { reference = "fixed-fixed", count = 2 }
pose = {}
"""


@pytest.fixture
def scene(tmp_path: Path, root: Path) -> Path:
    """A scene with what it extends, and a recipe by its full path; it cannot be run: its rod is held by nothing."""
    folder = tmp_path / "somebody" / "secret project"
    (folder / "parts").mkdir(parents=True)
    shutil.copy(root / "meshes" / "actuated_rod.toml", folder / "parts" / "rod.toml")
    (folder / "base.toml").write_text(ROD.replace("MESH", str(folder / "parts" / "rod.toml")))
    (folder / "mine.toml").write_text('extends = "base.toml"\ntitle = "Mine"\n[joint.J]\ntype = "no such joint"\n')
    return folder / "mine.toml"


def test_a_failure_is_repeated_from_one_file_without_a_path_of_this_machine(
    scene: Path, tmp_path: Path, command: Command
) -> None:
    path = tmp_path / "bundle.zip"
    command("doctor", "--bundle", scene, "--set", "time.end='2 ms'", "--out", path)
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        whole = b"".join(archive.read(name) for name in names)
        facts = json.loads(archive.read("facts.json"))
    assert names == {"facts.json", "log.txt", "files/mine.toml", "files/base.toml", "files/parts/rod.toml"}
    assert b"somebody" not in whole
    assert str(Path.home()).encode() not in whole
    assert facts["exit_code"] == 2
    assert facts["settings"] == ["time.end='2 ms'"]
    shutil.rmtree(scene.parent)
    said = command("doctor", "--repeat", path).out
    assert "the run ended with exit code 2 here, with 2 there" in said
    assert "no such joint" in said


def test_a_bundle_holds_files_of_any_name_but_none_from_elsewhere(
    scene: Path, tmp_path: Path, command: Command
) -> None:
    """Scenes and recipes are known by the keys that name them; what only a mesh names may be private."""
    folder, secret = scene.parent, tmp_path / "private.txt"
    secret.write_text("*HEADING\nnobody's business\n")
    recipe = f'[shape]\ntype = "mesh-file"\nfile = "{folder / "body.inp"}"\n'
    (folder / "rod.recipe").write_text(recipe)
    (folder / "body.inp").write_text(f"*INCLUDE, INPUT={secret}\n*INCLUDE, INPUT=parts/a.dat\n")
    (folder / "parts" / "a.dat").write_text("*INCLUDE, INPUT=../body.inp\n")
    (folder / "base").write_text(ROD.replace("MESH", "rod.recipe"))
    scene.write_text('extends = "base"\n')
    said = command("doctor", "--bundle", scene, "--out", tmp_path / "bundle.zip").out
    assert f"left out: {secret}" in said
    assert "a.dat" not in said
    with zipfile.ZipFile(tmp_path / "bundle.zip") as archive:
        names = {name.removeprefix("files/") for name in archive.namelist()} - {"facts.json", "log.txt"}
        assert b'file = "body.inp"' in archive.read("files/rod.recipe")
        assert not any(b"nobody" in archive.read(name) for name in archive.namelist())
    assert names == {"mine.toml", "base", "rod.recipe", "body.inp", "parts/a.dat"}


def test_nothing_outside_of_the_folder_of_a_scene_is_packed_or_quoted(
    scene: Path, tmp_path: Path, command: Command
) -> None:
    """A scene of someone else may name any file as the scene that it extends, as a recipe, or as the table of a law."""
    law = '[drive.d]\njoint = "j"\n[drive.d.law]\ntype = "table"\nfile = "{}"\ntime.column = {}\nvalue.column = 2\n'
    for name in ("keys", "keys.csv"):
        private = tmp_path / "home" / name
        private.parent.mkdir(exist_ok=True)
        private.write_text("-----BEGIN KEY-----, b\nnobody's, business\n")
        (scene.parent / "keys.toml").unlink(missing_ok=True)
        (scene.parent / "keys.toml").symlink_to(private)
        for text in (
            f'extends = "{private}"\n',
            ROD.replace("MESH", str(private)),
            ROD.replace("MESH", "keys.toml"),
            ROD + law.format(private, 1),
            ROD + law.format(private, '"t"'),
        ):
            scene.write_text(text)
            said = command("check", scene, code=2).err
            packed = command("doctor", "--bundle", scene, "--out", tmp_path / "bundle.zip").out
            assert f"left out: {private}" in packed
            with zipfile.ZipFile(tmp_path / "bundle.zip") as archive:
                content = b"".join(archive.read(one) for one in archive.namelist())
            for word in ("BEGIN", "nobody"):
                assert word not in said
                assert word.encode() not in content


def test_a_run_that_ends_otherwise_is_reported(scene: Path, tmp_path: Path, command: Command) -> None:
    path, _ = reproduction.make(str(scene), [], ["numpy"], tmp_path / "bundle.zip")
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    facts = json.loads(content["facts.json"])
    facts |= {"exit_code": 0, "libraries": {"numpy": "1.0"}}
    path.write_bytes(reproduction._zip_files({**content, "facts.json": json.dumps(facts).encode()}))
    reported = command("doctor", "--repeat", path, code=4)
    assert "with 0 there" in reported.out
    assert "here, 1.0 there" in reported.out


@pytest.mark.parametrize("name", ["../out.toml", "/out.toml", "files/../../out.toml", "files\\out.toml", "C:/out.toml"])
def test_a_file_that_leads_out_of_its_folder_is_refused(name: str, tmp_path: Path) -> None:
    facts = {"scene": "a.toml", "settings": [], "exit_code": 0, "libraries": {}, "python": ""}
    content = {"facts.json": json.dumps(facts).encode(), "log.txt": b"", name: b"x"}
    (tmp_path / "a.zip").write_bytes(reproduction._zip_files(content))
    with pytest.raises(InputError, match="lead out of it"):
        reproduction.repeat(tmp_path / "a.zip", [])


def test_what_is_no_such_file_is_refused(tmp_path: Path) -> None:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        archive.writestr("facts.json", '{"scene": "../../etc/a.toml", "settings": [], "exit_code": 0, "libraries": {}}')
    for content in (b"", b"PK\x03\x04", whole.getvalue(), whole.getvalue()[:40]):
        (tmp_path / "a.zip").write_bytes(content)
        with pytest.raises(InputError):
            reproduction.repeat(tmp_path / "a.zip", [])


def test_a_run_that_is_repeated_is_compared_to_the_last_bit(root: Path, tmp_path: Path, command: Command) -> None:
    scene = Path(shutil.copy(root / "scenes" / "checks" / "pendulum.toml", tmp_path))
    path, _ = reproduction.make(str(scene), ["time.end='20 ms'"], ["numpy"], tmp_path / "bundle.zip")
    assert "the run is the same to the last bit" in command("doctor", "--repeat", path).out
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    facts = json.loads(content["facts.json"]) | {"settings": ["time.end='30 ms'"]}
    path.write_bytes(reproduction._zip_files({**content, "facts.json": json.dumps(facts).encode()}))
    assert "the run is not the same to the last bit" in command("doctor", "--repeat", path).out
