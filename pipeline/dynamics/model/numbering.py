"""Places in the tables: which coordinate, column, row and slot belongs to what."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.mechanism import Link, Mechanism, Site

Route = list[tuple[int, int]]  #: (coordinate, column) pairs that move a site


@dataclass
class Numbering:
    """Numbering of a system. Coordinates: free ones 0..nv-1 in elimination order, then prescribed."""

    mechanism: Mechanism
    nq: int = 0
    nv: int = 0
    q0: list[int] = field(default_factory=list)
    c0: list[int] = field(default_factory=list)
    flex_q0: dict[int, int] = field(default_factory=dict)
    flex_c0: dict[int, int] = field(default_factory=dict)
    modes: dict[int, int] = field(default_factory=dict)
    sites: list[Site] = field(default_factory=list)
    ports: list[tuple[int, str, int]] = field(default_factory=list)  #: site, frame, first column
    columns: int = 0

    @property
    def known(self) -> int:
        """Number of prescribed coordinates."""
        return len(self.mechanism.drives)

    def site(self, site: Site) -> int:
        """Number of a site; of one that is there already when the place is the same."""
        for k, other in enumerate(self.sites):
            same = other.link == site.link and other.frame == site.frame
            if same and np.array_equal(other.place.p, site.place.p) and np.array_equal(other.place.R, site.place.R):
                return k
        return self.add_site(site)

    def add_site(self, site: Site) -> int:
        """Number of a new site, with a port of its own where the link is flexible."""
        self.sites.append(site)
        if site.frame is not None:
            self.ports.append((len(self.sites) - 1, site.frame, self.columns))
            self.columns += self.modes[site.link]
        return len(self.sites) - 1

    def port_of(self, site: int) -> int:
        """Port of a site, or -1."""
        return next((k for k, (s, _, _) in enumerate(self.ports) if s == site), -1)

    def port_of_inboard(self, link: int) -> int:
        """Port of a flexible link's own inboard frame: these follow those of the sites."""
        return len(self.ports) + sorted(self.modes).index(link)

    def route(self, site: int) -> Route:
        """What moves a site, from itself to the ground."""
        link = self.sites[site].link
        port = self.port_of(site)
        found: Route = []
        if port >= 0:
            first, c0 = self.ports[port][2], self.flex_c0[link]
            found += [(c0 + j, first + j) for j in range(self.modes[link])]
        return found + self.joint_route(link)

    def joint_route(self, link: int) -> Route:
        """What moves a link's inboard joint: its own coordinates, then its parent's."""
        if link == 0:
            return []
        own = range(self.c0[link], self.c0[link] + self.n_speeds(link))
        return [(c, c) for c in own] + self.route(link - 1)

    def n_speeds(self, link: int) -> int:
        """Coordinates of a link's joint, prescribed ones included."""
        return len(joint_class(self.mechanism.links[link].kind).SPEEDS) if link else 0

    def driven(self, link: int) -> int:
        """Number of the first prescribed coordinate of a link, or -1; it has all prescribed or none."""
        drives = self.mechanism.links[link].drives
        return self.mechanism.drives.index(drives[0]) if drives else -1


def number(mechanism: Mechanism) -> Numbering:
    """The layout of a system. Site k - 1 is the inboard site of link k."""
    numbering = Numbering(mechanism)
    links = mechanism.links
    numbering.q0, numbering.c0 = [0] * len(links), [0] * len(links)
    for i, link in enumerate(links):
        if link.flexible:
            numbering.modes[i] = mechanism.bundles[link.flexible].sizes["mode"]
    _number_positions(numbering, links)
    _number_coordinates(numbering, links)
    numbering.columns = numbering.nv + numbering.known
    for link in links[1:]:
        assert link.inboard is not None
        numbering.add_site(link.inboard)
    return numbering


def _number_positions(numbering: Numbering, links: list[Link]) -> None:
    for i, link in enumerate(links[1:], start=1):
        if numbering.driven(i) < 0:
            numbering.q0[i] = numbering.nq
            numbering.nq += len(joint_class(link.kind).POSITIONS)
        if i in numbering.modes:
            numbering.flex_q0[i] = numbering.nq
            numbering.nq += numbering.modes[i]
    for i in range(1, len(links)):
        if numbering.driven(i) >= 0:
            numbering.q0[i] = numbering.nq + numbering.driven(i)


def _number_coordinates(numbering: Numbering, links: list[Link]) -> None:
    """Descendants before ancestors: then the factor of the mass matrix has no fill."""
    children: dict[int, list[int]] = {}
    for i, link in enumerate(links[1:], start=1):
        children.setdefault(link.branch.parent, []).append(i)

    def visit(i: int) -> None:
        for child in children.get(i, []):
            visit(child)
        if i in numbering.modes:
            numbering.flex_c0[i] = numbering.nv
            numbering.nv += numbering.modes[i]
        if i and numbering.driven(i) < 0:
            numbering.c0[i] = numbering.nv
            numbering.nv += numbering.n_speeds(i)

    visit(0)
    for i in range(1, len(links)):
        if numbering.driven(i) >= 0:
            numbering.c0[i] = numbering.nv + numbering.driven(i)
