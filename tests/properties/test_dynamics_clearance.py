"""Forces of a clearance joint on the two bodies that it joins, at any relative motion, for every pair of laws."""

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact import form as forms
from flexclear.dynamics.contact import friction
from flexclear.dynamics.contact import surfaces as surfaces_of_joints
from flexclear.dynamics.mechanics.contacts import touch as touched
from flexclear.dynamics.mechanics.trees import Site
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.specialise.symbols import leaves
from flexclear.dynamics.vectors import UNIT, ZERO, Matrix, Motion, Vector
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.loose_joints import CONTACTS
from flexclear.scene.parts import Joint
from flexclear.scene.schema import Scene

FRICTION: dict[str, dict[str, Any]] = {
    "modified-coulomb": {"static": 0.15, "dynamic": 0.1, "v_static": 2e-4, "v_dynamic": 1e-2},
    "ambrosio": {"dynamic": 0.15, "v0": 1e-7, "v1": 1e-3},
    "lugre": {"static": 0.15, "dynamic": 0.1, "v_stribeck": 1e-3, "bristle_stiffness": 1e5, "bristle_damping": 20.0},
}
CLEARANCE = 5e-4
SURFACES: dict[str, dict[str, Any]] = {
    "clearance-spherical": {"clearance": CLEARANCE, "ball_radius": 0.02},
    "clearance-revolute": {"clearance": CLEARANCE, "pin_radius": 0.02, "length": 0.03},
    "clearance-slot": {"clearance": CLEARANCE, "pin_radius": 0.02, "length": 0.03, "travel": 0.1},
    "ball-on-plane": {"ball_radius": 0.02},
}
BODY = {"type": "rigid", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "pose": {}, "frames": {"centre": {}}}
#: one law of each form that is compiled
FORMS = {"hertz": {}, "flores": {"restitution": 0.8, "exponent": 1.5}, "kelvin-voigt": {"damping": 100.0}}
LAWS = [(n, f, "clearance-spherical") for n in FORMS for f in (None, *friction.FRICTION_LAWS)]
LAWS += [("flores", f, "clearance-revolute") for f in (None, "modified-coulomb", "lugre")]
every_law = pytest.mark.parametrize("laws", LAWS, ids=lambda laws: "-".join(str(law) for law in laws))
Laws = tuple[str, str | None, str]


@cache
def tables_of(laws: Laws) -> Model:
    """A free ball in a free socket."""
    contact: dict[str, Any] = {
        "type": laws[2],
        "between": ["socket.centre", "ball.centre"],
        **SURFACES[laws[2]],
        "normal": {"law": laws[0], "stiffness": 1e10 if laws[0] != "kelvin-voigt" else 1e7, **FORMS[laws[0]]},
    }
    if laws[1] is not None:
        contact["friction"] = {"law": laws[1], **FRICTION[laws[1]]}
    scene = {
        "title": "contact",
        "body": {"socket": BODY, "ball": BODY},
        "joint": {"contact": contact},
        "time": {"end": 1.0},
    }
    return tabulate(build(Scene.model_validate(scene), {}))


def numbers_of(laws: Laws) -> Any:
    """Its row of CONTACT_NUMBERS, by the names of the fields."""
    row = tables_of(laws).arrays.table(m.CONTACT_NUMBERS)[0]
    return SimpleNamespace(**{name: row[name].tolist() for name in row.dtype.names})


