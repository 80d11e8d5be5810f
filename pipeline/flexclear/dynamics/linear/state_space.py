r"""State space about a pose in balance: :math:`\dot x = Ax + Bu`, :math:`y = Cx + Du`, all as changes from there.

States are independent coordinates of the tree, their rates, and those internal states on which forces depend, such as
the integral part of a controller. Inputs are the values of the loads' laws, and their rates where forces depend on
these. A and B come from routines on dual numbers; C and D from the code that records quantities, by differences over
four points whose step is chosen for each entry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.linalg
import xarray as xr

from flexclear.artifacts.schema import STATE_SPACE, conform
from flexclear.dynamics import memory as m
from flexclear.dynamics.linear.bench import Bench, close, observe, state
from flexclear.dynamics.linear.equilibrium import Equilibrium
from flexclear.dynamics.linear.tangent import EPSILON, Tangent, change_rates, stiffness, tangent
from flexclear.dynamics.linear.vibrations import equations, principal_motions
from flexclear.dynamics.model.driving import joint_type, label
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.loads import describe
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import attributes, series, subject
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.sensitivity.parameters import central_difference
from flexclear.dynamics.specialise import dual
from flexclear.scene.loads import SampledPid
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene
from flexclear.scene.units import exponents, si_unit
from flexclear.system.errors import InputError, SolverError

#: steps of differences, in natural units
STEPS = tuple(10.0**-k for k in range(1, 10))
#: corrections of internal states, and their rate, as a fraction of the first one, that counts as none
CORRECTIONS, SETTLED = 20, 1e-9
#: an entry of C or D within this many of its estimated errors of zero is zero
ZERO_ENTRY = 10.0
#: beginning of the names of the forces that take the place of drives
RELEASED = "drive."


@dataclass(frozen=True)
class Coordinate:
    """An independent coordinate, as scenes and records name it; sign: of the tree's sense, number: among the speeds."""

    name: str
    unit: str
    number: int
    sign: float = 1.0


@dataclass(frozen=True)
class Input:
    """The value of a law of a load, by the keys of the scene, or its rate; number: of the law among all."""

    name: str
    unit: str
    number: int
    of_rate: bool = False


@dataclass(frozen=True)
class Directions:
    """Directions from a pose: positions and speeds of free motions, internal states `inner`, and inputs.

    motions: speeds of all coordinates per free motion, (nv, n).  inner: numbers in the state.
    """

    bench: Bench
    at: Tangent
    motions: np.ndarray
    inner: np.ndarray
    inputs: Sequence[Input]

    @property
    def states(self) -> np.ndarray:
        """Changes of the state along the directions but inputs, shape (2 n + inner, NY)."""
        model, n, own = self.bench.model, self.motions.shape[1], np.arange(self.motions.shape[1])
        rows = np.zeros((2 * n + len(self.inner), model.ny))
        rows[own, : model.nq] = (self.at.moves @ self.motions).T
        rows[n + own, model.speeds] = self.motions.T
        rows[2 * n + np.arange(len(self.inner)), self.inner] = 1.0
        return rows

    def effects(self) -> tuple[np.ndarray, np.ndarray]:
        """Return changes of forces at constant closure rows, (directions, nv), and of rates of `inner`."""
        states, model = self.states, self.bench.model
        laws = np.zeros((len(self.inputs), model.arrays.size(m.N_LAWS) * m.LAW.size))
        for row, one in zip(laws, self.inputs, strict=True):
            row[one.number * m.LAW.size + (m.LAW.rate if one.of_rate else m.LAW.value)] = 1.0
        still, same = np.zeros((len(laws), states.shape[1])), np.zeros((len(states), laws.shape[1]))
        rates = change_rates(self.bench, self.at.q, np.vstack([states, still]), laws=np.vstack([same, laws]))
        count = len(states) + len(laws)
        forces = dual.changes(rates[model.speeds], count) @ modes_of(model.arrays).T
        return forces, dual.changes(rates[self.inner], count)

    @contextmanager
    def given(self, one: Input, amount: float) -> Iterator[None]:
        """Change an input in the laws of time inside this context."""
        bench = self.bench
        piece = bench.model.arrays.table(m.PIECES)[bench.engine.piece(one.number, bench.time)]
        kept, change = piece["coefficients"].copy(), (piece["start"] - bench.time, 1.0) if one.of_rate else (1.0, 0.0)
        piece["coefficients"][:2] += amount * np.array(change)
        try:
            yield
        finally:
            piece["coefficients"][:] = kept


def require_continuous(scene: Scene) -> None:
    """Raise InputError for a scene with a controller that samples."""
    for name, load in scene.load.items():
        if isinstance(load, SampledPid):
            rule = "samples its error, and a state space is continuous in time"
            raise InputError(f"[load.{name}]", rule, 'write type = "pid", without a period')


