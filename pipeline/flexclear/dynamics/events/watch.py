"""Conditions of events: the first time at which one becomes true in a phase, located between rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flexclear.artifacts import quantities
from flexclear.artifacts.labelled import LabelledArray, LabelledArrays
from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Blocks, by_name
from flexclear.dynamics.events.impulse import rows as rows_of
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.record.dataset import variables_for
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.run.coordinates import joint_coordinates, named_coordinates
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine, copy_of_engine
from flexclear.dynamics.run.evaluation.observation import observe_blocks
from flexclear.dynamics.run.horizon.periods import handover
from flexclear.dynamics.run.pieces import Moment
from flexclear.dynamics.run.trajectory import integrate
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import silent

#: number of parts of a refined interval, and number of refinements, after which a straight line is exact enough
PARTS, CLOSER_LOOKS = 12, 5


class Watch:
    """Conditions of a phase, by event, evaluated with a separate engine.

    coordinates: joint coordinates at the start of the phase, full turns of earlier phases counted.
    hit: the event that happens first and its time [s], once the examined rows contain one.
    """

    def __init__(self, engine: Engine, y: np.ndarray, conditions: Mapping[str, Quantity], known: Mapping[str, float]):
        self._engine, self._conditions = copy_of_engine(engine), conditions
        self._rows = recording.empty_record(0, len(engine.model.contacts), engine.model.ny)
        self._seen: Blocks | None = None
        self._looked = 1
        self.hit: tuple[str, float] | None = None
        engine = self._engine
        engine.select_pieces_after(engine.start)
        closure_rows.select_rows(engine, y, engine.start)
        start = self._observed(rows_of(engine, y[None], engine.start), after=True)
        series = joint_coordinates(engine.model, by_name(start, engine.model.arrays.size))
        turning = {label for label, _, turns in named_coordinates(engine.model.scene) if turns}
        self.coordinates = {label: float(values[0][0]) for label, values in series.items()}
        self._turns = {
            label: 2.0 * np.pi * np.round((known[label] - at) / (2.0 * np.pi))
            for label, at in self.coordinates.items()
            if label in turning and label in known
        }
        self.coordinates |= {label: self.coordinates[label] + turns for label, turns in self._turns.items()}
        self.held = [name for name, values in self._values(start, np.array([engine.start])).items() if values[0] > 0.0]

    def stop(self, rows: np.ndarray) -> bool:
        """Return True when an event has happened in the rows so far."""
        # rows are examined again when their number has grown by this factor
        if len(rows) < 1.05 * len(self._rows):
            return False
        self.examine(rows)
        return self.hit is not None

    def examine(self, rows: np.ndarray) -> None:
        """Examine the new rows."""
        new = rows[len(self._rows) :]
        if len(new):
            self._rows, self._seen = rows.copy(), self._joined(self._seen, self._observed(new))
        if self.hit is not None or self._seen is None or len(rows) <= self._looked:
            return
        values = self._values(self._seen, rows[:, 0])
        first = max(self._looked - 1, 0)
        found = [
            (time, name) for name, series in values.items() if (time := self._first(name, series, first)) is not None
        ]
        self._looked = len(rows)
        if found:
            time, name = min(found)
            self.hit = name, time

    def _first(self, name: str, values: np.ndarray, first: int) -> float | None:
        """Return the time of the first passage through zero from row `first` on; None without one."""
        up = [k for k in range(first, len(values) - 1) if values[k + 1] > 0.0 and not values[k] > 0.0]
        for k in range(max(first, 1), (up[0] if up else len(values) - 1)):
            a, b, c = values[k - 1 : k + 2]
            if a < b >= c and b <= 0.0 and 2.0 * b - min(a, c) > 0.0:
                time = self._locate(name, k - 1, self._rows[k + 1, 0])
                if time is not None:
                    return time
        return self._locate(name, up[0], self._rows[up[0] + 1, 0]) if up else None

    def _locate(self, name: str, k: int, end: float) -> float | None:
        """Return the time at which a condition becomes true between row k and a time; None where it does not."""
        row, known = self._rows[k : k + 1], self._head(k + 1)
        begin, found = float(row[0, 0]), False
        if begin in self._engine.breaks and self._values(self._observed(row, after=True), row[:, 0])[name][0] > 0:
            return begin
        for _ in range(CLOSER_LOOKS):
            times = np.linspace(begin, end, PARTS + 1)
            inner = self._rows_from(row, times)
            every = self._joined(known, self._observed(inner))
            values = self._values(every, np.append(self._rows[: k + 1, 0], times))[name][-len(times) :]
            after = np.flatnonzero((values[1:] > 0.0) & ~(values[:-1] > 0.0))
            if not len(after):
                break
            j, found = int(after[0]), True
            begin, end, row = float(times[j]), float(times[j + 1]), inner[j : j + 1]
            low, high = values[j], values[j + 1]
        if not found:
            return None
        return begin - low / (high - low) * (end - begin) if np.isfinite(low) else end

    def _rows_from(self, row: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return rows at these times, integrated from a row."""
        engine = copy_of_engine(self._engine)
        first = recording.record(row, len(engine.model.contacts))
        modes, latched = first.modes[0], first.latched[0]
        watched, begun = np.zeros_like(engine.view(m.WATCH.at)), list[tuple[float, ...]]()
        for c in np.flatnonzero(modes > 0.0):
            m.named(m.WATCH, watched)["event_row"][c] = len(begun)
            begun.append((float(c), float(m.CLOSING), float(times[0]), float(latched[c]), 0.0, 0.0, np.nan))
        open_events = np.array(begun).reshape(len(begun), m.EVENT.size)
        moment = Moment(first.state[0].copy(), modes, latched, watched, open_events)
        part = replace(engine, start=float(times[0]), end=float(times[-1]))
        closure_rows.select_rows(part, moment.y, part.start)
        made = integrate(part, moment.y, silent, left=handover(part, moment), outputs=times)
        return made.rows[np.minimum(np.searchsorted(made.time, times), len(made.rows) - 1)]

    def _observed(self, rows: np.ndarray, *, after: bool = False) -> Blocks:
        one = recording.record(rows[:1], len(self._engine.model.contacts))
        if self._engine.model.closures:
            closure_rows.select_rows(self._engine, one.state[0], float(one.time[0]))
        return observe_blocks(self._engine, rows, after=after)

    def _values(self, seen: Blocks, time: np.ndarray) -> dict[str, np.ndarray]:
        """Return the conditions over rows, positive where they hold; NaN for parts that this phase's scene lacks."""
        observed, model = by_name(seen, self._engine.model.arrays.size), self._engine.model
        owners, values = model.scene.owners(), dict[str, np.ndarray]()
        for name, one in self._conditions.items():
            if not one.is_there(owners):
                values[name] = np.full(len(time), np.nan)
                continue
            arrays = self._turned(variables_for(model.scene, Motions(model, observed), one.terms(), time))
            made = np.broadcast_to(quantities.series(arrays, one)[:, 0], len(time))
            values[name] = np.where(observed.status == m.OK, made, np.nan)
        return values

    def _turned(self, arrays: LabelledArrays) -> LabelledArrays:
        """Return the series with the full turns of earlier phases added to joint angles."""
        if "joint_position" not in arrays:
            return arrays
        old, names = arrays["joint_position"], arrays["coordinate"].values.tolist()
        shift = np.array([self._turns.get(name, 0.0) for name in names])
        made = LabelledArray(old.dims, old.values + shift)
        return LabelledArrays({**arrays.variables, "joint_position": made}, arrays.coords, arrays.attrs)

    def _head(self, count: int) -> Blocks:
        assert self._seen is not None
        return {name: block[:count] for name, block in self._seen.items()}

    @staticmethod
    def _joined(one: Blocks | None, other: Blocks) -> Blocks:
        return other if one is None else {name: np.concatenate([one[name], other[name]]) for name in other}
