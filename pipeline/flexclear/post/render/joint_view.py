"""A ball or pin in its socket: the region of its centre without contact, and its path, in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.post.render import surfaces
from flexclear.post.render.surfaces import Surface
from flexclear.post.render.view import View
from flexclear.post.single_run.series import parameters
from flexclear.scene.loose_joints import SURFACES

#: colour of a path, as in the plots of orbits; largest number of its drawn points
PATH_COLOR, PLACES = "#009E73", 1500
#: radius of the mark at the centre and of the path, as fractions of the region's size
MARK, PATH = 0.05, 0.006
#: directions of view of a sphere and of a flat region
SLANTED, ABOVE = np.array([0.5, -1.0, 0.7]), np.array([0.0, -0.45, 1.0])


@dataclass(frozen=True, slots=True)
class JointView:
    """Surfaces in axes of the socket [m]; `mark` about the centre of the ball or pin."""

    room: Surface
    path: Surface
    mark: Surface
    view: View


def with_clearance(run: xr.Dataset) -> list[int]:
    """Return columns of the contacts that are joints with clearance; ends of stops have no path."""
    joints = parameters(run).get("joint", {})
    return [k for k, name in enumerate(run["contact"].values) if str(name) in joints] if "contact" in run.sizes else []


def drawn_joint(run: xr.Dataset, contact: int) -> JointView:
    """Return the drawn surfaces of one joint with clearance."""
    offset = run["contact_offset"].values[:, contact]
    room, half = _room(parameters(run)["joint"][str(run["contact"].values[contact])], offset)
    some = np.unique(np.linspace(0, len(offset) - 1, PLACES).astype(int))
    flat = np.ptp(room.points[:, 2]) < 0.1 * half
    view = View(ABOVE if flat else SLANTED, np.eye(3)[1 if flat else 2], False)
    return JointView(room, surfaces.tube(offset[some], PATH * half), surfaces.sphere(MARK * half), view)


def _room(given: dict, offset: np.ndarray) -> tuple[Surface, float]:
    """Return the region of the centre without contact, and a length for the size of marks [m].

    A sphere or disc of the clearance, a slot longer by its travel; for a ball on a plane the plane of the centre at
    contact.
    """
    kind = SURFACES[given["type"]]
    if not kind.hollow:
        low, high = offset.min(axis=0), offset.max(axis=0)
        reach = max(float((high - low).max()), 2.0 * float(given["ball_radius"]))
        plane = surfaces.box((*((high - low)[:2] + 0.4 * reach), 0.005 * reach))
        return surfaces.place(plane, np.array([*(0.5 * (low + high))[:2], given["ball_radius"]])), 0.6 * reach
    clearance = float(given["clearance"])
    if kind.ideal == "spherical":
        return surfaces.sphere(clearance), clearance
    half = 0.5 * float(given.get("travel", 0.0))
    outline = surfaces.hull(np.array([[-half, 0.0], [half, 0.0]]), clearance)
    return surfaces.prism(outline, 0.02 * clearance), max(clearance, 0.3 * half)
