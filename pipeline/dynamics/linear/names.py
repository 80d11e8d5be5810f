"""What the coordinates of a mechanism are called: by the joint that they belong to, or the flexible body."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.linear.bench import Bench


def owners(bench: Bench) -> list[str]:
    """Owner of every free coordinate: ``joint B2``, ``body ball`` (held by no joint), ``rod1`` (its deformation)."""
    numbering, links = bench.engine.model.numbering, bench.engine.model.mechanism.links
    found = [""] * numbering.nv
    for i, link in enumerate(links[1:], start=1):
        if i in numbering.modes:
            first = numbering.flex_c0[i]
            found[first : first + numbering.modes[i]] = [f"deformation of {link.flexible}"] * numbering.modes[i]
        if numbering.driven(i) < 0:
            edge, n = link.branch.edge, numbering.n_speeds(i)
            name = f"joint {edge.name}" if edge is not None else f"body {link.group.host}"
            found[numbering.c0[i] : numbering.c0[i] + n] = [name] * n
    return found


def leading(bench: Bench, motion: np.ndarray, mass: np.ndarray) -> str:
    """The owner of most of the kinetic energy of a motion; motion: speeds, shape (nv,)."""
    energy = motion * (mass @ motion)
    found: dict[str, float] = {}
    for name, value in zip(owners(bench), energy, strict=True):
        found[name] = found.get(name, 0.0) + float(value)
    return max(found, key=lambda n: found[n])
