"""Contacts in a scene: geometry, materials, normal law, friction law; and the friction of ideal joints.

The friction law 'modified-coulomb' is described in `dynamics.contact.friction.modified_coulomb`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, Union, get_args

from pydantic import Field, create_model, model_validator

from flexclear.scene import law_expressions
from flexclear.scene.fields import Force, FrameName, Length, Mass, Number, Part, Positive, Pressure, Speed
from flexclear.scene.laws import Value

Share = Field(ge=0.0, le=1.0)


class Material(Part):
    """Elastic constants of a contacting surface."""

    youngs_modulus: Annotated[Pressure, Positive]
    """Young's modulus"""
    poisson: Annotated[Number, Field(ge=0.0, lt=0.5)]
    """Poisson's ratio"""


class _Normal(Part):
    """Keys of all normal contact laws; `stiffness` may be given instead of materials and radii."""

    restitution: Annotated[Number, Share] | None = None
    """the law's own parameter c_r; a free impact rebounds with c_r only as well as the law achieves"""
    delivered_restitution: Annotated[Number, Share] | None = None
    """coefficient of restitution that a free impact must have; the law's parameter follows from it"""
    stiffness: Annotated[Number, Positive] | None = None
    """K in force = K penetration^exponent [N/m^exponent]; default: from materials and radii"""

    @model_validator(mode="after")
    def _one_restitution(self) -> Self:
        if self.restitution is not None and self.delivered_restitution is not None:
            raise ValueError(
                "restitution (the law's parameter) and delivered_restitution (the rebound) are alternatives; give one"
            )
        return self

    @property
    def given_restitution(self) -> float | None:
        """The restitution that the scene gives, of either kind."""
        return self.restitution if self.delivered_restitution is None else self.delivered_restitution

    @property
    def needs_mass(self) -> bool:
        """True when the damping follows from the mass that rebounds, and none is given."""
        return False

    @property
    def needs_materials(self) -> bool:
        """True when the elastic force follows from materials and radii."""
        return self.stiffness is None

    @property
    def kind(self) -> str:
        """What code of the law depends on besides its name: form of a tight fit, or structure of an expression."""
        return ""


class Layer(Part):
    """Elastic layer on a rigid surface."""

    modulus: Annotated[Pressure, Positive]
    """pressure over strain of the layer, which cannot spread sideways: E (1 - nu) / ((1 + nu) (1 - 2 nu))"""
    thickness: Annotated[Length, Positive]
    """thickness of the layer"""


class _Elastic(_Normal):
    """Keys of laws whose elastic force may be that of a tight fit."""

    exponent: Annotated[Number, Field(ge=1.0)] = 1.5
    """exponent of the penetration"""
    form: Literal["johnson", "radzimovsky", "goldsmith", "esdu-78035", "liu", "pereira", "winkler"] | None = None
    """elastic force of a tight fit, from radii and materials; default: a power of the penetration"""
    layer: Layer | None = None
    """elastic layer between the surfaces, for the form 'winkler'"""

    @model_validator(mode="after")
    def _one_elastic_force(self) -> Self:
        if self.form is not None and (self.stiffness is not None or self.exponent != 1.5):
            raise ValueError(f"the form '{self.form}' has its own stiffness; leave out stiffness and exponent")
        if (self.form == "winkler") != (self.layer is not None):
            raise ValueError("the form 'winkler' and layer = { modulus, thickness } belong together; give both")
        return self

    @property
    def needs_materials(self) -> bool:
        """True when the elastic force follows from materials and radii."""
        return self.stiffness is None and self.layer is None

    @property
    def kind(self) -> str:
        """Form of a tight fit."""
        return self.form or ""


class Hertz(_Elastic):
    """Elastic contact without loss."""

    law: Literal["hertz"]

    @model_validator(mode="after")
    def _check_restitution(self) -> Self:
        if self.delivered_restitution not in (None, 1.0):
            raise ValueError(
                f"the law 'hertz' has no loss and cannot deliver a restitution of {self.delivered_restitution:g}; "
                "choose a law with damping"
            )
        return self


