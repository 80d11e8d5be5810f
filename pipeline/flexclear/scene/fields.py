"""Field types that scene files and mesh recipes share: quantities, vectors, poses, sources."""

import ast
import inspect
import math
import re
import textwrap
from dataclasses import dataclass
from functools import cache
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    WithJsonSchema,
    model_validator,
)

from flexclear.numerics.axes import check_axes, check_axis
from flexclear.scene.units import components, quantity, with_article

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Measure:
    """Lets a float, or a vector of three, also be text with a unit of this dimension."""

    dimension: str
    vector: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        return handler.generate_schema(Annotated[source, BeforeValidator(self.read)])

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        one: dict[str, Any] = {"type": ["number", "string"], "format": self.dimension}
        return {"type": "array", "items": one, "minItems": 3, "maxItems": 3} if self.vector else one

    def read(self, value: Any) -> Any:
        """Return the SI value; raise ValueError in words."""
        if not self.vector:
            return quantity(value, self.dimension)
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            raise ValueError(f"expected three components [x, y, z], each {with_article(self.dimension)}")
        return tuple(components(value, self.dimension))


Three = tuple[float, float, float]
Length = Annotated[float, Measure("length")]
Time = Annotated[float, Measure("time")]
Mass = Annotated[float, Measure("mass")]
Force = Annotated[float, Measure("force")]
Angle = Annotated[float, Measure("angle")]
Speed = Annotated[float, Measure("velocity")]
Rate = Annotated[float, Measure("angular velocity")]
Stiffness = Annotated[float, Measure("stiffness")]
Damping = Annotated[float, Measure("damping")]
Pressure = Annotated[float, Measure("pressure")]
Viscosity = Annotated[float, Measure("viscosity")]
Density = Annotated[float, Measure("density")]
Number = Annotated[float, Measure("number")]
Area = Annotated[float, Measure("area")]
SecondMoment = Annotated[float, Measure("second moment of area")]
Position = Annotated[Three, Measure("length", vector=True)]
Velocity = Annotated[Three, Measure("velocity", vector=True)]
AngularVelocity = Annotated[Three, Measure("angular velocity", vector=True)]
Acceleration = Annotated[Three, Measure("acceleration", vector=True)]
Direction = Annotated[Three, Measure("number", vector=True)]
RotationVector = Annotated[Three, Measure("angle", vector=True)]
Positive = Field(gt=0.0)

#: relative rounding errors, of symmetry and of a zero moment, in an inertia that was computed elsewhere, as by rotation
_ROUNDING = 1e-12


def _inertia(value: Any) -> list[list[float]]:
    """Return ``[Ixx, Iyy, Izz]`` or a full 3x3 matrix as three rows [kg m^2]."""
    given = [
        row if isinstance(row, (list, tuple)) else [row] for row in (value if isinstance(value, (list, tuple)) else [])
    ]
    lengths = [len(row) for row in given]
    if lengths not in ([1, 1, 1], [3, 3, 3]):
        raise ValueError("an inertia is [Ixx, Iyy, Izz] or a 3x3 matrix, about the centre of mass")
    entries = components(chain.from_iterable(given), "inertia")
    if lengths == [1, 1, 1]:
        rows = [[entries[i] if i == j else 0.0 for j in range(3)] for i in range(3)]
    else:
        rows = _symmetric([entries[k : k + 3] for k in (0, 3, 6)])
    moments = _principal(rows)
    if moments[0] < -_ROUNDING * moments[2] or moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
        raise ValueError(
            f"principal moments {moments} kg m^2 are impossible: each must be >= 0 and at most the sum of the others"
        )
    return rows


def _symmetric(rows: list[list[float]]) -> list[list[float]]:
    off = max(abs(rows[i][j] - rows[j][i]) for i in range(3) for j in range(i))
    if off > _ROUNDING * max(abs(entry) for row in rows for entry in row):
        raise ValueError(f"an inertia matrix must be symmetric; opposite entries differ by up to {off:.3g} kg m^2")
    return [[0.5 * (rows[i][j] + rows[j][i]) for j in range(3)] for i in range(3)]


def _principal(rows: list[list[float]]) -> list[float]:
    """Return the principal moments, ascending."""
    if not any(rows[i][j] for i in range(3) for j in range(i)):
        return sorted(rows[k][k] for k in range(3))
    import numpy as np  # here, as in `Pose`: most scenes need no NumPy, and without it commands start in half the time

    moments: list[float] = np.linalg.eigvalsh(np.array(rows)).tolist()
    return moments


Inertia = Annotated[
    tuple[Three, Three, Three],
    BeforeValidator(_inertia),
    WithJsonSchema({"type": "array", "description": "[Ixx, Iyy, Izz] or 3x3, about the centre of mass, body axes"}),
]

#: names of bodies and frames: letters of any script, digits, underscores and hyphens
_NAME = r"\w[\w-]*"
#: longest name of a part in characters and bytes: file names contain it and more, and have 255 bytes at most
LONGEST_NAME, LONGEST_BYTES = 100, 200


def part_name(name: str) -> str:
    """Return a part's name if it fits into paths such as ``body.FRAME`` and into file names; else raise ValueError."""
    if len(name) > LONGEST_NAME or not re.fullmatch(_NAME, name):
        raise ValueError(f"'{name}' is not a name: use up to {LONGEST_NAME} letters, digits, _ and -")
    if len(name.encode()) > LONGEST_BYTES:
        raise ValueError(f"'{name}' is too long for the name of a file: {LONGEST_BYTES} bytes in UTF-8 at most")
    if name == "source":
        raise ValueError("'source' cannot be the name of a part: this key cites where values come from")
    return name


