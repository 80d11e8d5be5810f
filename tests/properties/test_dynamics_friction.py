"""Friction laws: what every one must do, whoever adds one."""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flexclear.dynamics.contact import friction
from flexclear.dynamics.effects.declared import BALL, PIN, SLIDER
from flexclear.dynamics.mechanics.bearings import pressure
from flexclear.dynamics.vectors import ZERO, Matrix, Vector, Wrench
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.clearance import Ambrosio, LuGre, ModifiedCoulomb
from tests.properties.test_dynamics_drives import adams_step

LUGRE = LuGre(
    law="lugre", static=0.15, dynamic=0.1, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=30.0, viscous=0.4
)
#: the paper's Table 6, and laws without the fall from static to dynamic
FRICTION: dict[str, tuple[Any, ...]] = {
    "modified-coulomb": (
        ModifiedCoulomb(law="modified-coulomb", static=0.15, dynamic=0.1, v_static=2e-4, v_dynamic=1e-2),
        ModifiedCoulomb(law="modified-coulomb", static=0.3, dynamic=0.3, v_static=1e-3, v_dynamic=2e-3),
    ),
    "ambrosio": (Ambrosio(law="ambrosio", dynamic=0.1, v0=1e-4, v1=1e-3),),
    "lugre": (LUGRE, LuGre(law="lugre", static=0.3, dynamic=0.3, v_stribeck=1e-2, bristle_stiffness=1e4)),
}
CASES = [case for cases in FRICTION.values() for case in cases]
SMOOTH = FRICTION["modified-coulomb"]
every_law = pytest.mark.parametrize("law", CASES, ids=lambda law: f"{law.law}-{law.dynamic}")
every_smooth = pytest.mark.parametrize("law", SMOOTH, ids=lambda law: f"{law.law}-{law.static}")
VECTOR = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def limit(law: Any) -> float:
    return float(getattr(law, "static", law.dynamic))


def part(law: Any) -> Any:
    return friction.FRICTION_LAWS[law.law]


def coefficient(law: Any, speed: float) -> float:
    kernel = import_module(f"{friction.__name__}.{law.law.replace('-', '_')}").coefficient
    return float(kernel(speed, part(law).parameters(law)))


def test_every_friction_law_is_tried_here() -> None:
    assert set(FRICTION) == set(friction.FRICTION_LAWS)


@every_law
@given(bent=VECTOR, slip=VECTOR, size=st.floats(-8.0, 1.0), force=st.floats(0.0, 1e5))
def test_friction_takes_energy_and_stays_below_the_static_limit(
    law: Any, bent: tuple[float, ...], slip: tuple[float, ...], size: float, force: float
) -> None:
    """For every deflection that the bristles can have, at every sliding speed."""
    z = np.array(bent) / np.sqrt(3.0) * (part(law).bristle(law) or 0.0)
    v = np.array(slip) * 10.0**size
    pull, loss, stored, z_rate = part(law).traction(Vector(z), Vector(v), force, part(law).parameters(law))
    # rounding of the root that finds the limit, and of the polynomials
    assert np.linalg.norm(pull) <= limit(law) * force * (1.0 + 1e-12) + 1e-300
    assert loss >= 0.0
    assert stored >= 0.0
    # what the sliding gives is lost, or bends the bristles at this normal force
    stiffness = part(law).parameters(law)[3] if part(law).bristle(law) else 0.0
    bending = stiffness * force * float(z @ np.array(z_rate))
    # rounding of the products; a loss that cancels to less is cut at zero
    size_of = limit(law) * force * np.linalg.norm(v) + abs(bending)
    assert -np.dot(pull, v) == pytest.approx(loss + bending, abs=1e-12 * size_of + 1e-300)


@every_law
def test_no_sliding_and_no_memory_is_no_force(law: Any) -> None:
    pull, loss, stored, z_rate = part(law).traction(ZERO, ZERO, 10.0, part(law).parameters(law))
    assert (*pull, loss, stored, *z_rate) == (0.0,) * 8


@every_smooth
def test_friction_has_neither_jump_nor_kink_where_its_pieces_meet(law: ModifiedCoulomb) -> None:
    for speed in (law.v_static, law.v_dynamic):
        step = 1e-6 * law.v_static
        here, below, above = (coefficient(law, speed + k * step) for k in (0, -1, 1))
        # flat on both sides: within one step it leaves its value only by curvature, 3 mu_s (1e-6)^2 at most
        assert below == pytest.approx(here, rel=1e-11)
        assert above == pytest.approx(here, rel=1e-11)
    assert coefficient(law, law.v_static) == pytest.approx(law.static, rel=1e-14)
    assert coefficient(law, law.v_dynamic) == pytest.approx(law.dynamic, rel=1e-14)
    assert coefficient(law, 100.0 * law.v_dynamic) == law.dynamic


@every_smooth
def test_friction_rises_from_zero_with_one_and_a_half_times_its_mean_slope(law: ModifiedCoulomb) -> None:
    assert coefficient(law, 0.0) == 0.0
    speed = 1e-6 * law.v_static
    # the cubic is y^2 / 3 = 3e-13 below its tangent there
    assert coefficient(law, speed) / speed == pytest.approx(1.5 * law.static / law.v_static, rel=1e-12)