class Touch:
    """A contact at random motions of socket and ball, `depth` [m] deep.

    together: both move as one rigid body does.
    """

    def __init__(self, laws: Laws, seed: int, depth: float, slip: float, together: bool = False) -> None:
        random = np.random.default_rng(seed)
        turned = rotation_vector_to_matrix(random.normal(size=3))
        self.axis = random.normal(size=3)
        if laws[2] == "clearance-revolute":  # in the plane normal to the journal's axis
            self.axis -= (self.axis @ turned[:, 2]) * turned[:, 2]
        self.axis /= np.linalg.norm(self.axis)
        self.centre = {"socket": random.uniform(-1.0, 1.0, 3)}
        self.centre["ball"] = self.centre["socket"] + (CLEARANCE + depth) * self.axis
        self.velocity = {name: slip * random.uniform(-1.0, 1.0, 3) for name in self.centre}
        self.omega = {name: slip * random.uniform(-10.0, 10.0, 3) for name in self.centre}
        if together:
            self.omega["ball"] = self.omega["socket"]
            arm = self.centre["ball"] - self.centre["socket"]
            self.velocity["ball"] = self.velocity["socket"] + np.cross(self.omega["socket"], arm)
        moving = [
            (
                Motion(Matrix(turned.ravel().tolist()), *(Vector(one[name].tolist()) for one in given), ZERO, ZERO),
                Site(ZERO, UNIT),
            )
            for given in [(self.centre, self.omega, self.velocity)]
            for name in self.centre
        ]
        # bristles somewhere below their largest deflection, in the tangent plane, axes of the socket
        self.bent, bristle = np.zeros(3), []
        if laws[1] == "lugre":
            across = np.cross(self.axis, random.normal(size=3))
            self.bent = random.uniform(0.0, 1.5e-6) * across / np.linalg.norm(across)
            bristle = (turned.T @ self.bent).tolist()
        form, latched = tables_of(laws).laws[0].form, random.uniform(0.01, 1.0)
        given = laws[2], (form, laws[1] or ""), 0, (), numbers_of(laws), 1, latched, bristle
        stored, wrenches, _ = touched(*given, *moving)
        #: moment about its centre, and force
        self.wrench = {name: np.ravel(one) for name, one in zip(self.centre, wrenches, strict=True)}
        found = np.array(leaves(stored))
        self.touch, (*losses, _), rate = np.split(found, [m.TOUCH.size, m.TOUCH.size + m.CONTACT_LEDGER.size])
        self.losses = np.array(losses)
        self.bending = 0.0  # power that bends the bristles at this normal force
        if bristle:
            self.bending = 1e5 * self.touch[m.TOUCH.normal_force] * float(self.bent @ turned @ rate)
            self.out_of_plane = float(turned @ rate @ self.axis)

    @property
    def power(self) -> float:
        """Power of the forces on both bodies [W]."""
        return sum(float(self.omega[one] @ w[:3] + self.velocity[one] @ w[3:]) for one, w in self.wrench.items())

    @property
    def total(self) -> np.ndarray:
        """Sum of the forces on both bodies, moments about the world's origin."""
        return sum(
            (np.append(w[:3] + np.cross(self.centre[one], w[3:]), w[3:]) for one, w in self.wrench.items()), np.zeros(6)
        )


def motions(test: Any) -> Any:
    """Some random motions, slow (rubbing below v_s) to fast."""
    examples = given(
        seed=st.integers(0, 2**32 - 1), depth=st.floats(1e-7, 1e-4), slip=st.sampled_from([1e-5, 1e-3, 0.1, 1.0])
    )
    return settings(max_examples=40)(examples(test))


@every_law
@motions
def test_action_is_reaction_in_force_and_moment(laws: Laws, seed: int, depth: float, slip: float) -> None:
    """Forces a penetration apart would leave a moment."""
    touch = Touch(laws, seed, depth, slip)
    # rounding of arms of some 1 m
    assert np.abs(touch.total).max() <= 1e-14 * np.abs(touch.wrench["ball"]).max()


@every_law
@motions
def test_the_ball_is_pushed_back_into_the_socket(laws: Laws, seed: int, depth: float, slip: float) -> None:
    touch = Touch(laws, seed, depth, slip)
    force = touch.wrench["ball"][3:]
    pressed = touch.touch[m.TOUCH.normal_force]
    assert pressed >= 0.0
    # rounding of the axis, of a difference of 0.5 mm between points some 1 m from the origin
    assert -force @ touch.axis == pytest.approx(pressed, rel=1e-11, abs=1e-12)
    tangential = force + pressed * touch.axis
    limit = 0.15 if laws[1] else 0.0
    assert np.linalg.norm(tangential) <= (limit + 1e-11) * pressed + 1e-12


