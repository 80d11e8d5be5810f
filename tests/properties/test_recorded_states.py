"""What the record has of a state obeys mechanics: without a compiler, of mechanisms in any motion.

References are derivatives along the motion, by differences of positions, velocities, momenta and energies, and balances
of forces, moments and powers. Loops need not be closed: their rows do work where they open.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import pytest

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.mobility import analyse
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.run.evaluation.engine import engine_in_python
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE
from tests.properties.articulated_chains import Evaluated, evaluated, tabulated
from tests.properties.mechanisms import two_loops
from tests.properties.test_acting_routines import pressed, pressed_rods, rubbing_tree, with_friction
from tests.properties.test_articulated import BENT, TREES
from tests.properties.test_routines import closed, opened

#: steps of differences [s], whose error is of their fourth power; the second one is for contacts, which are as deep as
#: bodies move in microseconds, and for energies of modes, whose speeds change by 1e9 per second
STEP, SHORT = 1e-5, 2e-8
#: of the largest of what is balanced, or changes: roundings, 1e-16, over 1e-5 and 2e-8 times the rate of change per
#: second, and what is beyond the fourth power; measured 1.1e-9 and 1.3e-7 at worst
ALIKE, ENERGIES = 1e-7, 1e-5
BENT_RODS = (
    *("free and fixed modes", "held shapes", "branches", "driven", "stiffened", "driven loop", "held shapes in a loop"),
    *("redundant rows", "friction", "friction in a loop"),
)
SCENES = ("checks/bennett", "checks/bricard", "checks/four_bars_2", "checks/universal_shaft", "gallery/four_bar")


def of_table(table: Any, **off: float) -> Evaluated:
    return evaluated(tabulate(build(Scene.model_validate(table), {})), **off)


def of_rods(table: Any) -> Evaluated:
    return evaluated(tabulated(Scene.model_validate(table)))


def of_scene(name: str) -> Evaluated:
    return evaluated(tabulate(build(load_scene(TREE / f"scenes/{name}.toml"), {})))


#: rubbing trees 1 and 5 jam, and 2 almost
CASES: dict[str, Callable[[], Evaluated]] = {
    **{f"tree {name}": partial(of_rods, table) for name, table in TREES.items() if "chain" not in name},
    **{f"bent {name}": partial(of_rods, BENT[name]) for name in BENT_RODS},
    "pressed rods": lambda: of_rods(pressed_rods()),
    **{f"pressed {number}": partial(pressed, number) for number in (0, 3, 9, 13)},
    **{f"rubbing {number}": lambda k=number: of_table(rubbing_tree(k), turns=0.1) for number in (0, 3)},
    **{f"rubbing loops {number}": lambda k=number: of_table(with_friction(two_loops(), k)) for number in range(2)},
    **{name: partial(of_scene, name) for name in SCENES},
    "opened 1": lambda: evaluated(opened(1)),
    "closed 1": lambda: evaluated(closed(1)),
}


class Look(NamedTuple):
    """A recorded state: what is in w."""

    model: Model
    h: np.ndarray
    w: np.ndarray

    def rows(self, table: Any, count: int) -> np.ndarray:
        return m.named(table, self.w[self.h[table.at] :][: table.size * count])

    def stretch(self, index: int, count: int) -> np.ndarray:
        return self.w[self.h[index] :][:count]

    @property
    def links(self) -> np.ndarray:
        return self.rows(m.LINK_FRAMES, len(self.model.links))

    @property
    def sites(self) -> np.ndarray:
        return self.rows(m.SITE_FRAMES, self.model.arrays.size(m.N_SITES))

    @property
    def touch(self) -> np.ndarray:
        return self.rows(m.TOUCH, len(self.model.contacts))

    @property
    def loads(self) -> np.ndarray:
        return self.rows(m.LOAD, self.model.arrays.size(m.N_LOADS))

    @property
    def closures(self) -> np.ndarray:
        return self.rows(m.CLOSURE_WRENCH, self.model.arrays.size(m.N_CLOSURES))

    @property
    def energy(self) -> np.ndarray:
        """Kinetic, potential and elastic energy of all bodies, with that of bristles."""
        rows = self.rows(m.ENERGY, self.model.arrays.size(m.N_COMPONENTS))
        return np.array([rows[kind].sum() for kind in rows.dtype.names])


class Looks:
    """A mechanism's recorded state, and such on both sides of it along its motion."""

    def __init__(self, found: Evaluated) -> None:
        self.found, self.model, self.h = found, found.model, found.h
        self._describe = engine_in_python(self.model, analyse(self.model)).entry.kernels.evaluate  # type: ignore[attr-defined]
        y = int(self.h[m.Y])
        self.state = found.w[y : y + self.model.ny].astype(float)
        self.here = self.at(0.0, np.zeros_like(self.state))
        self.rates = self.here.stretch(m.SLOPES, self.model.ny).copy()

    def at(self, later: float, rates: np.ndarray) -> Look:
        w, n, h = self.found.w.astype(float), self.found.space.n.copy(), self.h
        w[h[m.Y] : h[m.Y] + self.model.ny] = self.state + later * rates
        self._describe(h, self.model.arrays.f, w, n, 0.1 + later, int(h[m.Y]), int(h[m.SLOPES]))
        assert (n[m.EVALUATION], n[m.ABRIDGED]) == (m.OK, 0)
        return Look(self.model, h, w)

    def rate(self, read: Callable[[Look], np.ndarray], step: float = STEP) -> np.ndarray:
        """Derivative of what is read of the state, along the motion."""
        one, two = (read(self.at(k * step, self.rates)) - read(self.at(-k * step, self.rates)) for k in (1.0, 2.0))
        return np.asarray((8.0 * one - two) / (12.0 * step))