class Hysteretic(_Elastic):
    """Hertzian contact with a damping in proportion to the elastic force, by the law's factor for the restitution."""

    law: Literal[
        "hunt-crossley",
        "herbert-mcwhannell",
        "lee-wang",
        "lankarani-nikravesh",
        "gonthier",
        "flores",
        "hu-guo",
        "zhiying-qishao",
        "carvalho-martins",
    ]
    """name of the law, as docs/contact.md lists them"""

    @model_validator(mode="after")
    def _check_damping(self) -> Self:
        if self.given_restitution is None:
            raise ValueError(f"the law '{self.law}' needs a restitution, or a delivered_restitution")
        return self


class KelvinVoigt(_Normal):
    """Linear spring and damper in parallel."""

    law: Literal["kelvin-voigt"]
    damping: Annotated[Number, Field(ge=0.0)] | None = None
    """damping coefficient [N s/m]; default: from the restitution"""
    effective_mass: Annotated[Mass, Positive] | None = None
    """mass that rebounds; default: the reduced mass of the two bodies"""
    exponent: Annotated[Number, Field(ge=1.0, le=1.0)] = 1.0
    """exponent of the penetration: the law is linear"""

    @property
    def needs_mass(self) -> bool:
        """True when the damping follows from the mass that rebounds, and none is given."""
        return self.given_restitution is not None and self.effective_mass is None

    @model_validator(mode="after")
    def _check_damping(self) -> Self:
        if self.damping is None and self.given_restitution is None:
            raise ValueError("the law 'kelvin-voigt' needs a damping [N s/m], or a restitution")
        if self.damping is not None and self.given_restitution is not None:
            raise ValueError("damping and restitution are alternatives; give one")
        return self


class NormalExpression(Part):
    """A law of one's own: the normal force as an expression, which is never negative where the run uses it.

    Variables are the penetration `depth`, its rate, and `impact_rate`, the rate at which this contact began. What the
    force is at rate 0 is stored, the rest is damping.
    """

    law: Literal["expression"]
    force: str
    """the expression, as ``K*depth^1.5*(1 + a*rate/impact_rate)``"""
    values: dict[str, Value] = Field(default_factory=dict)
    """named constants of the expression, each a number or text with its unit"""
    restitution: Annotated[Number, Share] | None = None
    """restitution that the damping is meant to cause; the expression may contain it"""

    stiffness: ClassVar[None] = None
    needs_mass: ClassVar[bool] = False
    needs_materials: ClassVar[bool] = False

    @property
    def named(self) -> dict[str, Any]:
        """Named values of the expression, the restitution last."""
        return self.values | ({} if self.restitution is None else {"restitution": self.restitution})

    @property
    def encoded(self) -> tuple[str, tuple[float, ...]]:
        """Structure and values of the expression (`scene.law_expressions`)."""
        return law_expressions.encoded(self.force, self.named, law_expressions.NORMAL)

    @property
    def kind(self) -> str:
        """Structure of the expression."""
        return self.encoded[0]

    def check(self, *, turning: bool = False) -> None:
        """Raise ValueError, in words, for an expression without meaning. turning: for the end of an angle."""
        variables, dimension = (law_expressions.ANGULAR, "torque") if turning else (law_expressions.NORMAL, "force")
        law_expressions.check("normal.force", self.force, self.named, variables, dimension)


NormalLaw = Annotated[Hertz | Hysteretic | KelvinVoigt | NormalExpression, Field(discriminator="law")]
#: all kinds of normal laws
NORMALS: tuple[Any, ...] = get_args(get_args(NormalLaw)[0])


class _Friction(Part):
    """What all friction laws have; `kind`: by which code is composed."""

    @property
    def kind(self) -> str:
        """Name of the law, with the structure of its expression."""
        return str(self.law)  # type: ignore[attr-defined]


class ModifiedCoulomb(_Friction):
    """Wang & Wang's modified Coulomb friction, with its four parameters (Table 6)."""

    law: Literal["modified-coulomb"]
    static: Annotated[Number, Field(ge=0.0)]
    """largest coefficient of friction"""
    dynamic: Annotated[Number, Field(ge=0.0)]
    """coefficient of friction at high speed"""
    v_static: Annotated[Speed, Positive]
    """sliding speed at which the coefficient is `static`"""
    v_dynamic: Annotated[Speed, Positive]
    """sliding speed from which the coefficient is `dynamic`"""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.v_static < self.v_dynamic:
            raise ValueError(
                "v_static must be below v_dynamic, as friction falls from static to dynamic between them; "
                f"v_static = {self.v_static:g} m/s, v_dynamic = {self.v_dynamic:g} m/s"
            )
        _not_above(self.dynamic, self.static)
        return self


