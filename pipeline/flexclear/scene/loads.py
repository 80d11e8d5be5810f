"""Loads: gravity, forces and torques on frames, springs and dampers, and loads along joint coordinates.

The action of a load of type 'point-force' is described in `dynamics.loads.point_force`.
"""

import math
from itertools import combinations, product
from typing import Annotated, Any, Literal, Self, TypeAlias, get_args

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from flexclear.scene.expression import BENT
from flexclear.scene.fields import (
    Acceleration,
    Damping,
    FrameName,
    Length,
    OnCoordinate,
    Part,
    Stiffness,
    Time,
)
from flexclear.scene.laws import Bare, Value
from flexclear.scene.tables import LookupTable
from flexclear.scene.units import quantity

Components = tuple[Bare, Bare, Bare]

#: a 6x6 matrix between three displacements and three rotations
Matrix: TypeAlias = tuple[tuple[float, ...], ...]
NOTHING: Matrix = ((0.0,) * 6,) * 6
#: relative rounding errors, of symmetry and of a zero eigenvalue, in a matrix that was computed elsewhere
_ROUNDING = 1e-9
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def _matrix(value: Any, what: str, dimensions: tuple[str, str, str], symmetric: bool) -> Matrix:
    """Return the matrix in SI; dimensions: of displacement rows and columns, mixed ones, rotation rows and columns."""
    given = list(value) if isinstance(value, (list, tuple)) else []
    if len(given) == 6 and not any(isinstance(row, (list, tuple)) for row in given):
        given = [[entry if i == j else 0.0 for j in range(6)] for i, entry in enumerate(given)]
    if [len(row) if isinstance(row, (list, tuple)) else 0 for row in given] != [6] * 6:
        raise ValueError(f"a {what} is [x, y, z, rx, ry, rz] or a 6x6 matrix in that order")
    rows = [[_entry(given[i][j], dimensions[(i > 2) + (j > 2)]) for j in range(6)] for i in range(6)]
    return _symmetric_matrix(rows, what) if symmetric else tuple(map(tuple, rows))


def _entry(value: Any, dimension: str) -> float:
    """Return the SI value of an entry; a mixed entry is a force per angle, or equally a torque per displacement."""
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


def _symmetric_matrix(rows: list[list[float]], what: str) -> Matrix:
    """Return the matrix made exactly symmetric; raise ValueError unless symmetric and positive semidefinite."""
    sizes = [math.sqrt(abs(rows[k][k])) for k in range(6)]
    for j, i in combinations(range(6), 2):
        asymmetry = abs(rows[i][j] - rows[j][i])
        if asymmetry > _ROUNDING * max(abs(rows[i][j]), abs(rows[j][i]), sizes[i] * sizes[j]):
            raise ValueError(
                f"a {what} matrix must be symmetric; the entries between {_DIRECTIONS[i]} and {_DIRECTIONS[j]} are "
                f"{rows[i][j]:g} and {rows[j][i]:g}; symmetric = false allows this, for cross-coupled bearings"
            )
    mended = tuple(tuple(0.5 * (rows[i][j] + rows[j][i]) for j in range(6)) for i in range(6))
    for k in range(6):
        if mended[k][k] < 0.0:
            raise ValueError(f"a {what} must not be negative; the entry along {_DIRECTIONS[k]} is {mended[k][k]:g}")
    if any(mended[i][j] for i in range(6) for j in range(i)):
        _require_semidefinite(mended, sizes, what)
    return mended


def _require_semidefinite(matrix: Matrix, sizes: list[float], what: str) -> None:
    import numpy as np  # here, as in `fields`: most scenes are checked without it

    for i, j in product(range(6), repeat=2):
        if matrix[i][j] and not sizes[i]:
            raise ValueError(
                f"a {what} matrix must be positive semidefinite: {_DIRECTIONS[i]} has none on the "
                f"diagonal, but {matrix[i][j]:g} with {_DIRECTIONS[j]}"
            )
    unit = np.array([size or 1.0 for size in sizes])
    values, vectors = np.linalg.eigh(np.array(matrix) / np.outer(unit, unit))
    if values[0] < -_ROUNDING:
        direction = ", ".join(f"{v:.3g}" for v in vectors[:, 0] / unit / np.abs(vectors[:, 0] / unit).max())
        raise ValueError(
            f"a {what} matrix must be positive semidefinite, or it would supply energy; along "
            f"[{direction}] it is negative"
        )


