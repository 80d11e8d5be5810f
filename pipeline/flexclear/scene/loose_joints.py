"""Joints of surfaces in contact: with clearance, in a slot, on a plane; geometry, materials and laws of each."""

from collections.abc import Mapping
from math import cos, sin, tau
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from flexclear.scene.clearance import Friction, Material, NormalLaw, Wear
from flexclear.scene.fields import FrameName, Length, Part, Positive, Speed
from flexclear.scene.films import Film, JournalFilm
from flexclear.scene.pairs import Corner, Crown, Pair, Rim, Rough, Seat, Station, axes_along_side

#: approach speed of a contact
Rate = Annotated[Speed, Field(ge=0.0)]


class _Contact(Part):
    """Keys of all contacts between surfaces."""

    between: tuple[FrameName, FrameName]
    """frames of the outer and the inner surface, each as body.FRAME"""
    normal: NormalLaw
    """law of the normal force"""
    friction: Friction | None = None
    """law of friction; default: no friction"""
    floor: Annotated[Speed, Positive] | None = None
    """least impact rate of a closing, for grazing and resting contact; default: 1e-5 of the mechanism's size per
    second, at most 1e-6 m/s"""
    initial_approach_speed: Annotated[Speed, Field(ge=0.0)] | None = None
    """impact rate of a contact that exists at the start, which is refused otherwise; 0 for a resting one"""

    #: share of stiffness and damping of the normal law that the contact has
    share: ClassVar[float] = 1.0
    #: names of the outer and the inner surface in keys
    surfaces: ClassVar[tuple[str, str]]
    #: the ideal joint that constrains the two frames in addition to the contact; None for the contact alone
    held: ClassVar[str | None] = None
    #: the ideal joint that connects the two frames without clearance; None where nothing but the contact does
    ideal: ClassVar[str | None] = None
    #: whether the outer surface is hollow, and the inner one moves in it
    hollow: ClassVar[bool] = True
    #: axes of the outer frame along which `ideal` holds the inner one in the middle
    across: ClassVar[tuple[int, ...]] = (0, 1, 2)
    #: axes of the outer frame that show the motion; None for those of the largest motion
    plane: ClassVar[tuple[int, int] | None] = None
    #: what of the outer surface the inner one is near to, in words
    middle: ClassVar[str] = "centre"

    @model_validator(mode="after")
    def _stiffness_known(self) -> Self:
        if self.normal.needs_materials and None in self.materials:
            names = " and ".join(f"{surface}_material" for surface in self.surfaces)
            raise ValueError(f"the contact stiffness is unknown: give {names}, or normal.stiffness")
        return self

    @property
    def stiffness_from_radii(self) -> bool:
        """True when the elastic force follows from the radii of the surfaces."""
        return self.normal.stiffness is None and self.normal.law != "expression"

    @property
    def radius(self) -> float:
        """Radius of the inner surface [m]."""
        return float(getattr(self, f"{self.surfaces[1]}_radius"))

    @property
    def materials(self) -> tuple[Material | None, Material | None]:
        """Materials of the outer and the inner surface."""
        outer, inner = (getattr(self, f"{surface}_material") for surface in self.surfaces)
        return outer, inner

    @property
    def arm(self) -> float:
        """Distance of the surfaces from the middle of the inner one [m]."""
        return self.radius

    @property
    def shape(self) -> tuple[float, float, float]:
        """Further sizes that the kernels of the surfaces need."""
        return 0.0, 0.0, 0.0

    @property
    def pairs(self) -> dict[str, Pair]:
        """Pairs of features that may touch, by name; an empty name stands for the only pair."""
        return {"": Pair(self)}

    def with_approach_speeds(self, speeds: Mapping[str, float]) -> Self:
        """Return the joint with initial approach speeds [m/s] of pairs that touch at the start, by name."""
        return self.model_copy(update={"initial_approach_speed": speeds.get("", dict(speeds))})


class _Clearance(_Contact):
    """Keys of all clearance joints."""

    clearance: Annotated[Length, Positive]
    """half the difference of the diameters"""


class _Ball(_Contact):
    """Keys of all contacts of a ball."""

    ball_radius: Annotated[Length, Positive]
    """radius of the ball"""
    ball_material: Material | None = None
    """elastic constants, for the stiffness"""


class _Worn(_Clearance):
    """Keys of joints whose wear can be computed."""

    wear: Wear | None = None
    """wear of both surfaces; default: none"""
    film: Film | None = None
    """film of a liquid between the surfaces; default: none"""

    @model_validator(mode="after")
    def _film_fitting(self) -> Self:
        if self.film is not None:
            self.film.height(self.clearance)
        return self

    @property
    def pairs(self) -> dict[str, Pair]:
        """The two surfaces; with a film they touch where it is as thin as their roughness."""
        if self.film is None:
            return super().pairs
        return {"": Pair(Rough(self, "", self.clearance - self.film.height(self.clearance)))}