@every_smooth
@given(fraction=st.floats(0.0, 3.0))
def test_friction_coefficient_is_the_papers_steps(law: ModifiedCoulomb, fraction: float) -> None:
    """Eqs. (27)-(29), one step through zero and one down to mu_d; without the sign that is misprinted."""
    for speed in (fraction * law.v_static, fraction * law.v_dynamic):
        if speed < law.v_static:
            known = adams_step(speed, -law.v_static, -law.static, law.v_static, law.static)
        else:
            known = adams_step(speed, law.v_static, law.static, law.v_dynamic, law.dynamic)
        # rounding of s near 1/2, where the first step passes through zero: some times 1e-16, with a margin of ten
        assert coefficient(law, speed) == pytest.approx(known, abs=1e-14)


@pytest.mark.parametrize("speed, known", [(0.0, 0.0), (1e-4, 0.0), (5.5e-4, 0.05), (1e-3, 0.1), (1.0, 0.1)])
def test_ambrosios_friction_is_a_ramp(speed: float, known: float) -> None:
    # two units in the last place of 0.1, with a margin of ten
    assert coefficient(FRICTION["ambrosio"][0], speed) == pytest.approx(known, abs=1e-15)


@pytest.mark.parametrize("speed", [1e-4, 1e-3, 5e-3, 0.1])
def test_bristles_under_steady_sliding_carry_the_stribeck_curve(speed: float) -> None:
    """Z -> g / sigma_0 against the sliding, at the rate sigma_0 |v| / g."""
    p = part(LUGRE).parameters(LUGRE)
    g = 0.1 + 0.05 * np.exp(-((speed / 1e-3) ** 2))

    def rhs(_: float, z: np.ndarray) -> np.ndarray:
        return np.array(part(LUGRE).traction(Vector([z[0], 0.0, 0.0]), Vector([speed, 0.0, 0.0]), 1.0, p)[3][:1])

    done = solve_ivp(rhs, (0.0, 40.0 * g / (1e5 * speed)), [0.0], "DOP853", rtol=1e-11, atol=1e-20)
    # forty relaxation times leave e^-40; the rest is the tolerance
    assert done.y[0, -1] == pytest.approx(g / 1e5, rel=1e-9)
    pull = part(LUGRE).traction(Vector([done.y[0, -1], 0.0, 0.0]), Vector([speed, 0.0, 0.0]), 2.0, p)[0]
    assert pull[0] == pytest.approx(-2.0 * min(g + 0.4 * speed, 0.15), rel=1e-8)


def test_bristles_that_hardly_slip_are_a_spring() -> None:
    """Below v_S the deflection follows the displacement x, less x^2 sigma_0 / (2 g)."""
    p, shift = part(LUGRE).parameters(LUGRE), 1e-9
    done = solve_ivp(
        lambda _, z: np.array(part(LUGRE).traction(Vector([z[0], 0.0, 0.0]), Vector([shift, 0.0, 0.0]), 1.0, p)[3][:1]),
        (0.0, 1.0), [0.0], "DOP853", rtol=1e-11, atol=1e-22,
    )  # fmt: skip
    x = shift
    # next term of the expansion: (sigma_0 x / g)^2 / 6 = 7e-8
    assert done.y[0, -1] == pytest.approx(x * (1.0 - 1e5 * x / (2.0 * 0.15)), rel=1e-7)


@pytest.mark.parametrize(
    "made, said",
    [
        (lambda: SMOOTH[0].model_validate({**SMOOTH[0].model_dump(), "dynamic": 0.2}), "exceeds static"),
        (lambda: SMOOTH[0].model_validate({**SMOOTH[0].model_dump(), "v_static": 1.0}), "below v_dynamic"),
        (lambda: Ambrosio(law="ambrosio", dynamic=0.2, v0=1e-2, v1=1e-3), "below v1"),
        (lambda: LuGre(law="lugre", static=0.1, dynamic=0.2, v_stribeck=1e-3, bristle_stiffness=1e5), "exceeds static"),
        (lambda: LUGRE.model_validate({**LUGRE.model_dump(), "bristle_damping": 1e5}), "would add energy"),
    ],
)  # fmt: skip
def test_friction_that_cannot_be_is_refused(made: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        made()


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", [PIN, SLIDER, BALL])
def test_the_slopes_of_a_bearings_normal_force_are_its_derivatives(kind: int, seed: int) -> None:
    """By the reaction of its joint, whichever way that points: Newton's method converges without them, but slowly."""
    rng = np.random.default_rng(seed)
    bearing = SimpleNamespace(kind=kind, axis=seed % 3)
    numbers = SimpleNamespace(lever=1.7, axial=0.6, torsion=0.9, preload=2.0)
    R = Matrix(rotation_vector_to_matrix(rng.normal(size=3)).ravel())
    reaction, change = rng.normal(size=(2, 6))

    def size(way: float) -> Any:
        M, F = np.split(reaction + way * change, 2)
        return pressure(bearing, numbers, R, Wrench(Vector(M), Vector(F)))

    step, here = 1e-5, size(0.0)
    slope = (size(step).size - size(-step).size) / (2.0 * step)
    by_reaction = np.concatenate([here.by_M, here.by_F])
    # differences are off by the third derivative times step^2 / 6, and by 1e-16 / step
    assert by_reaction @ change == pytest.approx(slope, rel=1e-6, abs=1e-8)