@cache
def looks(name: str) -> Looks:
    return Looks(CASES[name]())


def assert_alike(made: np.ndarray, known: np.ndarray, size: float = 0.0, room: float = ALIKE) -> None:
    """Each within a share of the largest, or of a larger size."""
    largest = max(float(np.abs(known).max(initial=0.0)), size)
    assert np.abs(made - known).max(initial=0.0) <= room * (largest or 1.0)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_velocities_and_accelerations_are_rates_of_positions(name: str) -> None:
    """Of links and sites; lengths of loads, gaps of contacts."""
    seen = looks(name)
    gravity = seen.model.arrays.table(m.GRAVITY)["acceleration"][0]
    for frames in (lambda look: look.links, lambda look: look.sites):
        now = frames(seen.here)
        assert_alike(now["velocity"], seen.rate(lambda look, of=frames: of(look)["origin"]))
        assert_alike(now["acceleration"] + gravity, seen.rate(lambda look, of=frames: of(look)["velocity"]), 1.0)
        assert_alike(now["alpha"], seen.rate(lambda look, of=frames: of(look)["omega"]), 1.0)
        turning = seen.rate(lambda look, of=frames: of(look)["axes"]) @ np.swapaxes(now["axes"], 1, 2)
        assert_alike(now["omega"], np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1))
    assert_alike(seen.here.loads["rate"], seen.rate(lambda look: look.loads["value"]))
    aside = np.linalg.norm(seen.here.touch["offset"], axis=1) > 0.0  # in the middle of a bearing no way is outwards
    rate = seen.rate(lambda look: look.touch["gap"], SHORT)
    assert_alike(-seen.here.touch["rate"][aside], rate[aside], room=ENERGIES)
    nv, table, law = seen.model.nv, seen.model.arrays.table, seen.here.rows(m.LAW, seen.model.arrays.size(m.N_LAWS))
    drives = len(table(m.DRIVES))
    for stretch, first, field in ((m.X, seen.model.nq, "value"), (m.U, nv, "rate"), (m.DU, nv, "second_rate")):
        assert np.array_equal(seen.here.stretch(stretch, first + drives)[first:], law[field][:drives])


def moment_and_force(wrenches: np.ndarray) -> np.ndarray:
    return np.concatenate([wrenches["moment"], wrenches["force"]], axis=-1)


