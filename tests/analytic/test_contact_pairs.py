"""Joints of several contacts, loose sliders, against closed forms and a second derivation."""

from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from benchmarks.rigid_impacts import rigid_heights
from flexclear.dynamics.contact.surfaces.ball_on_strip import separation
from flexclear.dynamics.linear.clearance_response import bound_effects
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.run.run import integrate
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.dynamics.vectors import Matrix, Vector
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.scene.variants import effects, ideal_scene
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles, impacts
from tests.properties.mechanisms import LEAN, Table, frame, joint, matrix, rigid, scene, simulate, simulated, turned
from tests.reference.sliders import corners, final_state


class Sizes(NamedTuple):
    """What a surface reads of a contact."""

    radius: float
    shape: tuple[float, float, float]


MASS, INERTIA = 0.5, [6e-4, 4e-4, 2e-4]
LENGTH, HEIGHT, WIDTH, GAP, SIDE = 0.1, 0.04, 0.06, 1e-3, 0.8e-3
STIFFNESS = 1e6
LINEAR = {"law": "hertz", "exponent": 1.0, "stiffness": STIFFNESS}
SLIDER: Table = {"clearance": GAP, "length": LENGTH, "height": HEIGHT, "normal": LINEAR}
SPATIAL: Table = SLIDER | {"width": WIDTH, "side_clearance": SIDE}


def sliding(
    velocity: Any, omega: Any = (0.0, 0.0, 0.0), end: float = 0.01, *, short: bool = False, **more: Any
) -> Table:
    """A slider in the middle of a fixed guide, or where `short` a guide around a fixed slider; more: of the joint."""
    moving = rigid(MASS, INERTIA, {"F": {}}, pose={}, velocity=list(velocity), angular_velocity=list(omega))
    between = ("body.F", "ground.F") if short else ("ground.F", "body.F")
    guide = joint("clearance-prismatic", *between) | SLIDER | more
    return scene({"ground": {"type": "ground", "frames": {"F": {}}}, "body": moving}, {"guide": guide}, end)


def springs(radius: float = 0.0, short: float | None = None, *, spatial: bool = False) -> list[Any]:
    """Points of the moving body and planes that they meet, as the docstring of the joint describes them."""
    sizes, gaps = np.array([HEIGHT, WIDTH if spatial else 0.0]) / 2.0, np.array([GAP, SIDE if spatial else 0.0])
    centres = (
        np.append(sizes + gaps + radius, short / 2.0 - radius) if short else np.append(sizes, LENGTH / 2.0) - radius
    )
    result = []
    for x, y, z in product((1.0, -1.0), (1.0, -1.0) if spatial else (0.0,), (1.0, -1.0)):
        for axis, side in enumerate((x, y) if spatial else (x,)):
            normal = np.eye(3)[axis] * (side if short else -side)
            plane = np.eye(3)[axis] * side * (sizes[axis] + (0.0 if short else gaps[axis]))
            result.append((centres * [x, y, z], plane, normal))
    return result


def state(dataset: xr.Dataset) -> tuple[np.ndarray, ...]:
    last = dataset.sel(body="body").isel(time=-1)
    R = quaternion_to_matrix(last.quaternion.values)
    return last.position.values, last.velocity.values, R, last.angular_velocity.values


# One contact is several pairs ----------------------------------------------------------------------------------------
def test_a_slider_that_hits_its_guide_flat_touches_it_with_two_corners_at_once() -> None:
    """On two springs the contact lasts half a period of the mass on both, and throws it back as fast."""
    speed, half = 0.5, np.pi * np.sqrt(MASS / (2.0 * STIFFNESS))
    dataset = simulate(sliding([speed, 0.0, 2.0], end=0.009))
    assert list(dataset.contact.values) == [f"guide.corner_{k}" for k in (1, 2, 3, 4)]
    begin = GAP / speed
    across = 2.0 * GAP / speed
    for name in ("guide.corner_1", "guide.corner_2"):
        found = impacts(dataset, contact=name)
        # located to 1e-13 of the clearance, over the approach speed
        assert found["start"] == pytest.approx([begin], abs=1e-11)
        assert found["start"] + found["duration"] == pytest.approx([begin + half], abs=1e-11)
        assert found["approach"] == pytest.approx([speed], rel=1e-12)
    for name in ("guide.corner_3", "guide.corner_4"):
        assert impacts(dataset, contact=name)["start"] == pytest.approx([begin + half + across], abs=1e-11)
    peak = speed * np.sqrt(MASS * STIFFNESS / 2.0)
    tracked = dataset.event_peak_force.values[dataset.event_kind.values == "closing"][:2]
    assert tracked == pytest.approx([peak] * 2, rel=1e-9)
    # slides on without friction
    assert dataset.position.sel(body="body").values[:, 2] == pytest.approx(2.0 * dataset.time.values, abs=1e-12)