class Pin(_Clearance):
    """Keys of all joints of a pin, whose surfaces meet along a line."""

    held: ClassVar[str | None] = "planar"
    plane = (0, 1)
    pin_radius: Annotated[Length, Positive]
    """radius of the pin"""
    length: Annotated[Length, Positive]
    """length of the bearing along the axis"""
    pin_material: Material | None = None
    """elastic constants, for the stiffness"""


class ClearanceSpherical(_Ball, _Worn):
    """Ball in socket with radial clearance; between = [socket frame, ball frame]."""

    surfaces, ideal = ("socket", "ball"), "spherical"
    type: Literal["clearance-spherical"]
    socket_material: Material | None = None
    """elastic constants, for the stiffness"""


class _Several(_Contact):
    """Keys of joints that may have several contacts."""

    initial_approach_speed: Rate | dict[str, Rate] | None = None  # type: ignore[assignment]
    """impact rate of contacts that exist at the start, which are refused otherwise, or a table of rates by contact; 0
    for resting ones"""

    @model_validator(mode="after")
    def _known_contacts(self) -> Self:
        given = self.initial_approach_speed
        unknown = [name for name in given if name not in self.pairs] if isinstance(given, dict) else []
        if unknown:
            known = ", ".join(filter(None, self.pairs)) or "none, as the joint is one contact"
            raise ValueError(f"initial_approach_speed: there is no '{unknown[0]}'; known: {known}")
        return self


class _Tilting(_Several, Pin):
    """Keys of pins that may tilt in their journal."""

    surfaces = ("journal", "pin")
    journal_material: Material | None = None
    """elastic constants, for the stiffness"""

    @property
    def rims(self) -> dict[str, Pair]:
        """Pairs of the pin and the journal's two ends, ``end_1`` at positive z, each with half of the stiffness."""
        ends = {f"end_{k}": Seat((0.0, 0.0, side * 0.5 * self.length)) for k, side in ((1, 1.0), (2, -1.0))}
        return {name: Pair(Rim(self, name, self.clearance), end, end, swapped=True) for name, end in ends.items()}


class ClearanceRevolute(_Tilting, _Worn):
    """Pin in journal with radial clearance; between = [journal frame, pin frame], axis = z of the journal's frame.

    Its axial motion and its tilt are held, unless it has an `axial_clearance`.
    """

    ideal, across = "revolute", (0, 1)
    type: Literal["clearance-revolute"]
    film: JournalFilm | None = None
    """film of a liquid between pin and journal; default: none"""
    axial_clearance: Annotated[Length, Positive] | None = None
    """gap between either end of the journal and the pin's collar there; the pin then tilts within its clearance, and
    nothing is held but by contacts at both ends and the collars"""
    thrust_radius: Annotated[Length, Positive] | None = None
    """radius of curvature of crowned faces of the collars; default: the pin's radius"""
    collar_radius: Annotated[Length, Positive] | None = None
    """radius of flat faces of the collars, which touch the journal's ends there all around; default: crowned faces"""
    collar_points: Annotated[int, Field(ge=3, le=360)] | None = None
    """number of points all around at which flat faces of the collars may touch; default: 8"""

    @model_validator(mode="after")
    def _require_keys_of_collars(self) -> Self:
        given = next((key for key in ("thrust_radius", "collar_radius") if getattr(self, key) is not None), "")
        if self.axial_clearance is None and given:
            raise ValueError(f"{given} is of collars, which need an axial_clearance; give both or neither")
        if self.collar_points is not None and self.collar_radius is None:
            raise ValueError("collar_points is of flat faces, which need a collar_radius; give both or neither")
        if self.collar_radius is not None:
            if self.thrust_radius is not None:
                raise ValueError("thrust_radius is of crowned faces and collar_radius of flat ones; give one")
            if self.stiffness_from_radii:
                raise ValueError(
                    "the stiffness of flat faces is unknown: give normal.stiffness, or leave out collar_radius"
                )
            if self.collar_radius <= self.pin_radius + self.clearance:
                raise ValueError(
                    f"collar_radius = {self.collar_radius:g} m must be more than the journal's radius, "
                    f"{self.pin_radius + self.clearance:g} m: the face touches the end of the journal around its hole"
                )
        given = next((key for key in ("wear", "film") if getattr(self, key) is not None), "")
        if self.axial_clearance is not None and given:
            raise ValueError(f"the {given} of a pin that tilts is not computed; leave out {given} or axial_clearance")
        return self

    @property
    def held(self) -> str | None:  # type: ignore[override]
        """The ideal joint that holds axial motion and tilt."""
        return "planar" if self.axial_clearance is None else None

    @property
    def pairs(self) -> dict[str, Pair]:
        """The pin in its journal; of one that tilts both ends, and the collars ``thrust_1`` at positive z and 2.

        Flat collars touch at points ``thrust_1_1``, ``thrust_1_2`` ..., from x on about z of the journal.
        """
        gap = self.axial_clearance
        if gap is None:
            return super().pairs
        made = self.rims
        for k, side in ((1, 1.0), (2, -1.0)):
            end, collar = side * 0.5 * self.length, side * (0.5 * self.length + gap)
            if self.collar_radius is None:
                crown = Crown(self, f"thrust_{k}", gap)
                centre = Seat((0.0, 0.0, collar + side * crown.radius))
                made[crown.name] = Pair(crown, Seat((0.0, 0.0, end), axes_along_side(2, side)), centre)
                continue
            face = Seat((0.0, 0.0, collar), axes_along_side(2, -side))
            count = self.collar_points or 8
            for j in range(count):
                angle, station = tau * j / count, Station(self, f"thrust_{k}_{j + 1}", gap, count)
                around = Seat((self.collar_radius * cos(angle), self.collar_radius * sin(angle), end))
                made[station.name] = Pair(station, face, around, swapped=True)
        return made


