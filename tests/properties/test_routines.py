"""Compiled lists of calls compute what the same calls do in Python: rates, what steps read besides, and reports.

`test_articulated` and `test_recorded_states` compare what they compute with mechanics.
"""

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.families import turning
from benchmarks.families.growth import four_bars
from flexclear.dynamics import memory as m
from flexclear.dynamics.joints import JOINTS
from flexclear.dynamics.joints.rotation_vector import SERIES_ANGLE, series
from flexclear.dynamics.joints.rotation_vector import closed as closed_forms
from flexclear.dynamics.mechanics import closures, flexible, modes, shapes, trees
from flexclear.dynamics.mechanics.evaluation import REPORTS, status
from flexclear.dynamics.mechanics.evaluation import evaluate as evaluated_by
from flexclear.dynamics.mechanics.of_topology import list_of, mechanism_of
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.constraints import joint_positions, moved_frame
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.routines.store import load
from flexclear.dynamics.run.evaluation import engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of
from flexclear.dynamics.run.trajectory import Trajectory, integrate
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.dynamics.vectors import ZERO, Inertia, Matrix, Symmetric, Vector, Wrench, cross
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE
from tests.properties import movable
from tests.properties.articulated_chains import Evaluated, bending, evaluated, rods, tabulated
from tests.properties.mechanisms import two_loops
from tests.properties.movable_units import UNITS
from tests.properties.test_articulated import (
    BENT,
    BOTH,
    FIXED,
    FREE,
    MANY,
    MIXED,
    NONE,
    ONE,
    TREES,
    apart,
    massless,
)

#: of the largest rate of a kind: sums are taken in another order
ROUNDING = 1e-10
SCENES = (
    *("checks/bennett", "checks/bricard", "checks/door", "checks/four_bars_2", "checks/free_body", "checks/heavy_top"),
    *("checks/universal_shaft", "checks/bifilar_pendulum", "gallery/four_bar", "gallery/stewart", "sps4/ideal"),
    *("gallery/scott_russell", "sps4/variants/guided", "sps4/variants/stacked"),
)
#: mechanisms that the units make up, without clearance
CLOSED = [name for name in UNITS if "loose" not in name and "clearance" not in name]
_EVALUATE = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 4, ctypes.c_double, ctypes.c_int64, ctypes.c_int64)
#: laws of time that leave those of the evaluation in Python
NO_LAWS = ctypes.CFUNCTYPE(ctypes.c_int64)(lambda: 0)


def without_results(found: Evaluated) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """h, w and n of what was evaluated in Python, without what steps read; places of the state and its rates."""
    model, space = found.model, found.space
    h, w, n = space.h.copy(), space.w.astype(float), space.n.copy()
    y, dy, rows = int(h[m.Y]), int(h[m.SLOPES]), model.arrays.size(m.N_CLOSURE_ROWS)
    for begin, count in ((dy, model.ny), (h[m.RESIDUAL], rows), (h[m.RESIDUAL_RATE], rows), (h[m.PIVOT], min(rows, 1))):
        w[begin : begin + count] = np.nan
    return h, w, n, y, dy


def by_numbers(found: Evaluated) -> tuple[np.ndarray, np.ndarray]:
    """As `by_routines`, on numbers in Python."""
    model, (h, w, n, y, dy) = found.model, without_results(found)
    calls = Numbers(h, model.arrays.f, w, n, y, dy)
    evaluated_by(mechanism_of(Tables(model.parts, topology_of(model.arrays, h))), calls)
    n[[m.EVALUATION, m.ABRIDGED, m.STATE]] = calls.report, 1, y
    return w, n


def by_routines(found: Evaluated) -> tuple[np.ndarray, np.ndarray]:
    """The work space w, and n, after an evaluation by a compiled list of what was evaluated in Python."""
    model, f, (h, w, n, y, dy) = found.model, found.model.arrays.f, without_results(found)
    calls = load(list_of(model.parts, topology_of(model.arrays, h)), silent_text).instance(h)
    h[m.PRESCRIBE], h[m.CALLS] = ctypes.cast(NO_LAWS, ctypes.c_void_p).value, calls.words.ctypes.data
    _EVALUATE(calls.loaded.interpreter)(*(array.ctypes.data for array in (h, f, w, n)), 0.1, y, dy)
    return w, n


