"""``flexclear wear``: how surfaces wear over many cycles, by runs with the worn surfaces and steps between them.

A run is one or more cycles. Its work of Archard's law, spread over the surfaces, gives the depth per cycle, with which
the depths are extrapolated: by Euler's rule at first, then by that of Adams and Bashforth of order 2. The next run has
the extrapolated surfaces. The difference from the trapezoidal rule, with its depth per cycle, is the error of the step.
A step above the tolerance is repeated shorter. Steps are longer where the depth per cycle changes little, and no deeper
than a fraction of the clearance.

The contact is wider than a line: the work in one direction goes to where the surfaces would overlap, in proportion to
the overlap, as on an elastic foundation. The arc reaches at least one sector to either side.
Source: Archard (1953), Journal of Applied Physics 24, 981-988; Mukras et al. (2009), Wear 266, 822-831
(extrapolation); Mukras et al. (2010), Journal of Tribology 132, 031604 (elastic foundation).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexclear.artifacts.labelled import LabelledArrays, label_dataset
from flexclear.post.single_run.series import BANDS, SURFACES, spread_over_surface, surface_area
from flexclear.scene.load import edited
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace
from flexclear.study.members import comparing_task
from flexclear.system.errors import FlexclearError, InputError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

#: default tolerance of the depths of a step, and largest depth of a step, as fractions of the clearance
TOLERANCE, DEEPEST = 0.01, 0.1
#: bounds of a step's growth, and the fraction of the predicted length that it uses
LEAST, MOST, SAFE = 0.2, 4.0, 0.8
#: directions in which work is collected, per sector and per band
FINE = 4


class Wearing(NamedTuple):
    """State at the begin of a step: cycles so far, depths [m] by joint, error of the last step as fraction of the
    clearance; the task of its run, and the depths per cycle from that."""

    cycles: float
    depths: dict[str, np.ndarray]
    error: float
    run: Task
    rates: dict[str, np.ndarray]


@dataclass
class Study:
    """Steps of the wear of a scene. per_run: cycles of each run.  tolerance: of a step, fraction of the clearance.

    Depths of a joint have the shape (surface, band, sector).
    """

    scene: Scene
    workplace: Workplace
    per_run: float = 1.0
    tolerance: float = TOLERANCE
    steps: list[Wearing] = field(default_factory=list)

    @cached_property
    def joints(self) -> dict[str, Any]:
        """Return the joints that wear."""
        return self.scene.wearing_joints()

    def wear_until(self, cycles: float) -> None:
        """Wear the surfaces until so many cycles are done."""
        step = 0.0
        if not self.steps:
            self.steps.append(
                self._run_worn(0.0, {name: initial_depths(joint, name) for name, joint in self.joints.items()})
            )
        while self.steps[-1].cycles < cycles:
            now = self.steps[-1]
            left, deep = cycles - now.cycles, self._fraction(now.rates)
            if not step:
                step = self.tolerance / deep if deep else left
            step = min(max(min(step, DEEPEST / deep if deep else left), self.per_run), left)
            depths = self._extrapolate(step)
            reached = cycles if step == left else now.cycles + step
            after = self._run_worn(reached, depths)
            mean = {name: 0.5 * step * (now.rates[name] + after.rates[name]) for name in depths}
            error = self._fraction({name: mean[name] - depths[name] + now.depths[name] for name in depths})
            if error <= self.tolerance or step <= self.per_run:
                self.steps.append(after._replace(error=error))
            step *= min(max(SAFE * (self.tolerance / error) ** 0.5 if error else MOST, LEAST), MOST)

    def _extrapolate(self, step: float) -> dict[str, np.ndarray]:
        """Return the depths after a step of cycles, which are nowhere less than before."""
        now, before = self.steps[-1], self.steps[-2] if len(self.steps) > 1 else None
        depths = dict[str, np.ndarray]()
        for name, rate in now.rates.items():
            falling = before.rates[name] - rate if before else np.zeros_like(rate)
            bend = 0.5 * step / (now.cycles - before.cycles) if before else 0.0
            # the same factor everywhere: it keeps the volume
            least = np.min(rate[falling > 0.0] / falling[falling > 0.0], initial=np.inf)
            depths[name] = now.depths[name] + step * (rate - min(bend, least) * falling)
        return depths

    def _fraction(self, depths: dict[str, np.ndarray]) -> float:
        """Return the largest of depths, as fraction of the joint's clearance."""
        return max(float(np.abs(depths[name]).max()) / joint.clearance for name, joint in self.joints.items())

    def _run_worn(self, cycles: float, depths: dict[str, np.ndarray]) -> Wearing:
        """Return the state with these depths, whose run is brought up to date."""
        edits = {**worn_edits(self.joints, depths), "output.horizon": False}
        graph = Graph(edited(self.scene, edits), shown=False)
        (data,) = self.workplace.datasets(graph.simulate)
        run = label_dataset(data)
        worn = [str(name) for name in run["worn"].values]
        rates = {
            name: depths_of_run(run, worn.index(name), joint, depths[name]) / self.per_run
            for name, joint in self.joints.items()
        }
        return Wearing(cycles, depths, 0.0, graph.post, rates)

    def task(self) -> Task:
        """Return the task of the dataset of all steps so far, with its figure."""
        joints = {n: {"clearance": joint.clearance, "radius": joint.radius} for n, joint in self.joints.items()}
        steps = [
            {"cycles": one.cycles, "error": one.error}
            | {key: {n: d.tolist() for n, d in getattr(one, key).items()} for key in ("depths", "rates")}
            for one in self.steps
        ]
        params = {"joints": joints, "steps": steps, "title": self.scene.title}
        inputs = {f"post{k}": one.run for k, one in enumerate(self.steps)}
        return comparing_task("wear", self.scene.name, params, inputs)