def momenta(look: Look) -> np.ndarray:
    """Moment of momentum about the origin, of rigid links, and momentum of all links, (links, 6)."""
    table, x, u, frames = look.model.arrays.table, look.stretch(m.X, 10**6), look.stretch(m.U, 10**6), look.links
    made, numbers = np.zeros((len(frames), 6)), table(m.LINK_NUMBERS)
    for i in range(1, len(frames)):
        R, omega, body = frames["axes"][i], frames["omega"][i], numbers[i]
        xx, yy, zz, xy, xz, yz = body["inertia"]
        c = R @ body["com"]
        made[i, 3:] = body["mass"] * (frames["velocity"][i] + np.cross(omega, c))
        J = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        made[i, :3] = np.cross(frames["origin"][i] + c, made[i, 3:]) + J @ omega
    for body, whole in zip(table(m.FLEXES), table(m.FLEX_NUMBERS), strict=True):
        i, n = body["link"], int(body["n_modes"])
        R = frames["axes"][i]
        S = table(m.FLEX_DATA)["value"][body["data0"] : body["data0"] + 3 * n].reshape(3, n)
        c, rate = whole["first_moment"] + S @ x[body["q0"] :][:n], S @ u[body["c0"] :][:n]
        moving = whole["mass"] * frames["velocity"][i] + np.cross(frames["omega"][i], R @ c) + R @ rate
        made[i] = [np.nan] * 3 + moving.tolist()
    return made


