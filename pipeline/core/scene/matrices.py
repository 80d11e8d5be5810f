"""Symmetric 6x6 matrices between three displacements and three rotations, as scenes write them."""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, WithJsonSchema

from flexclear.pipeline.core.scene.units import quantity

Matrix: TypeAlias = tuple[tuple[float, ...], ...]
NOTHING: Matrix = ((0.0,) * 6,) * 6
#: what computing a matrix elsewhere, such as by turning it, may leave of symmetry and of a zero eigenvalue
_ROUNDING = 1e-9
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def _matrix(value: Any, what: str, dimensions: tuple[str, str, str]) -> Matrix:
    """Rows of the matrix, SI; dimensions: of displacement rows and columns, mixed ones, rotation rows and columns."""
    given = list(value) if isinstance(value, (list, tuple)) else []
    if len(given) == 6 and not any(isinstance(row, (list, tuple)) for row in given):
        given = [[entry if i == j else 0.0 for j in range(6)] for i, entry in enumerate(given)]
    if [len(row) if isinstance(row, (list, tuple)) else 0 for row in given] != [6] * 6:
        raise ValueError(f"a {what} is [x, y, z, rx, ry, rz] or a 6x6 matrix in that order")
    rows = [[_entry(given[i][j], dimensions[(i > 2) + (j > 2)]) for j in range(6)] for i in range(6)]
    return _checked(rows, what)


def _entry(value: Any, dimension: str) -> float:
    """SI value of an entry; a mixed one, a force per angle, is a torque per displacement too, which is a force."""
    try:
        return quantity(value, dimension)
    except ValueError as error:
        other = {"force per angle": "force", "force per angular velocity": "impulse"}.get(dimension)
        if other is None:
            raise
        try:
            return quantity(value, other)
        except ValueError:
            raise error from None


def _checked(rows: list[list[float]], what: str) -> Matrix:
    """The matrix, symmetric to the last digit; ValueError unless it is symmetric and positive semidefinite."""
    sizes = [math.sqrt(abs(rows[k][k])) for k in range(6)]
    for j, i in combinations(range(6), 2):
        asymmetry = abs(rows[i][j] - rows[j][i])
        if asymmetry > _ROUNDING * max(abs(rows[i][j]), abs(rows[j][i]), sizes[i] * sizes[j]):
            raise ValueError(
                f"a {what} matrix must be symmetric; the entries between {_DIRECTIONS[i]} and {_DIRECTIONS[j]} are "
                f"{rows[i][j]:g} and {rows[j][i]:g}"
            )
    mended = tuple(tuple(0.5 * (rows[i][j] + rows[j][i]) for j in range(6)) for i in range(6))
    for k in range(6):
        if mended[k][k] < 0.0:
            raise ValueError(f"a {what} must not be negative; that along {_DIRECTIONS[k]} is {mended[k][k]:g}")
    if any(mended[i][j] for i in range(6) for j in range(i)):
        _require_semidefinite(mended, sizes, what)
    return mended


def _require_semidefinite(matrix: Matrix, sizes: list[float], what: str) -> None:
    import numpy as np  # here, as in `fields`: most scenes are checked without it

    for i, j in product(range(6), repeat=2):
        if matrix[i][j] and not sizes[i]:
            raise ValueError(
                f"a {what} matrix must be positive semidefinite: {_DIRECTIONS[i]} has none of its own, "
                f"but {matrix[i][j]:g} with {_DIRECTIONS[j]}"
            )
    unit = np.array([size or 1.0 for size in sizes])
    values, vectors = np.linalg.eigh(np.array(matrix) / np.outer(unit, unit))
    if values[0] < -_ROUNDING:
        direction = ", ".join(f"{v:.3g}" for v in vectors[:, 0] / unit / np.abs(vectors[:, 0] / unit).max())
        raise ValueError(
            f"a {what} matrix must be positive semidefinite, or it would be a source of energy; "
            f"along [{direction}] it is negative"
        )


def _field(what: str, *dimensions: str) -> Any:
    three = (dimensions[0], dimensions[1], dimensions[2])
    return Annotated[
        tuple[tuple[float, ...], ...],
        BeforeValidator(lambda value: _matrix(value, what, three)),
        WithJsonSchema(
            {"type": "array", "minItems": 6, "maxItems": 6, "description": f"{what}: [x, y, z, rx, ry, rz] or 6x6"}
        ),
    ]


BushingStiffness: TypeAlias = _field("stiffness", "stiffness", "force per angle", "torsional stiffness")  # type: ignore[valid-type]
BushingDamping: TypeAlias = _field("damping", "damping", "force per angular velocity", "torsional damping")  # type: ignore[valid-type]
