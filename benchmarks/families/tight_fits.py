"""A pin pressed into a tight journal: forms of normal laws next to a plane finite-element contact.

The lower halves of an elastic pin and of an elastic journal, in plane strain and small displacements. The pin's
horizontal diameter is moved down; the journal is held at twice its radius. Pairs of nodes at the same angle touch where
their radial gap would be negative; the set of touching pairs is iterated.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from scipy.sparse import bmat, csr_array
from scipy.sparse.linalg import splu

from benchmarks.family import Case, Family, Record, each
from benchmarks.page import Columns, table
from flexclear.dynamics.contact.form import FORMS
from flexclear.dynamics.model.contacts import resolve_law
from flexclear.scene.loose_joints import Clearance

RADIUS, LENGTH, MODULUS, POISSON = 10e-3, 10e-3, 207e9, 0.3
MATERIAL = {"youngs_modulus": MODULUS, "poisson": POISSON}
#: clearances over the radius, and penetrations over the clearance
CLEARANCES, DEPTHS = (1e-3, 1e-2), (0.02, 0.1, 0.3, 1.0, 3.0)
LAWS = ("hertz", "johnson", "radzimovsky", "goldsmith", "esdu-78035", "liu", "pereira")
#: elements over a quarter of the circumference, smaller towards the load, and from the surface inwards
ROUND, INWARD = 40, 18


def _mesh(surface: float, end: float) -> Any:
    """Return a mesh between the radii of the surface and the end, below the horizontal diameter, on one side."""
    from skfem import MeshQuad

    angles = 0.5 * math.pi * np.linspace(0.0, 1.0, ROUND + 1) ** 1.6
    radii = surface + (end - surface) * np.linspace(0.0, 1.0, INWARD + 1) ** 2.2
    grid = MeshQuad.init_tensor(angles, np.sort(radii))
    angle, radius = grid.p
    return MeshQuad(np.stack([radius * np.sin(angle), -radius * np.cos(angle)]), grid.t)


class Body:
    """One of both bodies: stiffness, degrees of freedom of its surface, and those that are held.

    angles: of the surface's nodes, from below.  surface: their degrees of freedom, (nodes, 2).  held: values by index.
    """

    def __init__(self, surface: float, end: float, lifted: float) -> None:
        from skfem import Basis, ElementQuad2, ElementVector
        from skfem.models.elasticity import lame_parameters, linear_elasticity

        basis = Basis(_mesh(surface, end), ElementVector(ElementQuad2()))
        self.stiffness = linear_elasticity(*lame_parameters(MODULUS, POISSON)).assemble(basis)
        x, y = basis.doflocs

        def on(circle: float) -> list[np.ndarray]:  # edges are straight: their middles lie inside of the circle
            edges = basis.mesh.facets_satisfying(lambda p: np.abs(np.hypot(*p) - circle) < 2e-3 * circle, True)
            return [basis.get_dofs(edges).all(f"u^{k}") for k in (1, 2)]

        every, near = basis.get_dofs(elements=True), 1e-6 * RADIUS
        across, along = (every.all(f"u^{k}") for k in (1, 2))
        self.held = dict.fromkeys(across[np.abs(x[across]) < near].tolist(), 0.0)
        self.held |= dict.fromkeys(along[np.abs(y[along]) < near].tolist(), lifted)
        if end > surface:
            self.held |= dict.fromkeys(np.concatenate(on(end)).tolist(), 0.0)
        columns = on(surface)
        order = np.argsort(np.arctan2(x, -y)[columns[0]])
        self.surface = np.stack([one[order] for one in columns], axis=1)
        self.angles = np.arctan2(x, -y)[self.surface[:, 0]]


def pressed(clearance: float, depth: float) -> float:
    """Return the force [N] under a penetration [m], by finite elements."""
    pin, journal = Body(RADIUS, 0.02 * RADIUS, -(clearance + depth)), Body(RADIUS + clearance, 2.0 * RADIUS, 0.0)
    n, m = pin.stiffness.shape[0], journal.stiffness.shape[0]
    K: Any = bmat([[pin.stiffness, None], [None, journal.stiffness]], format="csr")
    held = pin.held | {n + k: value for k, value in journal.held.items()}
    u = np.zeros(n + m)
    u[list(held)] = list(held.values())
    free = np.setdiff1d(np.arange(n + m), list(held))
    angles, rows = pin.angles, np.repeat(np.arange(len(pin.angles)), 2)
    normal = np.stack([np.sin(angles), -np.cos(angles)], axis=1).ravel()
    places = np.concatenate([pin.surface.ravel(), n + journal.surface.ravel()])
    gap_of = csr_array((np.concatenate([-normal, normal]), (np.tile(rows, 2), places)), shape=(len(angles), n + m))
    touching = angles <= 2.0 * math.asin(math.sqrt(0.5 * depth / (clearance + depth)))
    for turn in range(60):
        C: Any = gap_of[touching][:, free]
        system = bmat([[K[free][:, free], C.T], [C, None]], format="csc")
        solved = splu(system).solve(np.concatenate([-(K @ u)[free], -clearance - (gap_of @ u)[touching]]))
        whole, push = u.copy(), np.zeros(len(angles))
        whole[free], push[touching] = solved[: len(free)], -solved[len(free) :]
        after = np.where(touching, push > 0.0, clearance + gap_of @ whole < 0.0)
        if turn > 20:  # pairs at the edge may alternate, of which the force knows nothing
            after &= touching
        if np.array_equal(after, touching):
            return float(2.0 * push @ np.cos(angles) * LENGTH)
        touching = after
    raise RuntimeError("the set of touching nodes does not settle")


def by_law(form: str, clearance: float, depth: float) -> float:
    """Return the force [N] under a penetration [m], by a form of the program, or by Hertz's exponent 1."""
    normal = {"law": "hertz", "exponent": 1.0} if form == "hertz" else {"law": "hertz", "form": form}
    keys = {"type": "clearance-revolute", "between": ["ground.O", "pin.P"], "clearance": clearance, "normal": normal}
    keys |= {"pin_radius": RADIUS, "length": LENGTH, "journal_material": MATERIAL, "pin_material": MATERIAL}
    law = resolve_law(TypeAdapter(Clearance).validate_python(keys), 1.0, "[normal]")
    elastic, _ = FORMS[law.form].force(depth, 0.0, 1.0, law.numbers)
    return float(elastic)


