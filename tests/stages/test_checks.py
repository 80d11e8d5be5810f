"""What a run refuses before it starts, `check` reports: the same errors, all at once, each with file and line."""

import re
import tomllib
from pathlib import Path

import pytest

from flexclear.commands.new import write
from flexclear.scene.load import edited, load_scene
from flexclear.stages.scenes import missing_stress_errors
from tests.stages.conftest import Command
from tests.stages.typical_mistakes import LOAD

#: a slider-crank of rigid bodies with a loose pin, which starts as its ideal mechanism does
LOOSE = """title = "Slider-crank"
time.end = "10 ms"
[load.gravity]
type = "gravity"
acceleration = [0, "-9.81 m/s^2", 0]
[body.ground]
type = "ground"
frames.O = {}
frames.guide = { axis = [1, 0, 0] }
[body.crank]
type = "rigid"
mass = 1
inertia = [1e-4, 1e-3, 1e-3]
frames.O = {}
frames.A = { position = ["50 mm", 0, 0] }
[body.rod]
type = "rigid"
mass = 0.5
inertia = [1e-4, 2e-3, 2e-3]
frames.A = {}
frames.B = { position = ["200 mm", 0, 0] }
[body.slider]
type = "rigid"
mass = 0.8
inertia = [1e-3, 1e-3, 1e-3]
frames.B = {}
frames.guide = { axis = [1, 0, 0] }
[joint.O]
type = "revolute"
between = ["ground.O", "crank.O"]
[joint.A]
type = "revolute"
between = ["crank.A", "rod.A"]
[joint.guide]
type = "prismatic"
between = ["ground.guide", "slider.guide"]
[joint.B]
type = "clearance-revolute"
between = ["rod.B", "slider.B"]
clearance = "0.1 mm"
pin_radius = "8 mm"
length = "16 mm"
normal = { law = "flores", restitution = 0.8, stiffness = 1e9 }
[drive.motor]
joint = "O"
law = { type = "polynomial", coefficients = ["40 deg", "300 rpm"] }
[start]
at = "ideal"
joint.guide.near = "230 mm"
"""
PID = '[load.{}]\ntype = "pid"\njoint = "{}"\nreference = 0\n{}\n'
#: changes of that scene, what is added to it -> key, line and words of each error
WRONG = {
    "drive and spring of a loose pin": (
        {'joint = "O"': 'joint = "B"'},
        LOAD.format("joint-spring", "B", "stiffness = 1"),
        {
            "drive.motor.joint": ('joint = "B"\nlaw', "the clearance-revolute joint 'B' has no coordinate"),
            "load.l.joint": ('joint = "B"\nstiff', "the clearance-revolute joint 'B' has no coordinate"),
        },
    ),
    "start beyond a stop": (
        {},
        '[stop.end]\njoint = "guide"\nupper = "0.1 m"\nnormal = { law = "hertz", stiffness = 1e9 }\n',
        # the guide starts at 50 mm cos 40 deg + sqrt((200 mm)^2 - (50 mm sin 40 deg)^2) = 235.7 mm
        {"stop.end": ("[stop.end]", "the coordinate starts 0.136 m beyond 0.1 m")},
    ),
    "spring and damper without length": (
        {},
        '[load.s]\ntype = "spring-damper"\nbetween = ["crank.A", "rod.A"]\nstiffness = 100\nfree_length = 0.01\n'
        '[load.d]\ntype = "spring-damper"\nbetween = ["rod.A", "crank.A"]\ndamping = 1\n',
        {
            "load.s.between": ('between = ["crank.A", "rod.A"]\nstiff', "its two ends coincide at the start"),
            "load.d.between": ('between = ["rod.A", "crank.A"]', "its two ends coincide at the start"),
        },
    ),
    "pins outside of journal and slot": (
        {'at = "ideal"\n': ""},  # with an ideal slot nothing could be assembled
        '[joint.slot]\ntype = "clearance-slot"\nbetween = ["ground.O", "crank.A"]\ntravel = "300 mm"\n'
        'clearance = "0.1 mm"\npin_radius = "8 mm"\nlength = 0.01\nnormal = { law = "hertz", stiffness = 1e9 }\n',
        # 50 mm sin 40 deg; the slider is at the guide's zero
        {
            "joint.slot.between": ('between = ["ground.O", "crank.A"]', "the pin ('crank.A') starts 32.14 mm from"),
            "joint.B.between": ('between = ["rod.B", "slider.B"]', "the pin ('slider.B') starts"),
        },
    ),
    "wrong units": (
        {},
        PID.format("p", "O", 'proportional = "10 N"')
        + PID.format("i", "A", 'integral = "10 N m"')
        + LOAD.format("joint-spring", "guide", 'stiffness = "4 N m/rad"\ndamping = "3 kg"'),
        {
            "load.p.proportional": ('proportional = "10 N"', "'10.0 N' is a force"),
            "load.i.integral": ('integral = "10 N m"', "'10.0 N m' is a torque"),
            "load.l.stiffness": ('stiffness = "4 N m/rad"', "'4.0 N m/rad' is a torsional stiffness"),
            "load.l.damping": ('damping = "3 kg"', "'3.0 kg' is a mass"),
        },
    ),
    "law of a loose pin that loses all": (
        {'"flores", restitution = 0.8': '"lankarani-nikravesh", delivered_restitution = 0.01'},
        "",
        {"joint.B.normal": ('normal = { law = "lank', "the law 'lankarani-nikravesh' delivers no restitution below")},
    ),
    "shape without a file": (
        {"[body.slider]\n": '[body.slider]\ngeometry = [{ type = "file", file = "no.stl", unit = "1 mm" }]\n'},
        "",
        {"body.slider.geometry.0": ("geometry = ", "there is no file")},
    ),
    "units of the parts next to one with an unknown key": (
        {},
        PID.format("p", "O", "propotional = 10") + LOAD.format("joint-spring", "guide", 'stiffness = "4 N m/rad"'),
        {
            "load.p.propotional": ("propotional", "unknown key"),
            "load.l.stiffness": ('stiffness = "4 N m/rad"', "'4.0 N m/rad' is a torsional stiffness"),
        },
    ),
    "pin of metres": (
        {'pin_radius = "8 mm"': "pin_radius = 8"},
        "",
        {"joint.B.pin_radius": ("pin_radius", "8 m is more than ten times the size of the mechanism")},
    ),
    "a pin, a stop and a spring at once": (
        {'pin_radius = "8 mm"': "pin_radius = 8"},
        '[stop.end]\njoint = "guide"\nupper = 0.1\nnormal = { law = "hertz", stiffness = 1e9 }\n'
        '[load.short]\ntype = "spring-damper"\nbetween = ["ground.O", "crank.O"]\nstiffness = 100\nfree_length = 0.1\n',
        {
            "joint.B.pin_radius": ("pin_radius", "8 m is more than ten times the size of the mechanism"),
            "stop.end": ("[stop.end]", "the coordinate starts 0.136 m beyond 0.1 m"),
            "load.short.between": ('between = ["ground.O", "crank.O"]\nst', "its two ends coincide at the start"),
        },
    ),
    "velocities that the joints forbid": (
        {"frames.B = {}": "frames.B = {}\nvelocity = [0, 1, 0]"},
        "",
        # the guide is along x
        {"body.slider.velocity": ("velocity = ", "joints and drives do not allow the given velocities of slider")},
    ),
    "events that are true at the start": (
        {
            'at = "ideal"\n': "",
            'type = "clearance-revolute"': 'type = "revolute"',
            'clearance = "0.1 mm"\npin_radius = "8 mm"\nlength = "16 mm"\n': "",
            'normal = { law = "flores", restitution = 0.8, stiffness = 1e9 }\n': "",
        },
        '[event.a]\nat = "O.position > 39 deg"\nrelease = "joint.A"\n'
        '[event.b]\nat = "slider.position.x < 0.3 m"\nrelease = "joint.guide"\n'
        '[event.c]\nat = "slider.position.x > 0.3 m"\nrelease = "load.gravity"\n',
        {
            "event.a.at": ('at = "O.', "'O.position > 39 deg' is already true at the start of the run"),
            "event.b.at": ('at = "slider.position.x < ', "'slider.position.x < 0.3 m' is already true"),
        },
    ),
    "event that is true where a pin starts pressed into its journal": (
        {},
        '[event.a]\nat = "B.normal_force > 0.1 N"\nrelease = "joint.guide"\n'
        '[event.b]\nat = "slider.position.x < 0.2 m"\nrelease = "joint.A"\n',
        {"event.a.at": ('at = "B.', "'B.normal_force > 0.1 N' is already true at the start of the run")},
    ),
    "angle without digits": (
        {'"polynomial", coefficients = ["40 deg", "300 rpm"]': '"harmonic", amplitude = 1, frequency = "1e30 Hz"'},
        "",
        # 2 pi 1e30 Hz 10 ms
        {"drive.motor.law": ("law = { type", "reaches an angle of 6.28e+28 rad in the run")},
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_check_and_run_report_the_same_errors_with_file_and_line(
    name: str, tmp_path: Path, command: Command, fresh: Path
) -> None:
    edits, more, expected = WRONG[name]
    scene, text = tmp_path / "own.toml", LOOSE + more
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    scene.write_text(text)
    for verb in ("check", "run"):
        said = command(verb, scene, code=2).err
        for key, (written, words) in expected.items():
            assert f"{scene} [{key}], line {text[: text.index(written)].count(chr(10)) + 1}: {words}" in said
        assert said.count(f"{scene} [") == len(expected)


@pytest.mark.parametrize("end", ["upper = 0.1", "lower = 0.3"])
def test_the_end_that_check_proposes_for_a_start_beyond_a_stop_is_accepted(
    end: str, tmp_path: Path, command: Command, fresh: Path
) -> None:
    """The guide starts at 0.2357 m: so far beyond the end that no contact can have begun before the start."""
    scene, stop = tmp_path / "own.toml", '[stop.end]\njoint = "guide"\nnormal = { law = "hertz", stiffness = 1e9 }\n'
    scene.write_text(LOOSE + stop + end)
    said = command("check", scene, code=2).err
    assert "initial_approach_speed" not in said
    proposed = re.search(r"set (upper|lower) to (\S+ m) or", said)
    assert proposed is not None
    scene.write_text(f'{LOOSE}{stop}{proposed[1]} = "{proposed[2]}"')
    command("check", scene)


#: scene, what is added to it -> key and words of its error; where a condition is true, and where a velocity is wrong,
#: follows from closed forms
STARTS = {
    "equilibrium": (
        "spring_pendulum",
        # 0.8 m + 9.81 m/s^2 1 kg / (500 N/m) = 0.81962 m; the scene's pose is at 0.79962 m
        '[start]\nat = "equilibrium"\n[event.a]\nat = "ball.position.z < -0.8196 m"\nrelease = "load.spring"\n'
        '[event.b]\nat = "ball.position.z < -0.8197 m"\nrelease = "load.gravity"\n',
        {"event.a.at": "is already true at the start of the run"},
    ),
    "flexible body": (
        "flexible_slider_crank",
        # both rods in line: 150 mm + 300 mm
        '[event.a]\nat = "slider.position.x > 0.4499 m"\nrelease = "joint.guide"\n'
        '[event.b]\nat = "slider.position.x > 0.4501 m"\nrelease = "joint.slider_pin"\n',
        {"event.a.at": "is already true at the start of the run"},
    ),
    "velocity next to a flexible body": (
        "flexible_slider_crank",
        "[set.body.slider]\nvelocity = [0, 1, 0]\n",  # the guide is along x
        {"body.slider.velocity": "joints and drives do not allow the given velocities of slider"},
    ),
}


@pytest.mark.parametrize("name", STARTS)
def test_check_finds_the_start_of_the_run(name: str, tmp_path: Path, command: Command, fresh: Path) -> None:
    """Also that of flexible bodies, and poses that the scene does not give; with the words of the run."""
    base, more, expected = STARTS[name]
    scene = tmp_path / "own.toml"
    scene.write_text(f'extends = "{Path(__file__).parents[2] / "scenes/checks" / base}.toml"\n{more}')
    for verb in ("check", "run") if name == "equilibrium" else ("check",):
        said = command(verb, scene, code=2).err
        for key, words in expected.items():
            line = more.split(key.removesuffix(".at").replace(".velocity", "]\nvel"))[0].count(chr(10)) + 3
            assert f"{scene} [{key}], line {line}: " in said
            assert words in said
        assert said.count(f"{scene} [") == len(expected)


@pytest.mark.parametrize(
    "old, new, warning",
    [
        (
            'pin_radius = "8 mm"',
            'pin_radius = "0.8 m"',
            "[joint.B.pin_radius], line 41: 0.8 m is more than the size of the mech",
        ),
        (
            '[0, "-9.81 m/s^2", 0]',
            "[0, 0, -9.81]",
            "[load.gravity.acceleration], line 5: [0.0, 0.0, -9.81] m/s^2 is along",
        ),
        (
            '[joint.O]\ntype = "revolute"\nbetween = ["ground.O", "crank.O"]\n',
            "",
            "[body.crank.frames.O], line 14: the frames 'ground.O' and 'crank.O' are unused: is a joint missing?",
        ),
    ],
)
def test_what_is_possible_but_hardly_meant_is_a_warning(
    old: str, new: str, warning: str, tmp_path: Path, command: Command
) -> None:
    text = LOOSE.replace('joint = "O"', 'joint = "A"') if not new else LOOSE
    (tmp_path / "own.toml").write_text(text.replace(old, new))
    assert f"warning: {tmp_path / 'own.toml'} {warning}" in command("check", tmp_path / "own.toml").err


def test_sections_that_the_run_does_not_contain_are_an_error(tmp_path: Path, command: Command) -> None:
    (tmp_path / "own.toml").write_text(text := LOOSE + '[sections]\nperiod = "20 ms"\n')
    line = text.count("\n")
    said = command("check", tmp_path / "own.toml", code=2).err
    assert f"[sections.period], line {line}: a period of 0.02 s is longer than the run" in said


@pytest.mark.parametrize(
    "start, error",
    [
        ('start.at = "equilibrium"\n', ""),
        ("start.modal.rod.coordinate = [1e-6]\n", ""),
        ("start.modal.rot.coordinate = [1e-6]\n", "[start.modal.rot], line 3: there is no flexible body 'rot'"),
    ],
)
def test_a_loaded_flexible_body_on_the_ground_may_start_in_balance_or_bent(
    start: str, error: str, tmp_path: Path, command: Command
) -> None:
    recipe = Path(__file__).parents[2] / "meshes" / "actuated_rod.toml"
    end = list(tomllib.loads(recipe.read_text())["frames"])
    (tmp_path / "own.toml").write_text(
        f'title = "Cantilever"\ntime.end = 1\n{start}[body.ground]\ntype = "ground"\nframes.O = {{}}\n'
        f'[body.rod]\ntype = "flexible"\nmesh = "{recipe}"\nmodes = {{ reference = "craig-bampton", count = 13 }}\n'
        f'[joint.wall]\ntype = "fixed"\nbetween = ["ground.O", "rod.{end[0]}"]\n'
        f'[load.tip]\ntype = "point-force"\nframe = "rod.{end[-1]}"\nforce = [0, 0, -1]\n'
    )
    done = command("check", tmp_path / "own.toml", code=2 if error else 0)
    assert error in done.err if error else "no error" in done.out


@pytest.mark.parametrize(
    "recipe, asked, lacks",
    [
        ("[shape]\ntype = 'mesh-file'", "rod.section_force", "a solid, which has no sections"),
        ("[shape]\ntype = 'mesh-file'", "rod.peak_von_mises", ""),
        ("[shape]\ntype = 'straight-beam'\n[section]\ntype = 'general'", "rod.peak_axial_stress", "unknown outline"),
        ("[shape]\ntype = 'straight-beam'\n[section]\ntype = 'general'", "rod.section_force", ""),
    ],
)
def test_a_watched_stress_that_a_body_does_not_have_is_refused(tmp_path: Path, recipe: str, asked: str, lacks: str):
    path = write("slider-crank", tmp_path)[0]
    scene = edited(load_scene(path), {"output.stress": ["rod"], "view": {"watch": [asked]}})
    (tmp_path / "rod.toml").write_text(recipe)
    said = [str(error) for error in missing_stress_errors(scene)]
    assert len(said) == bool(lacks)
    assert all(f"[view.watch]: '{asked}' is not recorded: 'rod' is" in one and lacks in one for one in said)