def state_space(bench: Bench, rest: Equilibrium, outputs: Sequence[Quantity]) -> xr.Dataset:
    """Return the matrices about an equilibrium (schema STATE_SPACE)."""
    model, inputs = bench.model, _inputs(bench.model)
    inner = _inner(Directions(bench, rest.at, rest.at.Z, np.arange(model.speeds.stop, model.ny), inputs))
    at = _settle_internal_states(bench, rest.at, inner)
    A, motions, coordinates = _free(bench, at)
    n = len(coordinates)
    along = Directions(bench, at, motions, inner, inputs)
    forces, rates = along.effects()
    # the rows of motions are those of the independent coordinates: Z has a unit mass, T = motions' inverse on them
    pushed = -np.linalg.lstsq(motions, at.Z @ (at.Z.T @ forces.T), rcond=None)[0] if n else np.zeros((0, len(forces)))
    first = 2 * n + len(inner)
    lower = np.hstack([A, pushed[:, 2 * n : first]])
    A = np.vstack([np.eye(n, first, n), lower, rates[:first].T])
    B = np.vstack([np.zeros((n, len(inputs))), pushed[:, first:], rates[first:].T])
    value, changes = _observe_outputs(along, outputs)
    used = [k for k, one in enumerate(inputs) if not one.of_rate or B[:, k].any()]
    names = [(c.name, c.unit) for c in coordinates]
    states = [*names, *((f"{name} rate", f"{unit}/s") for name, unit in names), *(_internal(model, k) for k in inner)]
    shown = [(name, q.unit) for q in outputs for name in _components(q)]
    laws, numbers = bench.engine.table(m.LAW), [inputs[k] for k in used]
    data = {
        "A": (("state", "state2"), A + 0.0),  # no negative zeros
        "B": (("state", "input"), B[:, used] + 0.0),
        "C": (("output", "state"), changes[:first].T),
        "D": (("output", "input"), changes[first:][used].T),
        "input_value": ("input", np.array([laws["rate" if u.of_rate else "value"][u.number] for u in numbers])),
        "output_value": ("output", value),
    }
    axes: dict[str, list[str]] = {"state2": [name for name, _ in states]}
    for what, entries in (("state", states), ("input", [(u.name, u.unit) for u in numbers]), ("output", shown)):
        axes[what] = [name for name, _ in entries]
        data[f"{what}_unit"] = (what, np.array([unit for _, unit in entries], dtype=str))
    title, facts = f"State space of {subject(bench.scene)}", attributes(bench.scene)
    return conform(xr.Dataset(data, axes), STATE_SPACE, title=title, time=bench.time, **facts)


def _free(bench: Bench, at: Tangent) -> tuple[np.ndarray, np.ndarray, list[Coordinate]]:
    """Return (-K, -D) of independent coordinates, the motions of all per one of these, and their names."""
    if not at.Z.shape[1]:
        return np.zeros((0, 0)), at.Z, []
    principal = principal_motions(bench, at)
    small, natural = equations(bench, at, principal), principal / bench.model.speed_scales[:, None]
    own = np.sort(scipy.linalg.qr(natural.T, mode="r", pivoting=True)[1][: at.Z.shape[1]])
    every = _coordinates(bench.model)
    chosen = [every[k] for k in own]
    T = np.array([[c.sign] for c in chosen]) * principal[own]
    inverse = np.linalg.inv(T)
    return -np.hstack([T @ small.K @ inverse, T @ small.D @ inverse]), principal @ inverse, chosen


def _inner(every: Directions) -> np.ndarray:
    """Return the states behind the speeds on which forces depend and which change, as numbers in the state."""
    n = every.motions.shape[1]
    forces, rates = every.effects()
    felt = np.any(forces[2 * n : 2 * n + len(every.inner)] != 0.0, axis=1)
    kept = [*range(2 * n), *(2 * n + np.flatnonzero(felt)), *range(2 * n + len(every.inner), len(forces))]
    return every.inner[felt & np.any(rates[kept] != 0.0, axis=0)]


def _settle_internal_states(bench: Bench, at: Tangent, inner: np.ndarray) -> Tangent:
    """Return the pose where internal states, which are set, stay as well; raise SolverError when none is found."""
    first, own = 0.0, inner - bench.model.ny + len(bench.internal)
    for _ in range(CORRECTIONS if len(inner) else 0):
        along = Directions(bench, at, at.Z, inner, ())
        forces, rates = along.effects()
        n, now = at.Z.shape[1], bench.engine.slope[inner].copy()
        first = max(first, float(np.abs(now).max()))
        if np.abs(now).max() <= SETTLED * first:
            return at
        K, _ = stiffness(bench, at, at.Z)
        slopes = np.block([[K, at.Z.T @ forces[2 * n :].T], [rates[:n].T, rates[2 * n :].T]])
        step = -np.linalg.lstsq(slopes, np.concatenate([at.unbalanced, now]), rcond=None)[0]
        bench.internal[own] += step[n:]
        at = tangent(bench, close(bench, at.q + at.moves @ (at.Z @ step[:n])))
    if len(inner):
        raise SolverError(
            f"at t = {bench.time:.6g} s: {_internal(bench.model, int(inner[0]))[0]} does not settle about this pose; "
            "give the controller a reference that can be reached, or no integral"
        )
    return at


