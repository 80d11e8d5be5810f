"""Which integrator suits a scene that asks for accuracy alone, by what reason, and who looks whether it was right.

Costs are counted in evaluations of the right-hand side. What stability will cost the explicit method follows from the
fastest rate of the equations, linearised at the start; what accuracy will cost, a run tells: it is taken over to other
tolerances by the order of the error estimate. So the first run is a guess, which runs to come and, while it goes on,
its judge correct.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.2 (stability limits).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from flexclear.pipeline.core.integrators import DEFAULT, STIFF, VIBRATING, by_need
from flexclear.pipeline.core.progress import silent
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run import refusal
from flexclear.pipeline.dynamics.run.engine import Engine
from flexclear.pipeline.dynamics.run.pace import Judge, foreseen, limited
from flexclear.pipeline.dynamics.run.run import engine_of
from flexclear.pipeline.dynamics.run.start import consistent_start

#: evaluations of a step of the default method, and how far its region of stability reaches where steps swing about it,
#: along both axes; the product of rate and step that its error control settles at
STAGES, REACH = 12.0, 5.0
#: an evaluation of the exponential method with its own algebra, in evaluations of the others
DEARER = 1.4
#: of a scene with contacts, evaluations of the default method where the modes limit it, as a share of what it needs to
#: be stable: it begins again at each contact, and steps more strictly there (measured: 1.45 and more)
TOUCHING = 1.5
#: least and largest power of the tolerance with which evaluations of the exponential method grow, as two runs tell
LEAST_POWER, LARGEST_POWER = 0.02, 0.4
#: the vibrations must be so much faster than all else, for nothing else limits the exponential method
APART = 10.0
#: a run of fewer evaluations needs no other method
CHEAP = 2000.0
#: how many times dearer than another one foresees a method must be to be given up, as pace and foresight are rough
CLEARLY = 3.0
#: a stiff run is handed on from so many evaluations in all; without another estimate, radau takes about as many
CRAWLING = 300_000.0
#: least evaluations between two looks
LEAST_LOOK = 500
#: relative step of the differences
PERTURBATION = 1e-7


@dataclass(frozen=True)
class Rates:
    """Fastest rates [1/s] of the equations at the start: of all, and with the bodies' modes held."""

    all: float
    held: float


@dataclass
class Suit:
    """What is known of a scene's costs.

    span: of the run [s].  seen: by integrator, tolerance and evaluations of its last run; before: of the one before.
    missed: integrators that a run with them has been handed on from.  touching: whether there are contacts.
    """

    rates: Rates
    span: float
    names: tuple[str, ...]
    seen: dict[str, tuple[float, float]] = field(default_factory=dict)
    missed: set[str] = field(default_factory=set)
    before: dict[str, tuple[float, float]] = field(default_factory=dict)
    touching: bool = False

    @property
    def by_stability(self) -> float:
        """Evaluations with which the default method is stable."""
        return STAGES * self.span * self.rates.all / REACH

    @property
    def least(self) -> float:
        """Evaluations that the default method takes at any tolerance."""
        return (TOUCHING if self.touching else 1.0) * self.by_stability

    def cost(self, name: str, rtol: float) -> float:
        """Evaluations foreseen at a tolerance, weighed by their algebra; nothing where only a run can tell."""
        least = self.least if name == DEFAULT else 0.0
        if name not in self.seen:
            return least
        at, evaluations = self.seen[name]
        order = ORDERS[name] + 1.0
        if name == DEFAULT:  # where stability limited the run, a tighter tolerance is free up to what accuracy needs
            return max(least, min(evaluations, 1.0) if rtol > at else evaluations * (at / rtol) ** (0.5 / order))
        # half of them are spent on finding and beginning contacts, whatever the tolerance
        return DEARER * evaluations * (at / rtol) ** self._power(name, (0.5 if self.touching else 1.0) / order)

    def _power(self, name: str, foreseen: float) -> float:
        """The power of the tolerance with which evaluations grow: as two runs tell, otherwise as foreseen."""
        if name not in self.before:
            return foreseen
        (at, evaluations), (other, others) = self.seen[name], self.before[name]
        return float(np.clip(np.log(others / evaluations) / np.log(at / other), LEAST_POWER, LARGEST_POWER))

    def best(self, rtol: float) -> str:
        """The integrator to take at a tolerance."""
        vibrating = VIBRATING in self.names and self.rates.all > APART * self.rates.held
        vibrating = vibrating and self.by_stability > CHEAP and VIBRATING not in self.missed
        if vibrating and self.cost(VIBRATING, rtol) < self.cost(DEFAULT, rtol):
            return VIBRATING
        return STIFF if DEFAULT in self.missed else DEFAULT

    def why(self, rtol: float) -> str:
        """The reason in words."""
        name, most = self.best(rtol), f"{self.by_stability:.2g} evaluations for {DEFAULT} to be stable"
        if name == STIFF:
            return f"{STIFF}: stability limited the steps of {DEFAULT} in a run before"
        if name == VIBRATING:
            return (
                f"{VIBRATING}: the modes' fastest vibration, {self.rates.all / 6.283:.3g} Hz, would take {most}; "
                f"with them followed exactly, the fastest rate is {self.rates.held:.3g} 1/s"
            )
        if VIBRATING in self.seen:
            return (
                f"{DEFAULT}: at a relative tolerance of {rtol:.1e} it is foreseen to take fewer evaluations than "
                f"{VIBRATING}, which took {self.seen[VIBRATING][1]:.0f} at {self.seen[VIBRATING][0]:.1e}"
            )
        if VIBRATING in self.missed:
            return (
                f"{DEFAULT}: a run before began with {VIBRATING}, which was dearer than foreseen and handed over to it"
            )
        return f"{DEFAULT}: the fastest rate at the start, {self.rates.all:.3g} 1/s, takes no more than {most}"

    def judges(self) -> dict[str, tuple[Judge, str]]:
        """By integrator, who looks whether its run goes as foreseen, and which one goes on if not."""
        most = max(self.least, CHEAP)
        look = max(int(0.1 * most), LEAST_LOOK)
        found = {DEFAULT: (Judge(look, _stiff), STIFF)}
        if VIBRATING in self.names:
            found[VIBRATING] = (Judge(look, lambda engine: _too_dear(engine, most)), DEFAULT)
        return found

    def learn(self, rtol: float, name: str, run: xr.Dataset) -> None:
        """Remember what a run that began with an integrator took."""
        if run.attrs["method"] != name:
            self.missed.add(name)
        else:
            if name in self.seen and self.seen[name][0] != rtol:
                self.before[name] = self.seen[name]
            self.seen[name] = (rtol, float(run.attrs["evaluations"]))


