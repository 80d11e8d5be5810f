"""What the command says to a user who made a mistake: place, value, rule, remedy, and the exit code."""

import re
from pathlib import Path

import pytest

from flexclear.commands.__main__ import build_parser
from flexclear.stages.graph import STAGES
from tests.stages.conftest import JOINT, SCENE, Command


@pytest.mark.parametrize("verb", ["run", "why"])
def test_wrong_scenes_are_refused_before_anything_runs(command: Command, tmp_path: Path, verb: str):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE + JOINT + "\n[body.ball.colour]\nred = 1\n")
    said = command(verb, path, code=2)
    assert said.out == ""
    assert said.err.startswith("flexclear: ")
    assert "Traceback" not in said.err
    for part in ("body.ball", "colour", "unknown key"):
        assert part in said.err


def test_all_errors_of_all_scenes_are_reported_at_once(command: Command, tmp_path: Path):
    for name in ("one", "two"):
        (tmp_path / f"{name}.toml").write_text(SCENE.replace('"1 kg"', "-1").replace('"1 s"', '"1 kg"') + JOINT)
    err = command("run", tmp_path / "one.toml", tmp_path / "two.toml", "sps4/nothing", code=2).err
    assert err.count("one.toml [body.ball.mass]") == err.count("two.toml [time.end]") == 1
    assert "sps4/nothing" in err


@pytest.mark.parametrize(
    "name, reported", [("sps4/csk", "did you mean 'sps4/csj'"), ("nowhere/a.toml", "no such file"), (".", "is neither")]
)
def test_scenes_that_are_not_there(command: Command, name: str, reported: str):
    assert reported in command("run", name, code=2).err


def test_scenes_are_named_by_file_or_by_name(command: Command, root: Path):
    by_name, by_file = command("why", "sps4/ideal"), command("why", root / "scenes" / "sps4" / "ideal.toml")
    assert by_name == by_file
    assert by_name.out.splitlines()[0] == "sps4/ideal"


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["chek", "a.toml"], "chek: unknown command\n  hint: did you mean 'check'?"),
        (["fly"], "fly: unknown command\n  hint: known: cache, check,"),
        (["a.toml"], "a.toml: is not a command\n  hint: a command comes first, as in: flexclear check a.toml"),
        (["run", "checks/pendulum", "--jbos", "2"], "--jbos: unknown option\n  hint: did you mean '--jobs'?"),
        (["plan", "a", "--bugdet", "2s"], "--bugdet: unknown option\n  hint: did you mean '--budget'?"),
        (["run", "a", "--bugdet", "2s"], "--bugdet: unknown option\n  hint: known: "),
        (["sweep", "a", "--jbos=3"], "--jbos: unknown option\n  hint: did you mean '--jobs'?"),
    ],
)
def test_a_misspelt_command_or_option_gets_the_nearest_one(command: Command, arguments: list[str], said: str):
    assert command(*arguments, code=2).err.startswith(f"flexclear: {said}")


@pytest.mark.parametrize("arguments", [[], ["run"], ["run", "sps4/ideal", "--to", "moon"]])
def test_usage_mistakes_end_with_2(command: Command, arguments: list[str]):
    assert "usage: flexclear" in command(*arguments, code=2).err


def test_help_names_every_stage(command: Command):
    said = command("run", "--help").out
    assert all(stage in said for stage in STAGES)
    assert build_parser([]).prog == "flexclear"


def test_cite_names_methods_that_are_used_and_no_others(command: Command):
    contact = command("cite", "sps4/csj").out
    ideal = command("cite", "sps4/ideal").out
    assert "Lankarani & Nikravesh (1990)" in contact
    assert "Lankarani" not in ideal
    assert "Hairer" in ideal
    assert "Table 1" in ideal
    pendulum = command("cite", "checks/pendulum").out
    assert "Hairer" in pendulum
    assert "PID" not in pendulum
    assert "dynamics.contact" not in pendulum
    controlled = command("cite", "checks/controllers").out
    assert "PID" in controlled


@pytest.mark.parametrize("scene", ["sps4/csj", "sps4/far_csj_cb"])
def test_cite_separates_the_methods_of_every_run_from_those_that_only_some_need(command: Command, scene: str):
    """All were in one list, with Lyapunov exponents, LU factors and the registers of the processor."""
    said = command("cite", scene).out
    always, _, rest = said.partition("Methods used only when a run or a command needs them\n")
    some, _, _ = rest.partition("Data of")
    for module in ("integrate.dop853", "contact.normal.lankarani_nikravesh", "drives.step"):
        assert f"{module}:" in always
    for module in ("integrate.radau", "integrate.newton", "run.singular_poses.collocation"):
        assert f"{module}:" in some
        assert f"{module}:" not in always
    for module in ("dynamics.compile", "dynamics.plan"):  # how code is made, and other commands
        assert module not in said


def test_report_lists_only_commands_that_do_something(command: Command):
    """Each verb of the help has its own help, and a function behind it."""
    verbs = re.findall(r"^ {4}([a-z]+)", command("--help").out, re.MULTILINE)  # deeper lines are texts
    assert {"run", "why", "render", "report", "schema", "cite"} <= set(verbs)
    for verb in verbs:
        command(verb, "--help")
