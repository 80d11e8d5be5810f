"""Members of an ensemble: the same scene from starts that differ by a hair.

Beyond the horizon of pointwise validity single values of a chaotic run mean nothing; mean and
spread of such members do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import ENSEMBLE, conform
from pipeline.core.errors import InputError
from pipeline.core.quantities import IMPACT
from pipeline.core.scene.schema import Ensemble, Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.record.dataset import attributes
from pipeline.dynamics.record.motion import Motion, body_motions, link_motions, quaternions
from pipeline.dynamics.run.engine import Engine, Progress, consistent_start
from pipeline.dynamics.run.ledger import require_closed
from pipeline.dynamics.run.perturbation import offset_jacobian, perturbed
from pipeline.dynamics.run.run import engines, observed
from pipeline.dynamics.run.switching import follow
from pipeline.dynamics.run.trajectory import Trajectory, output_times


def ensemble(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> xr.Dataset:
    """All members (schema ENSEMBLE) of a scene with clearance joints."""
    wanted = scene.ensemble or Ensemble()
    if not scene.contacts():
        raise InputError(
            "[ensemble]", "its members differ by the ball's offset, but there is no clearance joint", "remove it"
        )
    engine, other = engines(scene, bundles, progress)
    names = _bodies(engine, wanted)
    start, _ = consistent_start(engine)
    jacobian = offset_jacobian(engine, start)
    random = np.random.default_rng(wanted.seed)
    members, reasons = [], []
    for k in range(wanted.members):
        offsets = random.normal(size=(len(scene.contacts()), 3))
        offsets *= wanted.perturbation / np.linalg.norm(offsets, axis=1, keepdims=True)
        moved = perturbed(engine, start, jacobian, offsets.ravel())
        last, trajectory, switched = follow(engine, moved, _quiet, other)
        members.append(_member(last, trajectory, names))
        reasons += [switched] if switched else []
        progress((k + 1) / wanted.members, f"member {k + 1} of {wanted.members}")
    made = xr.concat(members, dim="member").assign_coords(member=np.arange(wanted.members))
    told = {"switched": f"{len(reasons)} of {wanted.members} members, the first {reasons[0]}"} if reasons else {}
    return conform(made, ENSEMBLE, **attributes(scene), seed=wanted.seed, perturbation=wanted.perturbation, **told)


def _quiet(share: float | None, text: str) -> None:
    """Progress is told per member."""


def _bodies(engine: Engine, wanted: Ensemble) -> list[str]:
    mechanism = engine.model.mechanism
    known = [n for n, b in mechanism.scene.body.items() if b.type != "ground"]
    if wanted.bodies is None:
        return sorted(
            {mechanism.frames[f].body for _, joint, _, _ in mechanism.contacts for f in joint.between} & set(known)
        )
    for name in wanted.bodies:
        if name not in known:
            raise InputError("[ensemble.bodies]", f"there is no body '{name}'", f"known: {', '.join(known)}")
    return list(wanted.bodies)


def _member(engine: Engine, trajectory: Trajectory, names: list[str]) -> xr.Dataset:
    scene = engine.model.scene
    regular = output_times(engine.breaks, scene.output.interval)
    rows = np.searchsorted(trajectory.time, regular)
    peak, count, share = _contact_statistics(engine, trajectory)
    kept = replace(trajectory, rows=trajectory.rows[rows])
    seen = observed(engine, kept)
    require_closed(engine.model, kept, seen)
    motions = body_motions(engine.model, seen, link_motions(engine.model, seen["link_frame"]))
    chosen = [motions[n] for n in names]
    touch = seen["touch"].reshape(len(rows), -1, m.TOUCH.size)
    variables = {
        **_series(chosen, engine.model.mechanism.origin),
        "contact_normal_force": (("time", "contact"), touch[..., m.TOUCH.normal_force]),
        "contact_offset": (("time", "contact", "axis"), touch[..., m.TOUCH.offset : m.TOUCH.offset + 3]),
        "impact_count": (("contact",), count),
        "peak_force": (("contact",), peak),
        "contact_time_share": (("contact",), share),
    }
    contacts = [name for name, *_ in engine.model.mechanism.contacts]
    return xr.Dataset(variables, coords={"time": kept.time, "body": names, "contact": contacts})


def _series(motions: list[Motion], origin: np.ndarray) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    dims = ("time", "body", "axis")
    return {
        "position": (dims, np.stack([m.p + origin for m in motions], axis=1)),
        "quaternion": (("time", "body", "quat"), np.stack([quaternions(m.R) for m in motions], axis=1)),
        "velocity": (dims, np.stack([m.v for m in motions], axis=1)),
        "angular_velocity": (dims, np.stack([m.omega for m in motions], axis=1)),
        "acceleration": (dims, np.stack([m.a for m in motions], axis=1)),
    }


def _contact_statistics(engine: Engine, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Largest force [N], impacts, and share of the time in contact, per contact."""
    e = trajectory.events
    span = engine.end - engine.start
    peak, count, share = [], [], []
    for c in range(engine.model.arrays.size(m.N_CONTACTS)):
        closing = e[(e[:, m.EVENT.contact] == c) & (e[:, m.EVENT.kind] == m.CLOSING)]
        lasting = np.where(
            np.isnan(closing[:, m.EVENT.duration]), engine.end - closing[:, m.EVENT.time], closing[:, m.EVENT.duration]
        )
        peak.append(closing[:, m.EVENT.peak_force].max(initial=0.0))
        count.append(int((closing[:, m.EVENT.speed] > IMPACT).sum()))
        share.append(lasting.sum() / span)
    return np.array(peak), np.array(count), np.array(share)
