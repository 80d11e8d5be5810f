"""Numbering of a mechanism: indices of positions, coordinates, columns, sites and ports."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.interface_basis import InterfaceBasis, interface_basis
from flexclear.dynamics.model.mechanism import Link, Mechanism, Site

Route = list[tuple[int, int]]  #: (coordinate, column) pairs that move a site


class Port(NamedTuple):
    """A site on a flexible link: its number, the name of its frame, the first column of the modes there."""

    site: int
    frame: str
    column: int


@dataclass
class Numbering:
    """Numbering of a mechanism: free coordinates 0..nv-1 in elimination order, then prescribed ones.

    positions, coordinates: of each link's joint; prescribed ones after all free ones.
    modal_positions, modal_coordinates: modes of flexible links.  bases: interface bases of these, in which coordinates
    are shapes, held ones before moving ones.  Site k - 1 is the inboard site of link k.
    """

    mechanism: Mechanism
    nq: int = 0
    nv: int = 0
    positions: list[range] = field(default_factory=list)
    coordinates: list[range] = field(default_factory=list)
    modal_positions: dict[int, range] = field(default_factory=dict)
    modal_coordinates: dict[int, range] = field(default_factory=dict)
    bases: dict[int, InterfaceBasis] = field(default_factory=dict)
    sites: list[Site] = field(default_factory=list)
    ports: list[Port] = field(default_factory=list)
    columns: int = 0

    @property
    def known(self) -> int:
        """Number of prescribed coordinates."""
        return len(self.mechanism.drives)

    @property
    def flexible(self) -> list[int]:
        """Flexible links, in the order of their tables."""
        return list(self.modal_positions)

    def site(self, site: Site) -> int:
        """Return the number of a site, which is added unless one with the same placement exists."""
        for k, other in enumerate(self.sites):
            same = other.link == site.link and other.frame == site.frame
            if (
                same
                and np.array_equal(other.placement.p, site.placement.p)
                and np.array_equal(other.placement.R, site.placement.R)
            ):
                return k
        return self.add_site(site)

    def sites_of(self, joint: str) -> tuple[int, int]:
        """Return the numbers of the sites at both frames of a joint."""
        first, second = (self.site(self.mechanism.site(frame)) for frame in self.mechanism.scene.joint[joint].between)
        return first, second

    def add_site(self, site: Site) -> int:
        """Add a site, with a port where its link is flexible; return its number."""
        self.sites.append(site)
        if site.frame is not None:
            self.ports.append(Port(len(self.sites) - 1, site.frame, self.columns))
            self.columns += len(self.moving(site.link))
        return len(self.sites) - 1

    def port_of(self, site: int) -> int:
        """Return the port of a site, or -1."""
        return next((k for k, port in enumerate(self.ports) if port.site == site), -1)

    def port_of_inboard(self, link: int) -> int:
        """Return the port of a flexible link's own inboard frame: these follow those of the sites."""
        return len(self.ports) + self.flexible.index(link)

    def moving(self, link: int) -> range:
        """Return the coordinates of a flexible link's moving shapes."""
        return self.modal_coordinates[link][self.bases[link].held :]

    def route(self, site: int) -> Route:
        """Return (coordinate, column) of all motions that move a site, from the site to the ground."""
        link, port = self.sites[site].link, self.port_of(site)
        moving = self.moving(link) if port >= 0 else ()
        return [(c, self.ports[port].column + j) for j, c in enumerate(moving)] + self.joint_route(link)

    def joint_route(self, link: int) -> Route:
        """Return (coordinate, column) of a link's inboard joint and of all motions that move its inboard site."""
        if link == 0:
            return []
        return [(c, c) for c in self.coordinates[link]] + self.route(link - 1)


def number(mechanism: Mechanism) -> Numbering:
    """Return the numbering of a mechanism, with the inboard sites of its links."""
    numbering = Numbering(mechanism)
    _number_positions(numbering, mechanism.links)
    _number_coordinates(numbering, mechanism.links)
    for i, link in enumerate(mechanism.links):
        if link.drives:  # as many as positions and as speeds
            first, count = mechanism.drives.index(link.drives[0]), len(link.drives)
            numbering.positions[i] = range(numbering.nq + first, numbering.nq + first + count)
            numbering.coordinates[i] = range(numbering.nv + first, numbering.nv + first + count)
    numbering.columns = numbering.nv + numbering.known
    for link in mechanism.links[1:]:
        assert link.inboard is not None
        numbering.add_site(link.inboard)
    return numbering


def _number_positions(numbering: Numbering, links: list[Link]) -> None:
    numbering.positions = [range(0)] * len(links)
    for i, link in enumerate(links[1:], start=1):
        if not link.drives:
            numbering.positions[i] = range(numbering.nq, numbering.nq + len(joint_type(link.kind).POSITIONS))
            numbering.nq = numbering.positions[i].stop
        if link.bundle is not None:
            numbering.modal_positions[i] = range(numbering.nq, numbering.nq + link.bundle.sizes["mode"])
            numbering.bases[i] = interface_basis(numbering.mechanism, i)
            numbering.nq = numbering.modal_positions[i].stop


def _number_coordinates(numbering: Numbering, links: list[Link]) -> None:
    """Number descendants before ancestors: then the factor of the mass matrix has no fill-in."""
    numbering.coordinates = [range(0)] * len(links)
    children: dict[int, list[int]] = {}
    for i, link in enumerate(links[1:], start=1):
        children.setdefault(link.branch.parent, []).append(i)

    def visit(i: int) -> None:
        for child in children.get(i, []):
            visit(child)
        if i in numbering.modal_positions:
            numbering.modal_coordinates[i] = range(numbering.nv, numbering.nv + len(numbering.modal_positions[i]))
            numbering.nv = numbering.modal_coordinates[i].stop
        if i and not links[i].drives:
            numbering.coordinates[i] = range(numbering.nv, numbering.nv + len(joint_type(links[i].kind).SPEEDS))
            numbering.nv = numbering.coordinates[i].stop

    visit(0)
