"""Forces of a clearance joint on the two bodies that it joins, at any relative motion, for every pair of laws."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.algebra import rotation_vector_to_matrix
from pipeline.core.registry import lookup
from pipeline.core.scene.schema import Scene
from pipeline.dynamics import tables
from pipeline.dynamics.assembly import dispatch
from pipeline.dynamics.assembly.numbers import Tables, tabulate
from pipeline.dynamics.assembly.system import build
from pipeline.dynamics.contact import friction, normal
from pipeline.dynamics.joints import clearance_spherical

BODY = {"type": "rigid", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "pose": {}, "frames": {"centre": {}}}
CLEARANCE, RADIUS = 5e-4, 0.02
LAWS = [(n, f) for n in normal.NAMES for f in (None, *friction.NAMES)]
every_law = pytest.mark.parametrize("laws", LAWS, ids=lambda laws: "-".join(str(law) for law in laws))
Laws = tuple[str, str | None]


@cache
def tables_of(laws: Laws) -> Tables:
    """A free ball in a free socket."""
    contact: dict[str, Any] = {
        "type": "clearance-spherical",
        "between": ["socket.centre", "ball.centre"],
        "clearance": CLEARANCE,
        "ball_radius": RADIUS,
        "normal": {"law": laws[0], "restitution": 0.8, "stiffness": 1e10},
    }
    if laws[1] is not None:
        contact["friction"] = {
            "law": laws[1], "static": 0.15, "dynamic": 0.1, "v_static": 2e-4, "v_dynamic": 1e-2,
        }  # fmt: skip
    scene = {
        "title": "contact",
        "body": {"socket": BODY, "ball": BODY},
        "joint": {"contact": contact},
        "time": {"end": 1.0},
    }
    return tabulate(build(Scene.model_validate(scene), {}))


@cache
def kernel(laws: Laws) -> Any:
    law, rub = lookup(normal.__name__, laws[0], where="test"), laws[1]
    rubbing = () if rub is None else (lookup(friction.__name__, rub, where="test").coefficient,)
    chosen = dispatch.normals((law.force,)), dispatch.energies((law.stored,)), dispatch.frictions(rubbing)
    return clearance_spherical.compose(*chosen)


class Touch:
    """A contact at random motions of socket and ball, `depth` [m] deep, applied by the kernel.

    together: both move as one rigid body does.
    """

    def __init__(self, laws: Laws, seed: int, depth: float, slip: float, together: bool = False) -> None:
        random = np.random.default_rng(seed)
        packed = tables_of(laws).packed
        w, n = packed.work_space()
        n[n[tables.MODE]] = 1
        self.axis = random.normal(size=3)
        self.axis /= np.linalg.norm(self.axis)
        self.centre = {"socket": random.uniform(-1.0, 1.0, 3)}
        self.centre["ball"] = self.centre["socket"] + (CLEARANCE + depth) * self.axis
        self.velocity = {name: slip * random.uniform(-1.0, 1.0, 3) for name in self.centre}
        self.omega = {name: slip * random.uniform(-10.0, 10.0, 3) for name in self.centre}
        if together:
            self.omega["ball"] = self.omega["socket"]
            arm = self.centre["ball"] - self.centre["socket"]
            self.velocity["ball"] = self.velocity["socket"] + np.cross(self.omega["socket"], arm)
        sites = packed.table("CONTACTS")[0, [tables.SOCKET, tables.BALL]]
        self.links = {name: int(packed.table("SITES")[s, 0]) for name, s in zip(self.centre, sites, strict=True)}
        for name, site in zip(self.centre, sites, strict=True):
            o = packed.offset("SITE_FRAMES") + tables.FRAME_SIZE * site
            w[o : o + 3] = self.centre[name]
            w[o + tables.AXES : o + tables.AXES + 9] = rotation_vector_to_matrix(random.normal(size=3)).ravel()
            w[o + tables.OMEGA : o + tables.OMEGA + 3] = self.omega[name]
            w[o + tables.VELOCITY : o + tables.VELOCITY + 3] = self.velocity[name]
        w[packed.offset("LATCHED")] = random.uniform(0.01, 1.0)
        kernel(laws)(packed.h, packed.f, w, n)
        wrench = packed.offset("WRENCH") + 6 * np.array(list(self.links.values()))
        # the table holds inertial minus applied wrenches (moment about the origin; force)
        self.wrench = {name: -w[o : o + 6] for name, o in zip(self.links, wrench, strict=True)}
        self.touch = w[packed.offset("TOUCH") :][: tables.TOUCH_SIZE]
        losses = packed.offset("LEDGER_RATE") + tables.CONTACT_LOSS
        self.losses = w[losses : losses + 2]

    @property
    def power(self) -> float:
        """Power of the forces on both bodies [W]."""
        return sum(self._power(name) for name in self.links)

    def _power(self, name: str) -> float:
        omega = self.omega[name]
        at_origin = self.velocity[name] - np.cross(omega, self.centre[name])
        return float(omega @ self.wrench[name][:3] + at_origin @ self.wrench[name][3:])


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
    total = touch.wrench["socket"] + touch.wrench["ball"]
    # the same numbers with both signs
    assert np.abs(total).max() <= 1e-15 * np.abs(touch.wrench["ball"]).max()


@every_law
@motions
def test_the_ball_is_pushed_back_into_the_socket(laws: Laws, seed: int, depth: float, slip: float) -> None:
    touch = Touch(laws, seed, depth, slip)
    force = touch.wrench["ball"][3:]
    pressed = touch.touch[tables.NORMAL_FORCE]
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
    assert touch.touch[tables.FRICTION_POWER] <= 0.0
    # a lossless law is subtracted from itself, in rounding where the compiler fuses the product
    rounding = 1e-15 * touch.touch[tables.NORMAL_FORCE] * abs(touch.touch[tables.RATE])
    assert touch.losses[0] >= -rounding
    assert touch.losses[1] >= 0.0
    if laws[1] is None:
        assert touch.losses[1] == 0.0
    elif touch.touch[tables.NORMAL_FORCE] > 0.0:
        assert touch.losses[1] > 0.0


@every_law
@motions
def test_the_ledger_books_what_the_forces_do(laws: Laws, seed: int, depth: float, slip: float) -> None:
    """Power on both bodies = -(rate of the stored energy) - the two losses."""
    touch = Touch(laws, seed, depth, slip)
    law = lookup(normal.__name__, laws[0], where="test")
    found = tables_of(laws).packed.table("CONTACT_NUMBERS")[0, tables.NORMAL_LAW :][:4]
    elastic = float(law.force(-touch.touch[tables.GAP], 0.0, 1.0, tuple(found)))
    stored = elastic * touch.touch[tables.RATE]
    size = np.abs(touch.wrench["ball"]).max() * slip * 20.0
    # rounding of moments about a point some 1 m away
    assert touch.power == pytest.approx(-stored - touch.losses.sum(), abs=1e-13 * size)


@every_law
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_rolling_is_no_sliding(laws: Laws, seed: int) -> None:
    """A ball and a socket that turn as one rigid body do not rub, wherever they turn about."""
    touch = Touch(laws, seed, 1e-5, 1.0, together=True)
    assert touch.touch[tables.RATE] == pytest.approx(0.0, abs=1e-12)  # rounding of speeds of some m/s
    # a sliding speed of rounding, 1e-15 m/s, times slope 1.5 mu_s / v_s = 1e3 s/m, force 1e4 N, and speed
    assert -touch.touch[tables.FRICTION_POWER] <= 1e-18