def silent_text(text: str) -> None:
    """Receive a message."""


def assert_alike(found: Evaluated) -> None:
    """Rates of positions, speeds and ledger; residuals, rates and pivots of the loops; the report."""
    for w, n in (by_routines(found), by_numbers(found)):
        assert_same(found, w, n)


def assert_same(found: Evaluated, w: np.ndarray, n: np.ndarray) -> None:
    model, h = found.model, found.h
    rates, speeds = w[h[m.SLOPES] :][: model.ny], model.speeds
    for part in (slice(speeds.start), speeds, slice(speeds.stop, None)):
        assert apart(rates[part], found.rates[part].astype(float)) < ROUNDING
    rows, kept = model.arrays.size(m.N_CLOSURE_ROWS), int(h[m.N_KEPT_ROWS])
    read = [
        h[m.ROOTS] + np.arange(kept),
        h[m.ROW_SCALE] + rows + np.arange(kept),
        h[m.PIVOT : m.PIVOT + 1],
    ]
    read += [h[stretch] + np.arange(rows) for stretch in (m.RESIDUAL, m.RESIDUAL_RATE)]
    for places in read:
        room = ROUNDING * np.abs(found.w[places]).max(initial=1.0)
        assert w[places] == pytest.approx(found.w[places].astype(float), rel=ROUNDING, abs=room)
    assert (n[m.EVALUATION], n[m.ABRIDGED], n[m.STATE]) == (found.report, 1, h[m.Y])


@pytest.mark.parametrize("name", TREES)
def test_trees_move_as_in_python(name: str) -> None:
    assert_alike(evaluated(tabulated(Scene.model_validate(TREES[name]))))


@pytest.mark.parametrize("name", [name for name in BENT if "friction" not in name])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_flexible_bodies_move_as_in_python(name: str) -> None:
    assert_alike(evaluated(tabulated(Scene.model_validate(BENT[name]))))


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_scenes_move_as_in_python(name: str) -> None:
    """Loops with redundant rows, drives of joints and of paths in loops."""
    assert_alike(evaluated(tabulate(build(load_scene(TREE / f"scenes/{name}.toml"), {}))))


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_joints_of_several_coordinates_close_loops_as_in_python() -> None:
    assert_alike(evaluated(tabulate(build(Scene.model_validate(two_loops()), {}))))


GRAVITY = {"gravity": {"type": "gravity", "acceleration": [1.0, 2.0, -9.81]}}


def closed(number: int) -> Model:
    """One to three random units in one mechanism, of any size, turned anyhow."""
    random = np.random.default_rng([number, 7])
    names = random.choice(CLOSED, size=random.integers(1, 4)).tolist()
    made = movable.together(random, [UNITS[name](random) for name in names])
    # at the origin, far from which kernels lose digits
    setting = replace(movable.any_setting(random), p=(0.0, 0.0, 0.0))
    table = movable.scene(made, random, setting, load=GRAVITY)
    return tabulate(build(Scene.model_validate(table), {}))


def opened(number: int) -> Model:
    """A random tree of joints of all kinds, some of them driven."""
    random = np.random.default_rng([number, 8])
    kinds = tuple(random.choice([*MIXED, "revolute", "fixed", "free"], size=5).tolist())
    driven = tuple(k for k in range(9) if kinds[k % 5] in ("revolute", "prismatic") and random.random() < 0.4)
    return tabulate(build(Scene.model_validate(rods(9, kinds, int(random.integers(1, 4)), driven=driven)), {}))


@pytest.mark.parametrize("number", range(20))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_random_mechanisms_move_as_in_python(number: int) -> None:
    for model in (closed(number), opened(number)):
        assert_alike(evaluated(model))


