"""What a notebook shows of scenes, runs and comparisons, and the notebooks of the documentation."""

import base64
import io
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

import flexclear as fc
from benchmarks.site import notebooks
from flexclear.artifacts.paths import PROJECT
from flexclear.post.render.sketch import sketch
from tests.browser import browser, needs_browser

NOTEBOOKS = PROJECT / "docs/notebooks"
PENDULUM = "scenes/checks/pendulum.toml"


def pictures(html: str) -> list[np.ndarray]:
    """The pictures in a text, shape (height, width, 3 or 4)."""
    return [imread(io.BytesIO(base64.b64decode(data))) for data in re.findall("base64,([^'\"]+)", html)]


def short(root: Path) -> xr.Dataset:
    return fc.run(fc.load_scene(root / PENDULUM, override={"time.end": "0.2 s", "title": "Swing < 1"}))


def boxes(heights: Sequence[float]) -> fc.Scene:
    """A red and a green box, one behind the other where the eye looks along -z."""
    body: dict[str, object] = {"ground": {"type": "ground"}}
    for name, color, height in zip(("first", "second"), ("#ff0000", "#00ff00"), heights, strict=True):
        shape = {"type": "box", "size": [1, 1, 0.1]}
        inertia = {"mass": 1, "inertia": [1, 1, 1], "pose": {"position": [0, 0, height]}}
        body[name] = {"type": "rigid", "color": color, "geometry": [shape], "frames": {"o": {}}, **inertia}
    joint = {name: {"type": "free", "between": ["ground.o", f"{name}.o"]} for name in ("first", "second")}
    body["ground"] = {"type": "ground", "frames": {"o": {}}}
    view = {"direction": [0, 0, 1], "up": [0, 1, 0]}
    return fc.load_scene({"title": "Boxes", "time": {"end": 1}, "body": body, "joint": joint, "view": view})


@pytest.mark.parametrize("heights, colour", [((1.0, 0.0), 0), ((0.0, 1.0), 1)])
def test_a_small_picture_needs_no_gl_and_hides_what_is_behind(heights: Sequence[float], colour: int):
    drawn = sketch(fc.show(boxes(heights)).view.drawn)
    middle = drawn[drawn.shape[0] // 2, drawn.shape[1] // 2]
    assert middle[colour] > 200
    assert middle[1 - colour] == 0


def test_a_scene_shows_its_title_a_picture_and_its_parts(root: Path):
    html = fc.load_scene(root / PENDULUM, override={"title": "Swing < 1"})._repr_html_()
    (drawn,) = pictures(html)
    assert np.ptp(drawn[:, :, :3].reshape(-1, 3), axis=0).max() > 0.5
    assert "<b>Swing &lt; 1</b>" in html
    assert "hinge (revolute)" in html


def test_a_scene_that_cannot_be_drawn_shows_its_parts(root: Path):
    html = fc.load_scene(root / PENDULUM, override={"joint.hinge.between": ["ground.O", "bob.no"]})._repr_html_()
    assert not pictures(html)
    assert "hinge (revolute)" in html


def test_a_run_shows_its_title_curves_and_how_it_was_computed(root: Path):
    run = short(root)
    html = run._repr_html_()
    assert len(pictures(html)) == 1
    for words in ("<b>Swing &lt; 1</b>", "0 to 0.2 s, 5 rows", "dop853", "joint_position"):
        assert words in html
    assert "<b>Swing" not in run.isel(time=0)._repr_html_()  # another dataset


def test_a_comparison_shows_its_curves_and_tables(root: Path):
    scenes = [fc.load_scene(root / PENDULUM, override={"time.end": "0.1 s", "title": name}) for name in ("A", "B")]
    html = fc.compare(*scenes)._repr_html_()
    assert len(pictures(html)) == 1
    assert "own error" in html


@needs_browser
def test_a_run_is_a_page_to_turn_in_a_notebook_and_in_a_file(root: Path, tmp_path: Path):
    shown = fc.show(short(root), tmp_path)
    assert (tmp_path / "motion.html").read_bytes() == shown.page
    assert len(repr(shown)) < 100  # of a terminal, which shows no page
    (tmp_path / "notebook.html").write_text(f"<meta charset='utf-8'>{shown._repr_html_()}")
    with browser() as window:
        window.open(tmp_path / "notebook.html")
        view = "document.querySelector('iframe').contentDocument.querySelector('.viewer')?.viewer"
        window.wait(f"return !!{view}")
        assert window.run(f"return {view}.data.times.length") > 1
        assert window.logs() == ([], [])


def test_a_stored_run_is_a_page_too(root: Path):
    """As `fc.open` returns it, without its scene."""
    shown = fc.show(xr.DataTree(short(root)))
    assert b"Swing &lt; 1: motion" in shown.page


def test_a_run_whose_bodies_are_not_known_is_refused(root: Path):
    run = xr.Dataset(attrs={"parameters": '{"body": {"rod": {"type": "flexible"}}}'})
    with pytest.raises(fc.InputError, match=r"hint: give what fc.run returns: fc.show\(fc.run\(scene\)\)"):
        fc.show(run)
    with pytest.raises(fc.InputError, match="is not that of a run"):
        fc.show(xr.Dataset())


def outputs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], str]:
    """A notebook of the documentation after its execution, and what its last cell printed."""
    if not notebooks.can_execute():
        pytest.skip("notebooks are executed with nbclient, ipykernel and distributed")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    done = notebooks.executed(NOTEBOOKS / f"{name}.ipynb")
    last = [cell for cell in done["cells"] if cell["cell_type"] == "code"][-1]
    return done, "".join(one["text"] for one in last["outputs"] if one.get("name") == "stdout")


@pytest.mark.filterwarnings("ignore")  # of the programs that execute
def test_the_notebook_of_a_first_mechanism_shows_scene_run_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    done, printed = outputs("first_mechanism", tmp_path, monkeypatch)
    text, shown = notebooks.page(done)
    assert sum("<iframe" in one for one in shown) == 2
    assert sum("<img" in one for one in shown) == 2
    assert all(text.count(f"\nOUTPUT-{k}-") == 1 for k in range(len(shown)))
    # the error of a run at the default tolerance, 1e-8 of energies of some joules
    assert float(re.findall(r"energy (\S+) J", printed)[0]) < 1e-6


@pytest.mark.filterwarnings("ignore")
def test_the_notebook_of_a_sweep_has_the_speeds_of_the_closed_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    _, printed = outputs("sweep_with_dask", tmp_path, monkeypatch)
    assert re.findall(r"[\d.]+", printed) == ["1."] * 12  # to three digits, at outputs every 20 ms


@pytest.mark.filterwarnings("ignore")
def test_the_notebook_of_a_fit_finds_the_numbers_behind_the_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """240 N/m and 3 N s/m within four standard deviations, and the noise of 0.5 mm: 149 residuals know it to 6 %."""
    _, printed = outputs("fit", tmp_path, monkeypatch)
    found = [tuple(map(float, pair)) for pair in re.findall(r"(\S+) ± (\S+)", printed)]
    for (value, uncertain), true in zip(found, (240.0, 3.0), strict=True):
        assert abs(value - true) < 4.0 * uncertain < 0.02 * true
    assert float(re.findall(r"noise (\S+) mm", printed)[0]) == pytest.approx(0.5, rel=0.25)


def test_notebooks_are_stored_without_outputs():
    for path in NOTEBOOKS.glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
