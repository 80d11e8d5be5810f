"""Method selection for a scene that requests only an accuracy, with reasons and with checks during the run.

Costs are numbers of evaluations of the right-hand side. The steps that stability requires of the explicit method follow
from the fastest rate of the equations, linearised at the start. The cost of accuracy comes from a run, extrapolated to
other tolerances by the order of the error estimate. So the choice for the first run is a guess, which later runs and,
during a run, its judge correct.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.2 (stability limits).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.progress_rate import Judge, Judges, Look, Panel, limited_by_stability, pace
from flexclear.dynamics.run.refusals import refusal
from flexclear.dynamics.run.run import engine_of
from flexclear.scene.integrators import DEFAULT, STIFF, VIBRATING, selectable_integrators
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent

#: evaluations per step of the default method; and the extent of its stability region along both axes where steps
#: oscillate about the limit: the product of rate and step at which error control settles
STEP_EVALUATIONS, STABILITY_REACH = 12.0, 5.0
#: cost of an evaluation with the algebra of its method, in evaluations of the default method
RELATIVE_COST = {DEFAULT: 1.0, VIBRATING: 1.4, STIFF: 2.0}
#: evaluations of the default method in a scene with contacts, limited by the modes, relative to what stability needs:
#: the method starts again at each contact, with stricter steps (measured: 1.45 and more)
CONTACT_FACTOR = 1.5
#: least and largest power of the tolerance with which evaluations grow, according to two runs
LEAST_POWER, LARGEST_POWER = 0.02, 0.4
#: least ratio of the vibrations' rate to the other rates, which alone limit the exponential method
FASTER_VIBRATIONS = 2.0
#: least cost of the default method at which the exponential and the stiff one are tried, and at which the stiff one is
#: chosen without any run
CHEAP, WORTH_STIFF, CRAWLING = 200.0, 3000.0, 300_000.0
#: these costs in a scene with contacts, at which each method starts again: before the exponential method is tried, and,
#: at the progress rate of a run, before it hands over to a method of unknown cost. A method is compiled once, for some
#: seconds (slider-crank of `flexclear new`: 13 s for two that gave up, where the default one took 0.5 s)
BETWEEN_CONTACTS, WORTH_COMPILING = 3e6, 1e6
#: assumed cost of the stiff method without any run, at this tolerance and at looser ones
UNKNOWN, AT = 20_000.0, 1e-4
#: cost ratio to another method above which a method is given up, since progress rate and prediction are rough; and the
#: ratio for a method that is only tried
CLEARLY_COSTLIER, TRIED = 3.0, 1.5
#: fraction of the other method's predicted cost at which the required ratio doubles, and earlier grows further: starts
#: may be hasty
EARLY_FRACTION = 0.1
#: least fraction of the motion that characterises the cost of the method that completes it
CHARACTERISTIC = 0.5
#: evaluations between two checks, as a fraction of those predicted, and at least
LOOK_FRACTION, LEAST_LOOK = 0.02, 200
#: an integrator that was too expensive is possible again at a tolerance looser by this factor
AGAIN = 10.0
#: relative step of finite differences
DIFFERENCE_STEP = 1e-7


@dataclass(frozen=True)
class Rates:
    """Fastest rates [1/s] of the equations at the start, 0 if unknown: of all, and with the bodies' modes held."""

    all: float
    held: float