@every_law
@motions
def test_rubbing_and_damping_only_take_energy(laws: Laws, seed: int, depth: float, slip: float) -> None:
    touch = Touch(laws, seed, depth, slip)
    assert touch.touch[m.TOUCH.friction_power] <= 0.0
    # a lossless law is subtracted from itself, in rounding where the compiler fuses the product
    rounding = 1e-15 * touch.touch[m.TOUCH.normal_force] * abs(touch.touch[m.TOUCH.rate])
    assert touch.losses[0] >= -rounding
    # what friction works is lost, but for what bends the bristles
    assert touch.losses[1] - touch.bending == pytest.approx(-touch.touch[m.TOUCH.friction_power], abs=1e-9)
    if laws[1] is None:
        assert touch.losses[1] == 0.0
    elif touch.touch[m.TOUCH.normal_force] > 0.0:
        assert touch.touch[m.TOUCH.friction_power] < 0.0


@every_law
@motions
def test_the_ledger_books_what_the_forces_do(laws: Laws, seed: int, depth: float, slip: float) -> None:
    """Power on both bodies = -(rate of the stored energy) - the two losses."""
    touch = Touch(laws, seed, depth, slip)
    law = tables_of(laws).laws[0]
    form = forms.FORMS[law.form]
    elastic = float(form.force(-touch.touch[m.TOUCH.gap], 0.0, 1.0, law.numbers)[0])
    stored = elastic * touch.touch[m.TOUCH.rate]
    size = np.abs(touch.wrench["ball"]).max() * slip * 20.0
    # rounding of moments about a point some 1 m away
    assert touch.power == pytest.approx(-stored - touch.losses.sum(), abs=1e-13 * size)


@every_law
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_rolling_is_no_sliding(laws: Laws, seed: int) -> None:
    """A ball and a socket that turn as one rigid body do not rub, wherever they turn about."""
    touch = Touch(laws, seed, 1e-5, 1.0, together=True)
    assert touch.touch[m.TOUCH.rate] == pytest.approx(0.0, abs=1e-12)  # rounding of speeds of some m/s
    # a sliding speed of rounding, 1e-15 m/s, times slope 1.5 mu_s / v_s = 1e3 s/m, force 1e4 N, and speed; bent
    # bristles bear up to mu_s of the force at any speed. The speed is a sum of some products of 10 m/s: ten times that
    bearing = 0.15 * touch.touch[m.TOUCH.normal_force] if laws[1] == "lugre" else 1e-3
    assert -touch.touch[m.TOUCH.friction_power] <= 1e-14 * bearing


# Every kind of surfaces ----------------------------------------------------------------------------------------------

every_kind = pytest.mark.parametrize("kind", SURFACES)
#: both surfaces of a contact, and 1/E* of them [1/Pa]
SOFT, HARD = {"youngs_modulus": 7e10, "poisson": 0.33}, {"youngs_modulus": 2.1e11, "poisson": 0.3}
FLEXIBILITY = sum((1.0 - one["poisson"] ** 2) / one["youngs_modulus"] for one in (SOFT, HARD))
#: radius of the equivalent sphere or cylinder on a plane [m]: 1/R = 1/R_inner - 1/R_outer
OF_CURVES = 0.02 * (0.02 + CLEARANCE) / CLEARANCE
#: a penetration [m], a force [N], and half the width that they have: of spheres sqrt(R d), of cylinders sqrt(4 F R/(pi
#: E* L)) (Johnson 1985, Contact Mechanics, eqs. 4.22 and 4.43)
DEPTH, FORCE = 1e-5, 2000.0
HALF_WIDTHS = {
    "clearance-spherical": np.sqrt(OF_CURVES * DEPTH),
    "clearance-revolute": np.sqrt(4.0 * FORCE * OF_CURVES * FLEXIBILITY / (np.pi * 0.03)),
    "clearance-slot": np.sqrt(4.0 * FORCE * 0.02 * FLEXIBILITY / (np.pi * 0.03)),
    "ball-on-plane": np.sqrt(0.02 * DEPTH),
}
#: the stiffness of that force [N/m^1.5]: 4/3 E* sqrt(R) for each
STIFFNESSES = {
    kind: 4.0 / (3.0 * FLEXIBILITY) * np.sqrt(OF_CURVES if kind.endswith(("spherical", "revolute")) else 0.02)
    for kind in SURFACES
}


