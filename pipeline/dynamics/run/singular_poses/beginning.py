"""Out of a singular pose in which a run starts, along one of the branches that cross there.

Velocities that are given choose the branch; where they, and the drives, leave a choice, `[start] branch` of the scene
does. Each branch has a motion out of the pose, a polynomial with closed states (`collocation`). Velocities that belong
to no branch show in that there is none, however short the way.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.scene.start import Branch
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.model.driving import coordinate_of
from flexclear.pipeline.dynamics.run.coordinates import joint_coordinates, label
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.observation import observe
from flexclear.pipeline.dynamics.run.singular_poses import branches
from flexclear.pipeline.dynamics.run.singular_poses.branches import Direction
from flexclear.pipeline.dynamics.run.singular_poses.collocation import Collocation, Lead, Sampler, collocate

#: the way is first as long as the fastest coordinate takes for this fraction of its unit, then half of that, and so on
FIRST_WAY, WAY_HALVINGS = 0.3, 9
#: velocities may differ from those of a branch by this fraction: they are given with some digits
EQUAL_VELOCITIES = 1e-6
#: directions that were searched for are good to some hundredths
ANY = 0.5
#: changes of a coordinate on two branches, which are known to some hundredths, that differ by less than this fraction
#: are alike
EQUAL_CHANGES = 0.05


def start_motion(engine: Engine, y: np.ndarray) -> Collocation:
    """From the state at the start, which has all loops closed; leaves its closure rows selected.

    SolverError when its velocities are not those of one smooth motion, or nothing says which of several it takes.
    """
    choices = engine.model.scene.start.branch if engine.model.scene.start is not None else ()
    if np.any(y[engine.model.speeds] != 0.0) and not choices:
        motions, turn = [branches.by_speeds(engine, y)], EQUAL_VELOCITIES
    else:
        motions, turn = _chosen(engine, branches.directions(engine, y), choices), ANY
    way = _along(engine, motions[0], turn) if motions else None
    if way is None:
        raise SolverError(engine.mobility.start_refusal)
    engine.keep(engine.selected)  # the scales of rows are those of another state
    return way


def _along(engine: Engine, way: Direction, turn: float) -> Collocation | None:
    """The motion in a direction; None when there is none, or none whose start differs by `turn` at most."""
    if way.size == 0.0:
        return None
    engine.control[m.END] = engine.breaks[1]
    for k in range(WAY_HALVINGS):
        span = way.reaching(FIRST_WAY * 0.5**k)
        closure_rows.select_rows(engine, way.state(engine.start + span), engine.start + span)
        sampler = Sampler(engine)
        lead = Lead(way.state, turn if way.at_speed else 0.0)
        made = collocate(sampler, engine.start, way.start, span, None, lead)
        sampler.restore()
        if made is not None:
            return made
    return None


# Which of them -------------------------------------------------------------------------------------------------------


def _chosen(engine: Engine, ways: list[Direction], choices: tuple[Branch, ...]) -> list[Direction]:
    """The ways that the choices leave; an error unless there is one at most."""
    if len(ways) > 1:
        until = engine.start + min(way.reaching(branches.WAY) for way in ways)
        changes = [_changes(engine, way, until) for way in ways]
        for number, choice in enumerate(choices):
            path = "[start.branch]" if len(choices) == 1 else f"[start.branch.{number}]"
            scene = engine.model.scene
            joint, k, _ = coordinate_of(scene, choice.joint, choice.coordinate, path)
            requested = [choice.sign * change[label(joint, scene.joint[joint].type, k)] for change in changes]
            best_ways = [max(requested) - value <= EQUAL_CHANGES * max(map(abs, requested)) for value in requested]
            ways = [way for way, best in zip(ways, best_ways, strict=True) if best]
            changes = [change for change, best in zip(changes, best_ways, strict=True) if best]
        if len(ways) > 1:
            _refuse_open(engine, changes, choices)
    return ways


def _changes(engine: Engine, way: Direction, until: float) -> dict[str, float]:
    """Change of every joint coordinate up to a time, roughly."""
    contacts = len(engine.model.contacts)
    rows = m.empty_record(2, contacts, engine.model.ny)
    record = m.record(rows, contacts)
    record.time[:] = engine.start, until
    record.state[:] = [way.state(t) for t in record.time]
    seen = observe(engine, rows)
    return {name: float(np.diff(series[0])[0]) for name, series in joint_coordinates(engine.model, seen).items()}


def _refuse_open(engine: Engine, changes: list[dict[str, float]], choices: tuple[Branch, ...]) -> None:
    """Say which joint distinguishes the branches best, and how its coordinate changes on each."""
    spread = {name: float(np.ptp([change[name] for change in changes])) for name in changes[0]}
    size = {name: max(abs(change[name]) for change in changes) for name in changes[0]}
    best = max(spread, key=lambda name: spread[name] / size[name] if size[name] > 0.0 else 0.0)
    text = ", ".join(f"{change[best] / size[best]:+.2g}" for change in changes)
    joint, _, coordinate = best.partition(".")
    written = f'joint = "{joint}", ' + (f'coordinate = "{coordinate}", ' if coordinate else "") + "sign = 1"
    ways = f"{len(changes)} ways, on which joint {best} begins to move like {text}"
    if choices:
        raise InputError(
            "[start.branch]", f"leaves {ways}", f"choose by {{ {written} }} or sign = -1, as one more of a list"
        )
    raise SolverError(
        f"{engine.mobility.singular_start}, here in {ways}: choose by [start] branch = {{ {written} }} or sign = -1, "
        "or give the bodies velocities"
    )
