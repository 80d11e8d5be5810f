"""Whatever stands in a scene or a recipe: taken, or refused in words, without endless work and in little memory."""

import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from flexclear.pipeline.core.scene.limits import Limits
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.errors import FlexclearError, InputError, ResourceError
from flexclear.pipeline.structure.kinds import kind
from flexclear.stages import meshing
from flexclear.stages.graph import Graph
from tests.properties.mutants import mutant, sound

#: processor time [s] after which work counts as endless (measured 0.4 s), resident memory [MB] and bytes of a message
#: at most; measured 20 MB and 3.6 kB, where a message is cut to its size
SECONDS, MEGABYTES, BYTES = 60.0, 200.0, 4000


def read_scene(path: Path) -> None:
    """As far as a command gets before a stage runs."""
    Graph(load_scene(path)).up_to("post")


def read_recipe(path: Path) -> None:
    """As far as stage 1 gets."""
    meshing.check_size(path, Limits(cells=1000))
    table = meshing.params(path)["recipe"]
    kind.build(table, path.parent)


def judged(read: Callable[[Path], None], texts: list[str], path: Path, seeds: range) -> list[str]:
    """What went wrong with mutants: seed and sentence."""
    wrong, before = [], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in seeds:
        path.write_text(mutant(texts, seed), errors="replace")
        begun, reported = time.process_time(), ""
        try:
            read(path)
        except (InputError, ResourceError) as error:
            reported = str(error)
        except Exception as error:
            wrong.append(f"{seed}: {type(error).__name__} {str(error)[:200]}")
        seconds = time.process_time() - begun
        if seconds > SECONDS:
            wrong.append(f"{seed}: {seconds:.2f} s")
        if len(reported.encode()) > BYTES or any(not (c.isprintable() or c == "\n") for c in reported):
            wrong.append(f"{seed}: {len(reported.encode())} bytes, {reported[:200]!r}")
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if after - before > 1024 * MEGABYTES:
            wrong.append(f"{seed}: {(after - before) / 1024:.0f} MB")
            before = after
    return wrong


KINDS = [pytest.param(read_scene, "scenes", id="scenes"), pytest.param(read_recipe, "meshes", id="recipes")]


@pytest.mark.parametrize("read, folder", KINDS)
def test_mutants_are_taken_or_refused_in_words(
    read: Callable[[Path], None], folder: str, root: Path, tmp_path: Path
) -> None:
    assert judged(read, list(sound(root / folder)), tmp_path / "mutant.toml", range(150)) == []


@pytest.mark.slow
@pytest.mark.parametrize("read, folder", KINDS)
def test_ten_thousand_mutants_are_taken_or_refused_in_words(
    read: Callable[[Path], None], folder: str, root: Path, tmp_path: Path
) -> None:
    assert judged(read, list(sound(root / folder)), tmp_path / "mutant.toml", range(1000, 11_000)) == []


def refusal(path: Path | str) -> str:
    begun = time.process_time()
    with pytest.raises(FlexclearError) as caught:
        load_scene(path)
    assert time.process_time() - begun < SECONDS
    assert caught.value.exit_code == 2
    reported = str(caught.value)
    assert len(reported.encode()) < BYTES
    return reported


def test_paths_that_are_no_files_are_refused(tmp_path: Path) -> None:
    """Reading the first of them would never end, the second would wait for a writer."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    assert "no ordinary file" in refusal("/dev/zero")
    assert "no ordinary file" in refusal(tmp_path / "pipe.toml")
    assert refusal(tmp_path / "loop.toml")
    assert refusal("a\0b.toml")
    assert refusal("x" * 5000 + ".toml")
    (tmp_path / "...toml").write_text('title = "a"')
    assert "is no name for a scene" in refusal(tmp_path / "...toml")
    text = (
        'title = "a"\ntime.end = 1\n[body.b]\ntype = "flexible"\nmesh = "MESH"\nmodes = { reference = "x", count = 1 }'
    )
    for mesh in ("/dev/zero", str(tmp_path / "pipe.toml"), "x" * 5000, "a\\u0000b"):
        (tmp_path / "scene.toml").write_text(text.replace("MESH", mesh))
        with pytest.raises(InputError):
            Graph(load_scene(tmp_path / "scene.toml")).up_to("mesh")


HOSTILE = {
    "a quantity with much white space": f'time.end = "1 a{" " * 60_000}"',
    "a key of many parts": "a." * 300_000 + "b = 1",
    "a number of 5000 digits": f"time.end = {'9' * 5000}",
    "a number of 400 digits": f"time.end = {'9' * 400}",
    "a part called source": '[body.source]\ntype = "ground"',
    "a frame called source": '[body.a]\ntype = "ground"\nframes.source = {}',
    "control characters": '[body."\\u001b[31m"]\ntype = "ground"',
    "a long key": f"{'k' * 60_000} = 1",
    "a line of many numbers": "x = " + "1 m " * 30_000,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_text_is_refused_at_once(text: str, tmp_path: Path) -> None:
    path = tmp_path / "hostile.toml"
    path.write_text(f'title = "a"\n{text}\n')
    assert "\x1b" not in refusal(path)


def test_a_title_is_no_formula() -> None:
    """Titles come from scenes; Matplotlib would read what stands between dollar signs, and give up over this."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    from flexclear.pipeline.post.plotting.style import heading

    figure = Figure()
    heading(figure, r"Costs $x^{ and \frac$", "below")
    figure.canvas.draw()