#: powers of the step with which the error estimates fall
ORDERS = {DEFAULT: 7.0, VIBRATING: 4.0}


def suit(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Suit:
    """What is known of a scene before any run."""
    names = by_need(bool(scene.flexible()))
    engine = engine_of(
        edited(scene, {"solver.integrator": VIBRATING if VIBRATING in names else DEFAULT}), bundles, silent
    )
    start = consistent_start(engine)
    engine.select_pieces_after(engine.start)
    touching = bool(engine.model.contacts)
    return Suit(rates(engine, start), engine.end - engine.start, names, touching=touching)


def rates(engine: Engine, y: np.ndarray) -> Rates:
    """Magnitudes of the largest eigenvalues of the equations, linearised in a state at the start."""
    n, model = engine.model.nq + engine.model.nv, engine.model
    J, scales = np.empty((n, n)), model.state_scales
    for k in range(n):
        sides = []
        step = PERTURBATION * max(abs(y[k]), float(scales[k]))
        for sign in (1.0, -1.0):
            z = y.copy()
            z[k] += sign * step
            sides.append(engine.evaluate(z, engine.start)[:n])
        J[:, k] = (sides[0] - sides[1]) / (2.0 * step)
    bodies = model.arrays.table(m.FLEXES)
    modes = [b["q0"] + j for b in bodies for j in range(b["n_modes"])]
    modes += [model.nq + b["c0"] + j for b in bodies for j in range(b["n_modes"])]
    return Rates(_fastest(J), _fastest(np.delete(np.delete(J, modes, 0), modes, 1)))


def _fastest(J: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(J)).max(initial=0.0))


def _stiff(engine: Engine) -> str:
    """Why an explicit method is to be given up: stability limits its steps, and there are very many of them."""
    if not limited(engine) or foreseen(engine) < CRAWLING:
        return ""
    return refusal.stiffness(engine.n, engine.control)


def _too_dear(engine: Engine, most: float) -> str:
    """Why the exponential method is to be given up: another one would be clearly cheaper."""
    whole = DEARER * foreseen(engine)
    if whole < CLEARLY * most:
        return ""
    return (
        f"at this pace the run takes {whole / DEARER:.2g} evaluations, while {DEFAULT} needs {most:.2g}: "
        "it is not the vibrations of the modes that make it dear"
    )