@dataclass
class Costs:
    """Known and predicted costs of a scene's runs.

    span: of the run [s].  seen: by integrator, evaluations of its runs by tolerance.  handed_over: by integrator, the
    loosest tolerance at which it handed a run over.  expected: by integrator, the evaluations predicted for the present
    run when it handed over.  left: evaluations and fraction of the motion at the last handover.
    """

    rates: Rates
    span: float
    names: tuple[str, ...]
    seen: dict[str, dict[float, float]] = field(default_factory=dict)
    handed_over: dict[str, float] = field(default_factory=dict)
    expected: dict[str, float] = field(default_factory=dict)
    left: tuple[float, float] = (0.0, 0.0)
    has_contacts: bool = False

    @property
    def by_stability(self) -> float:
        """Evaluations with which the default method is stable."""
        return STEP_EVALUATIONS * self.span * self.rates.all / STABILITY_REACH

    @property
    def least(self) -> float:
        """Least evaluations of the default method at any tolerance."""
        return (CONTACT_FACTOR if self.has_contacts else 1.0) * self.by_stability

    def evaluations(self, name: str, rtol: float) -> float:
        """Return the evaluations at a tolerance, extrapolated from the run at the nearest other one."""
        seen = self.seen[name]
        at = min(seen, key=lambda known: abs(np.log(known / rtol)))
        # half of them locate and begin contacts, at any tolerance
        power = (0.5 if self.has_contacts or name == DEFAULT else 1.0) / (ORDERS[name] + 1.0)
        if len(seen) > 1 and name != DEFAULT:  # stability may limit both runs of the default method
            other = min((one for one in seen if one != at), key=lambda known: abs(np.log(known / at)))
            slope = float(np.log(seen[other] / seen[at]) / np.log(at / other))
            power = float(np.clip(slope, LEAST_POWER, LARGEST_POWER))
        expected: float = seen[at] * (at / rtol) ** power
        # where stability limited the run, a looser tolerance saves nothing
        return max(expected, min(self.least, seen[at])) if name == DEFAULT else expected

    def cost(self, name: str, rtol: float) -> float:
        """Return the predicted cost of a run, in evaluations of the default method; 0 where only a run can show it."""
        if name in self.seen:
            return RELATIVE_COST[name] * self.evaluations(name, rtol)
        return self.least if name == DEFAULT else 0.0

    def possible(self, rtol: float) -> list[str]:
        """Return the integrators that are possible at a tolerance, the first of equally cheap ones first."""
        left = [name for name in (VIBRATING, DEFAULT, STIFF) if name in self.names and not self._dropped(name, rtol)]
        if VIBRATING in left and VIBRATING not in self.seen and not self._vibrates():
            left.remove(VIBRATING)
        others = [self.cost(name, rtol) for name in left if name != STIFF]
        if STIFF in left and STIFF not in self.seen and others:
            known = WORTH_COMPILING if self.has_contacts else WORTH_STIFF * self._growth(rtol)
            if not min(others) > (known if DEFAULT in self.seen else CRAWLING):
                left.remove(STIFF)
        return left or [STIFF]

    def _growth(self, rtol: float) -> float:
        """Return the factor of the stiff method's evaluations against those at a loose tolerance, by its order."""
        return float(max(AT / rtol, 1.0) ** (1.0 / (ORDERS[STIFF] + 1.0)))

    def _dropped(self, name: str, rtol: float) -> bool:
        """Return True for a method that was too expensive: by stability anywhere, by accuracy at tighter tolerances."""
        return name in self.handed_over and (name == DEFAULT or rtol < AGAIN * self.handed_over[name])

    def _vibrates(self) -> bool:
        """Return True when the modes' vibrations alone make the default method expensive."""
        enough = BETWEEN_CONTACTS if self.has_contacts else CHEAP
        return self.rates.all > FASTER_VIBRATIONS * self.rates.held and self.by_stability > enough

    def best(self, rtol: float) -> str:
        """Return the cheapest integrator at a tolerance."""
        return min(self.possible(rtol), key=lambda name: self.cost(name, rtol))

    def heir(self, name: str, rtol: float) -> tuple[str, float]:
        """Return the integrator that continues where another is too expensive, "" for none, and its predicted cost."""
        others = [
            one
            for one in self.names
            if one != name and not self._dropped(one, rtol) and (one != VIBRATING or one in self.seen)
        ]
        foreseen = {one: self.cost(one, rtol) or UNKNOWN * self._growth(rtol) for one in others}
        best = min(foreseen, key=foreseen.__getitem__, default="")
        return best, foreseen.get(best, 0.0)

    def why(self, rtol: float) -> str:
        """Return the reason of the choice as a sentence."""
        name, most = self.best(rtol), f"{self.by_stability:.2g} evaluations of {DEFAULT} for stability"
        known = [
            f"{other} takes {n:.0f} evaluations at {at:.1e}"
            for other, runs in self.seen.items()
            if other != name
            for at, n in [min(runs.items(), key=lambda run: abs(np.log(run[0] / rtol)))]
        ]
        if name == STIFF and DEFAULT in self.handed_over:
            return f"{STIFF}: stability limited the steps of {DEFAULT} in a run before"
        if name in self.seen and known:
            return (
                f"{name}: at a relative tolerance of {rtol:.1e} it is predicted to be the cheapest; {', '.join(known)}"
            )
        if name == STIFF and known:
            return f"{STIFF}: tried, as {', '.join(known)}"
        if name == STIFF:
            return f"{STIFF}: the fastest rate at the start, {self.rates.all:.3g} 1/s, would require {most}"
        if name == VIBRATING:
            return (
                f"{VIBRATING}: the modes' fastest vibration, {self.rates.all / 6.283:.3g} Hz, would require {most}; "
                f"with these modes integrated exactly, the fastest rate is {self.rates.held:.3g} 1/s"
            )
        if VIBRATING in self.handed_over:
            return f"{DEFAULT}: a run before began with {VIBRATING}, which cost more than predicted and was replaced"
        if not self.rates.all:
            return f"{DEFAULT}: default, as the start has no fast rate"
        return f"{DEFAULT}: the fastest rate at the start, {self.rates.all:.3g} 1/s, requires at most {most}"

    def judges(self, rtol: float) -> Judges:
        """Return judges that compare a run with the prediction, and separate ones for its perturbed run."""
        self.expected.clear()
        return Judges(self._panel(rtol), replace(self, expected={}, left=(0.0, 0.0))._panel(rtol))

    def _panel(self, rtol: float) -> Panel:
        panel = {}
        for name in self.names:
            heir, most = self.heir(name, rtol)
            if not heir:
                continue
            least = WORTH_STIFF
            if self.has_contacts and heir not in self.seen:
                least = WORTH_COMPILING / CLEARLY_COSTLIER
            enough = max(most, least)
            every = max(int(LOOK_FRACTION * enough), LEAST_LOOK)
            panel[name] = (Judge(every, self._verdict(name, heir, enough)), heir)
        return panel

    def _verdict(self, name: str, heir: str, most: float) -> Callable[[Engine, Sequence[Look]], str]:
        """Return the function that decides, with a reason, to give up an integrator for one with cost `most`."""
        tried = name == STIFF and STIFF not in self.seen and heir in self.seen

        def verdict(engine: Engine, looks: Sequence[Look]) -> str:
            if engine.model.scene.solver.integrator == DEFAULT and not limited_by_stability(looks):
                return ""
            # a method that handed over in this run took more than predicted
            enough = max(most, RELATIVE_COST[heir] * self.expected.get(heir, 0.0)) / RELATIVE_COST[name]
            whole = pace(looks, CLEARLY_COSTLIER * enough) * self.span
            used = max(looks[-1].evaluations - looks[0].evaluations, 1)
            if whole < (TRIED if tried else CLEARLY_COSTLIER) * (1.0 + EARLY_FRACTION * enough / used) * enough:
                return ""
            self.expected[name] = whole
            self.left = looks[-1].evaluations, (looks[-1].time - engine.start) / self.span
            if name == DEFAULT:
                return refusal.stiffness(engine.n, engine.control)
            return (
                f"at this progress rate the run takes {whole:.2g} evaluations with {name} "
                f"and with {heir} an estimated {most / RELATIVE_COST[heir]:.2g}"
            )

        return verdict

    def learn(self, rtol: float, name: str, run: Labelled, part: float = 1.0) -> None:
        """Store the cost of a run that began with an integrator. part: fraction of the motion that it covers."""
        if DEFAULT in self.expected:  # where stability limits the steps, the progress rate gives the whole cost
            self.seen.setdefault(DEFAULT, {})[rtol] = self.expected[DEFAULT]
        if run.attrs["method"] != name and not (name == DEFAULT and name in self.expected):
            self.handed_over[name] = max(rtol, self.handed_over.get(name, 0.0))
        used, done = self.left if self.expected else (0.0, 0.0)
        if done < CHARACTERISTIC * part:
            rest = (float(run.attrs["evaluations"]) - used) / (part - done)
            self.seen.setdefault(run.attrs["method"], {})[rtol] = max(rest, 1.0)


