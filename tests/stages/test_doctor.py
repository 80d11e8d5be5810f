"""``flexclear doctor`` tells what is there, computes something with a known answer, and says when it does not."""

from pathlib import Path

import pytest

from flexclear.commands import doctor, new
from flexclear.dynamics.compile import files
from flexclear.post.render import gl
from tests.processes import printed, python
from tests.stages.conftest import Command


def test_the_doctor_finds_this_place_well(command: Command):
    reported = command("doctor").out
    assert "WRONG" not in reported
    assert "a free fall of 0.1 s ends at -0.04905 m" in reported


def test_the_doctor_says_what_is_wrong(command: Command, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor, "_self_test", lambda: ("it fell upwards", False))
    reported = command("doctor", code=4)
    assert "WRONG  self-test  it fell upwards" in reported.out
    assert "problems: self-test" in reported.err


@pytest.mark.parametrize("draws, line", [(True, "ok     graphics"), (False, "lacks  graphics")])
def test_graphics_are_well_only_where_something_was_drawn(
    command: Command, monkeypatch: pytest.MonkeyPatch, draws: bool, line: str
):
    """Libraries that load may fail when they draw; they are not needed, so that the machine is well without them."""
    monkeypatch.setattr(doctor, "_self_test", lambda: ("it fell", True))
    monkeypatch.setattr(gl, "can_draw", lambda: draws)
    monkeypatch.setattr(gl, "library_state", lambda: "GL: libGL.so.1")
    assert line in command("doctor").out


def test_threads_that_somebody_asks_for_do_not_change_bytes():
    """Sums over several threads are added in another order; the libraries read this when they are loaded."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    code = f"import os, flexclear; print([os.environ[name] for name in {names}])"
    assert printed(code, **dict.fromkeys(names, "2")).strip() == "['1', '1']"


def test_the_usual_kinds_are_compiled_where_no_scene_is_named(
    monkeypatch: pytest.MonkeyPatch, fresh: Path, command: Command
) -> None:
    monkeypatch.setattr(doctor, "USUAL", ("pendulum",))
    assert "compiled: all functions for runs of pendulum" in command("doctor", "--compile").out
    assert not (fresh).exists()


def test_what_was_compiled_before_a_run_is_all_that_it_calls(tmp_path: Path) -> None:
    """Also by the methods among which it chooses; in processes of their own, as a user has them."""
    kernels = tmp_path / "kernels"
    own = {"FLEXCLEAR_RESULTS": str(tmp_path / "results"), "FLEXCLEAR_KERNELS": str(kernels)}

    def command(*words: str) -> None:
        python("-m", "flexclear.commands", *words, **own)

    def code() -> dict[Path, int]:  # a file that is written again replaces the first
        return {path: path.stat().st_ino for path in kernels.rglob(f"*{files.CODE}")}

    scene = new.write("pendulum", tmp_path)[0]
    command("doctor", "--compile", str(scene))
    before = code()
    assert before
    command("run", str(scene), "--to", "simulate", "-q")
    assert code() == before


@pytest.mark.parametrize(
    "options, words",
    [
        (("--bundle", "four_bar", "--out", "x.csv"), "unknown format '.csv'"),
        (("--bundle", "four_bar", "--out", "none/x.zip"), "its folder does not exist"),
        (("--out", "x.zip"), "of --bundle, which is not given"),
        (("--compile", "nowhere/none.toml"), "none.toml"),
    ],
)
def test_what_the_doctor_cannot_do_is_refused_at_once(options: tuple[str, ...], words: str, command: Command) -> None:
    assert words in command("doctor", *options, code=2).err
