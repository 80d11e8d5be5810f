"""Contact laws of one's own: the laws of the program written as expressions, kinks, units, and bad input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from flexclear.dynamics.contact.expression import OPERATIONS, composed
from flexclear.dynamics.contact.form import FORMS
from flexclear.dynamics.contact.friction import FRICTION_LAWS
from flexclear.dynamics.contact.friction.expression import check
from flexclear.dynamics.contact.law import Numbers, Resolved
from flexclear.dynamics.contact.normal import NORMAL_LAWS
from flexclear.dynamics.contact.normal.expression import rebound, resolve
from flexclear.dynamics.vectors import ZERO, Vector
from flexclear.scene.clearance import Friction, NormalLaw
from flexclear.scene.expression import FUNCTIONS, JUMPING, OPERANDS, Local
from flexclear.scene.law_expressions import encode_law
from flexclear.scene.load import load_scene
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE
from tests.properties.kernels import from_python
from tests.properties.test_dynamics_laws import DEPTH, IMPACT, MASS, NORMAL, RANGE, RATE, Law, law

REACH = 1e-2
#: of all laws whose damping is in proportion to the elastic force; of the others
HYSTERETIC, ELASTIC, LINEAR = "K*depth^n*(1 + a*rate/impact_rate)", "K*depth^n", "K*depth + C*rate"


def written(force: str, restitution: float | None = None, **values: Any) -> Any:
    given = {"law": "expression", "force": force, "values": values}
    return TypeAdapter(NormalLaw).validate_python(given | ({} if restitution is None else {"restitution": restitution}))


def resolved(force: str, mass: float | None = MASS, restitution: float | None = None, **values: Any) -> Resolved:
    return resolve(written(force, restitution, **values), mass, REACH)


def as_expression(known: Law) -> Any:
    """A law of the program as an expression."""
    K, n, a = known.resolved.numbers[:3]
    unit = f"N/m^{n:g}"
    if known.name == "kelvin-voigt":
        return written(LINEAR, K=f"{K!r} N/m", C=f"{a!r} N s/m")
    if known.name == "hertz":
        return written(ELASTIC, K=f"{K!r} {unit}", n=n)
    return written(HYSTERETIC, K=f"{K!r} {unit}", n=n, a=a)


def parts(law: Resolved, depth: float, rate: float, impact: float) -> tuple[float, float]:
    elastic, damping = from_python(FORMS[law.form].force)(depth, rate, impact, law.numbers)
    return float(elastic), float(damping)


@pytest.mark.parametrize("name", NORMAL_LAWS)
@settings(max_examples=30)
@given(
    choice=st.integers(0, len(RANGE)),
    stiffness=st.floats(1e5, 1e12),
    exponent=st.sampled_from([1.5, 1.0, 1.3, 2.0]),
    depth=DEPTH,
    rate=RATE,
    impact=IMPACT,
)
def test_the_laws_of_the_program_written_as_expressions_give_their_results_to_rounding(
    name: str, choice: int, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    known = law(name, choice, stiffness, exponent)
    kind, values = as_expression(known).encoded
    other = Resolved(kind, Numbers(0.0, 1.0, 1.0, (*values, *(0.0,) * 12)[:12]), None, None)
    elastic, damping = known.parts(depth, rate, impact)
    # sums and powers in another order; a damping that is small against the elastic force has the rounding of that
    size = 8e-16 * max(elastic, abs(damping))
    assert parts(other, depth, rate, impact) == pytest.approx((elastic, damping), rel=4e-15, abs=4.0 * size)
    stored = from_python(FORMS[other.form].stored)(depth, other.numbers)
    assert stored == pytest.approx(known.stored(depth), rel=1e-12)  # of the quadrature of a broken power
    # forces of smaller depths than 1e-100 m underflow
    assert other.depth(elastic) == pytest.approx(depth, rel=1e-12, abs=1e-100 if depth else 1e-9)


@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_delivered_restitutions_of_expressions_are_the_closed_ones(name: str) -> None:
    for c_r in NORMAL[name][1][1::2] or NORMAL[name][1]:
        known = Law(name, c_r, 1e9, 1.0 if name == "kelvin-voigt" else 1.5)
        found = resolve(as_expression(known), MASS, REACH)
        assert found.delivered == pytest.approx(known.resolved.delivered, abs=1e-4)  # of steps of a 150th of an impact


def test_a_restitution_that_depends_on_an_unknown_mass_is_not_told() -> None:
    assert resolved(LINEAR, None, K="1e6 N/m", C="100 N s/m").delivered is None
    assert resolved(HYSTERETIC, None, K="1e9 N/m^1.5", n=1.5, a=0.3).delivered == pytest.approx(0.84, abs=0.02)
    assert resolved(ELASTIC, None, K="1e9 N/m^1.5", n=1.5).delivered == 1.0


@pytest.mark.parametrize("depth", [5e-5, 3e-4, 2e-3, 9e-3])
def test_the_stored_energy_of_a_progressive_contact_counts_its_kinks(depth: float) -> None:
    found = resolved(
        "k*depth + max(0 N, m*(depth - d)) + max(0 N, m*(depth - 3*d))", k="1e6 N/m", m="4e6 N/m", d="1 mm"
    )
    assert found.numbers.values[12][:3] == pytest.approx((0.0, 1e-3, 3e-3), rel=1e-14)
    exact = 0.5e6 * depth**2 + sum(2e6 * max(0.0, depth - at) ** 2 for at in (1e-3, 3e-3))
    stored = from_python(FORMS[found.form].stored)(depth, found.numbers)
    assert stored == pytest.approx(exact, rel=1e-12)
    assert found.depth(sum(parts(found, depth, 0.0, 1.0))) == pytest.approx(depth, rel=1e-12)


@pytest.mark.parametrize(
    "force", ["K*depth*exp(depth/d)", "K*d*tanh(depth/d)", "K*d*log(1 + depth/d)", "K*d*sin(depth/d)"]
)
def test_the_stored_energy_of_any_force_is_its_integral(force: str) -> None:
    found = resolve(written(force, K="1e6 N/m", d="1 mm"), 1.0, 1e-3)
    elastic, stored = from_python(FORMS[found.form].force), from_python(FORMS[found.form].stored)
    for depth in (1e-6, 1e-3):
        exact = quad(lambda d: elastic(d, 0.0, 1.0, found.numbers)[0], 0.0, depth, epsrel=1e-13, epsabs=0.0)[0]
        assert stored(depth, found.numbers) == pytest.approx(exact, rel=1e-12)


def looked_up(points: Any, *of: str, unit: str = "N") -> dict[str, Any]:
    columns = [
        {"column": name, "unit": {"depth": "m", "rate": "m/s", "slip": "m/s", "force": "N"}[name]} for name in of
    ]
    return {"file": "made.csv", "of": columns, "value": {"column": "value", "unit": unit}, "points": points}


def test_the_stored_energy_of_a_table_is_the_integral_of_its_spline() -> None:
    """SciPy's antiderivative of the same spline, whose third derivative jumps at each point."""
    depths = np.linspace(0.0, 1.0, 37) ** 2 * 2e-3
    forces = 1e6 * depths * (1.0 + np.sin(3000.0 * depths))
    points = np.c_[depths, forces].tolist()
    law = TypeAdapter(NormalLaw).validate_python(
        {"law": "expression", "force": "table(f, depth)", "tables": {"f": looked_up(points, "depth")}}
    )
    law.check()
    found, spline = resolve(law, MASS, REACH), CubicSpline(depths, forces)
    for depth in (1e-6, 3.3e-5, 4.7e-4, 1.999e-3):
        stored = from_python(FORMS[found.form].stored)(depth, found.numbers)
        assert stored == pytest.approx(float(spline.antiderivative()(depth)), rel=1e-12)
        assert parts(found, depth, 0.0, 1.0)[0] == pytest.approx(float(spline(depth)), rel=1e-12)


