"""Loads as solids: springs, dampers, bushings, and other tension between two points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from flexclear.post.render import forms, surfaces
from flexclear.post.render.layout import (
    GROUND_COLOR,
    JOINT_COLOR,
    LOAD_COLOR,
    PIN,
    Layout,
    Part,
    Site,
    samples,
    travel_range,
)
from flexclear.post.render.surfaces import Surface
from flexclear.scene.units import quantity

#: fractions of the mechanism's size: radius of coils, length of the springs of joints at the end of their travel;
#: length, in radii, below which nothing is drawn between two points
COIL, FREE, NEAR = 0.02, 0.25, 0.1


def loads(at: Layout, size: float, bodies: Sequence[Part]) -> Iterator[Part]:
    """Yield springs as coils, dampers as cylinders with pistons, bushings as rings, other tension as thin bars."""
    for load in at.given.get("load", {}).values():
        if load["type"] == "bushing":
            yield from _bushing(at, load, size)
        elif "between" in load:
            first, second = load["between"]
            yield from _spring_between(at.run, (at.site(first), at.site(second)), load, COIL * size)
        elif load["type"] == "joint-spring":
            yield from _spring_on_joint(at, load, size, bodies)


def _bushing(at: Layout, load: Mapping[str, Any], size: float) -> Iterator[Part]:
    """Yield a ring, about the axis across which its stiffnesses are most alike, and the pin that it holds."""
    first, second = load["between"]
    along = np.diagonal(load["stiffness"])
    axis = min((2, 0, 1), key=lambda k: abs(along[(k + 1) % 3] - along[(k + 2) % 3]))
    turn, pin = surfaces.along(np.eye(3)[axis]), PIN * size
    ring = forms.ring(1.05 * pin, 2.8 * pin, 3.0 * pin)
    yield at.part_at_frame(first, surfaces.place(ring, np.zeros(3), turn), LOAD_COLOR)
    yield at.part_at_frame(second, surfaces.place(surfaces.cylinder(pin, 4.2 * pin), np.zeros(3), turn), JOINT_COLOR)


def _spring_on_joint(at: Layout, load: Mapping[str, Any], size: float, bodies: Sequence[Part]) -> Iterator[Part]:
    """Yield a spring along a joint's axis, on the side where it is pressed and around the body that slides, or a coil
    about the axis."""
    name, joint = load["joint"], at.given["joint"][load["joint"]]
    first, second = joint["between"]
    if joint["type"] in forms.SLIDING and load.get("coordinate") != "rotation":
        low, high = travel_range(at.run, name)
        side = 1.0 if 0.5 * (low + high) >= quantity(load.get("rest", 0.0), "length") else -1.0
        (origin, axes), centre = (
            at.frame_in_body(second),
            at.centre(second.partition(".")[0]) if at.owner(second) is not None else 0.0,
        )
        around = [
            surfaces.reach(
                (part.surface.points + centre - origin) @ axes, part.surface.triangles, side * FREE * size / 2
            )
            for part in bodies
            if part.owner == at.owner(second)
        ]
        radius = max([COIL * size, *(1.15 * one for one in around)])
        anchor = (high if side > 0.0 else low) + side * max(FREE * size, 3.0 * radius)
        yield from _spring_between(at.run, (at.site(first, anchor), at.site(second)), load, radius)
    elif load.get("stiffness"):
        radius, long = 2.2 * PIN * size, 3.0 * PIN * size
        coil = surfaces.place(forms.coil(radius, long, 0.2 * radius), np.array([0.0, 0.0, -0.5 * long]))
        yield at.part_at_frame(second, coil, LOAD_COLOR)


def _spring_between(run: xr.Dataset, ends: tuple[Site, Site], load: Mapping[str, Any], radius: float) -> Iterator[Part]:
    """Yield what acts along a line between two points: a coil of this radius [m], a cylinder with its piston, both, or
    a thin bar."""
    lengths = [float(np.linalg.norm(np.subtract(*(site.position(run, k) for site in ends)))) for k in samples(run)]
    long, owners = max(lengths), [site.owner for site in reversed(ends) if site.owner is not None]
    if not owners or long < NEAR * radius:
        return

    def part(surface: Surface, color: str, sites: tuple[Site, Site] = ends, length: float | None = None) -> Part:
        return Part(owners[0], surface, color, ends=sites, length=length)

    if load.get("stiffness"):
        yield part(forms.coil(radius, long, 0.2 * radius), LOAD_COLOR, length=long)
    if load.get("damping"):
        half = min(0.6 * long, 0.95 * min(lengths))
        for sites, thick, color in ((ends, 0.6, GROUND_COLOR), (ends[::-1], 0.3, JOINT_COLOR)):
            rod = surfaces.place(surfaces.cylinder(thick * radius, half), np.array([0.0, 0.0, 0.5 * half]))
            yield part(rod, color, (sites[0], sites[1]))
    if not load.get("stiffness") and not load.get("damping"):
        bar = surfaces.place(surfaces.cylinder(0.2 * radius, long), np.array([0.0, 0.0, 0.5 * long]))
        yield part(bar, LOAD_COLOR, length=long)
