"""Solids through the stages: artifacts that can be stored and opened elsewhere, and scenes that say how many modes."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError

import flexclear as fc
from flexclear.commands.__main__ import main
from flexclear.pipeline.core.artifacts.store import write_dataset
from flexclear.pipeline.core.scene.parts import FlexibleBody, Modes
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.structure.fe.exchange import files
from flexclear.pipeline.structure.kinds.kind import of_mesh
from flexclear.stages import meshing, modal_analysis, reduction
from tests.analytic.solid_models import block, build

MESHES = Path(__file__).parents[2] / "meshes"


def stored(data: xr.Dataset, path: Path) -> xr.Dataset:
    """The dataset after a way through a file, as the next stage gets it."""
    write_dataset(path, data)
    return xr.load_dataset(path)


def test_a_solid_goes_through_the_stages(tmp_path: Path) -> None:
    recipe = MESHES / "checks" / "solid_rod.toml"
    body = FlexibleBody(type="flexible", mesh=str(recipe), modes=Modes(reference="craig-bampton", up_to="5000 Hz"))
    assert meshing.modules(recipe) == ("flexclear.pipeline.structure.kinds.solid",)
    assert "flexclear.pipeline.structure.kinds.solid" in modal_analysis.modules(body, "scene")
    made = meshing.run(meshing.params(recipe), {}, silent)
    mesh = stored(made["nc"], tmp_path / "mesh.nc")
    solved = modal_analysis.run(modal_analysis.params(body), {"mesh": mesh}, silent)
    modes = stored(solved["nc"], tmp_path / "modes.nc")
    bundle = stored(reduction.run({}, {"mesh": mesh, "modes": modes}, silent)["nc"], tmp_path / "bundle.nc")
    # six constraint modes; between held ends two pairs lie below 5 kHz
    assert bundle.sizes["mode"] == 10
    (tmp_path / "mesh.vtu").write_bytes(made["vtu"])
    assert meshio.read(tmp_path / "mesh.vtu").cells[0].type == "hexahedron20"
    (tmp_path / "modes.vtu").write_bytes(solved["vtu"])
    drawn = meshio.read(tmp_path / "modes.vtu")
    assert [name.split("_")[1] for name in drawn.point_data] == [f"{k:03d}" for k in range(1, 11)]
    # the first shape is that of a rod clamped at the bottom: the largest displacement is one, at the top
    first = np.linalg.norm(next(iter(drawn.point_data.values())), axis=1)
    assert first.max() == pytest.approx(1.0)
    assert drawn.points[np.argmax(first), 0] == pytest.approx(0.24)


def test_files_of_a_recipe_count_by_their_content(tmp_path: Path) -> None:
    mesh = build(block("hex8", (2, 1, 1), (0.2, 0.1, 0.1), "mean"))
    files.write_npz(of_mesh(mesh).assemble(mesh), tmp_path / "body.npz")
    recipe = tmp_path / "body.toml"
    recipe.write_text(
        '[shape]\ntype = "matrices"\nunits = "m-kg-s"\nfile = "body.npz"\n[frames]\nfoot = { nodes = [1, 2, 3] }\n'
    )
    params = meshing.params(recipe)
    made = meshing.run({**params, "folder": str(tmp_path)}, {}, silent)["nc"]
    again = stored(made, tmp_path / "mesh.nc")
    assert of_mesh(again).assemble(again).size == 36
    assert meshing.params(recipe) == params
    assert meshing.files(params["recipe"], tmp_path) == {"body.npz": tmp_path / "body.npz"}
    (tmp_path / "body.npz").unlink()
    with pytest.raises(InputError, match=r"there is no file .*body\.npz"):
        meshing.params(recipe)


@pytest.mark.slow
def test_a_solid_swings_as_the_beam_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The rod of checks/swinging_rod with either mesh: the same pendulum, whose end moves by 0.24 m in 0.2 s."""
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path))
    scene = MESHES.parent / "scenes" / "checks" / "swinging_rod.toml"
    ends = []
    for name in ("actuated_rod.toml", "checks/solid_rod.toml"):
        run = fc.run(fc.load_scene(scene, override={"body.rod.mesh": str(MESHES / name)}))
        assert float(np.abs(run["energy_error"]).max()) < 1e-10
        ends.append(run["position"].values[-1, 0])
    # a uniform pendulum swings alike whatever its mass (the solid's eight sides lack 8e-4 of it); the two differ by
    # 1e-7 m, in how they bend and shake
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    "choice, value",
    [
        ({"count": 7}, 7),
        ({"count": "all"}, "all"),
        ({"up_to": "5000 Hz"}, 5000.0),
        ({"up_to": 5000}, 5000.0),
        ({"mass": "90 %"}, 0.9),
    ],
)
def test_one_choice_says_how_many_modes(choice: dict[str, Any], value: object) -> None:
    modes = Modes(reference="free-free", **choice)
    (name,) = choice
    assert getattr(modes, name) == pytest.approx(value)
    assert Modes.model_validate(modes.model_dump(mode="json")) == modes


@pytest.mark.parametrize(
    "choice", [{}, {"count": 7, "mass": 0.9}, {"count": -1}, {"up_to": "5 mm"}, {"compliance": 1.1}]
)
def test_two_choices_or_none_are_refused(choice: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Modes(reference="free-free", **choice)


def test_the_command_prints_what_bundles_lack(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path))
    assert main(["run", "sps4/frequencies/fixed_circle", "--to", "bundle"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("sps4/frequencies/fixed_circle, rod\n")
    assert "not even the first, 1564.49 Hz" in shown
