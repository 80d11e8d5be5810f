"""The command at work on a copy of the project with small engines: what runs, when, and how often."""

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray as xr

import flexclear as fc
from flexclear.artifacts.disk import _host
from tests.stages.conftest import CONTACT, JOINT, PATIENCE, SCENE, Project


def test_what_is_fresh_is_not_run_again(here: Project):
    assert here.run("run", "tiny/contact").returncode == 0
    assert here.calls() == ["simulate tiny/contact", "post tiny/contact"]
    shown = here.results / "runs" / "tiny" / "contact"
    assert xr.load_dataset(shown / "run.nc", decode_times=False).attrs["scene"] == "tiny/contact"
    assert (shown / "post.nc").is_file()
    again = here.run("run", "tiny/contact")
    assert (again.returncode, again.stderr, here.calls()) == (0, "", [])


def test_why_says_what_changed_and_run_does_just_that(project: Project):
    never = project.run("why", "tiny/contact").stdout
    assert never.split() == ["tiny/contact", "simulate", "never", "run", "post", "never", "run"]
    project.run("run", "tiny/contact")
    project.edit("scenes/tiny/contact.toml", "0.5 mm", "0.2 mm")
    with (project.folder / "pipeline/flexclear/dynamics/contact/normal/lankarani_nikravesh.py").open("a") as file:
        file.write("\nEDITED = 1\n")
    lines = [line.strip() for line in project.run("why", "tiny/contact").stdout.splitlines()]
    assert lines == [
        "tiny/contact",
        "simulate         code of dynamics changed",
        "scene.joint.J.clearance: 0.0005 -> 0.0002",
        "post             its input run would be computed again",
    ]
    project.calls()
    project.run("run", "tiny/contact")
    assert project.calls() == ["simulate tiny/contact", "post tiny/contact"]
    project.edit("scenes/tiny/contact.toml", "0.2 mm", "0.5 mm")
    project.edit("pipeline/flexclear/dynamics/contact/normal/lankarani_nikravesh.py", "\nEDITED = 1\n", "")
    project.run("run", "tiny/contact")
    assert project.calls() == []  # what was made before the edits is still in the cache


def test_equal_results_stop_the_chain(project: Project):
    """A new title of nothing else: simulate runs again after an edit, post has the same input."""
    project.run("run", "tiny/ideal")
    project.calls()
    first = "from __future__ import annotations\n"
    project.edit("pipeline/flexclear/stages/simulation.py", first, first + "\nEDITED = 1\n")
    project.run("run", "tiny/ideal", "--to", "simulate")
    assert project.calls() == ["simulate tiny/ideal"]
    assert "post             fresh" in project.run("why", "tiny/ideal").stdout


def test_a_corrupt_artifact_is_reported_in_one_line_and_rebuilt(here: Project):
    here.run("run", "tiny/ideal")
    path = here.artifact("simulate")
    whole = path.read_bytes()
    for broken in (whole[:-1] + bytes([whole[-1] ^ 1]), whole[:100]):
        here.calls()
        path.write_bytes(broken)
        assert "is corrupt" in here.run("why", "tiny/ideal").stdout
        done = here.run("run", "tiny/ideal")
        assert (done.returncode, here.calls()) == (0, ["simulate tiny/ideal"])
        assert sum("is corrupt" in line for line in done.stderr.splitlines()) == 1
        assert path.read_bytes() == whole


def test_two_commands_at_once_do_the_work_once(project: Project):
    hold = project.hold
    first = project.start("run", "tiny/ideal", HELD_BY=str(hold))
    _wait_for(project.began)
    second = project.start("run", "tiny/ideal")
    assert second.stderr is not None
    assert any("waiting for another process" in line for line in second.stderr)
    hold.unlink()
    ends = [process.communicate(timeout=PATIENCE) for process in (first, second)]
    assert [process.returncode for process in (first, second)] == [0, 0], ends
    assert project.calls() == ["simulate tiny/ideal", "post tiny/ideal"]
    assert project.run("why", "tiny/ideal").stdout.count("fresh") == 2


@pytest.mark.parametrize("scenes", [["tiny/ideal"], ["tiny/ideal", "tiny/contact"]], ids=["alone", "workers"])
def test_an_interrupt_ends_everything_with_130(project: Project, scenes: list[str]):
    process = project.start("run", *scenes, HELD_BY=str(project.hold))
    _wait_for(project.began)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    assert not list(project.results.rglob("*.nc"))


def test_a_solver_that_gives_up_stops_only_what_depends_on_it(here: Project):
    here.add("fails", SCENE + JOINT)
    done = here.run("run", "tiny/fails", "tiny/ideal", "--jobs", "1")
    assert done.returncode == 3
    assert "flexclear: tiny/fails simulate: at t = 0.1 s joint A1: no step is small enough" in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(here.calls()) == ["post tiny/ideal", "simulate tiny/fails", "simulate tiny/ideal"]


