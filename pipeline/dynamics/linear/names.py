"""What the coordinates of a mechanism are called: by the joint that they belong to, or the flexible body."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.linear.bench import Bench


def owners(bench: Bench) -> list[str]:
    """Owner of every free coordinate: ``joint B2``, ``body ball`` (held by no joint), ``rod1`` (its deformation)."""
    layout, links = bench.engine.built.layout, bench.engine.built.system.links
    found = [""] * layout.nv
    for i, link in enumerate(links[1:], start=1):
        if i in layout.modes:
            first = layout.flex_c0[i]
            found[first : first + layout.modes[i]] = [f"deformation of {link.flexible}"] * layout.modes[i]
        if layout.driven(i) < 0:
            edge, n = link.branch.edge, layout.n_speeds(i)
            name = f"joint {edge.name}" if edge is not None else f"body {link.group.host}"
            found[layout.c0[i] : layout.c0[i] + n] = [name] * n
    return found


def shares(bench: Bench, motion: np.ndarray, mass: np.ndarray) -> dict[str, float]:
    """Share of a motion's kinetic energy per owner; the shares add up to one, and coupling may make one negative.

    motion: speeds, shape (nv,), real or complex.
    """
    energy = np.real(np.conj(motion) * (mass @ motion))
    total = float(energy.sum())
    found: dict[str, float] = {}
    for name, value in zip(owners(bench), energy, strict=True):
        found[name] = found.get(name, 0.0) + (float(value) / total if total else 0.0)
    return found


def leading(bench: Bench, motion: np.ndarray, mass: np.ndarray) -> tuple[str, float]:
    """The owner with the largest share of a motion, and that share."""
    found = shares(bench, motion, mass)
    name = max(found, key=lambda n: found[n])
    return name, found[name]