class ClearanceCylindrical(_Tilting):
    """Pin in journal with radial clearance that slides along the axis, z of the journal's frame, and tilts."""

    ideal, held = "cylindrical", None
    type: Literal["clearance-cylindrical"]

    @property
    def pairs(self) -> dict[str, Pair]:
        """The two ends of the journal."""
        return self.rims


class ClearanceSlot(Pin):
    """Pin in a straight slot with round ends; between = [slot frame, pin frame].

    The slot lies along x of its frame, whose z is the pin's axis; its middle is the frame's origin.
    """

    surfaces, ideal, across, middle = ("slot", "pin"), "slot", (1,), "centre line"
    type: Literal["clearance-slot"]
    clearance: Annotated[Length, Positive]
    """half the slot's width minus the pin's radius"""
    travel: Annotated[Length, Positive]
    """travel of the pin's centre along the slot's middle line, from the centre of one end's half circle to that of the
    other"""
    slot_material: Material | None = None
    """elastic constants, for the stiffness"""

    @property
    def shape(self) -> tuple[float, float, float]:
        """Half the length of the straight part [m]."""
        return 0.5 * self.travel, 0.0, 0.0


class BallOnPlane(_Ball):
    """Ball above an unbounded plane; between = [plane frame, ball frame].

    The plane contains x and y of its frame; the ball is on the side of z.
    """

    surfaces, hollow, plane = ("plane", "ball"), False, (0, 2)
    type: Literal["ball-on-plane"]
    plane_material: Material | None = None
    """elastic constants, for the stiffness"""

    @property
    def clearance(self) -> float:
        """Distance that counts as far [m], since no second wall limits it: the radius."""
        return self.ball_radius