def test_a_full_disk_ends_with_4_and_leaves_nothing(project: Project):
    code = (
        "import resource, sys; from flexclear.commands.__main__ import main;"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY)); sys.exit(main(['run', 'tiny/ideal']))"
    )
    done = project.python("-c", code, CALLS=os.devnull)
    assert done.returncode == 4, done.stderr
    assert "the disk is full" in done.stderr
    assert "Traceback" not in done.stderr
    left = [path.name for path in project.results.rglob("*") if path.is_file() and path.stat().st_size]
    assert left == ["code.json"]  # which was there before


def test_a_scene_that_says_the_same_under_another_name_is_not_run_again(here: Project):
    """The name of its file is no fact; both show the result, and only `run` from Python and `--out` name it."""
    here.add("twin", SCENE + JOINT)
    for name in ("ideal", "twin"):
        here.run("run", f"tiny/{name}", "--to", "simulate", "--out", str(here.folder / f"{name}.nc"))
        named = xr.load_dataset(here.folder / f"{name}.nc", decode_times=False)
        assert named.attrs["scene"] == f"tiny/{name}"
    assert here.calls() == ["simulate tiny/ideal"]
    shown = [here.results / "runs" / "tiny" / name / "run.nc" for name in ("ideal", "twin")]
    assert shown[0].read_bytes() == shown[1].read_bytes()


def test_the_ensemble_is_a_stage_of_its_own(here: Project):
    here.add("many", CONTACT + "\n[ensemble]\nmembers = 3\n")
    here.run("run", "tiny/many")
    assert sorted(here.calls()) == ["ensemble tiny/many", "post tiny/many", "simulate tiny/many"]
    here.edit("scenes/tiny/many.toml", "members = 3", "members = 4")
    here.run("run", "tiny/many")
    assert here.calls() == ["ensemble tiny/many", "post tiny/many"]
    stored = xr.load_dataset(here.results / "runs" / "tiny" / "many" / "ensemble.nc")
    assert stored.sizes["member"] == 4


def test_an_edited_scene_does_not_take_the_place_of_its_file(here: Project):
    here.run("run", "tiny/contact", "--to", "simulate")
    shown = here.results / "runs" / "tiny" / "contact" / "run.nc"
    before = shown.read_bytes()
    run = fc.run(fc.load_scene("scenes/tiny/contact.toml", override={"output.interval": "1 ms"}))
    assert (float(run.time[1]), run.attrs["title"]) == (0.001, "Ball in a socket, with clearance")
    assert shown.read_bytes() == before
    assert "fresh" in here.run("why", "tiny/contact", "--to", "simulate").stdout


def test_out_copies_the_run(here: Project):
    target = here.folder / "mine.nc"
    assert here.run("run", "tiny/ideal", "--out", "mine.nc").returncode == 0
    copied = xr.load_dataset(target, decode_times=False)
    assert copied.attrs["title"] == "Ball in a socket"
    assert copied.sizes["time"] == 5
    assert here.run("run", "tiny/ideal", "--out", "mine.csv").returncode == 0
    columns = (here.folder / "mine.csv").read_text().splitlines()
    assert columns[0].startswith("time,")
    assert len(columns) > 2
    unknown = here.run("run", "tiny/ideal", "--out", "mine.hdf")
    assert unknown.returncode == 2
    assert "unknown format '.hdf'" in unknown.stderr
    refused = here.run("run", "tiny/ideal", "--out", "nowhere/mine.nc")
    assert refused.returncode == 2
    assert "its folder does not exist" in refused.stderr
    assert here.run("run", "tiny/ideal", "--out", ".").returncode == 2
    assert here.run("run", "tiny/ideal", "tiny/contact", "--out", "mine.nc").returncode == 2


def test_progress_goes_to_stderr_and_what_was_written_to_stdout(here: Project):
    done = here.run("run", "tiny/ideal")
    reported = "run.nc (the run), post.nc (derived from it)"
    assert done.stdout == f"{here.results.relative_to(here.folder)}/runs/tiny/ideal: {reported}\n"
    assert "flexclear: [0/2] tiny/ideal: simulate" in done.stderr.splitlines()
    json.loads(here.run("schema").stdout)


def _wait_for(condition: Callable[[], bool]) -> None:
    """Until something has happened in another process, which on a busy machine takes its time to start."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_two_files_of_one_name_are_distinguished_or_refused(here: Project):
    """Below the current folder they are called by their paths; elsewhere one must not take the other's place."""
    for name in ("a", "b"):
        (here.folder / name).mkdir()
        (here.folder / name / "x.toml").write_text(SCENE + JOINT + f"\n# {name}\n")
    assert here.run("run", "a/x.toml", "b/x.toml", "--to", "simulate", "--jobs", "1").returncode == 0
    assert all((here.results / "runs" / name / "x" / "run.nc").is_file() for name in ("a", "b"))
    away = here.folder.parent / "away"
    away.mkdir()
    paths = [str((here.folder / name / "x.toml").rename(away / f"{name}.toml")) for name in ("a", "b")]
    (away / "c").mkdir()
    twin = away / "c" / "a.toml"
    twin.write_text(SCENE + JOINT)
    done = here.run("run", paths[0], str(twin))
    assert done.returncode == 2
    assert "is called 'a', as" in done.stderr
    assert "replace each other" in done.stderr
    here.run("run", paths[0], "--to", "simulate")
    done = here.run("run", str(twin), "--to", "simulate")
    assert done.returncode == 0
    assert f"runs/a showed {paths[0]} and now shows {twin}" in done.stderr


