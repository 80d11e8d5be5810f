"""Tangents of tapes are the derivatives of what the tapes compute, to rounding."""

import operator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics.of_topology import list_of, program_of
from flexclear.dynamics.model import initial
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.specialise import dual, program, symbols
from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.derivative import tangent
from flexclear.dynamics.specialise.tape import FLOAT, Tape, UnsuitedError
from flexclear.dynamics.specialise.topology import (
    RATES,
    RATES_CHANGE,
    STATE,
    STATE_CHANGE,
    start,
    topology_of,
)
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties import tapes
from tests.properties.articulated_chains import keep_independent
from tests.properties.test_specialised import RIGID

#: of the largest change of a kind: products of up to a hundred factors, in another order than complex numbers take them
ROUNDING = 1e-10
STEP = 1e-40


def changes(scene: Scene, reduced: dict[str, Any], closed: int) -> list[np.ndarray]:
    """Changes of rates and contacts along a random direction: by a complex step of the tape, by its tangent, and by
    calls that run on numbers with changes."""
    model = tabulate(build(scene, reduced))
    space, random = model.arrays.work_space(m.Room(4, 0)), np.random.default_rng(2)
    h, y = space.h, int(space.h[m.Y])
    dy, vy, vdy = (int(h[m.SLOPES]) + k * model.ny for k in range(3))
    f, w, n, begin = model.arrays.f, space.w, space.n, initial.start_state(model)
    begin += 1e-3 * random.normal(size=model.ny)  # the distance of two points that coincide has no derivative
    begin[model.speeds] += 0.1 * random.normal(size=model.nv)
    w[y : y + model.ny] = begin
    keep_independent(model, space._replace(w=w.copy()), y, dy)
    laws = slice(h[m.LAW.at], h[m.LAW.at] + m.LAW.size * model.arrays.size(m.N_LAWS))
    impacts = slice(h[m.LATCHED], h[m.LATCHED] + len(model.contacts))
    w[laws], w[impacts], n[n[m.MODE] :] = 0.1 * random.normal(size=laws.stop - laws.start), 0.1, closed
    df, dw = f * random.normal(size=len(f)), np.zeros(len(w))
    dw[laws], dw[impacts] = random.normal(size=laws.stop - laws.start), random.normal(size=len(model.contacts))
    direction = random.normal(size=model.ny) * np.maximum(np.abs(begin), 1e-3)
    made = program_of(model.parts, topology_of(model.arrays, h), program.LONGEST_DIFFERENTIATED)

    exact = {"f": f, "w": w.copy(), "n": n.copy(), "df": df, "dw": dw}
    exact["w"][vy : vy + model.ny] = direction
    tapes.run(tangent(made, program.LONGEST_DIFFERENTIATED), h, exact, y, dy, (vy, vdy))
    moved = {"f": f + 1j * STEP * df, "w": w + 1j * STEP * dw, "n": n.copy()}
    moved["w"][y : y + model.ny] += 1j * STEP * direction
    tapes.run(made, h, moved, y, dy, operations=tapes.COMPLEX)
    assert np.allclose(exact["w"][dy : dy + model.ny], moved["w"][dy : dy + model.ny].real, rtol=1e-9, atol=1e-9)
    touch = slice(h[m.TOUCH.at], h[m.TOUCH.at] + m.TOUCH.size * len(model.contacts))
    dw[y : y + model.ny] = direction
    numbers, given = (np.array(dual.seed_changes(a, da[None, :]), dtype=object) for a, da in ((w, dw), (f, df)))
    list_of(model.parts, topology_of(model.arrays, h), m.CALLS, Numbers(h, given, numbers, n, y, dy))
    ways = [
        (moved["w"][dy : dy + model.ny].imag / STEP, moved["w"][touch].imag / STEP),
        (exact["w"][vdy : vdy + model.ny], exact["dw"][touch]),
        (dual.changes(numbers[dy : dy + model.ny], 1)[0], dual.changes(numbers[touch], 1)[0]),
    ]
    nq, end = model.nq, model.speeds.stop
    parts = [[way[0][:nq], way[0][nq:end], way[0][end:], way[1]] for way in ways]
    sizes = [np.abs(part).max(initial=0.0) or 1.0 for part in parts[0]]
    return [np.concatenate([part / size for part, size in zip(way, sizes, strict=True)]) for way in parts]


#: of the scenes of four-bars in a row, which differ in nothing but their number, the short ones; flexible bodies, and
#: the paper's mechanism
DIFFERENTIATED = [path for path in RIGID if path.stem != "four_bars_40"]
DIFFERENTIATED += [
    TREE / "scenes" / f"{name}.toml" for name in ("sps4/csj", "sps4/far_csj_cb", "checks/flexible_slider_crank")
]