@pytest.mark.parametrize(
    "force, of, points, words",
    [
        ("table(f, depth)", ["depth"], [(1e-6, 1.0), (1e-3, 2.0)], "no value at depth = 0 at rest: depth = 0 m leaves"),
        (
            "table(f, depth, rate)",
            ["depth", "rate"],
            [(d, v, 1.0) for d in (0, 1) for v in (1, 2)],
            "rate = 0 m/s leaves",
        ),
        ("table(f, depth)", ["depth"], [(0.0, 1.0), (1e-3, -2.0)], "pulls"),
        ("table(f, rate)", ["depth"], [(0.0, 1.0), (1e-3, 2.0)], "is over a value in m, not a value in m/s"),
        ("table(f, depth)*1 m", ["depth"], [(0.0, 1.0), (1e-3, 2.0)], "but a force"),
        ("1 N/m*depth", ["depth"], [(0.0, 1.0), (1e-3, 2.0)], "tables.f is not used"),
    ],
)
def test_impossible_tables_of_forces_are_refused_in_words(force: str, of: list[str], points: Any, words: str) -> None:
    law = {"law": "expression", "force": force, "tables": {"f": looked_up(points, *of)}}

    def tried() -> None:
        own = TypeAdapter(NormalLaw).validate_python(law)
        own.check()
        resolve(own, MASS, REACH)

    with pytest.raises(ValueError, match=words):
        tried()