class Sizes(NamedTuple):
    """The fields of CONTACT_NUMBERS that surfaces read."""

    clearance: float
    radius: float
    shape: tuple[float, float]


def test_every_kind_of_surfaces_is_tried_here() -> None:
    # strips are faces of sliders, in tests/analytic/test_contact_pairs
    assert set(surfaces_of_joints.SURFACES) - {"ball-on-strip"} == set(SURFACES) == set(HALF_WIDTHS)


def joint_of(kind: str, **more: Any) -> Any:
    between = {"type": kind, "between": ["a.f", "b.f"], "normal": {"law": "hertz"}}
    return TypeAdapter(Joint).validate_python({**between, **SURFACES[kind], **more})


@every_kind
def test_stiffness_and_half_width_are_those_of_hertz(kind: str) -> None:
    module, (outer, inner) = surfaces_of_joints.SURFACES[kind], joint_of_names(kind)
    joint = joint_of(kind, **{f"{outer}_material": SOFT, f"{inner}_material": HARD})
    assert module.contact_size(joint, DEPTH, FORCE) == pytest.approx(HALF_WIDTHS[kind], rel=1e-13)
    assert module.stiffness(joint, 1.5) == pytest.approx(STIFFNESSES[kind], rel=1e-13)


def joint_of_names(kind: str) -> tuple[str, str]:
    """Names of outer and inner surface in keys."""
    names: tuple[str, str] = next(
        model.surfaces for model in CONTACTS if kind in get_args(model.model_fields["type"].annotation)
    )
    return names


@every_kind
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_the_normal_is_the_gradient_of_the_gap_and_the_rates_are_those_of_motion(kind: str, seed: int) -> None:
    """At random places, in and next to a slot's round ends as well; the outer surface at rest in any axes."""
    random = np.random.default_rng(seed)
    joint = joint_of(kind, normal={"law": "hertz", "stiffness": 1e9})
    sizes = Sizes(joint.clearance, joint.radius, joint.shape)
    R = rotation_vector_to_matrix(random.normal(size=3))
    separation = surfaces_of_joints.SURFACES[kind].separation
    v = R @ random.normal(size=3)
    p = R @ (random.choice([-1.0, 1.0], 3) * random.uniform(0.01, 0.06, 3))

    def at(place: np.ndarray, speed: np.ndarray) -> tuple[float, float, np.ndarray, np.ndarray, np.ndarray]:
        gap, rate, normal, turning, offset = separation(
            sizes, Matrix(R.ravel().tolist()), Vector(place.tolist()), Vector(speed.tolist())
        )
        return gap, rate, np.array(normal), np.array(turning), np.array(offset)

    gap, rate, normal, turning, offset = at(p, v)
    step = 1e-6
    (after, _, normal_after, *_), (before, _, normal_before, *_) = at(p + step * v, v), at(p - step * v, v)
    # central differences: curvatures of 1/10 mm, times squares of 1 um steps, and rounding over the step
    assert (after - before) / (2.0 * step) == pytest.approx(-rate, abs=1e-6)
    assert (normal_after - normal_before) / (2.0 * step) == pytest.approx(turning, abs=1e-4)
    assert [at(p, axis)[1] for axis in np.eye(3)] == pytest.approx(normal, abs=1e-14)
    assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-14)
    outwards = float(offset @ normal)
    known = -outwards - joint.radius if kind == "ball-on-plane" else CLEARANCE - outwards
    assert gap == pytest.approx(known, abs=1e-15)
