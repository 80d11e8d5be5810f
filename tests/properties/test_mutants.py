"""Whatever stands in a scene or a recipe: taken, or refused in words, without endless work and in little memory."""

import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from flexclear.scene.limits import Limits
from flexclear.scene.load import load_scene
from flexclear.stages import meshing
from flexclear.stages.graph import Graph
from flexclear.structure.kinds import kind
from flexclear.system.errors import InputError, ResourceError
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


@pytest.mark.parametrize("seeds", [range(150), pytest.param(range(1000, 11_000), marks=pytest.mark.slow)], ids=len)
@pytest.mark.parametrize("read, folder", [(read_scene, "scenes"), (read_recipe, "meshes")], ids=["scenes", "recipes"])
def test_mutants_are_taken_or_refused_in_words(
    read: Callable[[Path], None], folder: str, seeds: range, root: Path, tmp_path: Path
) -> None:
    assert judged(read, list(sound(root / folder)), tmp_path / "mutant.toml", seeds) == []


def test_a_title_is_no_formula() -> None:
    """Titles come from scenes; Matplotlib would read what stands between dollar signs, and give up over this."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    from flexclear.post.plotting.style import heading

    figure = Figure()
    heading(figure, r"Costs $x^{ and \frac$", "below")
    figure.canvas.draw()
