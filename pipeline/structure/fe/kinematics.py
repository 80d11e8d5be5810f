r"""How a cross section moves: the fields of a cell, their strains, and the motion of the section.

Bernoulli (Euler-Bernoulli and Rayleigh beams): sections stay normal to the axis; deflections are Hermite cubics.
Timoshenko: sections turn by :math:`\psi` on their own, shear strain :math:`\gamma = v' - \psi`. Deflections are
cubic and rotations quadratic, so that :math:`v'` and :math:`\psi` span the same polynomials: slender cells do not lock
(where :math:`\gamma\to 0` the Hermite cubics are left), and frequencies converge with the fourth power of the cell
length.
Without the unknowns inside, condensed statically as in the elements with interdependent interpolation, the shear strain
of a cell is constant, and frequencies converge with the second power only.

Both have the same unknowns at a node: u, twist, v, slope of v, w, slope of w. What is inside a cell comes on top.
Source: Reddy (1997), Comput. Methods Appl. Mech. Eng. 149, 113-132 (interdependent interpolation, consistency of
degrees); Przemieniecki (1968), ch. 5 and 11.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from skfem import Element

from flexclear.pipeline.structure.fe.line_elements import Hierarchical, LocalHermite

#: unknowns of a node in scikit-fem's order, as indices of ux uy uz rx ry rz, with sign: ry = -slope of w
NODE_COMPONENT = (0, 3, 1, 5, 2, 4)
NODE_SIGN = (1.0, 1.0, 1.0, 1.0, 1.0, -1.0)


@dataclass(frozen=True)
class Kinematics:
    """One theory of the section's motion.

    elements: of the fields, for degrees of the extension and of the twist.
    component: index among ux uy uz rx ry rz of each field.
    strains: of the fields, by name.  section: (u, v, w), (twist, slope of v, slope of w) of the fields.
    """

    elements: Callable[[int, int], list[Element]]
    component: tuple[int, ...]
    strains: Callable[[Sequence[Any]], dict[str, Any]]
    section: Callable[[Sequence[Any]], tuple[tuple[Any, ...], tuple[Any, ...]]]


def _bernoulli_strains(fields: Sequence[Any]) -> dict[str, Any]:
    u, t, v, w = fields
    return {"stretch": u.grad[0], "twist": t.grad[0], "bend_v": v.hess[0][0], "bend_w": w.hess[0][0]}


def _bernoulli_section(fields: Sequence[Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    u, t, v, w = fields
    return (u, v, w), (t, v.grad[0], w.grad[0])


def _timoshenko_strains(fields: Sequence[Any]) -> dict[str, Any]:
    u, t, v, a, w, b = fields
    bending = {"bend_v": a.grad[0], "bend_w": b.grad[0]}
    shear = {"shear_v": v.grad[0] - a, "shear_w": w.grad[0] - b}
    return {"stretch": u.grad[0], "twist": t.grad[0]} | bending | shear


def _timoshenko_section(fields: Sequence[Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    u, t, v, a, w, b = fields
    return (u, v, w), (t, a, b)


BERNOULLI = Kinematics(
    lambda extension, twist: [Hierarchical(extension), Hierarchical(twist), LocalHermite(), LocalHermite()],
    (0, 3, 1, 2),
    _bernoulli_strains,
    _bernoulli_section,
)
TIMOSHENKO = Kinematics(
    lambda extension, twist: [Hierarchical(degree) for degree in (extension, twist, 3, 2, 3, 2)],
    (0, 3, 1, 5, 2, 4),
    _timoshenko_strains,
    _timoshenko_section,
)
#: by the recipe's name of the theory; Euler-Bernoulli and Rayleigh differ in the mass alone
THEORIES = {"euler-bernoulli": BERNOULLI, "rayleigh": BERNOULLI, "timoshenko": TIMOSHENKO}
