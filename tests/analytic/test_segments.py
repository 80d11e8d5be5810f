"""Rods in segments: elastica under a force and a moment at the tip, strut beyond its load, equality to whole rods."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad
from scipy.special import ellipk

import flexclear as fc
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.scene.toml_files import read_toml
from flexclear.stages.scenes import require_names
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.basis import ModeRequest
from flexclear.structure.modes.deficits import _solve
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError, InputErrors
from flexclear.system.progress import silent

LENGTH, WIDTH, HEIGHT, E = 1.0, 0.03, 0.003, 70e9
EI = E * WIDTH * HEIGHT**3 / 12.0
RECIPE = f"""
title = "Strip"
elements = 32
interfaces = ["root", "tip"]
shape = {{ type = "straight-beam", length = {LENGTH} }}
material = {{ density = 2700.0, youngs_modulus = {E}, poisson = 0.33 }}
section = {{ type = "rectangle", width = {WIDTH}, height = {HEIGHT} }}
[frames]
root = {{ x = 0.0 }}
middle = {{ x = "500 mm" }}
tip = {{ x = {LENGTH} }}
"""
SCENE = """
title = "Strip"
[body.ground]
type = "ground"
frames = { O = { axes = { z = [1, 0, 0], x = [0, 1, 0] } } }
[body.rod]
type = "flexible"
mesh = "rod.toml"
modes = { reference = "craig-bampton", count = 6 }
segments = 4
[joint.clamp]
type = "fixed"
between = ["ground.O", "rod.root"]
[load.tip]
type = "point-force"
frame = "rod.tip"
force = [0.0, 0.0, 1.0]
[time]
end = 0.01
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "rod.toml").write_text(RECIPE)
    (tmp_path / "strip.toml").write_text(SCENE)
    return tmp_path / "strip.toml"


def bundles(scene: Scene) -> dict[str, xr.Dataset]:
    result = {}
    for name, body in scene.flexible().items():
        mesh = kind.build(read_toml(Path(body.mesh)), segment=body.segment)
        count = None if body.modes.count == "all" else body.modes.count
        modes = solve(mesh, body.modes.reference, requested=ModeRequest(count=count))
        result[name] = bundle.build(mesh, modes, stiffening=body.stiffening is not None)
    return result


def tip(path: Path, segments: int, **changes: Any) -> np.ndarray:
    """Position of the tip at equilibrium, x and z [m]."""
    scene = load_scene(path, {"body.rod.segments": segments, **{k.replace("_", "."): v for k, v in changes.items()}})
    found = analyses.equilibrium(scene, bundles(scene), silent)
    values: np.ndarray = found["frame_position"].sel(frame=f"rod_{segments}.tip").values[[0, 2]]
    return values


def bent_by_force(angle: float) -> tuple[float, np.ndarray]:
    """Force that turns the tip by an angle, and the tip's position: theta'^2 = 2 F/EI (sin(angle) - sin(theta))."""

    def integral(factor: Any) -> float:  # theta = angle - u^2 removes the root's singularity
        def of_u(u: float) -> float:
            theta = angle - u * u
            return float(factor(theta) * 2.0 * u / np.sqrt(np.sin(angle) - np.sin(theta))) if u else 0.0

        return float(quad(of_u, 1e-9, np.sqrt(angle), epsabs=1e-12)[0])

    whole = integral(lambda theta: 1.0)
    place = np.array([integral(np.cos), integral(np.sin)]) * LENGTH / whole
    return 0.5 * EI * (whole / LENGTH) ** 2, place


def test_a_tip_force_that_turns_the_tip_by_60_degrees_is_met_with_order_two(path: Path) -> None:
    force, exact = bent_by_force(np.radians(60.0))
    errors = [np.linalg.norm(tip(path, n, load_tip_force=[0.0, 0.0, force]) - exact) for n in (4, 8)]
    assert errors[1] < 5e-3  # of 1 m; 3.8e-3 by the angle of 10 degrees that a segment bends by, squared / 8
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)  # 1/n^2, and a tenth for the next term at n = 4


def test_stiffening_leaves_the_order_and_lowers_the_error(path: Path) -> None:
    """Shortening by bending is the largest part of what a segment's linear modes leave out."""
    force, exact = bent_by_force(np.radians(60.0))
    plain, second = (
        np.linalg.norm(tip(path, 4, load_tip_force=[0.0, 0.0, force], body_rod_stiffening=value) - exact)
        for value in (None, {})
    )
    assert second < 0.5 * plain


