"""Articulated inertias give what the mass matrix gives, in linear time and without its loss of digits."""

from functools import cache
from typing import Any, cast

import numpy as np
import pytest

from flexclear import dynamics
from flexclear.dynamics import memory as m
from flexclear.dynamics.bodies.flexible import flexible_bodies
from flexclear.dynamics.compile import sources
from flexclear.dynamics.effects import Scheme
from flexclear.dynamics.equations import articulated, composite
from flexclear.dynamics.equations.closures import make_closing
from flexclear.dynamics.equations.projection import make_stiffen
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.mechanics.of_topology import list_of, program_of
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.evaluation.tree_factor import bias, carried_wrenches, mass_factor
from flexclear.dynamics.run.run import engine_of
from flexclear.dynamics.run.trajectory import integrate
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.dynamics.specialise.trace import Trace
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE
from tests.properties import tapes
from tests.properties.articulated_chains import Evaluated, bending, evaluated, reduced, rods, tabulated
from tests.properties.mechanisms import Table
from tests.properties.test_closure_rows import dense_factor

#: of the largest; the mass matrix of the chains here has a condition of 1e5 at most, of which 2e-12 was left
ROUNDING = 1e-9
#: of joints, with one to three coordinates
MIXED = ("spherical", "revolute", "prismatic", "universal", "cylindrical", "planar")
TREES: dict[str, Table] = {
    "plane chain": rods(5, plane=True),
    "chain": rods(10),
    "branches": rods(13, children=3),
    "joints of all kinds": rods(12, MIXED),
    "free": rods(6, ("free", "revolute", "fixed")),
    "driven joints": rods(9, ("revolute", "prismatic"), driven=(0, 3, 4)),
    "driven hinges among balls": rods(7, ("spherical", "revolute"), driven=(1, 3)),
}
#: modes of flexible rods that move both ends, one of them, and none
BOTH, ONE, NONE = (
    {"reference": "craig-bampton", "count": 6},
    {"reference": "cantilever", "count": 4, "interfaces": ["crank"]},
    {"reference": "pinned-pinned", "count": 4},
)
FREE, FIXED, MANY = (
    {"reference": "free-free", "count": 2},
    {"reference": "fixed-fixed", "count": 2},
    {"reference": "craig-bampton", "count": 15},
)
UP_AND_DOWN = (0.9, -0.6, 0.2)
RUBBING = {
    **{"law": "modified-coulomb", "static": 0.2, "dynamic": 0.15},
    **{"v_static": 5e-3, "v_dynamic": 0.015, "radius": 0.01},
}
#: flexible rods of all kinds of modes, with rigid ones between
BENT: dict[str, Table] = {
    "chain of three kinds": bending((BOTH, ONE, NONE), angles=UP_AND_DOWN),
    "free and fixed modes": bending((FREE, FIXED, FREE), ("spherical", "revolute"), UP_AND_DOWN),
    "held shapes": bending((MANY, MANY), ("spherical",), UP_AND_DOWN),
    "rigid rods between": bending((None, ONE, None, None, FREE, None), ("revolute", "spherical"), UP_AND_DOWN),
    "branches": bending((FREE, None, ONE, BOTH, FREE, None, NONE), ("spherical",), UP_AND_DOWN, children=2),
    "fork": bending((FREE, ONE, BOTH), ("spherical",), UP_AND_DOWN, children=2),
    "floating": bending((FREE, ONE), ("free", "fixed")),
    "driven": bending((FREE, ONE, None, NONE), ("revolute",), UP_AND_DOWN, driven=(0, 2)),
    "stiffened": bending((ONE, FREE, ONE), ("revolute",), UP_AND_DOWN, stiffening=True),
    "loop": bending((FREE, None, ONE, BOTH), ("spherical", "revolute"), UP_AND_DOWN, closed="spherical"),
    "held shapes in a loop": bending((MANY, None, MANY), ("revolute",), UP_AND_DOWN, closed="spherical"),
    "driven loop": bending((FREE, None, ONE), ("revolute",), UP_AND_DOWN, closed="spherical", driven=(0,)),
    "redundant rows": bending((None, NONE, None), ("revolute",), UP_AND_DOWN, closed="revolute"),
    "friction": bending((FREE, None, ONE), ("revolute",), UP_AND_DOWN, friction=RUBBING, driven=(0,)),
    "friction in a loop": bending((FREE, None, ONE), ("revolute",), UP_AND_DOWN, closed="spherical", friction=RUBBING),
}
#: loops, couplings, redundant rows, contacts that are closed, stops, friction in joints
SCENES = (
    *("checks/andrews_squeezer", "checks/bennett", "checks/bricard", "checks/gears", "checks/four_bars_2"),
    *("checks/universal_shaft", "checks/governor", "checks/clearance_slider_crank", "checks/sarrus", "sps4/ideal"),
    *("sps4/csj", "checks/rubbing_slider_crank"),
)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference, as fraction of the largest entry."""
    return float(np.abs(one - other).max(initial=0.0) / (np.abs(other).max(initial=0.0) or 1.0))


def both(scene: Scene) -> tuple[Evaluated, Evaluated]:
    one, other = (evaluated(tabulated(scene, way)) for way in (True, False))
    assert one.report == other.report == m.OK
    assert one.model.parts.articulated
    return one, other


@cache
def bent(name: str) -> tuple[Evaluated, Evaluated]:
    """Both of flexible rods; nobody writes into them."""
    return both(Scene.model_validate(BENT[name]))


def assert_alike(one: Evaluated, other: Evaluated) -> None:
    """Rates of positions, accelerations, powers and drives."""
    speeds = one.model.speeds
    for part in (slice(speeds.start), speeds, slice(speeds.stop, None)):
        assert apart(one.rates[part], other.rates[part]) < ROUNDING
    assert apart(one.drives, other.drives) < ROUNDING


@pytest.mark.parametrize("name", TREES)
def test_trees_move_as_with_the_mass_matrix(name: str) -> None:
    assert_alike(*both(Scene.model_validate(TREES[name])))


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_scenes_move_as_with_the_mass_matrix(name: str) -> None:
    """And half-solved closure rows."""
    one, other = both(load_scene(TREE / f"scenes/{name}.toml"))
    assert_alike(one, other)
    spread = [way.space.w[way.space.h[m.SPREAD] :][: way.space.h[m.JACOBIAN_SIZE]] for way in (one, other)]
    assert apart(*spread) < ROUNDING


@pytest.mark.parametrize("name", BENT)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_flexible_bodies_move_as_with_the_mass_matrix(name: str) -> None:
    """And half-solved closure rows; mass matrix and bias in full."""
    one, other = bent(name)
    assert_alike(one, other)
    assert one.model.arrays.size(m.N_CLOSURES) == int("closing" in BENT[name]["joint"])
    assert apart(one.stretch(m.SPREAD), other.stretch(m.SPREAD)) < ROUNDING
    L = mass_factor(cast("Engine", one))
    known = dense_factor(other.model.arrays.table(m.ENVELOPE), other.stretch(m.MASS))
    assert np.array_equal(L, np.tril(L))
    assert apart(L, known) < ROUNDING
    assert apart(bias(cast("Engine", one)), other.stretch(m.BIAS)[: one.model.nv]) < 1e-12  # a hundred sums
    for mine, theirs in zip(*(carried_wrenches(cast("Engine", way)) for way in (one, other)), strict=True):
        assert apart(mine, theirs) < 1e-12


def probed(found: Evaluated) -> list[np.ndarray]:
    """What else reads the factors: L^-1 and L^-T of some forces, power of the drives, and the correction that closes
    loops with the modes' stiffness next to their mass."""
    tree, model = (articulated if found.model.parts.articulated else composite), found.model
    forward, backward, drive_power, closing = tree.forward, tree.backward, tree.drive_power, make_closing(tree)
    stiffen, correction = make_stiffen(closing, tree, flexible_bodies()), closing.correction

    @kernel
    def half(h, f, w, n):
        d = data(h, f, w, n)
        forward(d, d.at_correction)

    @kernel
    def other_half(h, f, w, n):
        d = data(h, f, w, n)
        backward(d, d.at_correction)

    @kernel
    def power(h, f, w, n):
        d = data(h, f, w, n)
        d.last_pivot = drive_power(d, d.at_correction, d.at_u)

    @kernel
    def close(h, f, w, n):
        d = data(h, f, w, n)
        stiffen(d)
        correction(d, d.at_residual, d.at_correction)

    w, made, at = found.w.copy(), list[np.ndarray](), int(found.h[m.CORRECTION])
    pivot, step = slice(int(found.h[m.PIVOT]), int(found.h[m.PIVOT]) + 1), slice(at, at + model.nv)
    w[step] = np.random.default_rng(3).normal(size=model.nv)
    for made_of, place in ((half, step), (other_half, step), (power, pivot), (close, step)):
        Trace(0).plain(made_of)(found.h.tolist(), model.arrays.f, w, found.space.n)
        made.append(w[place].copy())
    return made