def test_a_table_of_a_coefficient_begins_at_rest_without_force() -> None:
    def tried(points: Any) -> None:
        own = TypeAdapter(Friction).validate_python(
            {
                "law": "expression",
                "coefficient": "table(mu, slip, normal_force)",
                "tables": {"mu": looked_up(points, "slip", "force", unit="1")},
            }
        )
        own.check()
        check(own)

    tried([(v, f, 0.1 * min(v, 1.0)) for v in (0.0, 0.5, 1.0, 2.0) for f in (0.0, 10.0)])
    with pytest.raises(ValueError, match=r"at which contacts begin: force = 0.001 N leaves table mu \(made.csv\)"):
        tried([(v, f, 0.1 * v) for v in (0.0, 1.0) for f in (5.0, 10.0)])
    with pytest.raises(ValueError, match=r"0\.1 at rest, where friction would jump"):
        tried([(v, f, 0.1) for v in (0.0, 1.0) for f in (0.0, 10.0)])
    with pytest.raises(ValueError, match="would drive the sliding"):
        tried([(v, f, -0.1 * v) for v in (0.0, 1.0) for f in (0.0, 10.0)])


def test_every_operation_of_the_language_is_composed() -> None:
    known = {name for name in OPERANDS if name not in JUMPING}
    assert known == set(OPERATIONS)
    assert set(FUNCTIONS) - set(JUMPING) <= known
    text = "a*sqrt(a)+min(a,b)-max(a,b)/abs(-b)+sin(a)*cos(b)+tan(a)*exp(-b)+log(b)*tanh(a)+norm(b)+a^2.5+b^-3+a^n+a^12"
    kind, values = encode_law(text, {"n": 1.7}, {"a": Local("x0", "1"), "b": Local("x1", "1")})
    x, y = 0.7, 1.9
    known = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh")}
    known |= {"min": min, "max": max, "abs": abs, "norm": abs, "a": x, "b": y, "n": 1.7}
    by_python = eval(text.replace("^", "**"), known)
    assert from_python(composed(kind))(x, y, 0.0, values) == pytest.approx(by_python, rel=1e-14)


# Friction -------------------------------------------------------------------------------------------------------------
RISE, FALL = "min(slip/v, 1)", "max(0, min(1, (slip - v)/(w - v)))"
COULOMB = f"mu*(3*{RISE} - {RISE}^3)/2 + (m - mu)*{FALL}^2*(3 - 2*{FALL})"
SLIDING: dict[str, tuple[dict[str, Any], str, dict[str, Any]]] = {
    "modified-coulomb": (
        {"static": 0.15, "dynamic": 0.1, "v_static": 1e-3, "v_dynamic": 0.01},
        COULOMB,
        {"mu": 0.15, "m": 0.1, "v": "1 mm/s", "w": "10 mm/s"},
    ),
    "ambrosio": (
        {"dynamic": 0.1, "v0": 1e-3, "v1": 2e-3},
        "m*min(1, max(0, (slip - a)/(b - a)))",
        {"m": 0.1, "a": "1 mm/s", "b": "2 mm/s"},
    ),
}


