"""Range of validity of linear modes: how far flexible bodies bend, how fast they rotate.

At the limits the omitted terms reach some per cent: the tip of a cantilever that bends by a tenth of its length is one
per cent off the elastica. The tension of its own mass adds about 1.2 Omega^2 to the square of the first frequency of a
clamped beam that rotates across its length (Wright et al. 1982), more on a hub of some radius.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.refusals.reach import restore_work_array

#: displacement of a point in its body frame, as fraction of the body's length, above which a warning follows
BENT = 0.05
#: rotation of a section in the body frame [rad] above which a warning follows
SECTION_ROTATION = 0.15
#: angular speed, as fraction of the first frequency, above which a warning follows for a body without stiffening
SPIN = 0.2
#: rows whose shapes are superposed at a time
ROWS = 16


@dataclass(frozen=True)
class Flexible:
    """Data of a flexible link for the limits.

    axis: unit vector along its longest extent, `length` [m], in the body frame.
    first: lowest frequency [rad/s] of its modes; 0 for a body whose rotation is not limited.
    segments: number of segments of the rod of which this is one; 1 for a whole rod, 0 for other bodies.
    sections_turn: the bundle has the second-order motion of rotation, as all but bodies of some matrices have.
    """

    name: str
    link: int
    coordinates: range
    shapes: np.ndarray
    rotations: np.ndarray
    axis: np.ndarray
    length: float
    first: float
    sections_turn: bool
    segments: int

    def remedy(self, excess: float) -> str:
        """Return the advice for a body that bends by a multiple of what linear modes hold for: of a rod, segments."""
        if not self.segments:
            return "divide it into several bodies joined by fixed joints, or make it stiffer"
        return f"cut the rod into segments = {ceil(excess * self.segments)}, or make it stiffer"


def flexibles(model: Model) -> list[Flexible]:
    """Return the flexible links of a model, with their data for the limits."""
    bodies = []
    for i, coordinates in sorted(model.numbering.modal_positions.items()):
        name, bundle = str(model.links[i].flexible), model.links[i].bundle
        assert bundle is not None
        places = bundle["node_position"].values
        offsets = places - places.mean(axis=0)
        axis = np.linalg.svd(offsets, full_matrices=False)[2][0]
        along = offsets @ axis
        stiffened = getattr(model.scene.body[name], "stiffening", None) is not None
        least = 0.0 if stiffened else float(np.linalg.eigvalsh(bundle["modal_stiffness"].values)[0])
        bodies.append(
            Flexible(
                name,
                i,
                coordinates,
                bundle["shape_translation"].values,
                bundle["shape_rotation"].values,
                axis,
                float(along.max() - along.min()),
                float(np.sqrt(max(least, 0.0))),
                bool(bundle["second_order_moment"].values.any()),
                0
                if bundle.attrs.get("section") in ("solid", "matrices")
                else (model.scene.flexible()[name].segment or (1, 1))[1],
            )
        )
    return bodies


def warnings(model: Model, time: np.ndarray, seen: Observed) -> list[str]:
    """Return warnings about flexible bodies that left the range of linear modes in the observed rows of a run."""
    return _worst(model, flexibles(model), time, seen.positions, seen.links)


def doubts(engine: Engine, bodies: Sequence[Flexible]) -> list[str]:
    """Return such warnings about bodies in the state at the end of the last step; the engine is not changed."""
    with restore_work_array(engine):
        # the last evaluation may be of a step that was rejected, at speeds that the motion never had
        engine.attempt(engine.view(m.Y).copy(), float(engine.control[m.TIME]))
        coordinates, frames = engine.view(m.Y)[None, : engine.model.nq], engine.table(m.LINK_FRAMES)[None]
        if not (np.all(np.isfinite(coordinates)) and np.all(np.isfinite(engine.view(m.LINK_FRAMES.at)))):
            return []
        time = engine.control[m.TIME : m.TIME + 1]
        return _worst(engine.model, bodies, time, coordinates, frames)


def _worst(
    model: Model, bodies: Sequence[Flexible], time: np.ndarray, coordinates: np.ndarray, frames: np.ndarray
) -> list[str]:
    """Return the warnings about flexible bodies; of the segments of a rod the worst of each kind.

    Shapes (rows, coordinate) and (rows, link), the latter fields of LINK_FRAMES.
    """
    found: dict[tuple[str, str], tuple[float, str]] = {}
    rod_of = {piece: rod for rod, pieces in model.scene.rods().items() for piece in pieces}
    for body in bodies:
        for kind, excess, text in _warnings_of_body(body, time, coordinates, frames):
            key = rod_of[body.name], kind
            found[key] = max(found.get(key, (0.0, "")), (excess, text))
    return [text for _, text in found.values()]


def _warnings_of_body(
    body: Flexible, time: np.ndarray, coordinates: np.ndarray, frames: np.ndarray
) -> Iterator[tuple[str, float, str]]:
    """Yield kind, excess over the limit and text of each warning about one body."""
    yield from (("speed", 1.0, text) for text in _spun(body, time, frames[:, body.link]))
    q = coordinates[:, body.coordinates]
    if body.length > 0.0:
        row, bent = largest_displacement(body.shapes, q, BENT * body.length)
        if bent > BENT * body.length:
            excess = bent / body.length / BENT
            text = (
                f"{body.name}: at t = {time[row]:.6g} s a point is {bent:.3g} m from its undeformed position, "
                f"{bent / body.length:.2g} of its length; linear modes hold below {BENT:g}: " + body.remedy(excess)
            )
            yield "displacement", excess, text
    row, turned = largest_displacement(body.rotations, q, SECTION_ROTATION)
    if turned > SECTION_ROTATION:
        excess = turned / SECTION_ROTATION
        text = (
            f"{body.name}: at t = {time[row]:.6g} s a section is rotated by {turned:.3g} rad by its deformation; "
            f"linear modes hold below {SECTION_ROTATION:g} rad: " + body.remedy(excess)
        )
        yield "rotation", excess, text


def _spun(body: Flexible, time: np.ndarray, frame: np.ndarray) -> Iterator[str]:
    """Warn of rotation that would stiffen or soften the body by terms that it lacks."""
    if body.first <= 0.0:
        return
    omega = frame["omega"]
    # rotation about a body's length loads no tension, but acts on sections that turn
    acting = np.cross(omega, frame["axes"] @ body.axis) if body.sections_turn else omega
    speeds = np.linalg.norm(acting, axis=1)
    row = int(np.argmax(speeds))
    if speeds[row] <= SPIN * body.first:
        return
    fraction = speeds[row] / body.first
    turns = (
        f"{body.name}: at t = {time[row]:.6g} s it turns at {speeds[row]:.4g} rad/s, {fraction:.2g} of its first "
        f"natural frequency ({body.first:.4g} rad/s)"
    )
    if body.sections_turn:
        # 1.19: square of the first frequency that tension adds to a clamped beam, over that of the speed
        yield (
            f"{turns}, and nothing stiffens it: clamped to a small hub, that frequency would be higher by "
            f"{100.0 * (np.sqrt(1.0 + 1.19 * fraction**2) - 1.0):.2g} %; linear modes hold below {SPIN:g} and "
            "diverge close to 1: give the body stiffening = {}"
        )
    else:
        yield (
            f"{turns}, and its matrices do not give the second-order motion of its rotation: frequencies are wrong by "
            f"up to {50.0 * fraction**2:.2g} %; mesh it with a recipe, or lump its mass at nodes that turn"
        )


def largest_displacement(shapes: np.ndarray, q: np.ndarray, floor: float) -> tuple[int, float]:
    """Return row and size of the largest displacement or rotation of any node, among rows that can exceed `floor`.

    shapes: (node, axis, mode).  q: modal coordinates, (rows, mode).
    """
    bound = np.abs(q) @ np.linalg.norm(shapes, axis=1).max(axis=0, initial=0.0)
    order = np.argsort(-bound, kind="stable")
    peak = (0, 0.0)
    for first in range(0, len(order), ROWS):
        rows = order[first : first + ROWS]
        if not bound[rows[0]] > max(floor, peak[1]):
            break
        sizes = np.linalg.norm(np.einsum("nam,tm->tna", shapes, q[rows]), axis=2).max(axis=1)
        best = int(np.argmax(sizes))
        if sizes[best] > peak[1]:
            peak = int(rows[best]), float(sizes[best])
    return peak
