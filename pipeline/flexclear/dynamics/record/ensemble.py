"""Ensemble: runs of the same scene from starts that differ by tiny amounts.

Beyond the predictability horizon single values of a chaotic run mean nothing; mean and spread of the members do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from flexclear.artifacts.quantities import IMPACT
from flexclear.artifacts.schema import ENSEMBLE, conform
from flexclear.dynamics import memory as m
from flexclear.dynamics.model.contacts import arms
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import attributes, contact_names, subject
from flexclear.dynamics.record.motion import Motions, motion_series
from flexclear.dynamics.run.evaluation import specialised_code
from flexclear.dynamics.run.evaluation.batched_evaluation import Place, Places
from flexclear.dynamics.run.evaluation.closure_rows import select_rows
from flexclear.dynamics.run.evaluation.engine import Engine, copy_of_engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon.horizon import offset_jacobian, perturbed_start
from flexclear.dynamics.run.ledger import require_closed, speeds_of_bodies
from flexclear.dynamics.run.pieces import digest
from flexclear.dynamics.run.progress_rate import DearError, affordable, scene_without_comparison
from flexclear.dynamics.run.run import engines, follow, observe_run, require_shallow, rows_to_judge
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.scene.event_kinds import CLOSING
from flexclear.scene.limits import require_scatter
from flexclear.scene.schema import Ensemble, Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress
from flexclear.workflow import journal
from flexclear.workflow.cores import concurrent_threads, side_by_side

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled

#: default difference of the members' starts: a fraction of a contact's clearance or penetration; penetrations count as
#: at least the second fraction, of the mechanism's size
FRACTION_OF_CLEARANCE, LEAST_OF_SIZE = 1e-3, 2.5e-8
#: numbers of members that are evaluated together, chosen by the number of threads without effect on the bits; fewer
#: than `FEW` are evaluated one by one
FEW, LANES = 2, (4, 8)
#: variables of one member by name, with the schema's dimensions except `member`, and the reason `switched` of a change
#: of method
Member = dict[str, np.ndarray]


def ensemble(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Return all members (schema ENSEMBLE) of a scene with clearance joints."""
    try:
        return _members(scene, bundles, progress)
    except DearError as dear:
        progress(None, str(dear))
        return _members(scene_without_comparison(scene), bundles, progress)


