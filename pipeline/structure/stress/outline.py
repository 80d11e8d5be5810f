r"""Stress in a cross section from its section forces: linear maps at fibres on the outline and inside.

Axial stress is :math:`\sigma = N/A + M_y z/I_y - M_z y/I_z`. Shear stress of circles and tubes is the exact solution of
St. Venant (torsion and flexure); that of rectangles the exact one of torsion and the parabola of flexure, which leaves
out Poisson's part of the variation across the width.

Sources: Love, *A Treatise on the Mathematical Theory of Elasticity*, ch. XV (flexure of a hollow circular cylinder);
Timoshenko & Goodier, *Theory of Elasticity*, sec. 109 (torsion of a rectangle).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.structure.fe import section as sections
from flexclear.pipeline.structure.fe.section import Section, Value

#: fibres around a round section, a whole step of 5 deg; one of them lies in the plane of bending (`Outline.round`)
AROUND = 72
#: fibres along each side of a rectangle, corners included
ALONG = 9
#: odd terms of the series of a rectangle's torsion; they fall as 1/n^2 at the middle of a side
TERMS = np.arange(1, 400, 2)


@dataclass(frozen=True)
class Outline:
    """Stress maps of one section.

    stress: axial stress and shear along y and z [Pa] per N, Qy, Qz, T, My, Mz, shape (fibres, 3, 6).
    round: the same about every axis, so that y may be turned into the plane of bending.
    """

    stress: np.ndarray
    round: bool


def outline(types: tuple[str, ...], given: Section, poisson: float) -> Outline | None:
    """The maps of a section with these constants that is of one of `types`; None where it has no known outline."""
    name, lengths = sections.shape(types, given)
    if not name:
        return None
    made = getattr(sections, name)(*lengths)
    return _sides(made, *lengths) if name == "rectangle" else _round(made, *lengths, poisson=poisson)


def _round(made: Section, radius: float, inner: float = 0.0, *, poisson: float) -> Outline:
    angle = 2.0 * math.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(angle), np.sin(angle)])
    y, z = np.concatenate([radius * ring, inner * ring if inner else np.zeros((2, 1))], axis=1)
    stress = _axial(made, y, z)
    stress[:, 1, 3], stress[:, 2, 3] = -z / made.torsion, y / made.torsion
    stress[:, 1, 1], stress[:, 2, 1] = _flexure(y, z, radius, inner, poisson, made.second_z)
    # a force along z is one along y, seen a quarter turn on
    stress[:, 2, 2], stress[:, 1, 2] = _flexure(z, y, radius, inner, poisson, made.second_y)
    return Outline(stress, True)


def _axial(made: Section, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    stress = np.zeros((len(y), 3, 6))
    stress[:, 0, 0] = 1.0 / made.area
    stress[:, 0, 4], stress[:, 0, 5] = z / made.second_y, -y / made.second_z
    return stress


def _flexure(
    y: np.ndarray, z: np.ndarray, radius: float, inner: float, poisson: float, second: Value
) -> tuple[np.ndarray, np.ndarray]:
    """Shear stress along y and z per unit force along y."""
    square, k = np.maximum(y**2 + z**2, 1e-12 * radius**2), 0.75 + 0.5 * poisson
    hole = (radius * inner) ** 2
    along = -k * (radius**2 + inner**2) - k * hole * (z**2 - y**2) / square**2 + 0.75 * (y**2 - z**2)
    across = 2.0 * k * hole * y * z / square**2 - 1.5 * y * z
    scale = -1.0 / (2.0 * (1.0 + poisson) * second)
    along = along + 0.5 * poisson * y**2 + (1.0 - 0.5 * poisson) * z**2
    return scale * along, scale * (across + (2.0 + poisson) * y * z)


def _sides(made: Section, width: float, height: float) -> Outline:
    s = np.linspace(-0.5, 0.5, ALONG)
    half = np.full(ALONG, 0.5)
    y = width * np.concatenate([s, s, half, -half, [0.0]])
    z = height * np.concatenate([half, -half, s, s, [0.0]])
    stress = _axial(made, y, z)
    stress[:, 1, 3], stress[:, 2, 3] = _torsion(y, z, width, height, made.torsion)
    stress[:, 1, 1] = 1.5 / made.area * (1.0 - (2.0 * y / width) ** 2)
    stress[:, 2, 2] = 1.5 / made.area * (1.0 - (2.0 * z / height) ** 2)
    return Outline(stress, False)


def _torsion(y: np.ndarray, z: np.ndarray, width: float, height: float, J: Value) -> tuple[np.ndarray, np.ndarray]:
    """Shear stress along y and z of a rectangle per unit torque."""
    a, b, n = 0.5 * width, 0.5 * height, TERMS
    sign = np.where(n % 4 == 1, 1.0, -1.0) / n**2
    wave = np.outer(y, n) * math.pi / (2.0 * a)
    # cosh(k z) / cosh(k b) and sinh(k z) / cosh(k b) without their large exponents
    k, far = n * math.pi / (2.0 * a), np.abs(z)[:, None]
    rise, fall = np.exp(-k * (b - far)), np.exp(-k * (b + far))
    base = 1.0 + np.exp(-2.0 * k * b)
    cosh, sinh = (rise + fall) / base, np.sign(z)[:, None] * (rise - fall) / base
    series = 16.0 * a / math.pi**2
    along_y = -series * np.sum(sign * sinh * np.cos(wave), axis=1)
    along_z = 2.0 * y - series * np.sum(sign * cosh * np.sin(wave), axis=1)
    return along_y / J, along_z / J