def _coordinates(model: Model) -> list[Coordinate]:
    """Return the free coordinates of the tree, in the order of the speeds."""
    found: dict[int, Coordinate] = {}
    for i, link in enumerate(model.links[1:], start=1):
        for k, c in enumerate(model.numbering.modal_coordinates.get(i, ())):
            found[c] = Coordinate(f"{link.flexible} shape {k + 1}", "m", c)
        if link.drives:
            continue
        edge, speeds, sign = link.branch.edge, joint_type(link.kind).SPEEDS, 1.0
        names = [
            f"{edge.name if edge else link.group.host} {'rotation' if letter == 'r' else 'position'} {'xyz'[k % 3]}"
            for k, letter in enumerate(speeds)
        ]
        if edge is not None and not link.on_path and joint_type(edge.kind).COORDINATES:
            names, sign = [label(edge.name, edge.kind, k) for k in link.joint.positions], link.joint.sign
        for name, letter, c in zip(names, speeds, model.numbering.coordinates[i], strict=True):
            found[c] = Coordinate(name, "rad" if letter == "r" else "m", c, sign)
    return [found[c] for c in range(model.nv)]


def _inputs(model: Model) -> list[Input]:
    """Return values and rates of all laws of loads."""
    inputs = []
    for (name, _), load in zip(model.loads, model.arrays.table(m.LOADS), strict=True):
        laws = describe(model.scene, name).row.laws
        for k, (_, dimension, path) in enumerate(laws):
            if dimension == "time":  # of an expression
                continue
            key = path.strip("[]").removeprefix(f"load.{RELEASED}")
            key = f"drive.{key}" if name.startswith(RELEASED) else key
            key += f".{'xyz'[k]}" if len(laws) == 3 else ""
            unit, number = si_unit(exponents(dimension)), int(load["law0"]) + k
            inputs += [Input(key, unit, number), Input(f"{key} rate", f"{unit}/s", number, of_rate=True)]
    return inputs


def _internal(model: Model, k: int) -> tuple[str, str]:
    """Return name and unit of an internal state: the integral part of a controller, or deflection of bristles."""
    own = k - model.ny + model.arrays.size(m.N_INTERNAL)
    for (name, _), row in zip(model.loads, model.arrays.table(m.LOADS), strict=True):
        if own >= 0 and row["internal0"] == own:
            return f"load.{name} integral", _force(model, name)
    return f"bristle {k}", "m"


def _force(model: Model, load: str) -> str:
    coordinate = describe(model.scene, load).coordinate
    return "" if coordinate is None else si_unit(exponents(coordinate.force))


def _components(quantity: Quantity) -> list[str]:
    """Return the names of a quantity's components."""
    letters = {"": ("",), "axis": ("x", "y", "z"), "quat": ("w", "x", "y", "z")}[quantity.dim]
    return [f"{quantity.name}.{one}".rstrip(".") for one in letters]


def _observe_outputs(along: Directions, outputs: Sequence[Quantity]) -> tuple[np.ndarray, np.ndarray]:
    """Return values of outputs, and their derivatives along the directions, shape (directions, outputs)."""
    bench, model = along.bench, along.bench.model
    y = state(bench, along.at.q)

    def seen(states: np.ndarray) -> np.ndarray:
        motions = Motions(model, observe(bench, states))
        found = series(bench.scene, motions, outputs, np.full(len(states), bench.time))
        return np.hstack([found[q.name].reshape(len(states), -1) for q in outputs] or [np.zeros((len(states), 0))])

    def by_state(row: np.ndarray, amounts: np.ndarray) -> np.ndarray:
        return seen(y + np.outer(amounts, row))

    def by_input(one: Input, amounts: np.ndarray) -> np.ndarray:
        rows = []
        for amount in amounts:
            with along.given(one, amount):
                rows.append(seen(y[None, :])[0])
        return np.array(rows)

    natural = np.where(np.arange(model.ny) < model.speeds.stop, model.state_scales, np.maximum(np.abs(y), 1.0))
    changes = []
    for row in along.states:
        unit = 1.0 / np.max(np.abs(row) / natural)
        changes.append(_slope(partial(by_state, row), unit))
    changes += [_slope(partial(by_input, one), 1.0) for one in along.inputs]
    value = seen(y[None, :])[0]
    return value, np.array(changes).reshape(len(along.states) + len(along.inputs), len(value))


def _slope(values: Callable[[np.ndarray], np.ndarray], unit: float) -> np.ndarray:
    """Return the derivatives of values at zero, each by the step that shows the least error; unit: natural step."""
    steps, at = unit * np.array(STEPS), (-2, -1, 1, 2)
    rows = values(np.outer(steps, at).ravel()).reshape(len(steps), 4, -1)
    best, least = np.zeros(rows.shape[2]), np.full(rows.shape[2], np.inf)
    for step, row in zip(steps, rows, strict=True):
        change = central_difference(dict(zip(at, row, strict=True)), step)
        error = np.abs(change - (row[2] - row[1]) / (2.0 * step)) + EPSILON * np.abs(row).max(axis=0) / step
        best, least = np.where(error < least, change, best), np.minimum(error, least)
    return np.where(np.abs(best) <= ZERO_ENTRY * least, 0.0, best)