CASES: dict[str, tuple[Table, list[float], list[float], list[Any]]] = {
    "sharp corners in a plane": (SLIDER, [0.3, 0.0, 1.0], [0.0, 5.0, 0.0], springs()),
    "round corners in a plane": (SLIDER | {"corner_radius": 2e-3}, [0.3, 0.0, 1.0], [0.0, 5.0, 0.0], springs(2e-3)),
    "short guide": (SLIDER | {"guide_length": 0.07}, [0.3, 0.0, 0.2], [0.0, 5.0, 0.0], springs(short=0.07)),
    "short round guide": (
        SLIDER | {"guide_length": 0.07, "corner_radius": 2e-3},
        *([0.3, 0.0, 0.2], [0.0, 5.0, 0.0], springs(2e-3, 0.07)),
    ),
    "all directions": (SPATIAL, [0.3, 0.2, 1.0], [2.0, 5.0, 4.0], springs(spatial=True)),
    "short guide, all directions": (
        SPATIAL | {"guide_length": 0.07},
        *([0.3, 0.2, 0.2], [2.0, 5.0, 4.0], springs(short=0.07, spatial=True)),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_corners_and_faces_push_as_in_a_second_derivation(case: str) -> None:
    """After several impacts, tilted; the run and SciPy's are both good to about 1e-10 there."""
    given, velocity, omega, points = CASES[case]
    short = "guide_length" in given
    dataset = simulate(sliding(velocity, omega, short=short, **given))
    assert len(impacts(dataset)["start"]) >= 2
    push = corners(points, STIFFNESS, given.get("corner_radius", 0.0))
    known = final_state(push, 0.05 * np.sqrt(MASS / STIFFNESS), MASS, INERTIA, velocity, omega, 0.01)
    for found, exact in zip(state(dataset), known, strict=True):
        assert found == pytest.approx(exact, abs=1e-7 * max(1.0, float(np.abs(exact).max())))
    # the pairs' forces are summed at the joint, of which the second body is the moving one or the fixed one
    force = dataset.joint_force.sel(joint="guide").values
    known_force = MASS * dataset.acceleration.sel(body="body").values * (-1.0 if short else 1.0)
    assert force == pytest.approx(known_force, abs=1e-9 * np.abs(known_force).max())
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * float(dataset.kinetic[0])


def test_a_slider_rubs_with_all_corners_that_touch_and_the_books_close() -> None:
    """Pressed flat by its weight it slides to rest by mu g, whatever number of corners shares the weight."""
    rough = {"law": "ambrosio", "dynamic": 0.2, "v0": 0.0, "v1": 1e-3}
    law = {"law": "kelvin-voigt", "stiffness": 1e7, "damping": 1e3}
    table = sliding([0.0, 0.0, 0.5], end=0.05, normal=law, friction=rough)
    table["load"] = {"gravity": {"type": "gravity", "acceleration": [-9.81, 0.0, 0.0]}}
    table["start"] = {"at": "equilibrium"}
    dataset = simulate(table)
    touching = dataset.contact_normal_force.values[0]
    # at rest the two lower corners share the weight; moving, friction at their faces tilts it by mu height/length
    assert touching == pytest.approx([0.0, 0.0, 0.5 * MASS * 9.81, 0.5 * MASS * 9.81], rel=1e-6)
    assert dataset.velocity.sel(body="body").values[:, 2] == pytest.approx(
        0.5 - 0.2 * 9.81 * dataset.time.values, abs=1e-4
    )
    pressed = dataset.contact_normal_force.values[-1]
    # vibrations from the beginning of friction have died out
    assert pressed[2:].sum() == pytest.approx(MASS * 9.81, rel=1e-6)
    assert (pressed[2] - pressed[3]) / pressed.sum() == pytest.approx(0.2 * HEIGHT / LENGTH, rel=1e-4)
    lost = float(dataset.contact_friction_loss.values[-1].sum())
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * lost


@pytest.mark.parametrize("short, at", [(False, 0.02), (False, 0.08), (True, 0.02), (True, 0.08)])
def test_an_ideal_start_presses_the_corners_that_carry_force_and_moment(short: bool, at: float) -> None:
    """A force at a distance from the middle: both corners of a side where it is between them, else one of each side."""
    load, arm = 30.0, 0.5 * (0.07 if short else LENGTH)
    table = sliding([0.0] * 3, end=1e-3, short=short, **({"guide_length": 0.07} if short else {}))
    table["body"]["body"]["frames"]["P"] = {"position": [0.0, 0.0, at]}
    table["load"] = {"push": {"type": "point-force", "frame": "body.P", "force": [-load, 0.0, 0.0]}}
    table["start"] = {"at": "ideal"}
    dataset = simulated(Scene.model_validate(table))
    pushed = {(side, end): 0.5 * load * (1.0 + end * at / arm) for side, end in product((1, -1), (1, -1))}
    # corners 1 to 4 are at x+ z+, x+ z-, x- z+, x- z-; the moving guide is pushed against the slider from above
    lower, upper = ([0.0, 0.0, *(max(0.0, sign * pushed[-1, end]) for end in (1, -1))] for sign in (1.0, -1.0))
    known = np.array(lower) + np.array([*upper[2:], 0.0, 0.0])
    known = known[[2, 3, 0, 1]] if short else known
    # pressed to 1e-9 of the clearance
    assert dataset.contact_normal_force.values[0] == pytest.approx(known, abs=1e-6 * load)
    # where the slider is jammed, its tilt of up to 2 clearance/length changes the lever arms by some hundredths
    rest = 0.06 if at > arm else 1e-3
    assert dataset.contact_normal_force.values[-1] == pytest.approx(known, abs=rest * load)


def test_a_run_goes_on_with_the_corners_that_touch_at_an_event() -> None:
    """Each with the rate at which it began, which a law with hysteresis needs: as without the event."""
    table = sliding([0.3, 0.0, 1.0], [0.0, 5.0, 0.0], normal={"law": "flores", "restitution": 0.5, "stiffness": 1e8})
    idle = {"type": "point-force", "frame": "body.F", "force": [0.0, 0.0, 0.0]}
    whole = simulate(table)
    begun = impacts(whole)
    middle = float(begun["start"][0] + 0.5 * begun["duration"][0])
    split = simulate(
        table | {"load": {"idle": idle}, "event": {"cut": {"release": "load.idle", "at": f"{middle!r} s"}}}
    )
    for found, exact in zip(state(split), state(whole), strict=True):
        assert found == pytest.approx(exact, abs=1e-9)


#: heights are compared after the first impact and after the second one [s]
AFTER = (4e-3, 6e-3)


def test_stiffer_corners_come_close_to_newtons_law_for_rigid_ones() -> None:
    """The slider-crank of Flores, Leine & Glocker (2010), without friction: in proportion to the impacts' duration.

    That goes with stiffness to the power -2/5 (Hertz), to first order.
    """
    exact = rigid_heights(AFTER, (150.0, -75.0), 1e-3, 0.4, 9.81)
    away = []
    for stiffness in (1e11, 1e12, 1e13):
        numbers = {"time.end": 8e-3, "output.interval": 1e-3, "solver.rtol": 1e-11}
        changes = numbers | {"joint.guide.normal.stiffness": stiffness, "joint.guide.friction": None}
        dataset = simulated(edited(load_scene(TREE / "scenes/gallery/loose_slider.toml"), changes))
        away.append(
            dataset.position.sel(body="slider", axis="y").sel(time=list(AFTER), method="nearest").values - exact
        )
    assert np.abs(away[-1]).max() < 2e-6
    assert np.array(away[:-1]) / np.array(away[1:]) == pytest.approx(np.full((2, 2), 10.0**0.4), rel=0.05)


def test_sharp_corners_take_a_law_of_ones_own() -> None:
    """Hertz's written as an expression, which is the law of each corner, gives the same motion."""
    own = {"law": "expression", "force": "K*depth", "values": {"K": f"{STIFFNESS} N/m"}}
    found, known = (state(simulate(sliding([0.3, 0.0, 1.0], [0.0, 5.0, 0.0], normal=law))) for law in (own, LINEAR))
    for one, exact in zip(found, known, strict=True):
        assert one == pytest.approx(exact, abs=1e-9 * max(1.0, float(np.abs(exact).max())))


# Faces that end ------------------------------------------------------------------------------------------------------
GUIDE = 0.15


def test_the_gap_above_a_strip_is_the_distance_from_a_block_and_its_normal_the_gradient() -> None:
    """Above, past the end, about the edge and inside; distances of a block as in any book on signed distances."""
    half, radius = 0.02, 1e-3
    numbers, random = Sizes(radius, (half, 0.0, 0.0)), np.random.default_rng(7)
    for _ in range(200):
        R, p, v = matrix(random.normal(size=3)), random.uniform(-0.04, 0.04, 3), random.normal(size=3)

        def at(place: np.ndarray, R: np.ndarray = R, v: np.ndarray = v) -> tuple[float, float, np.ndarray, np.ndarray]:
            found = separation(
                numbers, Matrix(R.ravel().tolist()), Vector((R @ place).tolist()), Vector((R @ v).tolist())
            )
            return found.gap, found.approach, R.T @ np.array(found.normal), R.T @ np.array(found.turning)

        gap, rate, normal, turning = at(p)
        out = np.array([abs(p[0]) - half, p[2]])
        assert gap == pytest.approx(np.linalg.norm(out.clip(0.0)) + min(out.max(), 0.0) - radius, abs=1e-15)
        step = 1e-7
        (after, _, n_after, _), (before, _, n_before, _) = at(p + step * v), at(p - step * v)
        if min(abs(out[0] - out[1]), *abs(out)) < 1e-5:
            continue  # its normal jumps or its curvature does
        # differences over 1e-7 of numbers of 0.04
        assert (after - before) / (2.0 * step) == pytest.approx(-rate, abs=1e-6)
        assert (n_after - n_before) / (2.0 * step) == pytest.approx(turning, abs=1e-2 * (1.0 + np.abs(turning).max()))
        assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-14)


def leaving(speed: float, end: float, **more: Any) -> xr.Dataset:
    """A slider pressed by its weight to the guide that it leaves."""
    law = {"law": "hertz", "exponent": 1.0, "stiffness": STIFFNESS}
    table = sliding([0.0, 0.0, speed], end=end, faces="bounded", guide_length=GUIDE, normal=law, **more)
    table["load"] = {"gravity": {"type": "gravity", "acceleration": [-9.81, 0.0, 0.0]}}
    table["start"] = {"at": "equilibrium"}
    return simulate(table)


def test_a_slider_leaves_its_guide_by_one_corner_and_then_rests_on_the_guides_end() -> None:
    """The front corner, deep by d = m g/2K, loses its face where that ends, when it meets the edge by less than d.

    There it is pushed out by -K p, p < 0 the way to the end, while the force K d of the rear corner tips the slider:
    p'' = -K p (1/m + height^2/4I) - K d height length/4I. The guide's corner meets the slider's face at the same time.
    """
    speed, inertia = 0.5, INERTIA[1]
    found = leaving(speed, 0.055)
    deep = MASS * 9.81 / (2.0 * STIFFNESS)
    omega = np.sqrt(STIFFNESS * (1.0 / MASS + HEIGHT**2 / (4.0 * inertia)))
    middle = -STIFFNESS * deep * HEIGHT * LENGTH / (4.0 * inertia) / omega**2

    def way(t: float) -> float:
        return middle - (deep + middle) * np.cos(omega * t) + speed / omega * np.sin(omega * t)

    out = (0.5 * (GUIDE - LENGTH) - deep) / speed + brentq(way, 0.0, 2.0 * deep / speed, xtol=1e-18)
    kinds, names, times = (found[f"event_{key}"].values for key in ("kind", "contact", "time"))
    opening = times[(kinds == "opening") & (names == "guide.corner_3")]
    closing = times[(kinds == "closing") & (names == "guide.guide_corner_3")]
    # located to 1e-12 of a step
    assert opening[0] == pytest.approx(out, abs=1e-11)
    assert closing[0] == pytest.approx(out, abs=1e-11)
    # beyond, the rear corner on the guide and the guide's on the slider carry it, until it tips over the edge
    late = found.isel(time=-1)
    carrying = {str(name) for name in late.contact.values if late.contact_normal_force.sel(contact=name) > 0.0}
    assert carrying <= {"guide.corner_4", "guide.guide_corner_3"}
    assert carrying
    assert np.abs(found.energy_error.values).max() < 1e-8 * float(found.kinetic[0])


def test_a_slider_beside_its_guide_touches_nothing() -> None:
    """Half a length beyond the end, it falls past the face as if there were no guide."""
    table = sliding([0.0, 0.0, 1.0], end=0.05, faces="bounded", guide_length=GUIDE)
    table["body"]["body"]["pose"] = {"position": [0.0, 0.0, 0.5 * (GUIDE + LENGTH) + 1e-3]}
    table["load"] = {"gravity": {"type": "gravity", "acceleration": [-9.81, 0.0, 0.0]}}
    dataset = simulate(table)
    t = dataset.time.values
    assert dataset.position.sel(body="body").values[:, 0] == pytest.approx(-0.5 * 9.81 * t**2, abs=1e-11)
    assert len(impacts(dataset)["start"]) == 0


# What else a scene can ask of it --------------------------------------------------------------------------------------
def test_the_ideal_counterpart_is_a_prismatic_joint_along_the_same_axis() -> None:
    loose = Scene.model_validate(sliding([0.0, 0.0, 2.0]))
    assert [effect.name for effect in effects(loose)] == ["joint.guide.clearance"]
    tight = ideal_scene(loose)
    assert tight.joint["guide"].type == "prismatic"
    dataset = simulated(tight)
    assert dataset.position.sel(body="body").values[:, 2] == pytest.approx(2.0 * dataset.time.values, abs=1e-12)


def test_a_guide_may_be_turned_and_carried() -> None:
    """The motion in the guide is the same in any pose of it."""
    R, velocity, omega = matrix(LEAN), [0.3, 0.0, 1.0], [0.0, 5.0, 0.0]
    table = sliding(velocity, omega)
    table["body"]["ground"]["frames"]["F"] = frame((0.2, -0.1, 0.3), LEAN)
    pose = {"position": [0.2, -0.1, 0.3], "rotation_vector": list(LEAN)}
    table["body"]["body"] |= {"pose": pose, "velocity": turned(R, velocity), "angular_velocity": turned(R, omega)}
    one, other = simulate(sliding(velocity, omega)), simulate(table)
    moved = other.position.sel(body="body").values[-1] - [0.2, -0.1, 0.3]
    assert R.T @ moved == pytest.approx(one.position.sel(body="body").values[-1], abs=1e-9)


#: change of the joint, and what the refusal says
REFUSED: dict[str, tuple[Table, str]] = {
    "long guide": ({"guide_length": 0.2}, "the slider's corners touch the guide"),
    "faces without end": ({"faces": "bounded"}, "give guide_length"),
    "no gap": ({"clearance": 0.0}, "clearance"),
    "half loose": ({"width": WIDTH}, "side_clearance"),
    "sharp steel": ({"normal": {"law": "hertz"}, "guide_material": {"youngs_modulus": 2e11, "poisson": 0.3},
                     "slider_material": {"youngs_modulus": 2e11, "poisson": 0.3}}, "corner_radius"),
    "ball": ({"corner_radius": 0.03}, "less than half the shortest side"),
    "unknown corner": ({"initial_approach_speed": {"corner_9": 0.1}}, "there is no 'corner_9'"),
    "wear": ({"wear": {"coefficient": 1e-4, "hardness": 2e9}}, "wear"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_slider_that_cannot_be_is_refused_in_words(case: str) -> None:
    changed, words = REFUSED[case]
    with pytest.raises(ValueError, match=words):
        Scene.model_validate(sliding([0.0] * 3, **changed))


def test_a_slider_that_starts_in_the_guides_face_is_refused() -> None:
    table = sliding([0.0] * 3)
    table["body"]["body"]["pose"] = {"position": [1.5e-3, 0.0, 0.0]}
    with pytest.raises(InputError, match="starts with a penetration of 500 um into the guide"):
        simulate(table)
    assert edited(Scene.model_validate(table), {"joint.guide.clearance": 2e-3}) is not None


@pytest.mark.parametrize(
    "name", ["sps4/csj", "checks/scotch_yoke", "checks/ball_on_plane", "checks/clearance_slider_crank"]
)
def test_a_joint_with_one_pair_is_the_contact_itself_at_its_frames(name: str) -> None:
    """Its name, numbers and sites are the joint's, to the last bit, so that its runs and their layout are as well."""
    whole = load_scene(TREE / "scenes" / f"{name}.toml")
    mechanism = build(whole, {})
    assert [contact.name for contact in mechanism.contacts] == [*whole.contacts()]
    for contact in mechanism.contacts:
        assert contact.joint is whole.joint[contact.name]
        for site, at in zip((contact.outer, contact.inner), whole.joint[contact.name].between, strict=True):
            same = mechanism.site(at)
            assert (site.link, site.frame) == (same.link, same.frame)
            assert np.array_equal(site.placement.p, same.placement.p)
            assert np.array_equal(site.placement.R, same.placement.R)


def test_a_corner_beside_a_frame_of_a_flexible_body_is_refused() -> None:
    """Such a frame bends with the body, and what is beside it may not be on the body at all."""
    rod = load_scene(TREE / "scenes/checks/swinging_rod.toml")
    guide = joint("clearance-prismatic", "ground.hook", "rod.top") | SLIDER
    with pytest.raises(InputError, match="fix a rigid body to the frame"):
        build(edited(rod, {"joint.guide": guide}), bundles(rod))


def test_the_clearance_of_a_guide_has_a_derivative() -> None:
    """A slider that comes back from its guide is 2 dc farther away: it travels the wider gap there and back."""
    whole = Scene.model_validate(sliding([0.5, 0.0, 2.0], end=0.005))
    found = sensitivities(whole, {}, silent, ["body.position"], ["joint.guide.clearance", "joint.guide.height"])
    by_gap, by_height = (found["body.position"].sel(parameter=f"joint.guide.{key}") for key in ("clearance", "height"))
    assert by_gap.values[-1] == pytest.approx([2.0, 0.0, 0.0], abs=1e-7)
    assert by_height.values[-1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-7)


def test_a_slider_tilts_no_farther_than_the_bound_of_its_clearance_says() -> None:
    """Bound of the effect: 2 clearance/length without load, and the same for what the corners give way."""
    loose = Scene.model_validate(
        sliding([0.3, 0.0, 1.0], [0.0, 5.0, 0.0], end=0.02, normal=LINEAR | {"stiffness": 1e9})
    )
    tight = ideal_scene(Scene.model_validate(sliding([0.0, 0.0, 1.0])))
    chosen = [parse("body.orientation", loose.owners())]
    bound = bound_effects(loose, integrate(tight, {}, silent), chosen)["guide"]
    assert bound["body.orientation"] == pytest.approx(2.0 * GAP / LENGTH, rel=1e-6)
    dataset = simulated(loose)
    deep = float(dataset.contact_penetration.max())
    tilt = 2.0 * np.abs(dataset.quaternion.sel(body="body").values[:, 2])
    # a part of the height's tilt counts as well: height tilt^2 / 2
    assert tilt.max() <= 2.0 * (GAP + deep) / LENGTH * (1.0 + 1e-3)
    assert np.abs(dataset.position.sel(body="body").values[:, 0]).max() <= GAP + deep