class Ambrosio(_Friction):
    """Ambrosio's Coulomb friction: none below v0, a linear rise to `dynamic` at v1."""

    law: Literal["ambrosio"]
    dynamic: Annotated[Number, Field(ge=0.0)]
    """coefficient of friction"""
    v0: Annotated[Speed, Field(ge=0.0)]
    """sliding speed up to which friction is zero"""
    v1: Annotated[Speed, Positive]
    """sliding speed from which friction has its full value"""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.v0 < self.v1:
            raise ValueError(
                "v0 must be below v1, as friction rises from zero at v0 to `dynamic` at v1; "
                f"v0 = {self.v0:g} m/s, v1 = {self.v1:g} m/s"
            )
        return self


class LuGre(_Friction):
    """LuGre friction per unit of normal force."""

    law: Literal["lugre"]
    static: Annotated[Number, Positive]
    """coefficient of friction when sliding begins"""
    dynamic: Annotated[Number, Positive]
    """coefficient of friction at high speed"""
    v_stribeck: Annotated[Speed, Positive]
    """speed over which friction falls from static to dynamic"""
    bristle_stiffness: Annotated[Number, Positive]
    """sigma_0 [1/m], over the normal force"""
    bristle_damping: Annotated[Number, Field(ge=0.0)] = 0.0
    """sigma_1 [s/m], over the normal force"""
    viscous: Annotated[Number, Field(ge=0.0)] = 0.0
    """sigma_2 [s/m], over the normal force"""

    @model_validator(mode="after")
    def _check_passivity(self) -> Self:
        _not_above(self.dynamic, self.static)
        # the damping fades as exp(-(v/v_stribeck)^2); its v-fold is then at most 0.4289 v_stribeck sigma_1, and
        # the law takes energy only while that stays below 4 mu (Barahanov & Ortega 2000, for constant damping)
        most = 4.0 * self.dynamic / (0.42888194248035340 * self.v_stribeck)
        if self.bristle_damping > most:
            raise ValueError(
                f"bristle_damping = {self.bristle_damping} s/m would add energy to the "
                f"sliding; with these coefficients at most {most:.6g} s/m dissipates"
            )
        return self


class FrictionExpression(_Friction):
    """A law of one's own: the coefficient of friction as an expression of the sliding speed and the normal force."""

    law: Literal["expression"]
    coefficient: str
    """the expression of `slip` and `normal_force`, zero at rest, as ``mu*tanh(slip/v)``"""
    values: dict[str, Value] = Field(default_factory=dict)
    """named constants of the expression, each a number or text with its unit"""

    @property
    def encoded(self) -> tuple[str, tuple[float, ...]]:
        """Structure and values of the expression (`scene.law_expressions`)."""
        return law_expressions.encoded(self.coefficient, self.values, law_expressions.SLIDING)

    @property
    def kind(self) -> str:
        """Structure of the expression."""
        return self.encoded[0]

    def check(self) -> None:
        """Raise ValueError, in words, for an expression without meaning."""
        law_expressions.check("friction.coefficient", self.coefficient, self.values, law_expressions.SLIDING, "number")


Friction = Annotated[ModifiedCoulomb | Ambrosio | LuGre | FrictionExpression, Field(discriminator="law")]
#: all friction laws
FRICTIONS: tuple[Any, ...] = get_args(get_args(Friction)[0])


def _not_above(dynamic: float, static: float) -> None:
    if dynamic > static:
        raise ValueError(
            "dynamic must not exceed static, as friction does not grow when sliding begins; "
            f"dynamic = {dynamic:g} exceeds static = {static:g}"
        )


class Wear(Part):
    """Archard's wear of a contact: depth = coefficient * normal force * sliding distance / (hardness * area)."""

    coefficient: Annotated[Number, Positive]
    """wear coefficient k [-] of the pair of surfaces"""
    hardness: Annotated[Pressure, Positive]
    """hardness of the softer surface"""
    sectors: Annotated[int, Field(ge=4, le=720)] = 36
    """number of sectors about their axis into which both surfaces are divided for the map of depths; a ball and its
    socket also into bands of equal area"""


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
    def shape(self) -> tuple[float, float]:
        """Further sizes that the kernels of the surfaces need."""
        return 0.0, 0.0

    @property
    def pairs(self) -> dict[str, Pair]:
        """Pairs of features that may touch, by name; an empty name stands for the only pair."""
        return {"": Pair(self)}

    def begun(self, speeds: Mapping[str, float]) -> Self:
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