def bent(number: int) -> Model:
    """Random rigid and flexible rods in a chain or a tree, often in a loop, some of them driven, or stiffened."""
    random = np.random.default_rng([number, 9])
    stiffening, count = bool(random.random() < 0.4), int(random.integers(2, 6))
    modes = (BOTH, ONE, NONE, FREE, FIXED, None, *(() if stiffening else (MANY,)))
    references = (FREE, *(modes[k] for k in random.integers(len(modes), size=count - 1)))
    turned = bool(random.random() < 0.7)  # against each other, so that joints must turn about z
    free = ("revolute", "spherical", "cylindrical", "planar") if turned else (*MIXED, "fixed", "free")
    kinds = tuple(random.choice(free, size=3).tolist())
    children = int(random.integers(1, 3))
    last = count if children == 1 else 2  # rods that turn against the one before them
    driven = tuple(k for k in range(last) if kinds[k % 3] == "revolute" and random.random() < 0.4)
    given = {"children": children, "closed": str(random.choice(["", "spherical", "revolute"]))}
    angles = tuple((turned * random.uniform(-1.2, 1.2, size=3)).tolist())
    scene = bending(references, kinds, angles, **given, driven=driven, stiffening=stiffening)
    return tabulated(Scene.model_validate(scene))


@pytest.mark.parametrize("number", range(20))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_random_flexible_mechanisms_move_as_in_python(number: int) -> None:
    assert_alike(evaluated(bent(number)))


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_rounding_does_not_grow_with_the_distance_from_the_origin() -> None:
    """A thousand sizes away, against the same equations in extended precision."""
    random, setting = np.random.default_rng(0), movable.Setting(p=(-281.0, 870.0, -602.0))
    table = movable.scene(UNITS["spherical five-bar"](random), random, setting, load=GRAVITY)
    exact = evaluated(tabulate(build(Scene.model_validate(table), {})), number=np.longdouble)
    assert np.finfo(np.longdouble).eps < 1e-18
    w, _ = by_routines(exact)
    speeds = exact.model.speeds
    assert apart(w[exact.h[m.SLOPES] :][speeds], exact.rates[speeds].astype(float)) < 1e-11  # measured 2e-13


@pytest.mark.parametrize("coaxial", [True, False])
def test_coordinates_that_move_no_mass_are_noticed(coaxial: bool) -> None:
    with np.errstate(invalid="ignore"):
        found = evaluated(tabulated(Scene.model_validate(massless(coaxial))))
    for evaluate in (by_routines, by_numbers):
        assert evaluate(found)[1][m.EVALUATION] == found.report == (m.NOT_POSITIVE if coaxial else m.OK)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_dependent_rows_are_a_singular_pose() -> None:
    """Of a planar four-bar all rows at once, in its plane."""
    found = evaluated(tabulate(build(load_scene(TREE / "scenes/checks/four_bars_2.toml"), {})))
    everything = np.ones(found.model.arrays.size(m.N_CLOSURE_ROWS), dtype=bool)
    assert by_routines(found)[1][m.EVALUATION] == m.OK
    selection.write(found.model, found.h, everything)
    for evaluate in (by_routines, by_numbers):
        assert evaluate(found)[1][m.EVALUATION] == m.SINGULAR


# Joints ---------------------------------------------------------------------------------------------------------------
def positions(kind: str, random: np.random.Generator, scale: float) -> np.ndarray:
    """Random positions of a joint; quaternions of another norm than 1."""
    return scale * random.normal(size=len(JOINTS[kind].POSITIONS))


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "fixed"])
@pytest.mark.parametrize("scale", [1.0, 0.5 * SERIES_ANGLE**0.5 / 3.0])
def test_motions_of_joints_are_rates_of_their_poses(kind: str, scale: float) -> None:
    """By central differences along the rate of the positions, whose error is the square of the step; on floats."""
    random, step = np.random.default_rng(3), 1e-5
    x, u = positions(kind, random, scale), random.normal(size=len(JOINTS[kind].SPEEDS))
    joint = JOINTS[kind]

    def twist(x: np.ndarray) -> np.ndarray:
        return np.concatenate(trees.total(joint.motion(x.tolist(), u.tolist()).S, u.tolist()))

    rate = np.array(joint.position_rate(x.tolist(), u.tolist()))
    ahead, behind = (joint.motion((x + side * step * rate).tolist(), u.tolist()) for side in (1.0, -1.0))
    here = joint.motion(x.tolist(), u.tolist())
    R, dR = np.reshape(here.R_FG, (3, 3)), np.subtract(ahead.R_FG, behind.R_FG).reshape(3, 3) / (2.0 * step)
    spin, v = dR @ R.T, np.subtract(ahead.p_FG, behind.p_FG) / (2.0 * step)
    assert twist(x) == pytest.approx([spin[2, 1], spin[0, 2], spin[1, 0], *v], abs=1e-8)
    growth = (twist(x + step * rate) - twist(x - step * rate)) / (2.0 * step)
    assert np.concatenate(here.bias) == pytest.approx(growth, abs=1e-8)


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "fixed"])
def test_positions_of_joints_are_those_that_poses_have(kind: str) -> None:
    """By what places the start pose; quaternions up to their norm."""
    x = positions(kind, np.random.default_rng(4), 0.7)
    size = np.ones(len(x))
    if kind in ("spherical", "free"):
        size[:4] = np.copysign(np.linalg.norm(x[:4]), x[0])
    found = joint_positions(kind, Placement(), moved_frame(kind, Placement(), x))
    assert found == pytest.approx(x / size, abs=1e-13)