def _frame(value: Any) -> Any:
    if isinstance(value, str) and not re.fullmatch(rf"{_NAME}\.{_NAME}", value):
        raise ValueError("a frame must be named with its body, as in 'body.FRAME'")
    return value


PartName = Annotated[str, AfterValidator(part_name)]
FrameName = Annotated[str, BeforeValidator(_frame), WithJsonSchema({"type": "string", "description": "body.FRAME"})]

#: provenance of values: one text for the whole part, or one per key; "assumed: why" for assumptions
Source = str | dict[str, str]


@cache
def _texts(part: type) -> list[tuple[str, str]]:
    """Return the keys that a class of this program declares with a text below, and the texts."""
    if not part.__module__.startswith("flexclear."):
        return []
    try:
        lines = ast.parse(textwrap.dedent(inspect.getsource(part))).body[0].body  # type: ignore[attr-defined]
    except OSError:  # a class made by a function
        return []
    found = list[tuple[str, str]]()
    for pair in pairwise(lines):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                found.append((name, inspect.cleandoc(text)))
    return found


class Part(BaseModel):
    """Base of all models of scene files: frozen, without unknown keys. Texts below keys are their meaning in schemas.

    Modules of parts do not postpone the evaluation of annotations: every command would have to compile each as text.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    #: begin of the paths of its keys, as messages show it
    _owner: ClassVar[str] = "PART."

    source: Source | None = None
    """where the values come from; 'assumed: why' for an assumption"""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the schema with the texts below keys: to read them takes longer than all else of an import."""
        schema = handler(core)
        keys = handler.resolve_ref_schema(schema).get("properties", {})
        for name, text in {name: text for base in reversed(cls.__mro__) for name, text in _texts(base)}.items():
            keys.get(cls.model_fields[name].alias or name, {})["description"] = text
        return schema

    def __setattr__(self, name: str, value: Any) -> None:
        """Raise AttributeError for keys, as a scene is changed by copies; set private attributes."""
        if name in type(self).model_fields:
            remedy = f'fc.edited(scene, {{"{self._owner}{name}": {value!r}}}) returns a changed copy'
            raise AttributeError(f"{name}: a scene and its parts cannot be changed in place; {remedy}")
        super().__setattr__(name, value)


class OnCoordinate(Part):
    """Keys of parts that act on a joint coordinate."""

    joint: str
    """name of the joint"""
    coordinate: str | None = None
    """name of the joint's coordinate, if the joint has several"""


def given_keys(part: Part, keys: tuple[str, ...]) -> list[str]:
    """Return those of the keys that a part has."""
    return [key for key in keys if getattr(part, key) is not None]


def require_one(part: Part, keys: tuple[str, ...], says: str) -> None:
    """Raise ValueError unless a part has exactly one of these keys; says: their purpose, as "says where"."""
    present = given_keys(part, keys)
    if len(present) != 1:
        text = f"{' and '.join(present)} do" if present else "nothing does"
        raise ValueError(f"one of {', '.join(keys)} {says}; here {text}")


def given_once(part: Part, ways: tuple[str, ...]) -> None:
    """Raise ValueError when an orientation is given in more than one of these ways."""
    if len(present := given_keys(part, ways)) > 1:
        raise ValueError(f"give an orientation once, not by {' and '.join(present)}")


class Pose(Part):
    """Position and orientation of a frame in its parent; the orientation in at most one way."""

    position: Position = (0.0, 0.0, 0.0)
    """origin of the frame in its parent"""
    quaternion: tuple[float, float, float, float] | None = None
    """orientation of the frame in its parent as unit quaternion w, x, y, z"""
    rotation_vector: RotationVector | None = None
    """orientation of the frame in its parent as axis times angle"""
    axes: dict[str, Direction] | tuple[Direction, Direction, Direction] | None = None
    """two of the frame's axes as directions in the parent, e.g. ``{ z = [0, 1, 2], x = [1, 0, 0] }``; the first is
    exact, the second is made perpendicular to it. Or all three, as a list [x, y, z]"""
    axis: Direction | None = None
    """direction of z alone, by the least rotation from the parent that brings z there (for -z, half a turn about x)"""

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        given_once(self, ("quaternion", "rotation_vector", "axes", "axis"))
        if self.quaternion is not None and not 0.999 < math.hypot(*self.quaternion) < 1.001:
            raise ValueError(
                f"a quaternion (w, x, y, z) must have norm 1; {list(self.quaternion)} has "
                f"{math.hypot(*self.quaternion):.6g}"
            )
        if self.axes is not None:
            check_axes(self.axes)
        if self.axis is not None:
            check_axis(self.axis)
        return self

    def as_quaternion(self) -> "np.ndarray":
        """Return the unit quaternion w x y z, frame to parent, shape (4,)."""
        import numpy as np

        from flexclear.numerics.rotations import (
            axes_to_matrix,
            axis_to_matrix,
            matrix_to_quaternion,
            rotation_vector_to_quaternion,
        )

        if self.quaternion is not None:
            return np.array(self.quaternion) / np.linalg.norm(self.quaternion)
        if self.rotation_vector is not None:
            return rotation_vector_to_quaternion(np.array(self.rotation_vector))
        if self.axes is not None:
            return matrix_to_quaternion(axes_to_matrix(self.axes))
        if self.axis is not None:
            return matrix_to_quaternion(axis_to_matrix(self.axis))
        return np.array([1.0, 0.0, 0.0, 0.0])
