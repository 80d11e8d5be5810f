"""Pairs of features of one joint that may touch: where each feature is, and what contact the two make."""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple


class Seat(NamedTuple):
    """Place of a feature in the frame of its joint: origin [m], and its axes there, as rows of the rotation matrix."""

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


#: at the frame itself
MIDDLE = Seat()


@dataclass(frozen=True)
class Pair:
    """Two features of a joint that may touch, each at its seat in a frame of the joint.

    contact: their surfaces and laws, with the attributes of a joint that is one contact.  swapped: the outer feature is
    on the joint's second body.
    """

    contact: Any
    outer: Seat = MIDDLE
    inner: Seat = MIDDLE
    swapped: bool = False

    @property
    def between(self) -> tuple[tuple[str, Seat], tuple[str, Seat]]:
        """Frame of the joint and seat in it, of the outer and the inner feature."""
        frames = self.contact.between[::-1] if self.swapped else self.contact.between
        return (frames[0], self.outer), (frames[1], self.inner)


@dataclass(frozen=True)
class Feature:
    """One of several contacts of a joint, with the attributes of a joint that is one contact.

    Those that the contacts of a joint have in common are the joint's: laws, frames, materials.
    share: of the stiffness and damping of the joint's normal law.
    """

    joint: Any
    name: str
    clearance: float
    share: ClassVar[float] = 1.0
    shape: ClassVar[tuple[float, float, float]] = (0.0, 0.0, 0.0)

    def __getattr__(self, key: str) -> Any:
        """Return an attribute of the joint; copies are made before they have one."""
        if key == "joint":
            raise AttributeError(key)
        return getattr(self.joint, key)

    @property
    def initial_approach_speed(self) -> float | None:
        """Impact rate of this contact, if its surfaces touch at the start."""
        given = self.joint.initial_approach_speed
        return given.get(self.name) if isinstance(given, dict) else given

    @property
    def arm(self) -> float:
        """Distance of the surfaces from the middle of the inner one [m]."""
        return float(self.radius)


class Rough(Feature):
    """The one contact of a joint with a film: rough surfaces, whose gap ends before the clearance does."""


@dataclass(frozen=True)
class Corner(Feature):
    """Corner of one part of a sliding joint above a face of the other.

    end: half the length of the face, along x of its seat [m]; 0 for an unbounded one.
    """

    end: float = 0.0

    hollow, across = False, (2,)

    @property
    def type(self) -> str:
        """Kind of the surfaces."""
        return "ball-on-strip" if self.end else "ball-on-plane"

    @property
    def shape(self) -> tuple[float, float, float]:  # type: ignore[override]
        """Half the length of the face [m]."""
        return self.end, 0.0, 0.0


class Rim(Feature):
    """End of a journal round the axis of a pin that may tilt: the circles meet on the journal's rim."""

    type, hollow, share = "clearance-revolute", True, 0.5

    @property
    def arm(self) -> float:
        """Distance of the rim from its centre [m], negative as the journal is the inner feature here."""
        return -float(self.radius + self.clearance)


class Crown(Feature):
    """Crowned face of a pin's collar above an end of the journal."""

    type, hollow, across = "ball-on-plane", False, (2,)

    @property
    def radius(self) -> float:
        """Radius of curvature of the face [m]."""
        return float(self.joint.thrust_radius or self.joint.pin_radius)


@dataclass(frozen=True)
class Station(Feature):
    """One of `count` points round the end of a journal, below the flat face of a pin's collar.

    They rest on the journal while the pin turns; together they are the ring on which a flat face rests.
    """

    count: int

    type, hollow, across, radius = "ball-on-plane", False, (2,), 0.0

    @property
    def share(self) -> float:  # type: ignore[override]
        """Share of the stiffness and damping of the joint's normal law."""
        return 1.0 / self.count


def axes_along_side(axis: int, side: float, turn: int = 1) -> tuple[tuple[float, float, float], ...]:
    """Return axes, as of a `Seat`, whose z is a frame's axis, or for a `side` of -1 points the other way.

    turn: 1 or 2, the axis of the frame, counted from that one, along which x is.
    """
    columns = ((axis + turn) % 3, side if turn == 1 else -side), ((axis - turn) % 3, 1.0), (axis, side)
    x, y, z = ([value if k == row else 0.0 for k, value in columns] for row in range(3))
    return (x[0], x[1], x[2]), (y[0], y[1], y[2]), (z[0], z[1], z[2])