class ClearancePrismatic(_Several, _Clearance):
    """Rectangular slider in a guide with clearance; between = [guide frame, slider frame], each in the middle.

    It slides along z of the guide's frame. Without `width` it also moves across its height, along x, and turns about y,
    and the rest is held; with `width` and `side_clearance` nothing is held but by the contacts. Corners of the slider
    meet the faces of the guide, which are longer than its travel; those of a shorter guide meet the slider's faces.
    With `faces = "bounded"` the slider may leave the guide: corners of both meet the other's faces as far as these go.
    """

    surfaces, ideal, plane = ("guide", "slider"), "prismatic", (0, 2)
    type: Literal["clearance-prismatic"]
    clearance: Annotated[Length, Positive]
    """gap on either side of the slider across its height, when it is in the middle"""
    length: Annotated[Length, Positive]
    """length of the slider, along z"""
    height: Annotated[Length, Positive]
    """height of the slider, along x"""
    width: Annotated[Length, Positive] | None = None
    """width of the slider, along y, when it is loose in this direction as well"""
    side_clearance: Annotated[Length, Positive] | None = None
    """gap on either side of the slider across its width"""
    guide_length: Annotated[Length, Positive] | None = None
    """length of a guide that is shorter than the slider, or has bounded faces; default: longer than the slider's
    travel"""
    faces: Literal["bounded"] | None = None
    """"bounded" for faces that end with the guide and the slider; default: unbounded ones"""
    corner_radius: Annotated[Length, Field(ge=0.0)] = 0.0
    """radius of the corners; default: sharp ones, which need a normal.stiffness"""
    guide_material: Material | None = None
    """elastic constants, for the stiffness"""
    slider_material: Material | None = None
    """elastic constants, for the stiffness"""

    @model_validator(mode="after")
    def _require_keys_of_faces(self) -> Self:
        if (self.width is None) != (self.side_clearance is None):
            given, absent = ("width", "side_clearance") if self.width is not None else ("side_clearance", "width")
            raise ValueError(
                f"{given} is given and {absent} is not: a slider that is loose across its width, too, needs both, "
                "a plane one neither"
            )
        if self.faces is not None and self.guide_length is None:
            raise ValueError("bounded faces end with the guide, whose length is unknown: give guide_length")
        if self.faces is None and self.guide_length is not None and not self.guide_length < self.length:
            raise ValueError(
                f"guide_length = {self.guide_length:g} m is not below the slider's length, {self.length:g} m: it is of "
                "a guide whose ends touch the slider's faces; leave it out where the slider's corners touch the guide, "
                'or give faces = "bounded" where it may leave the guide'
            )
        if self.stiffness_from_radii and not self.corner_radius:
            raise ValueError("the stiffness of sharp corners is unknown: give normal.stiffness, or corner_radius")
        short = min(filter(None, (self.guide_length or self.length, self.height, self.width)))
        if not 2.0 * self.corner_radius < short:
            raise ValueError(
                f"corner_radius = {self.corner_radius:g} m must be less than half the shortest side, {short:g} m"
            )
        return self

    @property
    def held(self) -> str | None:  # type: ignore[override]
        """The ideal joint that holds a slider in its plane."""
        return "guided" if self.width is None else None

    @property
    def radius(self) -> float:
        """Radius of the corners [m]."""
        return self.corner_radius

    @property
    def arms(self) -> tuple[float, float, float]:
        """Distances of the corners that stop a turn about z, x and y of the guide [m]."""
        long = self.guide_length or self.length
        return self.width or self.height, long, long

    @property
    def pairs(self) -> dict[str, Pair]:
        """Pairs of a corner and the face above it: ``corner_1`` to 4 or 8 across the height, ``side_1`` to 8.

        With bounded faces those are of the slider, and ``guide_corner_1``, ``guide_side_1`` ... of the guide.
        """
        if self.faces is not None:
            return self._corners(short=False) | self._corners("guide_", short=True)
        return self._corners(short=self.guide_length is not None)

    def _corners(self, kind: str = "", *, short: bool) -> dict[str, Pair]:
        """Return the pairs of the slider's corners with the guide's faces, or of a short guide's with the slider's.

        kind: what precedes their names.
        """
        r, own = self.corner_radius, (self.guide_length if short else None) or self.length
        ends, other = 0.5 * own - r, self.length if short else self.guide_length
        end = 0.5 * other if self.faces is not None and other is not None else 0.0
        sizes = (0.5 * self.height, 0.5 * (self.width or 0.0), 0.5 * own)
        gaps, made = (self.clearance, self.side_clearance or 0.0, 0.0), dict[str, Pair]()
        # to the centre of a corner's sphere: of the slider's inwards from its faces, of the guide's outwards
        inset = tuple(size + gap + r if short else size - r for size, gap in zip(sizes, gaps, strict=True))
        loose = (0,) if self.width is None else (0, 1)
        signs = [
            (x, y, z) for x in (1.0, -1.0) for y in ((0.0,) if self.width is None else (1.0, -1.0)) for z in (1.0, -1.0)
        ]
        for axis, prefix in zip(loose, ("corner", "side"), strict=False):
            for k, (x, y, z) in enumerate(signs, 1):
                side, name = (x, y)[axis], f"{kind}{prefix}_{k}"
                face = [0.0, 0.0, 0.0]
                face[axis] = side * (sizes[axis] + (0.0 if short else gaps[axis]))
                turn = 2 - axis if end else 1
                seats = Seat((face[0], face[1], face[2]), axes_along_side(axis, side if short else -side, turn))
                centre = Seat((x * inset[0], y * inset[1], z * ends))
                made[name] = Pair(Corner(self, name, gaps[axis], end), seats, centre, swapped=short)
        return made


Clearance = (
    ClearanceSpherical | ClearanceRevolute | ClearanceCylindrical | ClearanceSlot | ClearancePrismatic | BallOnPlane
)
#: all types of contacts
CONTACTS: tuple[Any, ...] = get_args(Clearance)
#: their classes by type
SURFACES: dict[str, Any] = {name: kind for kind in CONTACTS for name in get_args(kind.model_fields["type"].annotation)}