class Pin(_Clearance):
    """Keys of all joints of a pin, whose surfaces meet along a line."""

    held, plane = "planar", (0, 1)
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
    shape: ClassVar[tuple[float, float]] = (0.0, 0.0)

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


class Corner(Feature):
    """Corner of one part of a sliding joint above a face of the other."""

    type, hollow, across = "ball-on-plane", False, (2,)


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


class _Several(_Contact):
    """Keys of joints that may have several contacts."""

    initial_approach_speed: Annotated[Speed, Field(ge=0.0)] | dict[str, Annotated[Speed, Field(ge=0.0)]] | None = None
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
    axial_clearance: Annotated[Length, Positive] | None = None
    """gap between either end of the journal and the pin's collar there; the pin then tilts within its clearance, and
    nothing is held but by contacts at both ends and the collars"""
    thrust_radius: Annotated[Length, Positive] | None = None
    """radius of curvature of the collars' faces; default: the pin's radius"""

    @model_validator(mode="after")
    def _tilting(self) -> Self:
        given = next((key for key in ("thrust_radius",) if getattr(self, key) is not None), "")
        if self.axial_clearance is None and given:
            raise ValueError(f"{given} is of collars, which need an axial_clearance; give both or neither")
        if self.axial_clearance is not None and self.wear is not None:
            raise ValueError("the wear of a pin that tilts is not computed; leave out wear or axial_clearance")
        return self

    @property
    def held(self) -> str | None:  # type: ignore[override]
        """The ideal joint that holds axial motion and tilt."""
        return "planar" if self.axial_clearance is None else None

    @property
    def pairs(self) -> dict[str, Pair]:
        """The pin in its journal; of one that tilts both ends, and the collars ``thrust_1`` at positive z and 2."""
        gap = self.axial_clearance
        if gap is None:
            return super().pairs
        made = self.rims
        for k, side in ((1, 1.0), (2, -1.0)):
            crown = Crown(self, f"thrust_{k}", gap)
            face = Seat((0.0, 0.0, side * 0.5 * self.length), facing(2, side))
            made[crown.name] = Pair(crown, face, Seat((0.0, 0.0, side * (0.5 * self.length + gap + crown.radius))))
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
    def shape(self) -> tuple[float, float]:
        """Half the length of the straight part [m]."""
        return 0.5 * self.travel, 0.0


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
    """length of a guide that is shorter than the slider; default: longer than the slider's travel"""
    corner_radius: Annotated[Length, Field(ge=0.0)] = 0.0
    """radius of the corners; default: sharp ones, which need a normal.stiffness"""
    guide_material: Material | None = None
    """elastic constants, for the stiffness"""
    slider_material: Material | None = None
    """elastic constants, for the stiffness"""

    @model_validator(mode="after")
    def _fitting(self) -> Self:
        if (self.width is None) != (self.side_clearance is None):
            given, absent = ("width", "side_clearance") if self.width is not None else ("side_clearance", "width")
            raise ValueError(
                f"{given} is given and {absent} is not: a slider that is loose across its width, too, needs both, "
                "a plane one neither"
            )
        if self.guide_length is not None and not self.guide_length < self.length:
            raise ValueError(
                f"guide_length = {self.guide_length:g} m is not below the slider's length, {self.length:g} m: it is of "
                "a guide whose ends touch the slider's faces; leave it out where the slider's corners touch the guide"
            )
        if self.normal.stiffness is None and not self.corner_radius:
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
        """Pairs of a corner and the face above it: ``corner_1`` to 4 or 8 across the height, ``side_1`` to 8."""
        short, r = self.guide_length is not None, self.corner_radius
        ends = 0.5 * (self.guide_length or self.length) - r
        sizes = (0.5 * self.height, 0.5 * (self.width or 0.0), 0.5 * (self.guide_length or self.length))
        gaps, made = (self.clearance, self.side_clearance or 0.0, 0.0), dict[str, Pair]()
        # to the centre of a corner's sphere: of the slider's inwards from its faces, of the guide's outwards
        inset = tuple(size + gap + r if short else size - r for size, gap in zip(sizes, gaps, strict=True))
        loose = (0,) if self.width is None else (0, 1)
        signs = [
            (x, y, z) for x in (1.0, -1.0) for y in ((0.0,) if self.width is None else (1.0, -1.0)) for z in (1.0, -1.0)
        ]
        for axis, prefix in zip(loose, ("corner", "side"), strict=False):
            for k, (x, y, z) in enumerate(signs, 1):
                side, name = (x, y)[axis], f"{prefix}_{k}"
                face = [0.0, 0.0, 0.0]
                face[axis] = side * (sizes[axis] + (0.0 if short else gaps[axis]))
                seats = Seat((face[0], face[1], face[2]), facing(axis, side if short else -side))
                centre = Seat((x * inset[0], y * inset[1], z * ends))
                made[name] = Pair(Corner(self, name, gaps[axis]), seats, centre, swapped=short)
        return made