@pytest.mark.parametrize("name", ["branches", "driven", "held shapes", "loop", "held shapes in a loop", "driven loop"])
def test_projection_and_exponential_steps_read_the_same(name: str) -> None:
    for one, other in zip(*map(probed, bent(name)), strict=True):
        assert apart(one, other) < ROUNDING
    assert bool(np.any(other)) == ("loop" in name)  # in the end: what closes loops


def mass_by_energy(found: Evaluated) -> np.ndarray:
    """Mass matrix of the state's speeds by the kinetic energies of motions, which no factor has a part in."""
    model, h, w, f = found.model, found.h, found.w.astype(np.longdouble), found.model.arrays.f.astype(np.longdouble)
    topology, y = topology_of(model.arrays, h), int(h[m.Y])
    w[h[m.LAW.at] :][: m.LAW.size * model.arrays.size(m.N_LAWS)] *= np.tile([1, 0, 0], model.arrays.size(m.N_LAWS))

    def energy(speeds: np.ndarray) -> Any:
        w[y : y + model.ny][model.speeds] = speeds
        list_of(model.parts, topology, m.RECORD_CALLS, Numbers(h, f, w, found.space.n, y, int(h[m.SLOPES])))
        return sum(w[int(h[m.ENERGY.at]) :: m.ENERGY.size][: model.arrays.size(m.N_COMPONENTS)])

    units = np.eye(model.nv)
    alone = [energy(unit) for unit in units]
    M = np.diag([2.0 * one for one in alone])
    for i in range(model.nv):
        for j in range(i):
            M[i, j] = M[j, i] = energy(units[i] + units[j]) - alone[i] - alone[j]
    return M.astype(float)


