"""The energy ledger: energy supplied, stored and lost, by cause; and its balance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Variables
from flexclear.dynamics.model.initial import centre_of
from flexclear.dynamics.model.mechanism import Site
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run import joint_friction
from flexclear.dynamics.run.controllers import REMEDY, require_controlled
from flexclear.dynamics.run.progress_rate import DearError, affordable
from flexclear.dynamics.run.refusals.refusal import STIFF_SHARE
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.numerics.rotations import cross, rotate
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.solver import Solver
from flexclear.system.errors import SolverError

#: losses of an effect, in the first variables of its block of the ledger [J]: variable of the run's dataset and its
#: dimension; for each loss its two sites, and its cause in words
Losses = tuple[str, str, list[tuple[Site, Site]], list[str]]
#: of effects: their losses, and checks that refuse an unusable run
LOSSES = {"joint_friction": joint_friction.losses}
REFUSALS = {"controllers": require_controlled}
#: no contact law is known to a thousandth of its energy; a larger error of a run with adaptive steps has another cause.
#: Tighter tolerances have a better balance: of three hundred hard cases at rtol 1e-10 (benchmarks/atlas.py) none is off
#: by 1e-6, unless something is wrong; numerical damping is not distinguished from a fault that soon. Fixed steps serve
#: comparisons: their error is to be visible, up to a tenth of all energy
CHOSEN, STRICT, PER_RTOL, FIXED = 1e-3, 1e-4, 1e5, 0.1
#: speed above which a run diverges [m/s]: a hundredth of that of light, where Newton's mechanics is off by 1e-4
DIVERGED = 3e6
#: steps over many vibrations leave up to half of this in the work of oscillating forces while the drives' speeds change
LONG_STEPS, LONG_PER_RTOL = 2e-2, 50.0


def _losses_of_effects(model: Model) -> list[tuple[int, Losses]]:
    """Return the index in the ledger of each effect's losses."""
    losing = [effect.name for effect in model.parts.present if effect.name in LOSSES]
    return [(model.arrays.size(m.SIZES[f"{name}_slot"]), LOSSES[name](model)) for name in losing]


def series(model: Model, seen: Observed, component: int | None = None) -> Variables:
    """Return the variables of the ledger, total and by cause.

    component: the independent mechanism to which totals are restricted; None for all.
    """
    parts, ledger = model.mechanism.components, seen.state[:, model.speeds.stop :]
    some = slice(None) if component is None else slice(component, component + 1)
    books, energy = model.arrays.table(m.BOOKS)[some], seen.energy[:, some]
    kinetic, potential, elastic = (energy[name].sum(axis=1) for name in ("kinetic", "potential", "elastic"))

    def total(values: np.ndarray, owners: Iterable[tuple[Site, Site]]) -> np.ndarray:
        """Sum over the parts that act between the sites; values: shape (rows, owners)."""
        mine = [component in (None, parts.of(a.link, b.link)) for a, b in owners]
        return np.asarray((values if all(mine) else values[:, mine]).sum(axis=1))

    slots = ledger[:, m.CONTACT_SLOTS : m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * len(model.contacts)]
    lost = m.named(m.CONTACT_LEDGER, slots)
    # the ledger has friction's work; the energy that bent bristles still store is not lost
    damping, friction = lost["damping"], lost["friction"] - seen.touch["bent"]
    work, modal = (ledger[:, books[name]].sum(axis=1) for name in ("work", "loss"))
    touching = [(contact.outer, contact.inner) for contact in model.contacts]
    dissipated = modal + total(damping, touching) + total(friction, touching)
    balance = kinetic + potential + elastic + dissipated - work
    loaded: Variables = {}
    if model.loads:
        load_work, load_loss = (ledger[:, books["load"] + k].sum(axis=1) for k in range(2))
        dissipated, balance = dissipated + load_loss, balance + load_loss - load_work
        loaded = {"load_work": (("time",), load_work), "load_loss": (("time",), load_loss)}
    for slot, (variable, dimension, sites, _) in _losses_of_effects(model):
        values = ledger[:, slot : slot + len(sites)]
        lost_there = total(values, sites)
        dissipated, balance = dissipated + lost_there, balance + lost_there
        loaded[variable] = (("time", dimension), values)
    variables: Variables = {
        "kinetic": (("time",), kinetic),
        "potential": (("time",), potential),
        "elastic": (("time",), elastic),
        "dissipated": (("time",), dissipated),
        "drive_work": (("time",), work),
        "energy_error": (("time",), balance - balance[0]),
        "constraint_error": (("time",), seen.residual),
        **loaded,
    }
    if model.numbering.flexible:
        variables["modal_damping_loss"] = (("time",), modal)
    if model.contacts:
        variables["contact_elastic"] = (("time", "contact"), seen.touch["stored"] + seen.touch["bent"])
        variables["contact_damping_loss"] = (("time", "contact"), damping)
        variables["contact_impulse"] = (("time", "contact"), lost["impulse"])
        variables["contact_friction_loss"] = (("time", "contact"), friction)
    return variables