def _members(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    requested = scene.ensemble or Ensemble()
    require_scatter(scene, "[ensemble]")
    engine, other = engines(scene, bundles, progress)
    names = recorded_bodies(engine.model, requested.bodies, "[ensemble.bodies]")
    start = consistent_start(engine)
    select_rows(engine, start, engine.start)
    jacobian = offset_jacobian(engine, start)
    offsets = ball_offsets(engine.model, requested, requested.members)
    starts = [perturbed_start(engine, start, jacobian, moved) for moved in offsets]
    making, judges, stored = Lock(), affordable(scene), journal.current_journal()
    piece = digest(engine, *starts) if stored is not None else ""

    def next_engine(name: str) -> Engine:
        with making:
            return copy_of_engine(other(name))

    def run_member(k: int, alive: Progress, place: Place | None) -> Member:
        """Run a member with an engine of its own, so that the result does not depend on previous members."""
        mine = copy_of_engine(engine)
        mine.specialised.place = place
        last, trajectory, switched = follow(mine, starts[k], alive, next_engine, judges and judges.run)
        return _member(last, trajectory, names) | {"switched": np.array(switched)}

    def done(k: int) -> None:
        progress(k / requested.members, f"member {k} of {requested.members}")

    places = places_of(engine, requested.members, concurrent_threads(), progress)

    def member(k: int, alive: Progress) -> Member:
        name = f"member-{k}-{piece}"
        if stored is not None and (earlier := stored.find(name)) is not None:
            return earlier
        with places.place() if places else nullcontext() as place:
            made = run_member(k, alive, place)
        if stored is not None:
            stored.store(name, lambda: made)
        return made

    members = side_by_side(member, requested.members, done, places.seats if places else 0)
    reasons = [text for one in members if (text := str(one["switched"]))]
    kept = [name for name in members[0] if name != "switched"]
    variables = {name: (ENSEMBLE[name].dims, np.stack([one[name] for one in members])) for name in kept}
    time = engine.output_times(scene.output.interval)
    coordinates = {"member": np.arange(requested.members), "time": time, "body": names, **contact_names(engine.model)}
    made = xr.Dataset(variables, coords=coordinates)
    facts = {"switched": f"{len(reasons)} of {requested.members} members, the first {reasons[0]}"} if reasons else {}
    facts |= attributes(scene) | {"title": f"{requested.members} motions of {subject(scene)}"}
    return conform(made, ENSEMBLE, **facts, seed=requested.seed, perturbation=requested.perturbation)


def places_of(engine: Engine, members: int, threads: int, progress: Progress) -> Places | None:
    """Return places for as many engines like this one, in so many threads; None where each is evaluated alone.

    Copies of the engine by `copy_of_engine` evaluate with the same bits in both cases.
    """
    engine.specialised.exact, rows = True, engine.selected.tobytes()
    lanes = next((one for one in LANES if one * threads >= members), LANES[-1])
    together = members >= FEW * threads and engine.staged
    if together and specialised_code.code_address(engine.model, engine.h, rows, progress, lanes=lanes, exact=True):
        return Places(lanes, threads)
    engine.settle(progress)
    return None


def difference_of_starts(engine: Engine, start: np.ndarray) -> Ensemble:
    """Return the default difference of the members' starts [m].

    It is FRACTION_OF_CLEARANCE of the least clearance: no start is known better. It is at least LEAST_OF_SIZE of the
    mechanism's size, since with closer members the errors of a loose tolerance would look like effects of parameters.
    Contacts that are closed at the start hold it in equilibrium, so the difference is at most the same fraction of
    their penetration: a larger one would change the force itself and shake the mechanism.
    """
    model = engine.model
    engine.attempt(start, engine.start)
    least, depths = LEAST_OF_SIZE * model.length, -engine.table(m.TOUCH)["gap"] * arms(model.mechanism)
    clearance = min((joint.clearance for joint in model.scene.contacts().values()), default=0.0)
    pressed = max(least, depths[depths > 0.0].min(initial=np.inf))
    return Ensemble(perturbation=min(max(least, FRACTION_OF_CLEARANCE * clearance), FRACTION_OF_CLEARANCE * pressed))


def ball_offsets(model: Model, requested: Ensemble, members: int) -> Iterator[np.ndarray]:
    """Yield the offset of the balls for each member's start [m], (3 contacts,): random directions, equal lengths."""
    random = np.random.default_rng(requested.seed)
    for _ in range(members):
        offsets = random.normal(size=(len(model.contacts), 3))
        yield (offsets * (requested.perturbation / np.linalg.norm(offsets, axis=1, keepdims=True))).ravel()


def recorded_bodies(model: Model, requested: tuple[str, ...] | None, path: str) -> list[str]:
    """Return the bodies to record: those requested, else those with contacts, or all where none has contacts."""
    known = [n for n, b in model.scene.body.items() if b.type != "ground"]
    if requested is None:
        frames = model.mechanism.frames
        return sorted({frames[f].body for c in model.contacts for f in c.joint.between} & set(known)) or known
    for name in requested:
        if name not in known:
            raise InputError(path, f"there is no body '{name}'", f"known: {', '.join(known)}")
    return list(requested)


def _member(engine: Engine, trajectory: Trajectory, names: list[str]) -> Member:
    model = engine.model
    regular = engine.output_times(model.scene.output.interval)
    peak, count, fraction = _contact_statistics(engine, trajectory)
    rows = np.searchsorted(trajectory.time, regular)
    seen = observe_run(engine, trajectory)
    require_shallow(model, trajectory, seen)
    throughout = rows_to_judge(engine, trajectory, seen)
    require_closed(model, *throughout)
    speed = speeds_of_bodies(model, throughout[1]).max(axis=0)
    series = motion_series(Motions(model, seen).several(names), model.mechanism.origin)
    return {
        **{name: values[rows] for name, (_, values) in series.items()},
        # rows at events count, too: an impact is shorter than the output interval
        "peak_speed": speed[[model.mechanism.moving_bodies.index(name) for name in names]],
        "peak_acceleration": np.abs(series["acceleration"][1]).max(axis=0),
        "contact_normal_force": seen.touch["normal_force"][rows],
        "contact_offset": seen.touch["offset"][rows],
        "impact_count": count,
        "peak_force": peak,
        "contact_time_share": fraction,
    }


def _contact_statistics(engine: Engine, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return largest force [N], number of impacts, and fraction of the time in contact, per contact."""
    closings = trajectory.events[trajectory.events["kind"] == CLOSING]
    peak, count, fraction = [], [], []
    for c in range(trajectory.contacts):
        mine = closings[closings["contact"] == c]
        lasting = np.where(np.isnan(mine["duration"]), engine.end - mine["time"], mine["duration"])
        peak.append(mine["peak_force"].max(initial=0.0))
        count.append(int((mine["speed"] > IMPACT).sum()))
        fraction.append(lasting.sum() / (engine.end - engine.start))
    return np.array(peak), np.array(count), np.array(fraction)