def wear_surfaces(
    scene: Scene,
    workplace: Workplace,
    cycles: float,
    *,
    per_run: float = 1.0,
    tolerance: float = TOLERANCE,
) -> Made:
    """Return the wear of a scene over a number of cycles, with its figure; runs that exist are not repeated.

    Interrupted work leaves the steps so far. Raises InputError for a scene without wear, and for numbers that are not
    above zero.
    """
    for name, value in (("cycles", cycles), ("per_run", per_run), ("tolerance", tolerance)):
        if not 0.0 < value < np.inf:
            raise InputError(f"--{name.replace('_', '-')} {value:g}", "must be above zero", "give a positive number")
    if not scene.wearing_joints():
        text = "no joint has wear"
        raise InputError(scene.name, text, "give a clearance-revolute or clearance-spherical joint a wear = { ... }")
    study = Study(scene, workplace, per_run, tolerance)
    try:
        study.wear_until(cycles)
    except (KeyboardInterrupt, FlexclearError):
        if study.steps:
            with suppress(FlexclearError):
                workplace.made(study.task())
        raise
    return workplace.made(study.task())[0]


def is_ball(joint: Any) -> bool:
    """Return True for a ball in a socket, False for a pin in a journal."""
    return "ball_radius" in type(joint).model_fields


def initial_depths(joint: Any, name: str) -> np.ndarray:
    """Return the depths of a joint at the start of a study [m]: those of its profile, else none."""
    shapes = joint.wear.shapes.get(name)
    if shapes is not None:
        return np.array([shapes.outer, shapes.inner])
    return np.zeros((2, BANDS if is_ball(joint) else 1, joint.wear.sectors))


def worn_edits(joints: dict[str, Any], depths: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return the edits of a scene that give its joints worn surfaces; round ones stay without a profile."""
    edits = dict[str, Any]()
    for name, joint in joints.items():
        if np.any(depths[name]):
            outer, inner = depths[name].tolist()
            radii = [joint.radius + joint.clearance, joint.radius]
            edits[f"joint.{name}.wear.shapes"] = {name: {"radii": radii, "outer": outer, "inner": inner}}
    return edits


def depths_of_run(run: LabelledArrays, k: int, joint: Any, depths: np.ndarray) -> np.ndarray:
    """Return the depths that a run has added to the surfaces of its worn joint k [m]; depths: before it."""
    _, bands, sectors = depths.shape
    path = run["wear_load_path"].values[:, k]
    contact = run["contact"].values.tolist().index(str(run["worn"].values[k]))
    grown = np.diff(path)
    middle = 0.5 * (run["contact_penetration"].values[1:, contact] + run["contact_penetration"].values[:-1, contact])
    penetration = float(grown @ middle / grown.sum()) if grown.sum() > 0.0 else 0.0
    per_path = joint.wear.coefficient / joint.wear.hardness
    shares, added = (joint.wear.outer_share, 1.0 - joint.wear.outer_share), np.zeros_like(depths)
    for j, side in enumerate(SURFACES):
        fine = FINE * sectors, FINE * bands if bands > 1 else 1
        work = spread_over_surface(run[f"wear_direction_{side}"].values[:, k], path[:, None], *fine)[..., 0]
        area = surface_area(joint.model_dump(), side) / (sectors * bands)
        spread = spread_over_arcs(work, depths[j], joint.clearance, penetration)
        added[j] = shares[j] * per_path * spread / area
    return added


def spread_over_arcs(work: np.ndarray, depths: np.ndarray, clearance: float, penetration: float) -> np.ndarray:
    """Return work by band and sector [N m], of work in finer directions, spread over where the surfaces overlap.

    depths: by band and sector of one surface [m].  penetration: typical one [m].  The surfaces overlap by
    e cos(angle) - clearance - depth, where the distance e of the centres is that of this penetration at the mean depth
    of the cells around the direction.
    """
    cells, fine = directions(*depths.shape), directions(*work.shape)
    loaded = np.flatnonzero(work)
    cosines, narrow = cells @ fine[loaded].T, np.cos(2.0 * np.pi / depths.shape[1])
    # bands of a sphere are wider than its sectors near the poles: then the nearest cell alone is around
    around = np.maximum(0.0, cosines - np.minimum(narrow, cosines.max(axis=0) - 1e-9))
    gap = clearance + depths.ravel()
    mean = gap @ around / around.sum(axis=0)
    overlap = np.maximum(0.0, (mean + np.maximum(penetration, mean * (1.0 / narrow - 1.0))) * cosines - gap[:, None])
    overlap = np.where(overlap.any(axis=0), overlap, around)
    spread: np.ndarray = overlap / overlap.sum(axis=0) @ work.ravel()[loaded]
    return spread.reshape(depths.shape)


def directions(bands: int, sectors: int) -> np.ndarray:
    """Return the unit vectors to the middles of bands of equal area and sectors, (cells, 3)."""
    z = np.repeat(2.0 * (np.arange(bands) + 0.5) / bands - 1.0, sectors)
    angle = np.tile(2.0 * np.pi * (np.arange(sectors) + 0.5) / sectors, bands)
    across = np.sqrt(1.0 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
