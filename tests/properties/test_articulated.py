"""Articulated inertias give what the mass matrix of kinetic energies gives, in linear time and with more digits."""

from collections.abc import Callable
from functools import cache
from typing import Any, cast

import numpy as np
import pytest

from flexclear import dynamics
from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics.evaluation import place_links
from flexclear.dynamics.mechanics.of_topology import mechanism_of, program_of
from flexclear.dynamics.mechanics.record import store_energies
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.matrices import Matrices, holding_forces
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of
from flexclear.dynamics.run.trajectory import integrate
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.dynamics.vectors import Vector, Wrench
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.properties import tapes
from tests.properties.articulated_chains import (
    Evaluated,
    bending,
    evaluated,
    known_accelerations,
    reduced,
    rods,
    tabulated,
)
from tests.properties.mechanisms import Table

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


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference, as fraction of the largest entry."""
    return float(np.abs(one - other).max(initial=0.0) / (np.abs(other).max(initial=0.0) or 1.0))


def full(found: Evaluated) -> np.ndarray:
    """Factor of the mass matrix in full."""
    return Matrices(cast("Engine", found)).factor


@cache
def bent(name: str) -> Evaluated:
    """Flexible rods, evaluated; nobody writes into them."""
    found = evaluated(tabulated(Scene.model_validate(BENT[name])))
    assert found.report == m.OK
    return found


def kinetic_energy(found: Evaluated) -> Callable[[np.ndarray], Any]:
    """Kinetic energy of the speeds of all coordinates in the evaluated pose, in extended precision."""
    model, h, w, f = found.model, found.h, found.w.astype(np.longdouble), found.model.arrays.f.astype(np.longdouble)
    y, drives, tables = int(h[m.Y]), model.arrays.size(m.N_DRIVES), Tables(model.parts, topology_of(model.arrays, h))
    rates = int(h[m.LAW.at]) + m.LAW.rate + m.LAW.size * np.arange(drives)

    def energy(speeds: np.ndarray) -> Any:
        w[y : y + model.ny][model.speeds], w[rates] = speeds[: model.nv], speeds[model.nv :]
        mechanism = mechanism_of(tables)
        with Numbers(h, f, w, found.space.n, y, int(h[m.SLOPES])).building() as calls:
            place_links(mechanism)
            for link in mechanism.links:
                if link.modes:
                    link.modes.need(link.motion, masses=False)  # sums over modes
            store_energies(tables, mechanism, calls)
        return sum(w[int(h[m.ENERGY.at]) :: m.ENERGY.size][: model.arrays.size(m.N_COMPONENTS)])

    return energy


def mass_by_energy(found: Evaluated) -> np.ndarray:
    """Mass matrix of all speeds by the kinetic energies of motions, which no factor has a part in."""
    energy, units = kinetic_energy(found), np.eye(len(found.stretch(m.U)))
    alone = [energy(unit) for unit in units]
    M = np.diag([2.0 * one for one in alone])
    for i in range(len(units)):
        for j in range(i):
            M[i, j] = M[j, i] = energy(units[i] + units[j]) - alone[i] - alone[j]
    return M.astype(float)


def drives_bias(found: Evaluated) -> np.ndarray:
    """Forces of the drives without free accelerations: wrenches along their motions."""
    engine, numbering, made = cast("Engine", found), found.model.numbering, np.zeros(len(found.drives))
    wrenches, links = holding_forces(engine)[1], Matrices(engine).mechanism.links
    for i, coordinates in enumerate(numbering.coordinates):
        for e, k in enumerate(coordinates):
            if k >= numbering.nv:
                link, wrench = links[i - 1], Wrench(*map(Vector, np.split(wrenches[i], 2)))
                made[k - numbering.nv] = wrench.about(-link.motion.p_WB).on(link.step.S[e])
    return made


#: of what is evaluated by kinetic energies: trees of rigid rods, and flexible ones without friction
TREES_AND_BENT = (
    "plane chain",
    "free",
    "driven hinges among balls",
    *(name for name in BENT if "friction" not in name),
)


@pytest.mark.parametrize("name", TREES_AND_BENT)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_bodies_have_the_mass_that_their_energy_says(name: str) -> None:
    """And accelerations and drives' forces of a dense solve by it, with the closures' rows."""
    found = bent(name) if name in BENT else evaluated(tabulated(Scene.model_validate(TREES[name])))
    assert found.report == m.OK
    model, M, L = found.model, mass_by_energy(found), full(found)
    modes, nv = modes_of(model.arrays), model.nv
    assert np.array_equal(L, np.tril(L))
    L = modes @ L
    assert apart(L @ L.T, M[:nv, :nv]) < 1e-12  # differences of energies in extended precision
    by_routines, loops = (one := Matrices(cast("Engine", found))), one.loops
    J, spread = by_routines.jacobian[:, :nv], by_routines.dense({k: by.V for k, by in loops.found.items()})[:, :nv]
    assert apart(L @ spread.T, modes @ J.T) < ROUNDING
    J = J @ modes.T
    full_matrix = np.block([[M[:nv, :nv], J.T], [J, np.zeros((len(J),) * 2)]])
    forces = np.concatenate([-modes @ holding_forces(cast("Engine", found))[0], known_accelerations(found)])
    solved = np.linalg.solve(full_matrix, forces)[:nv]
    assert apart(found.rates[model.speeds], solved) < ROUNDING
    if not len(J):
        assert apart(found.drives, M[nv:, :nv] @ solved + drives_bias(found)) < ROUNDING


@pytest.mark.parametrize("name", ["branches", "held shapes in a loop", "driven loop", "stiffened"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_straight_code_of_flexible_bodies_computes_what_calls_do(name: str) -> None:
    found = bent(name)
    model, h, w, n = found.model, found.h, found.w.copy(), found.space.n.copy()
    y, dy = int(h[m.Y]), int(h[m.SLOPES])
    w[dy : dy + model.ny] = 0.0
    tape = program_of(model.parts, topology_of(model.arrays, h), 200_000)
    tapes.run(tape, h, {"f": model.arrays.f, "w": w, "n": n}, y, dy)
    assert apart(w[dy : dy + model.ny], found.rates) < ROUNDING


def test_rounding_does_not_grow_with_the_number_of_flexible_rods() -> None:
    """40 rods, against the same calls in extended precision."""
    model = tabulated(Scene.model_validate(bending((FREE,) * 40, angles=UP_AND_DOWN)))
    found, exact = (evaluated(model, number=number) for number in (float, np.longdouble))
    assert apart(found.rates[model.speeds], exact.rates[model.speeds].astype(float)) < 1e-12  # measured 9e-15


def test_energy_of_a_swinging_chain_of_flexible_rods_stays() -> None:
    """Eight rods let go at once, 0.05 s."""
    scene = Scene.model_validate(bending((FREE,) * 8, angles=UP_AND_DOWN, solver={"rtol": 1e-10}))
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
    model = tabulated(Scene.model_validate(rods(40, plane=True)))
    found = evaluated(model, speeds=0.5, turns=0.3)
    y, order = found.space.h[m.Y], [c.start for c in model.numbering.coordinates[1:]]
    angles, rates = found.space.w[y : y + model.nq], found.space.w[y + model.nq : y + model.nq + model.nv]
    expected = plane_accelerations(angles, rates[order])
    assert apart(found.rates[model.speeds][order], expected) < 1e-12  # measured 4e-14


@pytest.mark.parametrize("plane", [True, False])
def test_rounding_does_not_grow_with_the_length(plane: bool) -> None:
    """300 links, against the same calls in extended precision."""
    model = tabulated(Scene.model_validate(rods(300, plane=plane)))
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
    model = tabulated(Scene.model_validate(TREES[name]))
    numbers, parents = model.arrays.table(m.LINK_NUMBERS), [link.branch.parent for link in model.links]
    for turns in (0.0, 0.3, 1.0):
        mass, polar = borne(evaluated(model, turns=turns), parents)
        assert numbers["borne"][1:] == pytest.approx(mass, rel=1e-12)  # a dozen sums
        assert np.all(numbers["reaching"][1:] >= polar * (1.0 - 1e-12))


def test_the_bound_of_what_is_borne_is_no_larger_than_a_straight_chain_needs() -> None:
    """A larger one would call light links massless."""
    model = tabulated(Scene.model_validate(rods(10)))
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


def test_coordinates_that_move_no_mass_are_noticed() -> None:
    """Of both coaxial hinges one turns nothing; a light link that others follow is no such thing."""
    reports = []
    for coaxial in (True, False):
        model = tabulated(Scene.model_validate(massless(coaxial)))
        with np.errstate(invalid="ignore"):  # a pivot that is rounding has either sign, and its root may be no number
            reports.append(evaluated(model).report)
    assert reports == [m.NOT_POSITIVE, m.OK]


def test_a_long_chain_takes_as_many_steps_as_a_short_one() -> None:
    """0.2 s from the horizontal; and energies balance as the tolerance of 1e-10 lets them."""
    counts = []
    for count in (40, 150):
        one = engine_of(Scene.model_validate(rods(count, plane=True)), {}, silent)
        run = integrate(one, consistent_start(one), silent)
        assert run.time[-1] == pytest.approx(0.2)
        counts.append(int(one.n[m.EVALUATIONS]))
    assert counts[1] < 1.2 * counts[0]