@pytest.mark.parametrize("name", ["chain of three kinds", "fork", "driven", "stiffened", "loop"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_flexible_bodies_have_the_mass_that_their_energy_says(name: str) -> None:
    """And accelerations of a dense solve by it, with the closures' rows."""
    one, other = bent(name)
    M, modes, speeds = mass_by_energy(one), modes_of(one.model.arrays), one.model.speeds
    L = modes @ mass_factor(cast("Engine", one))
    assert apart(L @ L.T, M) < 1e-12  # differences of energies in extended precision
    J = selection.dense_rows(one.model, one.h, one.stretch(m.JACOBIAN)) @ modes.T
    gamma = one.stretch(m.GAMMA)[selection.selected_indices(one.model, one.h)]
    full = np.block([[M, J.T], [J, np.zeros((len(J),) * 2)]])
    forces = np.concatenate([-modes @ other.stretch(m.BIAS)[: one.model.nv], gamma])
    expected = np.linalg.solve(full, forces)[: one.model.nv]
    assert apart(one.rates[speeds], expected) < ROUNDING


@pytest.mark.parametrize("name", ["branches", "held shapes in a loop", "driven loop", "stiffened"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_straight_code_of_flexible_bodies_computes_what_kernels_do(name: str) -> None:
    found, _ = bent(name)
    model, h, w, n = found.model, found.h, found.w.copy(), found.space.n.copy()
    y, dy = int(h[m.Y]), int(h[m.SLOPES])
    w[dy : dy + model.ny] = 0.0
    tape = program_of(model.parts, topology_of(model.arrays, h), 200_000)
    tapes.run(tape, h, {"f": model.arrays.f, "w": w, "n": n}, y, dy)
    assert apart(w[dy : dy + model.ny], found.rates) < ROUNDING


def test_rounding_does_not_grow_with_the_number_of_flexible_rods() -> None:
    """40 rods, against the same kernels in extended precision."""
    model = tabulated(Scene.model_validate(bending((FREE,) * 40, angles=UP_AND_DOWN)), True)
    found, exact = (evaluated(model, number=number) for number in (float, np.longdouble))
    assert apart(found.rates[model.speeds], exact.rates[model.speeds].astype(float)) < 1e-12  # measured 9e-15


def test_energy_of_a_swinging_chain_of_flexible_rods_stays() -> None:
    """Eight rods let go at once, 0.05 s: by the depth of the tree, without being asked."""
    scene = Scene.model_validate(bending((FREE,) * 8, angles=UP_AND_DOWN, solver={"rtol": 1e-10}))
    assert tabulate(build(scene, reduced(scene))).parts.articulated
    made = dynamics.simulate(scene, reduced(scene), silent)
    moved = float(np.ptp(made.potential.values))
    assert float(np.abs(made.energy_error).max()) < 1e-7 * moved


def plane_accelerations(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Second rates of a plane chain's joint angles, from the mass matrix in absolute angles, in extended precision.

    Links of 1 m and 1 kg on a fixed hinge; angles about y, from the x axis towards -z.  In absolute angles the matrix
    has a condition of 1e4.
    """
    turned, spin = (np.cumsum(one.astype(np.longdouble)) for one in (angles, rates))
    number = np.arange(len(angles))
    beyond = len(angles) - number - np.longdouble(0.5)  # mass times lever of what follows, in m kg
    weight = np.minimum.outer(beyond, beyond)
    difference = np.subtract.outer(turned, turned)
    M = weight * np.cos(difference)
    M[number, number] = np.longdouble(1.0) / 12 + beyond - np.longdouble(0.25)
    force = np.longdouble(9.81) * beyond * np.cos(turned) - (weight * np.sin(difference)) @ spin**2
    for k in number:  # Gauss, of a positive definite matrix
        factor = M[k + 1 :, k] / M[k, k]
        M[k + 1 :] -= np.outer(factor, M[k])
        force[k + 1 :] -= factor * force[k]
    for k in number[::-1]:
        force[k] = (force[k] - M[k, k + 1 :] @ force[k + 1 :]) / M[k, k]
    return np.diff(force, prepend=np.longdouble(0.0)).astype(float)


def test_a_plane_chain_has_its_closed_form() -> None:
    """40 links, whose mass matrix has a condition of 1e7: it alone would leave 1e-10."""
    model = tabulated(Scene.model_validate(rods(40, plane=True)), True)
    found = evaluated(model, speeds=0.5, turns=0.3)
    y, order = found.space.h[m.Y], [c.start for c in model.numbering.coordinates[1:]]
    angles, rates = found.space.w[y : y + model.nq], found.space.w[y + model.nq : y + model.nq + model.nv]
    expected = plane_accelerations(angles, rates[order])
    assert apart(found.rates[model.speeds][order], expected) < 1e-12  # measured 4e-14


@pytest.mark.parametrize("plane", [True, False])
def test_rounding_does_not_grow_with_the_length(plane: bool) -> None:
    """300 links, against the same kernels in extended precision."""
    model = tabulated(Scene.model_validate(rods(300, plane=plane)), True)
    found, exact = (evaluated(model, 0.5, 0.3, number) for number in (float, np.longdouble))
    assert np.finfo(np.longdouble).eps < 1e-18
    assert apart(found.rates[model.speeds], exact.rates[model.speeds].astype(float)) < 1e-12  # measured 3e-14


def massless(coaxial: bool) -> Table:
    """A deep chain with a link without mass, between hinges about one axis or about two."""
    table = rods(12)
    table["body"]["rod5"] |= {"mass": 1e-40, "inertia": [1e-40] * 3}
    if coaxial:
        table["body"]["rod5"]["frames"]["end6"] = dict(table["body"]["rod5"]["frames"]["foot"])
        for k in range(6, 12):
            position = np.array(table["body"][f"rod{k}"]["pose"]["position"]) - [1.0, 0.0, 0.0]
            table["body"][f"rod{k}"]["pose"]["position"] = position.tolist()
        table["body"]["rod6"]["frames"]["foot"]["axes"] = table["body"]["rod5"]["frames"]["foot"]["axes"]
    return table


@pytest.mark.parametrize("name", TREES)
def test_the_bound_of_what_is_borne_holds_in_any_pose(name: str) -> None:
    """Pivots are compared with it: mass, and a polar moment that no pose exceeds."""
    model = tabulated(Scene.model_validate(TREES[name]), True)
    numbers, parents = model.arrays.table(m.LINK_NUMBERS), [link.branch.parent for link in model.links]
    for turns in (0.0, 0.3, 1.0):
        mass, polar = borne(evaluated(model, turns=turns), parents)
        assert numbers["borne"][1:] == pytest.approx(mass, rel=1e-12)  # a dozen sums
        assert np.all(numbers["reaching"][1:] >= polar * (1.0 - 1e-12))


def test_the_bound_of_what_is_borne_is_no_larger_than_a_straight_chain_needs() -> None:
    """A larger one would call light links massless."""
    model = tabulated(Scene.model_validate(rods(10)), True)
    _, polar = borne(evaluated(model), [link.branch.parent for link in model.links])
    assert model.arrays.table(m.LINK_NUMBERS)["reaching"][1:] == pytest.approx(polar, rel=1e-12)


def borne(found: Evaluated, parents: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Mass of each moving link and all beyond, and polar moment about its origin in an evaluated pose."""
    space, numbers = found.space, found.model.arrays.table(m.LINK_NUMBERS)
    frames = m.named(m.LINK_FRAMES, space.w[space.h[m.LINK_FRAMES.at] :][: len(parents) * m.LINK_FRAMES.size])
    centres = frames["origin"] + np.einsum("ijk,ik->ij", frames["axes"], numbers["com"])
    spins = 0.5 * numbers["inertia"][:, :3].sum(axis=1)
    mass, polar = np.zeros(len(parents)), np.zeros(len(parents))
    for j in range(1, len(parents)):
        i = j
        while i:  # of all links between it and the ground
            mass[i] += numbers["mass"][j]
            polar[i] += numbers["mass"][j] * np.sum((centres[j] - frames["origin"][i]) ** 2) + spins[j]
            i = parents[i]
    return mass[1:], polar[1:]


@pytest.mark.parametrize("articulated", [True, False])
def test_coordinates_that_move_no_mass_are_noticed(articulated: bool) -> None:
    """Of both coaxial hinges one turns nothing; a light link that others follow is no such thing."""
    reports = []
    for coaxial in (True, False):
        model = tabulated(Scene.model_validate(massless(coaxial)), articulated)
        with np.errstate(invalid="ignore"):  # a pivot that is rounding has either sign, and its root may be no number
            reports.append(evaluated(model).report)
    assert reports == [m.NOT_POSITIVE, m.OK]


def engine(count: int) -> Engine:
    made = engine_of(Scene.model_validate(rods(count, plane=True)), {}, silent)
    assert made.model.parts.articulated
    return made


def test_a_long_chain_takes_as_many_steps_as_a_short_one() -> None:
    """0.2 s from the horizontal; and energies balance as the tolerance of 1e-10 lets them."""
    counts = []
    for count in (40, 150):
        one = engine(count)
        run = integrate(one, consistent_start(one), silent)
        assert run.time[-1] == pytest.approx(0.2)
        counts.append(int(one.n[m.EVALUATIONS]))
    assert counts[1] < 1.2 * counts[0]


def test_factor_and_bias_in_full_are_those_of_the_mass_matrix() -> None:
    """What equilibria, vibrations and the choice of closure rows read."""
    scene = Scene.model_validate(rods(20, plane=True))
    known = evaluated(tabulated(scene, False), 0.0)
    one, h, w = engine(20), known.space.h, known.space.w
    y = w[h[m.Y] :][: one.model.ny]
    closure_rows.evaluate(one, y, 0.0)
    L = dense_factor(known.model.arrays.table(m.ENVELOPE), w[h[m.MASS] :])
    found = mass_factor(one)
    assert apart(found @ found.T, L @ L.T) < 1e-13  # some hundred products of numbers of that size
    assert apart(bias(one), w[h[m.BIAS] :][: one.model.nv]) < 1e-13


def test_the_depth_of_the_tree_decides() -> None:
    """Only the way that a mechanism takes is composed."""
    for count, deep in ((10, False), (20, True)):
        parts = tabulate(build(Scene.model_validate(rods(count)), {})).parts
        assert parts.articulated == deep
        for source in (sources.sources(parts, Scheme("dop853")) | sources.kernels(parts)).values():
            assert ("articulated" in source) <= deep
            assert ("composite" in source) <= (not deep)


def test_shapes_on_the_way_to_the_ground_count_as_depth() -> None:
    """Modes of one body do not count for each other: a single one is shallow, however many it has."""
    for references, deep in (((MANY,), False), ((FREE,) * 3, False), ((FREE,) * 8, True), ((None,) * 8, False)):
        scene = Scene.model_validate(bending(references))
        assert tabulate(build(scene, reduced(scene))).parts.articulated == deep