@pytest.mark.parametrize("path", DIFFERENTIATED, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_every_scene_is_differentiated(path: Path) -> None:
    """Along state, numbers, laws of time and impact rates at once; contacts open and closed."""
    scene = load_scene(path)
    for closed in (0, 1):
        stepped, *others = changes(scene, bundles(scene), closed)
        assert all(np.abs(other - stepped).max() < ROUNDING for other in others)


def single(operation: str, *numbers: float) -> tuple[float, complex]:
    """Change of one operation of numbers that change by 1, 2, ..: by its rule, and by a complex step."""
    tape = Tape(lambda condition: False, 100)
    given = [tape.write(FLOAT, "load", "w", start(STATE) + k) for k in range(len(numbers))]
    made = Program(tape.block, [("w", start(RATES), tape.write(FLOAT, operation, *given))])
    w, h, count = np.zeros(8), np.zeros(1, int), len(numbers)
    w[:count], w[4 : 4 + count] = numbers, np.arange(1, count + 1)
    tapes.run(tangent(made, 100), h, {"w": w}, 0, 3, (4, 7))
    stepped = np.zeros(8, complex)
    stepped[:count] = np.array(numbers) + 1j * STEP * np.arange(1, count + 1)
    tapes.run(made, h, {"w": stepped}, 0, 3, operations=tapes.COMPLEX)
    return w[7], stepped[3].imag / STEP


OPERATIONS = pytest.mark.parametrize(
    "operation, numbers",
    [
        *(
            (name, (x,))
            for name in ("neg", "reciprocal", "sqrt", "sin", "cos", "tan", "exp", "log", "tanh", "round")
            for x in (0.3, 2.0)
        ),
        *(("fabs", (x,)) for x in (-0.3, 0.4)),
        *((name, xy) for name in ("add", "sub", "mul", "pow") for xy in ((0.3, 2.0), (1.7, 0.4))),
        *(
            (name, xy)
            for name in ("arctan2", "copysign")
            for xy in ((0.3, 2.0), (-1.7, 0.4), (1.7, -0.4), (-2.0, -0.3))
        ),
    ],
)


@OPERATIONS
def test_each_operation_has_its_rule(operation: str, numbers: tuple[float, ...]) -> None:
    exact, stepped = single(operation, *numbers)
    assert exact == pytest.approx(stepped, rel=1e-13, abs=1e-300)


#: operations as Python writes them
WRITTEN = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "pow": operator.pow, "neg": operator.neg,
    "fabs": abs, "reciprocal": lambda a: 1.0 / a,
}  # fmt: skip


@OPERATIONS
def test_numbers_with_changes_follow_the_same_rules(operation: str, numbers: tuple[float, ...]) -> None:
    """Of all arguments, of each alone next to a plain number, and along two directions."""
    function = WRITTEN.get(operation) or getattr(symbols, {"round": "nearest"}.get(operation, operation))

    def at(*given: Any) -> np.ndarray:
        return dual.changes([function(*given)], 2)[0 if len(given) == 1 else slice(None), 0]

    plain = [np.float64(x) for x in numbers]
    whole = at(*(dual.Dual(x, np.array([k + 1.0, -k - 1.0])) for k, x in enumerate(plain)))
    known = single(operation, *numbers)[1]
    assert np.ravel(whole)[0] == pytest.approx(known, rel=1e-13, abs=1e-300)
    if len(plain) == 2:
        parts = at(dual.Dual(plain[0], np.array([1.0, -1.0])), plain[1])
        parts = parts + at(plain[0], dual.Dual(plain[1], np.array([2.0, -2.0])))
        assert parts == pytest.approx([known, -known], rel=1e-12, abs=1e-15)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_the_root_of_zero_does_not_change() -> None:
    assert single("sqrt", 0.0)[0] == 0.0


def test_what_would_be_too_long_is_refused() -> None:
    tape = Tape(lambda condition: False, 100)
    x = tape.write(FLOAT, "load", "w", start(STATE))
    made = Program([*tape.block], [("w", start(RATES), tape.write(FLOAT, "sin", x))])
    assert STATE_CHANGE != RATES_CHANGE
    with pytest.raises(UnsuitedError, match="too long"):
        tangent(Program(tape.block, made.stores), 0)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("exponent", [9.0, -9.0])
def test_whole_powers_have_their_slope_below_zero(exponent: float) -> None:
    """Of symbols and of numbers with changes."""
    base = dual.Dual(np.float64(-0.5), np.array([1.0]))
    (found,) = dual.changes([base**exponent], 1)[0]
    assert found == pytest.approx(exponent * (-0.5) ** (exponent - 1.0), rel=1e-14)