def friction(coefficient: str, **values: Any) -> Any:
    return TypeAdapter(Friction).validate_python({"law": "expression", "coefficient": coefficient, "values": values})


@pytest.mark.parametrize("name", SLIDING)
def test_friction_laws_without_memory_written_as_expressions_give_their_results(name: str) -> None:
    keys, coefficient, values = SLIDING[name]
    known, own = TypeAdapter(Friction).validate_python({"law": name, **keys}), friction(coefficient, **values)
    own.check()
    check(own)
    one, other = FRICTION_LAWS[name], FRICTION_LAWS[own.kind]
    assert other.kinks(own) == pytest.approx(one.kinks(known), rel=1e-13)
    for speed in (0.0, 1e-12, 3e-4, 1e-3, 1.7e-3, 5e-3, 0.01, 3.0):
        expected, found = (
            from_python(law.traction)(ZERO, Vector((speed * 0.6, 0.0, speed * 0.8)), 7.0, law.parameters(of))
            for law, of in ((one, known), (other, own))
        )
        assert found[0] == pytest.approx(expected[0], rel=1e-14)
        assert found[1] == pytest.approx(expected[1], rel=1e-14)


def test_a_coefficient_may_depend_on_the_normal_force() -> None:
    own = friction("mu*tanh(slip/v)*(F/(F + normal_force))^(1/3)", mu=0.2, v="1 mm/s", F="50 N")
    own.check()
    check(own)
    force, *_ = from_python(FRICTION_LAWS[own.kind].traction)(
        ZERO, Vector((0.3, 0.0, 0.0)), 80.0, (*own.encoded[1], 0, 0, 0)
    )
    assert force[0] == pytest.approx(-80.0 * 0.2 * (50.0 / 130.0) ** (1.0 / 3.0), rel=1e-14)


@pytest.mark.parametrize(
    "coefficient, values, words",
    [
        ("mu", {"mu": 0.1}, "0.1 at rest, where friction would jump"),
        ("mu*tanh(slip/v) - 0.1*tanh(slip/w)", {"mu": 0.05, "v": "1 mm/s", "w": "1 m/s"}, "would drive the sliding"),
        ("mu*tanh(slip/v)/(normal_force - F)*F", {"mu": 0.1, "v": "1 mm/s", "F": "1 N"}, "drive the sliding|no number"),
        ("mu*slip", {"mu": 0.1}, "number"),
        ("mu*slip/v + depth/v", {"mu": 0.1, "v": "1 m/s"}, "'depth' is unknown.*slip, normal_force, mu, v"),
        ("mu*sign(slip)", {"mu": 0.1}, "jumps"),
    ],
)
def test_impossible_coefficients_are_refused_in_words(coefficient: str, values: dict[str, Any], words: str) -> None:
    def tried() -> None:
        own = friction(coefficient, **values)
        own.check()
        check(own)

    with pytest.raises(ValueError, match=words):
        tried()


# Bad input ------------------------------------------------------------------------------------------------------------
K, K15 = {"K": "1e6 N/m"}, {"K": "1e9 N/m^1.5"}