def _field(what: str, *dimensions: str) -> Any:
    three = (dimensions[0], dimensions[1], dimensions[2])
    return Annotated[
        tuple[tuple[float, ...], ...],
        BeforeValidator(lambda value, info: _matrix(value, what, three, info.data.get("symmetric", True))),
        WithJsonSchema(
            {"type": "array", "minItems": 6, "maxItems": 6, "description": f"{what}: [x, y, z, rx, ry, rz] or 6x6"}
        ),
    ]


BushingStiffness: TypeAlias = _field("stiffness", "stiffness", "force per angle", "torsional stiffness")  # type: ignore[valid-type]
BushingDamping: TypeAlias = _field("damping", "damping", "force per angular velocity", "torsional damping")  # type: ignore[valid-type]


class Gravity(Part):
    """Uniform acceleration field, world axes."""

    type: Literal["gravity"]
    acceleration: Acceleration
    """acceleration of a falling body, world axes"""


class PointForce(Part):
    """Force [N] at the origin of a frame; each component is a value or a law of time."""

    type: Literal["point-force"]
    frame: FrameName
    force: Components
    """components x, y, z [N]"""
    axes: Literal["world", "frame"] = "world"
    """axes of the components; those of the frame rotate with it"""


class PointTorque(Part):
    """Torque [N m] on the body of a frame; each component is a value or a law of time."""

    type: Literal["point-torque"]
    frame: FrameName
    torque: Components
    """components x, y, z [N m]"""
    axes: Literal["world", "frame"] = "world"
    """axes of the components; those of the frame rotate with it"""


class SpringDamper(Part):
    """Spring and damper between the origins of two frames, along the line between them.

    Tension: stiffness (length - free_length) + damping (rate of the length).
    """

    type: Literal["spring-damper"]
    between: tuple[FrameName, FrameName]
    """the two frames"""
    stiffness: Annotated[Stiffness, Field(ge=0.0)] = 0.0
    """force per length"""
    damping: Annotated[Damping, Field(ge=0.0)] = 0.0
    """force per speed"""
    free_length: Annotated[Length, Field(ge=0.0)] | None = None
    """length at which the spring force is zero"""

    @model_validator(mode="after")
    def _check_action(self) -> Self:
        if self.stiffness == 0.0 and self.damping == 0.0:
            raise ValueError("a spring-damper needs a stiffness, a damping, or both; it has neither")
        if self.stiffness > 0.0 and self.free_length is None:
            raise ValueError("a spring needs a free_length, its length without force; none is given")
        return self


class JointForce(OnCoordinate):
    """Force [N] or torque [N m] along a joint coordinate, on the joint's second body: a motor of given strength."""

    type: Literal["joint-force"]
    force: Bare
    """force or torque over time"""


class _ByExpression(Part):
    """Keys of loads by an expression of `values`, quantities of position and velocity, and the time `t`."""

    values: dict[str, Value] = Field(default_factory=dict)
    """named constants, each a number or text with its unit"""
    tables: dict[str, LookupTable] = Field(default_factory=dict)
    """named tables: ``table(NAME, ...)`` is the value of `tables.NAME` there"""

    @property
    def texts(self) -> tuple[str, ...]:
        """The expressions of the load's components."""
        force: str | tuple[str, ...] = self.force  # type: ignore[attr-defined]
        return (force,) if isinstance(force, str) else force

    @property
    def bends(self) -> bool:
        """True when an expression contains functions whose slope jumps."""
        return any(f"{name}(" in text.replace(" ", "") for name in BENT for text in self.texts)


class JointExpression(OnCoordinate, _ByExpression):
    """Force [N] or torque [N m] along a joint coordinate, on the joint's second body, by an expression."""

    type: Literal["joint-expression"]
    force: str
    """the expression, as ``-k * max(0, guide.position - 10 mm)^1.5``"""


class LineExpression(_ByExpression):
    """Tension between the origins of two frames, along the line between them, by an expression."""

    type: Literal["line-expression"]
    between: tuple[FrameName, FrameName]
    """the two frames"""
    force: str
    """the expression; positive pulls the frames together. `length` is their distance, `rate` its rate"""


class PointExpression(_ByExpression):
    """Force [N] at the origin of a frame by an expression for each component, or by one with a vector as value."""

    type: Literal["point-expression"]
    frame: FrameName
    force: str | tuple[str, str, str]
    """components x, y, z, or one vector"""
    axes: Literal["world", "frame"] = "world"
    """axes of the components; those of the frame rotate with it"""