def facing(axis: int, side: float) -> tuple[tuple[float, float, float], ...]:
    """Return axes, as of a `Seat`, whose z is a frame's axis, or for a `side` of -1 points the other way."""
    columns = ((axis + 1) % 3, side), ((axis + 2) % 3, 1.0), (axis, side)
    x, y, z = ([value if k == row else 0.0 for k, value in columns] for row in range(3))
    return (x[0], x[1], x[2]), (y[0], y[1], y[2]), (z[0], z[1], z[2])


Clearance = (
    ClearanceSpherical | ClearanceRevolute | ClearanceCylindrical | ClearanceSlot | ClearancePrismatic | BallOnPlane
)
#: all types of contacts
CONTACTS: tuple[Any, ...] = get_args(Clearance)
#: their classes by type
SURFACES: dict[str, Any] = {name: kind for kind in CONTACTS for name in get_args(kind.model_fields["type"].annotation)}

#: sizes that the bearing of a joint may have, and those that it must have
SIZES: dict[str, tuple[set[str], set[str]]] = {
    "revolute": ({"radius", "length", "axial_radius"}, {"radius"}),
    "prismatic": ({"radius", "length"}, set()),
    "cylindrical": ({"radius", "length"}, {"radius"}),
    "universal": ({"radius", "length"}, {"radius"}),
    "spherical": ({"radius"}, {"radius"}),
}


class _Bearing(Part):
    """Surfaces of an ideal joint with friction; loads whose conversion needs an absent size are not counted."""

    radius: Annotated[Length, Positive] | None = None
    """radius of the pin, the ball, or the pins of a universal joint's cross; of a prismatic joint the lever arm of the
    pads that carry moments about its axis"""
    length: Annotated[Length, Positive] | None = None
    """distance between the two ends that carry moments across the axis; of a prismatic joint the length of the slider,
    its middle at the second frame's origin"""
    axial_radius: Annotated[Length, Positive] | None = None
    """radius of the collar that carries the axial force of a revolute joint; default: `radius`"""
    preload: Annotated[Force, Field(ge=0.0)] = 0.0
    """constant normal force, added to the others"""


def _bearing_model(law: Any) -> Any:
    """Return a model with the parameters of a friction law and those of a bearing."""
    return create_model(f"{law.__name__}Bearing", __base__=(_Bearing, law), __doc__=law.__doc__, __module__=__name__)


if TYPE_CHECKING:
    JointFriction: TypeAlias = Any
else:
    JointFriction = Annotated[Union[tuple(_bearing_model(law) for law in FRICTIONS)], Field(discriminator="law")]  # noqa: UP007


def require_fitting(kind: str, friction: Any) -> None:
    """Raise ValueError for a joint type without friction, and for sizes that its bearing lacks or cannot have."""
    if kind not in SIZES:
        known = ", ".join(SIZES)
        raise ValueError(f"a joint of type '{kind}' has no friction of its own; those that have: {known}")
    if "x1" in friction.kind.split(","):
        raise ValueError("friction of an ideal joint depends on the slip alone: its coefficient has no normal_force")
    possible, needed = SIZES[kind]
    given = {name for name in ("radius", "length", "axial_radius") if getattr(friction, name) is not None}
    for name in sorted(needed - given):
        raise ValueError(
            f"friction in a {kind} joint needs a {name}, the lever arm of the friction force; none is given"
        )
    for name in sorted(given - possible):
        may = ", ".join(sorted(possible))
        raise ValueError(f"the bearing of a {kind} joint has no {name}; sizes of such a joint: {may}")