#: orders of the error estimates: powers of the step
ORDERS = {DEFAULT: 7.0, VIBRATING: 4.0, STIFF: 3.0}


def method_costs(scene: Scene, bundles: Mapping[str, Labelled]) -> Costs:
    """Return the costs of a scene's methods that are known before any run."""
    names = selectable_integrators(bool(scene.flexible()))
    engine = engine_of(
        edited(scene, {"solver.integrator": VIBRATING if VIBRATING in names else DEFAULT}), bundles, silent
    )
    start = consistent_start(engine)
    engine.select_pieces_after(engine.start)
    try:
        known = rates(engine, start)
    except SolverError:  # a run may start where linearisation is impossible, as in a singular pose
        known = Rates(0.0, 0.0)
    return Costs(known, engine.end - engine.start, names, has_contacts=bool(engine.model.contacts))


def rates(engine: Engine, y: np.ndarray) -> Rates:
    """Return the magnitudes of the largest eigenvalues of the equations, linearised in a state at the start."""
    n, model = engine.model.nq + engine.model.nv, engine.model
    J, scales = np.empty((n, n)), model.state_scales
    for k in range(n):
        sides = []
        step = DIFFERENCE_STEP * max(abs(y[k]), float(scales[k]))
        for sign in (1.0, -1.0):
            z = y.copy()
            z[k] += sign * step
            sides.append(closure_rows.evaluate(engine, z, engine.start)[:n])
        J[:, k] = (sides[0] - sides[1]) / (2.0 * step)
    bodies = model.arrays.table(m.FLEXES)
    modes = [b["q0"] + j for b in bodies for j in range(b["n_modes"])]
    modes += [model.nq + b["c0"] + j for b in bodies for j in range(b["n_modes"])]
    return Rates(_fastest(J), _fastest(np.delete(np.delete(J, modes, 0), modes, 1)))


def _fastest(J: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(J)).max(initial=0.0))