@pytest.mark.parametrize(
    "force, keys, words",
    [
        ("K*depth^1.5", K, "its value is in kg m\\^1.5/s\\^2, but a force"),
        ("K*depth", {"K": 1e6}, "its value is in m, but a force"),
        ("K*depth + C*rate", K, "'C' is unknown: a contact law depends on its own contact alone, here on depth, rate"),
        ("K*depth*ball.position.x/1 m", K, "'ball.position.x' is unknown"),
        ("K*depth", {**K, "a": 2}, "values.a is not used"),
        ("K*depth", {**K, "rate": 2}, "'rate' cannot name a constant"),
        ("K*depth*step(rate/1 m/s)", K, "step\\(...\\) jumps"),
        ("K*depth + __import__('os')", K, "is not a quantity"),
        ("K*depth.real", K, "is unknown"),
        ("+".join(f"a{k}*depth" for k in range(13)), {f"a{k}": "1 N/m" for k in range(13)}, "13 values, at most 12"),
        ("K*depth - F", {**K, "F": "1 N"}, "pulls: it is -1 N at rest at depth = 0"),
        ("K*depth - M*depth^2", {**K, "M": "2e8 N/m^2"}, "pulls"),
        ("K*depth*(1 - 0.5*rate/impact_rate)", K, "rebounds with .* of it"),
        ("K*depth*(1 + impact_rate/1 m/s)", K, "depends on impact_rate at rest"),
        ("K*depth + C*rate/depth", {**K, "C": "1 N s"}, "is no number at depth = 0"),
        ("K*sqrt((depth - 1 mm)*1 m)", K, "is no number at depth = 0"),
        ("K*depth", {**K, "restitution": 0.8}, "no damping.*restitution of 0.8 is asked"),
        ("K*depth + max(0 N, K*(1 mm)*sin(depth/1 mm))", K, "kinks at rest, at most 1"),
        ("K*table(stiff, depth)", K, "there is no table 'stiff'"),
    ],
)
def test_impossible_forces_are_refused_in_words(force: str, keys: dict[str, Any], words: str) -> None:
    values = dict(keys)
    restitution = values.pop("restitution", None)

    def tried() -> None:
        own = written(force, restitution, **values)
        own.check()
        resolve(own, MASS, REACH)

    with pytest.raises(ValueError, match=words):
        tried()


def test_a_restitution_that_the_expression_misses_is_a_warning() -> None:
    force = "K*depth^1.5*(1 + 3/4*(1 - restitution^2)*rate/impact_rate)"
    found = resolved(force, restitution=0.5, **K15)
    assert found.parameter == 0.5
    assert "restitution = 0.5 delivers 0.72" in (found.warning or "")  # 0.725 of Lankarani & Nikravesh's law
    assert resolved(force, restitution=0.9, **K15).warning is None


def test_rebounds_count_mass_and_speed() -> None:
    """Of K d^1.5 + C d' the damping counts less the heavier the mass and, as contacts last shorter, the speed."""
    found = resolved("K*depth^1.5 + C*rate*(depth/1 m)^0.25", C="1e4 N s/m", **K15)
    e = [rebound(found.form, found.numbers.values, m, v) for m, v in ((1.0, 0.1), (4.0, 0.1), (1.0, 1.0))]
    assert e[0] < e[1] < 1.0
    # dimensions: with d ~ (m v^2/K)^0.4 a damping C d^0.25 d' counts as m^-0.5 v^0: the restitution knows no speed
    assert e[2] == pytest.approx(e[0], abs=1e-4)


SOCKET = "checks/bounce.toml"


def socket(**changes: Any) -> Any:
    return load_scene(TREE / "scenes" / SOCKET, override=changes)


def test_scenes_place_their_expressions_errors() -> None:
    normal = {"law": "expression", "force": "K*depth", "values": {"K": 1e6}}
    with pytest.raises(InputError, match=r"\[joint.contact\]: normal.force = 'K\*depth': its value is in m"):
        socket(**{"joint.contact.normal": normal})
    with pytest.raises(InputError, match=r"\[stop.C\]: normal.force = 'K\*depth': its value is in .*but a torque"):
        load_scene(TREE / "scenes/checks/stops.toml", {"stop.C.normal": normal | {"values": {"K": "1e6 N/m"}}})
    bearing = {"law": "expression", "coefficient": "tanh(slip/1 m/s)*1 N/(1 N + normal_force)", "radius": "1 mm"}
    with pytest.raises(InputError, match="slip alone: its coefficient has no normal_force"):
        load_scene(TREE / "scenes/checks/rubbing_slider_crank.toml", {"joint.A.friction": bearing})