def test_series_of_rotation_vectors_go_over_into_closed_forms() -> None:
    """The rates of the coefficients, which are differences over the squared angle of 0.01, lose four digits more."""
    found, exact = (of(SERIES_ANGLE) for of in (series, closed_forms))
    assert found[:3] == pytest.approx(exact[:3], abs=1e-13)
    assert found[3:] == pytest.approx(exact[3:], abs=1e-11)


@pytest.mark.parametrize("mass, sound", [(1e-13, 1.0), (1e-15, 0.0), (np.nan, 0.0)])
def test_a_coordinate_moves_mass_or_rounding(mass: float, sound: float) -> None:
    """As share of the mass that it carries; on floats."""
    still = trees.ground([0.0, 0.0, 0.0])
    body = trees.Body(mass, ZERO, Symmetric([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    step = trees.Step([trees.Twist(ZERO, Vector([0.0, 0.0, 1.0]))], ZERO)
    assert trees.eliminate(0, still, body, trees.Bounds(1.0, 1.0), step, [], 1.0)[-1] == sound


@pytest.mark.parametrize("mass, sound", [(2e-14, 1.0), (5e-15, 0.0), (np.nan, 0.0)])
def test_a_shape_moves_mass_or_rounding(mass: float, sound: float) -> None:
    """As share of its own, once another shape of the same motion is eliminated; on floats."""
    none = [Wrench(ZERO, ZERO)] * 2
    body = flexible.Need(
        Inertia(*inertia_parts(np.random.default_rng(6))), none[0], none, [[1.0], [1.0, 1.0 + mass]], [0.0] * 2
    )
    with np.errstate(invalid="ignore"):
        given = trees.Resistance(body.I, body.F), body.P, body.m, body.forces, shapes.none_taken(2)
        assert shapes.eliminate(1, *given, [], np.float64(1.0))[-1] == sound


@pytest.mark.parametrize(
    "pivot, diagonal, scale, share", [(3.0, 3.0, 12.0, 0.25), (3.0, 6.0, 1.0, 0.5), (np.nan, 1.0, 1.0, 0.0)]
)
def test_pivots_of_closures_count_as_share_of_their_row(
    pivot: float, diagonal: float, scale: float, share: float
) -> None:
    """Of the largest diagonal entry that it has had; on floats. The least share stays."""
    for before in (1.0, 0.1):
        assert closures.cholesky([[pivot]], [diagonal], [scale], before)[-1] == min(before, share)


def test_reports_of_an_evaluation() -> None:
    """Of massless coordinates first, then of pivots of the loops below 1e-13."""
    found = [
        status(REPORTS, *given)[0] for given in ((1.0, 1.0, 0.0), (1.0, 2e-13, 0.0), (1.0, 5e-14, 0.0), (0.0, 0.0, 0.0))
    ]
    assert found == [m.OK, m.OK, m.SINGULAR, m.NOT_POSITIVE]


def test_spatial_quantities_refer_to_a_point() -> None:
    """Power and wrench of an inertia do not depend on the point, which `about` and `at` move."""
    random = np.random.default_rng(5)
    a, b, c, arm = (Vector(random.normal(size=3).tolist()) for _ in range(4))
    R, I = Matrix(random.normal(size=9).tolist()), Inertia(*inertia_parts(random))
    there = trees.Twist(a, b)
    here = there.at(-arm)
    assert np.concatenate(I.about(arm).of(here)) == pytest.approx(np.concatenate(I.of(there).about(arm)))
    assert Wrench(b, c).about(arm).on(here) == pytest.approx(Wrench(b, c).on(there))
    assert tuple(R @ R.T @ a) == pytest.approx(tuple(R @ (R.T @ a)))
    assert tuple(cross(a, b)) == pytest.approx(np.cross(a, b).tolist())


def inertia_parts(random: np.random.Generator) -> tuple[Symmetric, Matrix, Symmetric]:
    A, C = (Symmetric(random.normal(size=6).tolist()) for _ in range(2))
    return A, Matrix(random.normal(size=9).tolist()), C


# Steps ----------------------------------------------------------------------------------------------------------------
#: ways of steps, and what makes the engine take them
WAYS: dict[str, dict[str, Any]] = {
    "list of a short run": {},
    "list where straight code would be too long": {"LONG": 0, "address_for_rows": lambda *given, **more: 0},
    "list of a fifth selection": {"LONG": 0, "SELECTIONS": 0},
    "straight code": {"LONG": 0},
}


@pytest.mark.parametrize("number", range(8))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_shapes_in_blocks_move_as_in_python(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held shapes, frames on bodies, bodies on these, loops, stiffening; most have blocks of unequal sizes."""
    monkeypatch.setattr(modes, "FEW", 1)
    monkeypatch.setattr(modes, "SIZE", 2)
    assert_alike(evaluated(bent(number)))


@pytest.mark.parametrize("case", ["1-clamped-free", "3a"])
def test_codes_do_not_multiply_with_modes(case: str) -> None:
    """Bodies of 79 and 280 modes: codes repeat, and are short."""
    body = turning.CASES[case]()
    scene = Scene.model_validate(turning.turning(body, 100.0))
    found = evaluated(tabulate(build(scene, {"rod": turning.reduced(body)})))
    assert_same(found, *by_numbers(found))
    codes = list_of(found.model.parts, topology_of(found.model.arrays, found.h)).codes
    assert len(codes) < 200  # measured 60 to 140
    assert sum(len(code.program.block) for code in codes) < 50_000  # 25 000; each product once would be a million


def by_ways(scene: Scene) -> dict[str, Trajectory]:
    """Runs of a scene whose steps evaluate in each way."""
    engines, runs = {way: engine_of(scene, {}, silent) for way in WAYS}, {}
    for way, one in engines.items():
        with pytest.MonkeyPatch.context() as patch:
            for name, value in WAYS[way].items():
                patch.setattr(engine, name, value)
            runs[way] = integrate(one, consistent_start(one), silent)
        assert bool(one.h[m.CALLS]) == (way != "straight code")
        assert one.h[m.RATES] != one.h[m.EVALUATE]
    return runs


def test_steps_of_long_mechanisms_run_on_routines() -> None:
    runs = by_ways(four_bars(3, 0.3))
    assert all(apart(run.state, runs["straight code"].state) < 1e-9 for run in runs.values())


def test_a_list_belongs_to_the_rows_that_are_selected(monkeypatch: pytest.MonkeyPatch) -> None:
    """With rows that depend on others the same pose is singular."""
    one = engine_of(load_scene(TREE / "scenes/checks/four_bars_2.toml"), {}, silent)
    y, lists, reports = consistent_start(one), [], []
    kept = one.selected.copy()
    for rows in (kept, np.ones_like(kept), kept):
        one.keep(rows)
        one.settle(silent)
        lists.append(int(one.h[m.CALLS]))
        before, one.h[m.EVALUATE] = int(one.h[m.EVALUATE]), one.h[m.RATES]
        one.attempt(y, one.start)
        reports.append(int(one.n[m.EVALUATION]))
        one.h[m.EVALUATE] = before
    assert not kept.all()
    assert lists[0] == lists[2] != lists[1]
    assert reports == [m.OK, m.SINGULAR, m.OK]