def default_energy_error(solver: Solver) -> float:
    """Return the default energy error above which a run is refused, as a fraction of the exchanged energy."""
    if solver.step is not None:
        return FIXED
    if INTEGRATORS[solver.integrator].dissipative:
        return CHOSEN
    usual = max(STRICT, min(CHOSEN, PER_RTOL * solver.rtol))
    return (
        max(usual, min(LONG_STEPS, LONG_PER_RTOL * solver.rtol)) if INTEGRATORS[solver.integrator].long_steps else usual
    )


def _tolerance(solver: Solver) -> float:
    """Return the energy error above which a run is refused, as a fraction of the exchanged energy."""
    return solver.ledger_tolerance or default_energy_error(solver)


def _energy_of_held_states(solver: Solver, kinetic: float, elastic: float) -> float:
    """Return the energy that counts as exchanged at least [J], for states that elastic parts hold at rest.

    An error e of a state that stores E changes its forces and deflections by sqrt(e/E), which the tolerance resolves.
    kinetic, elastic: largest energies [J].
    """
    tolerance = _tolerance(solver)
    # 1e-16: speeds that are a hundred-millionth of those with which E would be exchanged are rounding and the residue
    # of the equilibrium; steps over many vibrations take one for a motion that lasts the whole step
    if kinetic <= 1e-16 * elastic:
        return elastic
    # fixed steps either diverge or leave no vibration, adaptive ones at the limit of stability one within the tolerance
    return 0.0 if solver.step is not None else min(tolerance, PER_RTOL * solver.rtol) ** 2 / tolerance * elastic


@dataclass(frozen=True)
class Balance:
    """Energy error at the rows of a run, the energy exchanged, and the rounding of the largest energy [J].

    of: the mechanism whose energies these are, in words; empty for all bodies.
    """

    of: str
    totals: dict[str, np.ndarray]
    error: np.ndarray
    exchanged: float
    rounding: float

    @property
    def worst(self) -> int:
        """Row of the largest error, or of the first that is not finite."""
        finite = np.isfinite(self.error)
        return int(np.argmax(self.error)) if finite.all() else int(np.argmin(finite))


def balances(model: Model, seen: Observed) -> list[Balance]:
    """Return the energy balance of each independent mechanism in observed rows.

    Methods that integrate all vibrations together account for them as one mechanism, which has one balance.
    """
    count = len(model.mechanism.components.lengths)
    if count == 1 or INTEGRATORS[model.scene.solver.integrator].long_steps:
        return [balance(model, seen)]
    return [balance(model, seen, component) for component in range(count)]


def balance(model: Model, seen: Observed, component: int | None = None) -> Balance:
    """Return the energy balance of an independent mechanism, by number, or of all bodies, in observed rows."""
    totals = {name: values for name, (_, values) in series(model, seen, component).items()}
    exchanging = [
        n for n in ("kinetic", "potential", "elastic", "dissipated", "drive_work", "load_work") if n in totals
    ]
    exchanged = max(float(totals["kinetic"].max()), *(float(np.ptp(totals[n])) for n in exchanging))
    largest = max(float(np.abs(totals[n]).max()) for n in exchanging)
    of = ""
    if component is not None:
        mechanism = model.mechanism
        body = next(n for n in mechanism.moving_bodies if mechanism.components.of(mechanism.link_of[n]) == component)
        of = f" of body {body} and what it is connected to"
    # 1e-12: roundings of the largest energies, which may cancel in the balance
    # 1e-14: roundings of the work that the largest force does over the size of the mechanism: a force that holds it at
    # rest does work by the rounding of its positions
    # 1e-30: energies below this count as zero: a billionth of the thermal energy of one degree of freedom, 4e-21 J [J]
    rounding = max(1e-12 * largest, 1e-14 * _largest_work(model, seen, component), 1e-30)
    held = _energy_of_held_states(model.scene.solver, *(float(np.abs(totals[n]).max()) for n in ("kinetic", "elastic")))
    return Balance(of, totals, np.abs(totals["energy_error"]), max(exchanged, held), rounding)


def _largest_work(model: Model, seen: Observed, component: int | None) -> float:
    """Return the work that the largest force in a joint, load or contact does over the size of its mechanism [J]."""
    parts, loads = model.mechanism.components, model.arrays.table(m.LOADS)
    length = model.length if component is None else parts.lengths[component]
    of_link = np.array(parts.of_link)
    of_site = np.append(of_link[model.arrays.table(m.SITES)["link"]], -1)  # of site -1, the world
    of_contact = np.array([parts.of(contact.outer.link, contact.inner.link) for contact in model.contacts], int)
    wrenches = (seen.link_wrenches, of_link), (seen.loads, np.maximum(of_site[loads["a"]], of_site[loads["b"]]))
    works = [
        (np.abs(one["moment"]).max(axis=2) + length * np.abs(one["force"]).max(axis=2), of) for one, of in wrenches
    ]
    works.append((length * seen.touch["normal_force"], of_contact))
    mine = [work if component is None else work[:, of == component] for work, of in works]
    return max(float(work.max(initial=0.0)) for work in mine)