class JointSpring(OnCoordinate):
    """Spring and damper along a joint coordinate: -stiffness (coordinate - rest) - damping (rate).

    Full turns count: an angle may grow beyond 180 deg.
    """

    type: Literal["joint-spring"]
    stiffness: Value = 0.0
    """force, or torque, per unit of the coordinate"""
    damping: Value = 0.0
    """force, or torque, per unit of the coordinate's rate"""
    rest: Value = 0.0
    """coordinate at which the spring force is zero"""


class Coulomb(Part):
    """Friction force [N] or torque [N m] over the speed: rises to `static` at v_static, falls to `dynamic`."""

    static: Value
    """friction at the speeds v_static and v_dynamic"""
    dynamic: Value
    """friction at the speeds v_static and v_dynamic"""
    v_static: Value
    """speeds along the coordinate, the first below the second"""
    v_dynamic: Value
    """speeds along the coordinate, the first below the second"""


class JointFriction(OnCoordinate):
    """Friction along a joint coordinate: viscous coefficient times the rate, plus Coulomb friction."""

    type: Literal["joint-friction"]
    viscous: Value = 0.0
    """friction per unit of the rate"""
    coulomb: Coulomb | None = None
    """Coulomb friction of given strength"""

    @property
    def bends(self) -> bool:
        """True when the friction has speeds at which its slope or curvature jumps."""
        return self.coulomb is not None


class Bushing(Part):
    """Elastic mount between two frames: force -(stiffness x + damping dx/dt) on six displacements x of the second.

    The displacements are those of the second frame in the first one's axes: x, y, z of its origin and the rotation
    vector, which is followed up to a full turn.
    """

    type: Literal["bushing"]
    between: tuple[FrameName, FrameName]
    """the frame of the mount, and the frame that it carries"""
    symmetric: bool = True
    """false allows any 6x6 matrices, as of cross-coupled bearings and seals; the work of the skew-symmetric part of the
    stiffness is work of the load"""
    stiffness: BushingStiffness = NOTHING
    """six numbers on the diagonal, or a symmetric, positive semidefinite 6x6 matrix; any with `symmetric = false`"""
    damping: BushingDamping = NOTHING
    """six numbers on the diagonal, or a symmetric, positive semidefinite 6x6 matrix; any with `symmetric = false`"""

    @model_validator(mode="after")
    def _check_action(self) -> Self:
        if self.stiffness == NOTHING and self.damping == NOTHING:
            raise ValueError("a bushing needs a stiffness, a damping, or both; it has neither")
        return self


class _Controller(OnCoordinate):
    """Keys of controllers. They push `joint` along its coordinate by a law of the error = reference - measured."""

    measured: str | None = None
    """the measured coordinate, ``A`` or ``A.rotation``; default: the one that is pushed"""
    reference: Bare
    """desired value of the measured coordinate, a law of time"""
    proportional: Value = 0.0
    """gain [force, or torque, per unit of the measured coordinate]"""
    integral: Value = 0.0
    """gain of the integral [1/s of the proportional unit]"""
    derivative: Value = 0.0
    """gain of the derivative [s of the proportional unit]"""
    limits: tuple[Value, Value] | None = None
    """least and largest force"""
    tracking_time: Annotated[Time, Field(gt=0.0)] | None = None
    """time in which the integral adapts to a limited output [s]; default proportional/integral"""


class Pid(_Controller):
    """Continuous PID: proportional e + integral of (integral e + (force - asked)/tracking_time) + derivative de/dt."""

    type: Literal["pid"]


class SampledPid(_Controller):
    """PID that samples every `period` from the start of the run, and holds its output in between (zero-order hold).

    At sample k: proportional e_k + I_k + derivative (e_k - e_(k-1))/period, no derivative at the first;
    I_(k+1) = I_k + period (integral e_k + (force - asked)/tracking_time).
    """

    type: Literal["sampled-pid"]
    period: Annotated[Time, Field(gt=0.0)]
    """time between two samples"""


#: loads whose force is an expression
EXPRESSIONS = (JointExpression, LineExpression, PointExpression)
Load = Annotated[
    Gravity
    | PointForce
    | PointTorque
    | SpringDamper
    | JointForce
    | JointExpression
    | LineExpression
    | PointExpression
    | JointSpring
    | JointFriction
    | Bushing
    | Pid
    | SampledPid,
    Field(discriminator="type"),
]
#: all types of loads
KINDS: tuple[Any, ...] = get_args(get_args(Load)[0])