def test_a_moment_bends_a_rod_to_half_a_circle_with_order_two(path: Path) -> None:
    moment, exact = np.pi * EI / LENGTH, np.array([0.0, 2.0 * LENGTH / np.pi])
    load = {"type": "point-torque", "frame": "rod.tip", "torque": [0.0, -moment, 0.0]}
    errors = [np.linalg.norm(tip(path, n, load_tip=load) - exact) for n in (4, 8)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


def test_a_strut_bends_beyond_its_load_as_its_elastica_does(path: Path) -> None:
    """Clamped-free strut under a dead load: P/P_E = (2 K(k)/pi)^2 with k the sine of half the tip's angle."""
    angle = np.radians(90.0)
    load = (2.0 * ellipk(np.sin(0.5 * angle) ** 2) / np.pi) ** 2 * EI * (0.5 * np.pi / LENGTH) ** 2
    # a small push, 2e-4 of the load, chooses the side; beyond the buckling load it shifts the tip by its order only
    found = [tip(path, n, load_tip_force=[-load, 0.0, 2e-4 * load])[1] for n in (4, 8)]
    k = np.sin(0.5 * angle)
    across = 2.0 * k * LENGTH / ellipk(k * k)
    # of order 1/n^2, from 1.8e-2 for four segments to 2e-3 for eight
    assert found[0] == pytest.approx(across, rel=0.05)
    assert found[1] == pytest.approx(across, rel=0.0125)


def test_with_all_modes_a_rod_in_segments_is_the_whole_rod(path: Path) -> None:
    """Small vibrations do not know of the cuts: a tapered rod with masses, one at a cut, clamped at its root."""
    text = RECIPE.replace("elements = 32", "elements = 12").replace(
        "[frames]\nroot",
        """
[end_section]
type = "rectangle"
width = "20 mm"
height = "2 mm"
[masses.at_cut]
x = "0.25 m"
mass = 0.1
inertia = [1e-5, 1e-5, 1e-5]
[masses.at_tip]
x = "1 m"
mass = 0.05
com = [0.0, 0.01, 0.02]
[frames]
root""",
    )
    (path.parent / "rod.toml").write_text(text)
    changes = {"body.rod.modes.count": "all", "load": {}}
    cut, whole = (load_scene(path, {**changes, "body.rod.segments": n}) for n in (4, None))
    assert list(whole.flexible()) == ["rod"]
    found = [analyses.frequencies(scene, bundles(scene), silent)["frequency"].values for scene in (cut, whole)]
    assert found[0] == pytest.approx(found[1], rel=1e-6)  # eigenvalues of 72 coordinates span ten decades


def test_names_edits_and_effects_are_those_of_one_rod(path: Path) -> None:
    scene = load_scene(path)
    require_names(scene)
    assert list(scene.flexible()) == ["rod_1", "rod_2", "rod_3", "rod_4"]
    assert scene.joint["clamp"].between == ("ground.O", "rod_1.root")
    assert scene.joint["rod_cut_2"].between == ("rod_2.cut_2", "rod_3.cut_2")
    assert parse("rod.middle.position.z", scene.owners()).owner == "rod_2.middle"
    assert [effect.name for effect in variants.effects(scene)] == ["body.rod.modes"]
    rigid = variants.without_effects(scene, variants.effects(scene))
    assert [body.type for body in rigid.body.values()] == ["ground"] + ["rigid"] * 4
    assert len(edited(scene, {"body.rod.segments": 3}).flexible()) == 3
    assert edited(scene, {"time.end": 0.02}).rods() == {"rod": ["rod_1", "rod_2", "rod_3", "rod_4"]}


@pytest.mark.parametrize(
    "override, message",
    [
        ({"body.rod.segments": 40}, r"body.rod.segments\].*its 32 elements cannot be cut into 40 segments"),
        ({"body.rod.segments": 1}, r"body.rod.segments\].*greater than or equal to 2|at least 2"),
        (
            {"body.rod.modes.interfaces": ["root", "tip"]},
            r"^[^\n]*\[body.rod.modes\][^\n]*\n.*leave out modes.interfaces[^\n]*$",
        ),
        ({"body.rod.velocity": [1, 0, 0], "body.rod.angular_velocity": [0, 0, 1]}, "a rod in segments that turns"),
        ({"body.rod_2": {"type": "ground"}}, "a part is called 'rod_2' already"),
        ({"load.tip.frame": "rod.top"}, "body 'rod' has no frame 'top'|there is no body 'rod'"),
    ],
)
def test_mistakes_are_told_in_words(path: Path, override: dict[str, Any], message: str) -> None:
    with pytest.raises((InputError, InputErrors), match=message):
        require_names(load_scene(path, override))


def test_a_solid_cannot_be_cut(path: Path) -> None:
    solid = Path(__file__).parents[2] / "meshes/gallery/bracket.toml"
    with pytest.raises(InputError, match="only rods can be cut, not the shape 'mesh-file'"):
        load_scene(path, {"body.rod.mesh": str(solid)})


def test_a_run_is_asked_for_frames_of_the_whole_rod(path: Path) -> None:
    scene = load_scene(path, {"body.rod.segments": 2, "time.end": 0.002, "output.interval": 1e-3})
    run = dynamics.simulate(scene, bundles(scene), silent)
    assert (
        fc.quantity(run, "rod.tip.position.z").values == run["frame_position"].sel(frame="rod_2.tip", axis="z")
    ).all()
    assert "rod_cut_1" in run["joint"]


def test_the_error_bound_at_the_frequency_of_a_shape_has_an_exact_solution() -> None:
    """As for a segment of one element, whose stretching with one end held has half the frequency of the free one."""
    matrix, right = np.array([[0.0, 3.0], [3.0, 1.0]]), np.array([[6.0], [5.0]])
    assert _solve(matrix, right) == pytest.approx(np.array([[1.0], [2.0]]), rel=1e-12)