@pytest.mark.parametrize("name", [name for name in CASES if name != "bent stiffened"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_recorded_wrenches_change_the_momentum_of_every_link(name: str) -> None:
    """Forces and moments of rigid links, forces of flexible ones.

    By joints of the tree, closures, loads and contacts; gears act on four links, of which the record has one wrench.
    """
    seen = looks(name)
    model, table, here = seen.model, seen.model.arrays.table, seen.here
    if len(table(m.NAMED["couplings"])):
        return
    sites, gravity = table(m.SITES)["link"], table(m.GRAVITY)["acceleration"][0]
    acting = moment_and_force(here.rows(m.WRENCH, len(model.links)))
    acting[0] = 0.0
    size = np.abs(acting).max(axis=0)
    for i in range(1, len(model.links)):
        acting[table(m.LINKS)["parent"][i]] -= acting[i]

    def act(a: int, b: int, wrench: np.ndarray) -> None:
        acting[sites[b]] += wrench
        if a >= 0:
            acting[sites[a]] -= wrench

    for rows, first, second, wrenches in (
        (table(m.CLOSURES), "site_a", "site_b", moment_and_force(here.closures)),
        (table(m.LOADS), "a", "b", moment_and_force(here.loads)),
    ):
        for row, wrench in zip(rows, wrenches, strict=True):
            act(row[first], row[second], wrench)
    for c, (row, now) in enumerate(zip(table(m.CONTACTS), here.touch, strict=True)):
        force, arm = now["force"], now["point"]
        if c >= model.arrays.size(m.N_SURFACES):
            arm = here.sites["origin"][row["inner"]]
        turning = c >= model.arrays.size(m.N_SURFACES) and table(m.GAUGES)["turning"][row["surfaces"]]
        act(row["outer"], row["inner"], np.append(*((force, 0 * force) if turning else (np.cross(arm, force), force))))
        if row["subtracted"] >= 0:  # the flank of a gear acts back on the first joint
            gauges = [table(m.GAUGES)[row[name]] for name in ("surfaces", "subtracted")]
            axes = [here.sites["axes"][one["b" if one["side"] else "a"]][:, one["axis"]] for one in gauges]
            back = -table(m.CONTACT_NUMBERS)["shape"][c][2] * (force @ axes[0]) * axes[1]
            arm = here.sites["origin"][gauges[1]["b"]]
            both = (back, 0 * back) if gauges[1]["turning"] else (np.cross(arm, back), back)
            act(gauges[1]["a"], gauges[1]["b"], np.append(*both))
    mass, numbers = momenta(here), table(m.LINK_NUMBERS)
    for i, frame in enumerate(here.links[1:], start=1):
        weight = numbers["mass"][i] * gravity
        acting[i] += np.append(np.cross(frame["origin"] + frame["axes"] @ numbers["com"][i], weight), weight)
    for body, whole in zip(table(m.FLEXES), table(m.FLEX_NUMBERS), strict=True):
        acting[body["link"], 3:] += (whole["mass"] - numbers["mass"][body["link"]]) * gravity
    changed = seen.rate(momenta)
    known = ~np.isnan(mass)[1:]
    for part in (slice(3), slice(3, 6)):
        there = known[:, part]
        assert_alike(acting[1:, part][there], changed[1:, part][there], float(size[part].max()))


def powers(look: Look, state: np.ndarray, rates: np.ndarray) -> tuple[float, float]:
    """Power supplied less lost by the ledger, without the closures; and the largest part of it."""
    model, table, books = look.model, look.model.arrays.table, rates[look.model.speeds.stop :]
    rows, parts = table(m.BOOKS), list[float]()
    for row in rows:
        parts += [books[row["work"]], -books[row["loss"]]]
        if model.loads:
            parts += [books[row["load"]], -books[row["load"] + 1]]
    for c in range(len(model.contacts)):
        parts += (-books[m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * c :][:2]).tolist()
    if rubbing := len(table(m.NAMED["rubbing"])):
        parts += (-books[model.arrays.size(m.SIZES["joint_friction_slot"]) :][:rubbing]).tolist()
    return sum(parts), max(map(abs, parts), default=0.0)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_energies_change_by_the_recorded_powers(name: str) -> None:
    """All powers, and those of closures' wrenches where loops open; drives' forces on their speeds."""
    seen = looks(name)
    here, table, twists = seen.here, seen.model.arrays.table, seen.here.sites
    supplied, largest = powers(here, seen.state, seen.rates)
    if not len(table(m.NAMED["couplings"])):
        for row, wrench in zip(table(m.CLOSURES), here.closures, strict=True):
            for site, sign in ((row["site_b"], 1.0), (row["site_a"], -1.0)):
                origin, omega, v = (twists[field][site] for field in ("origin", "omega", "velocity"))
                work = sign * (omega @ wrench["moment"] + (v - np.cross(omega, origin)) @ wrench["force"])
                supplied, largest = supplied + work, max(largest, abs(work))
        # friction in a loop's joint is part of its wrench
        for row in table(m.NAMED["rubbing"]):
            if row["closure"] >= 0:
                book = seen.model.speeds.stop + seen.model.arrays.size(m.SIZES["joint_friction_slot"])
                supplied += seen.rates[book + list(table(m.NAMED["rubbing"])).index(row)]
        bent = seen.rate(lambda look: look.touch["bent"], SHORT).sum()
        changed = seen.rate(
            lambda look: look.energy, SHORT if seen.model.contacts or seen.model.parts.flexible else STEP
        )
        size = max(largest, float(np.abs(changed).max()))
        assert_alike(np.array([supplied + bent]), np.array([changed.sum()]), size, ENERGIES)
    drives, nv = len(table(m.DRIVES)), seen.model.nv
    work = here.stretch(m.DRIVE_FORCE, drives) * here.stretch(m.U, nv + drives)[nv:]
    books = np.zeros(seen.model.arrays.size(m.N_LEDGER))
    np.add.at(books, table(m.DRIVES)["book"], work)
    assert_alike(books[table(m.BOOKS)["work"]], seen.rates[seen.model.speeds.stop :][table(m.BOOKS)["work"]])


@pytest.mark.parametrize(
    "name", ["bent driven loop", "bent held shapes in a loop", "bent redundant rows", *SCENES, "closed 1"]
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_the_recorded_jacobian_gives_the_rates_at_which_loops_open(name: str) -> None:
    """Those of all speeds less those of the drives alone."""
    seen = looks(name)
    model, h, nv = seen.model, seen.h, seen.model.nv
    J = selection.dense_rows(model, h, seen.here.stretch(m.JACOBIAN, model.arrays.size(m.JACOBIAN_SIZE)))
    kept, count = selection.selected_indices(model, h), model.arrays.size(m.N_CLOSURE_ROWS)
    speeds, whole = seen.state[model.speeds].copy(), seen.here.stretch(m.RESIDUAL_RATE, count)[kept]
    seen.state[model.speeds] = 0.0
    still = seen.at(0.0, seen.rates).stretch(m.RESIDUAL_RATE, count)[kept]
    seen.state[model.speeds] = speeds
    for body in model.arrays.table(m.FLEXES):  # to the interface basis
        n, entries = int(body["n_modes"]), range(body["basis0"], body["basis0"] + body["n_basis"])
        T, basis = np.zeros((n, n)), model.arrays.table(m.BASIS)
        for e in entries:
            T[basis["mode"][e], basis["shape"][e]] = model.arrays.table(m.BASIS_VALUES)["value"][e]
        speeds[body["c0"] :][:n] = T.T @ speeds[body["c0"] :][:n]
    assert J.shape[1] == nv
    assert_alike(J @ speeds, whole - still, room=1e-12)  # a dozen sums