def measure(case: Case) -> list[Record]:
    """Return a record for each penetration of a clearance."""
    clearance = case.of * RADIUS
    found = []
    for share in DEPTHS:
        depth = share * clearance
        force = pressed(clearance, depth)
        ratios = {form: by_law(form, clearance, depth) / force for form in LAWS}
        found.append({"case": case.name, "clearance": clearance, "depth": depth, "force": force, **ratios})
    return found


def show(records: list[Record]) -> str:
    """Return the table of forces over that of finite elements."""
    columns: Columns = {
        "clearance": lambda r: f"{1e6 * r['clearance']:.0f} um",
        "penetration": lambda r: f"{1e6 * r['depth']:.3g} um",
        "force by elements": lambda r: f"{1e-3 * r['force']:.4g} kN",
        **{f"`{form}`": partial(_ratio, form) for form in LAWS},
    }
    return table(records, columns)


def _ratio(form: str, record: Record) -> str:
    return f"{record[form]:.3f}"


FAMILY = Family(
    what="forces of a pin in a tight journal, next to finite elements",
    takes="some minutes",
    page="tight-fits.md",
    cases=lambda: [Case(f"clearance {share:g} of the radius", share) for share in CLEARANCES],
    measure=each(measure),
    show=show,
    times=False,
    code=("flexclear.dynamics.contact",),
)
