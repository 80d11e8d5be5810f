"""Vectors, matrices and spatial quantities with operators; their entries are numbers or symbols.

All are nested tuples, so they are arguments and results of routines. Frames stand in the names of symbols: R_WB turns
components in axes of B into components in axes of W, p_SB is the vector from S to B.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple


class Vector(tuple):
    """Three components."""

    __slots__ = ()
    __array_priority__ = 1.0  # NumPy's numbers leave products to the vector

    def __add__(self, b: Any) -> Any:
        return type(self)([x + y for x, y in zip(self, b, strict=True)])

    def __sub__(self, b: Any) -> Any:
        return type(self)([x - y for x, y in zip(self, b, strict=True)])

    def __mul__(self, factor: Any) -> Any:
        return type(self)([factor * x for x in self])

    __rmul__ = __mul__

    def __neg__(self) -> Any:
        return type(self)([-x for x in self])


class Symmetric(Vector):
    """The entries xx yy zz xy xz yz of a symmetric matrix."""

    __slots__ = ()

    def __matmul__(self, b: Any) -> Any:
        return self.full @ b

    @property
    def full(self) -> Matrix:
        """The matrix with all entries."""
        xx, yy, zz, xy, xz, yz = self
        return Matrix([xx, xy, xz, xy, yy, yz, xz, yz, zz])


class Matrix(Vector):
    """Nine entries, row by row."""

    __slots__ = ()

    def __matmul__(self, b: Any) -> Any:
        rows = [self[3 * i : 3 * i + 3] for i in range(3)]
        if isinstance(b, Symmetric):
            b = b.full
        if isinstance(b, Matrix):
            return Matrix([dot(row, b[j::3]) for row in rows for j in range(3)])
        return Vector([dot(row, b) for row in rows])

    @property
    def T(self) -> Matrix:
        """The transposed matrix."""
        return Matrix([self[3 * j + i] for i in range(3) for j in range(3)])

    @property
    def symmetric(self) -> Symmetric:
        """The entries of this symmetric matrix."""
        return Symmetric([self[0], self[4], self[8], self[1], self[2], self[5]])

    def column(self, k: int) -> Vector:
        """Return a column."""
        return Vector(self[k::3])


def dot(a: Any, b: Any) -> Any:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> Vector:
    """Return the vector product a x b."""
    return Vector([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def outer(a: Any, b: Any) -> Matrix:
    """Return the matrix a b^T."""
    return Matrix([x * y for x in a for y in b])


def skew(a: Any) -> Matrix:
    """Return the matrix that maps b to a x b."""
    return Matrix([0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0])


ZERO, UNIT = Vector([0.0] * 3), Matrix([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
#: unit vectors along x, y and z
AXES = tuple(UNIT.column(k) for k in range(3))


class Twist(NamedTuple):
    """A velocity or acceleration of a body, or its motion per unit of a speed. linear: of the point it refers to."""

    angular: Any
    linear: Any

    def __add__(self, b: Any) -> Twist:
        return Twist(self.angular + b.angular, self.linear + b.linear)

    def __mul__(self, factor: Any) -> Twist:
        return Twist(self.angular * factor, self.linear * factor)

    def seen(self, R: Matrix) -> Twist:
        """Return the twist in other axes."""
        return Twist(R @ self.angular, R @ self.linear)

    def at(self, arm: Any) -> Twist:
        """Return the acceleration of the point to which `arm` leads, without the part from velocities."""
        return Twist(self.angular, self.linear + cross(self.angular, arm))


class Motion(NamedTuple):
    """Motion of a frame in the world, in its axes. alpha, a: without the part from unknown rates of speeds."""

    R_WB: Matrix
    p_WB: Vector
    omega: Vector
    v: Vector
    alpha: Vector
    a: Vector


class Wrench(NamedTuple):
    """A moment about a point [N m] and a force [N]."""

    moment: Any
    force: Any

    def __add__(self, b: Any) -> Wrench:
        return Wrench(self.moment + b.moment, self.force + b.force)

    def __sub__(self, b: Any) -> Wrench:
        return Wrench(self.moment - b.moment, self.force - b.force)

    def __mul__(self, factor: Any) -> Wrench:
        return Wrench(self.moment * factor, self.force * factor)

    def on(self, twist: Twist) -> Any:
        """Return the power on a velocity, or the force along a coordinate by its motion."""
        return dot(self.moment, twist.angular) + dot(self.force, twist.linear)

    def about(self, arm: Any) -> Wrench:
        """Return the wrench about the point from which `arm` leads to the present one."""
        return Wrench(self.moment + cross(arm, self.force), self.force)


AT_REST = Twist(ZERO, ZERO)


class Inertia(NamedTuple):
    """Maps accelerations to the wrenches that they need: moment A a + B b, force B^T a + C b."""

    A: Any
    B: Any
    C: Any

    def __add__(self, o: Any) -> Inertia:
        return Inertia(self.A + o.A, self.B + o.B, self.C + o.C)

    def of(self, twist: Twist) -> Wrench:
        """Return the wrench that an acceleration needs."""
        a, b = twist
        return Wrench(self.A @ a + self.B @ b, self.B.T @ a + self.C @ b)

    def without(self, g: Wrench, share: Any) -> Inertia:
        """Return this inertia less share g g^T."""
        m, f = share * g.moment, share * g.force
        A, C = (outer(a, b).symmetric for a, b in ((m, g.moment), (f, g.force)))
        return Inertia(self.A - A, self.B - outer(m, g.force), self.C - C)

    def about(self, arm: Any) -> Inertia:
        """Return the inertia about the point from which `arm` leads to the present one."""
        a = skew(arm)
        B = self.B + a @ self.C
        return Inertia(self.A + (a @ self.B.T).symmetric + (B @ a.T).symmetric, B, self.C)


#: the inertia of nothing
WITHOUT = Inertia(Symmetric([0.0] * 6), Matrix([0.0] * 9), Symmetric([0.0] * 6))


def total(twists: Iterable[Twist], factors: Iterable[Any]) -> Twist:
    """Return the sum of twists, each times its factor."""
    return sum((twist * factor for twist, factor in zip(twists, factors, strict=True)), AT_REST)