def require_closed(model: Model, trajectory: Trajectory, seen: Observed, exchanged: float = 0.0) -> float:
    """Return the largest energy exchanged [J], by this run or before it.

    exchanged: energy before it, of a run that continues another one.
    Raises SolverError when the run diverges, or its ledger is off by more than the scene's tolerance; DearError where
    stability limited the steps and the scene names no integrator.
    """
    for refuse in model.parts.functions(REFUSALS):
        refuse(model, trajectory, seen)
    _require_bounded(model, trajectory, seen)
    made = balances(model, seen)
    for energies in made:
        _require(model, trajectory, energies, exchanged)
    return max([exchanged, *(energies.exchanged for energies in made)])


def _require(model: Model, trajectory: Trajectory, result: Balance, exchanged: float) -> None:
    solver = model.scene.solver
    tolerance = _tolerance(solver)
    allowed = tolerance * max(result.exchanged, exchanged) + result.rounding
    if result.error[result.worst] <= allowed:
        return
    first = int(np.argmax(~(result.error <= allowed)))
    noisy = trajectory.counters["stiff_steps"] > STIFF_SHARE * trajectory.counters["steps"]
    raise (DearError if noisy and affordable(model.scene) else SolverError)(
        f"at t = {trajectory.time[first]:.6g} s: the energy balance{result.of} does not close: the error is up to "
        f"{result.error[result.worst]:.3g} J of {result.exchanged:.3g} J exchanged (tolerance {tolerance:g}, "
        f"[solver.ledger_tolerance]); lost so far: {_losses(model, result.totals, first)}; "
        "choose a smaller rtol or step, or another integrator"
    )


def warnings(model: Model, seen: Observed) -> list[str]:
    """Warn of an energy error above a hundredth of the exchanged energy, which the scene's tolerance allows."""
    # 1e-2: fraction of the exchanged energy above which an error is a warning: forces and speeds are wrong by about a
    # per cent
    return [
        f"the energy balance{one.of} is off by {error:.3g} J, {100.0 * error / one.exchanged:.2g} % of the "
        f"{one.exchanged:.3g} J that are exchanged: choose a smaller rtol or step"
        for one in balances(model, seen)
        if not (error := float(one.error[one.worst])) <= 1e-2 * one.exchanged + one.rounding
    ]


def speeds_of_bodies(model: Model, seen: Observed) -> np.ndarray:
    """Return the speeds of all moving bodies' centres of mass, as if undeformed [m/s], (rows, bodies)."""
    speeds = np.zeros((len(seen.state), len(model.mechanism.moving_bodies)))
    for k, name in enumerate(model.mechanism.moving_bodies):
        centre = centre_of(model, name)
        link = seen.links[:, centre.link]
        v = link["velocity"] + cross(link["omega"], rotate(link["axes"], centre.place))
        speeds[:, k] = np.linalg.norm(v, axis=1)
    return speeds


def _require_bounded(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """Raise SolverError for an unbounded motion, for instance under a controller that makes it unstable."""
    speeds = speeds_of_bodies(model, seen)
    beyond = np.flatnonzero(~(speeds.max(axis=1, initial=0.0) <= DIVERGED))
    if len(beyond):
        k, fastest = int(beyond[0]), int(np.argmax(speeds[beyond[0]]))
        name = model.mechanism.moving_bodies[fastest]
        text = f"the motion diverges: body {name} moves at {speeds[k, fastest]:.3g} m/s"
        raise SolverError(f"at t = {trajectory.time[k]:.6g} s: {text}; {REMEDY}")


def _losses(model: Model, totals: dict[str, np.ndarray], t: int) -> str:
    parts = []
    for c, contact in enumerate(model.contacts):
        for cause in ("damping", "friction"):
            parts.append(f"{totals[f'contact_{cause}_loss'][t, c]:.3g} J to the {cause} of {contact.words}")
    if "modal_damping_loss" in totals:
        parts.append(f"{totals['modal_damping_loss'][t]:.3g} J to modal damping")
    for _, (variable, *_, words) in _losses_of_effects(model):
        parts += [f"{totals[variable][t, k]:.3g} J to {what}" for k, what in enumerate(words)]
    if "load_loss" in totals:
        parts.append(f"{totals['load_loss'][t]:.3g} J to the loads")
    return ", ".join(parts) or "nothing"
