"""Rates that the table ``[start]`` gives joint coordinates and modes, as conditions on the speeds at the start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects.gears.model import Coupling
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.model.start_table import given_coordinates, given_modal_velocities


@dataclass(frozen=True)
class Rate:
    """A rate that is given: `requested` [m/s or rad/s], where the scene says so, and what counts as much.

    speed, sign: of which free coordinate it is the speed, times the sign; of a joint that closes a loop none.
    sites: of the two frames of such a joint, `coordinate` which of its motions.
    """

    place: str
    requested: float
    size: float
    speed: int | None = None
    sign: float = 1.0
    sites: tuple[int, int] = (0, 0)
    coordinate: Coordinate | None = None

    def of(self, sites: np.ndarray, u: np.ndarray) -> float:
        """Its value at free speeds u, with the sites' frames, named fields of SITE_FRAMES."""
        if self.speed is not None:
            return self.sign * float(u[self.speed])
        assert self.coordinate is not None
        a, b = sites[self.sites[0]], sites[self.sites[1]]
        along = (a, b)[self.coordinate.side]["axes"][:, self.coordinate.axis]
        if self.coordinate.turning:
            return float(along @ (b["omega"] - a["omega"]))
        arm = b["origin"] - a["origin"]
        return float(along @ (b["velocity"] - a["velocity"] - np.cross(a["omega"], arm)))


def given_rates(model: Model) -> list[Rate]:
    """All rates that the scene gives, but those of driven coordinates."""
    return [*_of_joints(model), *_of_modes(model)]


def _of_joints(model: Model) -> Iterator[Rate]:
    closures = model.arrays.table(m.CLOSURES)
    for start in given_coordinates(model.scene):
        if start.velocity is None:
            continue
        path, size = f"{start.place[:-1]}.velocity]", 1.0 if start.coordinate.turning else model.length
        for i, link in enumerate(model.links):
            edge = link.branch.edge
            if edge is not None and edge.name == start.joint and not link.drives:
                numbers = dict(zip(link.joint.positions, model.numbering.coordinates[i], strict=True))
                if start.number in numbers:
                    yield Rate(path, start.velocity, size, numbers[start.number], link.joint.sign)
        for row, closure in zip(closures, model.closures, strict=True):
            if not isinstance(closure, Coupling) and closure.edge.name == start.joint:
                sites = int(row["site_a"]), int(row["site_b"])
                yield Rate(path, start.velocity, size, sites=sites, coordinate=start.coordinate)


def _of_modes(model: Model) -> Iterator[Rate]:
    bundles = {link.flexible: link.bundle for link in model.links if link.flexible and link.bundle is not None}
    for name, values in given_modal_velocities(model.scene, bundles).items():
        for c, value in zip(model.numbering.modal_coordinates[model.mechanism.link_of[name]], values, strict=True):
            yield Rate(f"[start.modal.{name}.velocity]", float(value), float(model.speed_scales[c]), c)