def test_a_run_that_failed_or_was_killed_does_not_leave_the_last_one_looking_current(project: Project):
    folder = project.results / "runs" / "tiny" / "ideal"
    project.run("run", "tiny/ideal")
    assert not (folder / "OUTDATED.txt").exists()
    engine = "pipeline/flexclear/dynamics/__init__.py"
    project.edit(engine, 'if "fails" in scene.name', 'if "ideal" in scene.name')
    assert project.run("run", "tiny/ideal").returncode == 3
    reported = (folder / "OUTDATED.txt").read_text()
    assert "are outdated" in reported
    assert "simulate: tiny/ideal simulate: at t = 0.1 s joint A1: no step is small enough" in reported
    assert "post: tiny/ideal simulate: at t = 0.1 s" in reported
    assert "the shown results are outdated: tiny/ideal simulate: at t" in project.run("why", "tiny/ideal").stdout
    project.edit(engine, 'if "ideal" in scene.name', 'if "other" in scene.name')
    process = project.start("run", "tiny/ideal", HELD_BY=str(project.hold))
    project.calls()
    _wait_for(project.began)
    process.kill()
    process.communicate(timeout=PATIENCE)
    assert "an update was started and not finished" in (folder / "OUTDATED.txt").read_text()
    project.calls()
    assert project.run("run", "tiny/ideal").returncode == 0
    assert project.calls() == ["simulate tiny/ideal"]  # with the result of the first run
    assert not (folder / "OUTDATED.txt").exists()
    assert project.run("why", "tiny/ideal").stdout.count("fresh") == 2


def test_workers_and_what_they_left_are_gone_after_their_parent_was_killed(project: Project):
    """Whatever it was killed by; temporary files and locks go with the next command."""
    process = project.start("run", "tiny/ideal", "tiny/contact", HELD_BY=str(project.hold))
    _wait_for(lambda: project.began() and len((project.folder / "calls").read_text().splitlines()) == 2)
    family = _descendants(process.pid)
    assert len(family) >= 2  # two workers, and what tracks their locks
    locks = list(project.results.rglob("*.lock"))
    assert locks
    process.kill()
    process.communicate(timeout=PATIENCE)
    _wait_for(lambda: not any(_alive(pid) for pid in family))
    left = project.results / "cache" / "simulate" / locks[0].name.replace(".lock", ".json")
    stem = f".{left.stem}.{_host()}-{process.pid}.0badcafe.tmp"
    (left.parent / stem).write_bytes(b"half a record")
    assert project.run("why", "tiny/ideal").returncode == 0
    assert project.run("run", "tiny/ideal").returncode == 0
    assert not list(project.results.rglob("*.lock"))
    assert not list(project.results.rglob("*.tmp"))


def _descendants(pid: int) -> list[int]:
    """Processes that it started, and those that these started."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found += [child, *_descendants(child)]
    return found


def _alive(pid: int) -> bool:
    """A zombie has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_what_a_run_is_to_be_doubted_for_ends_the_command_each_time(here: Project):
    here.add("doubtful", SCENE + JOINT)
    reported = ["tiny/doubtful: warning: the rod bends too far", "tiny/doubtful: warning: the contact is too deep"]
    for _ in range(2):  # the second time nothing runs
        done = here.run("run", "tiny/doubtful")
        assert done.returncode == 0
        assert done.stderr.splitlines()[-2:] == [f"flexclear: {sentence}" for sentence in reported]


def test_a_missed_accuracy_ends_with_3_unless_the_scene_allows_it(here: Project):
    requested = SCENE + JOINT + '[accuracy]\nball.position = "1 um"\n'
    here.add("wanted", requested)
    for _ in range(2):
        done = here.run("run", "tiny/wanted")
        assert done.returncode == 3
        assert (
            "tiny/wanted [accuracy]: missed: ball.position has an error of 2e-06, 2 times the requested accuracy"
            in done.stderr
        )
        assert "allow_missed = true" in done.stderr
        assert "Traceback" not in done.stderr
    kept = xr.load_dataset(here.results / "runs" / "tiny" / "wanted" / "run.nc", decode_times=False)
    assert "2 times the requested accuracy" in kept.attrs["accuracy_verdict"]
    here.calls()
    here.add("wanted", requested + "allow_missed = true\n")
    done = here.run("run", "tiny/wanted")
    assert done.returncode == 0
    assert "missed: ball.position" in done.stderr
    assert here.calls() == []  # whether it may be missed changes nothing of the run
