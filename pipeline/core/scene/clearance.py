"""Contacts as a scene says them: geometry, materials, normal law, friction law; and the friction of ideal joints.

What a friction law called 'modified-coulomb' does is in `pipeline.dynamics.contact.friction.modified_coulomb`.
"""

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias, Union, get_args

from pydantic import Field, create_model, model_validator

from flexclear.pipeline.core.scene.fields import Force, FrameName, Length, Mass, Number, Part, Positive, Pressure, Speed

Share = Field(ge=0.0, le=1.0)


class Material(Part):
    """Elastic constants of a contacting surface.

    youngs_modulus: Young's modulus.  poisson: Poisson's ratio.
    """

    youngs_modulus: Annotated[Pressure, Positive]
    poisson: Annotated[Number, Field(ge=0.0, lt=0.5)]


class NormalLaw(Part):
    """A normal contact law; `stiffness` K [N/m^exponent] may be given instead of materials and radii.

    restitution: the law's own parameter c_r; a free impact rebounds with it only as well as the law
    achieves.  delivered_restitution: the rebound that a free impact is to have; the parameter
    follows from it.  exponent: default 1.5, for linear laws 1.
    law: name of the law, as docs/contact.md lists them.  stiffness: K in force = K depth^exponent; without it, from
    materials and radii.  damping: of linear laws [N s/m].  effective_mass: of linear laws: mass that rebounds; default:
    the reduced mass of the two links.
    """

    law: str
    restitution: Annotated[Number, Share] | None = None
    delivered_restitution: Annotated[Number, Share] | None = None
    exponent: Annotated[Number, Field(ge=1.0)] | None = None
    stiffness: Annotated[Number, Positive] | None = None
    damping: Annotated[Number, Field(ge=0.0)] | None = None
    effective_mass: Annotated[Mass, Positive] | None = None

    @model_validator(mode="after")
    def _one_restitution(self) -> Self:
        if self.restitution is not None and self.delivered_restitution is not None:
            raise ValueError(
                "restitution (the law's parameter) and delivered_restitution (the rebound) say the same; give one"
            )
        return self


class ModifiedCoulomb(Part):
    """Wang & Wang's modified Coulomb friction, with its four parameters (Table 6).

    static, dynamic: coefficients of friction.  v_static, v_dynamic: sliding speeds at which friction has the one and
    the other.
    """

    law: Literal["modified-coulomb"]
    static: Annotated[Number, Field(ge=0.0)]
    dynamic: Annotated[Number, Field(ge=0.0)]
    v_static: Annotated[Speed, Positive]
    v_dynamic: Annotated[Speed, Positive]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.v_static < self.v_dynamic:
            raise ValueError(
                "v_static must be below v_dynamic, as friction falls from static to dynamic between them; "
                f"v_static = {self.v_static:g} m/s, v_dynamic = {self.v_dynamic:g} m/s"
            )
        _not_above(self.dynamic, self.static)
        return self


class Ambrosio(Part):
    """Ambrosio's Coulomb friction: none below v0, a linear rise to `dynamic` at v1.

    dynamic: coefficient of friction.  v0, v1: sliding speeds between which it rises from nothing to its full value.
    """

    law: Literal["ambrosio"]
    dynamic: Annotated[Number, Field(ge=0.0)]
    v0: Annotated[Speed, Field(ge=0.0)]
    v1: Annotated[Speed, Positive]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.v0 < self.v1:
            raise ValueError(
                "v0 must be below v1, as friction rises from nothing at v0 to `dynamic` at v1; "
                f"v0 = {self.v0:g} m/s, v1 = {self.v1:g} m/s"
            )
        return self


class LuGre(Part):
    """LuGre friction per unit of normal force.

    v_stribeck: speed over which friction falls from static to dynamic.
    static, dynamic: coefficients of friction.  bristle_stiffness, bristle_damping, viscous: sigma_0 [1/m], sigma_1
    [s/m] and sigma_2 [s/m], each over the normal force.
    """

    law: Literal["lugre"]
    static: Annotated[Number, Positive]
    dynamic: Annotated[Number, Positive]
    v_stribeck: Annotated[Speed, Positive]
    bristle_stiffness: Annotated[Number, Positive]
    bristle_damping: Annotated[Number, Field(ge=0.0)] = 0.0
    viscous: Annotated[Number, Field(ge=0.0)] = 0.0

    @model_validator(mode="after")
    def _passive(self) -> Self:
        _not_above(self.dynamic, self.static)
        # the damping fades as exp(-(v/v_stribeck)^2); its v-fold is then at most 0.4289 v_stribeck sigma_1, and
        # the law takes energy only while that stays below 4 mu (Barahanov & Ortega 2000, for constant damping)
        most = 4.0 * self.dynamic / (0.42888194248035340 * self.v_stribeck)
        if self.bristle_damping > most:
            raise ValueError(
                f"bristle_damping = {self.bristle_damping} s/m would drive the sliding; "
                f"with these coefficients at most {most:.6g} s/m dissipates"
            )
        return self


Friction = Annotated[ModifiedCoulomb | Ambrosio | LuGre, Field(discriminator="law")]
#: all of them
FRICTIONS: tuple[Any, ...] = get_args(get_args(Friction)[0])


def _not_above(dynamic: float, static: float) -> None:
    if dynamic > static:
        raise ValueError(
            "dynamic must not exceed static, as friction does not grow when sliding begins; "
            f"dynamic = {dynamic:g} exceeds static = {static:g}"
        )


class Wear(Part):
    """Archard's wear of a contact: depth = coefficient * normal force * sliding distance / (hardness * area).

    coefficient: k [-], for the pair of surfaces.  hardness: of the softer one.  sectors: into which both surfaces are
    divided around their axis for the map of depths; a ball and its socket also into bands of equal area.
    """

    coefficient: Annotated[Number, Positive]
    hardness: Annotated[Pressure, Positive]
    sectors: Annotated[int, Field(ge=4, le=720)] = 36


class _Contact(Part):
    """What all contacts between surfaces have.

    floor: least approach speed used as the impact rate of a closing [m/s]; keeps the law regular
    for grazing and resting contact.  Without it, 1e-5 of the size of the mechanism per second, at most 1e-6 m/s.
    initial_approach_speed: impact rate of a contact that the
    scene's start already has, 0 of one that rests there; without it, a start in contact is refused.
    between: frames of the outer and the inner surface, each as body.FRAME.  normal: law of the normal force.  friction:
    law of friction; without it there is none.
    """

    between: tuple[FrameName, FrameName]
    normal: NormalLaw
    friction: Friction | None = None
    floor: Annotated[Speed, Positive] | None = None
    initial_approach_speed: Annotated[Speed, Field(ge=0.0)] | None = None

    #: what the outer and the inner surface are called in keys
    surfaces: ClassVar[tuple[str, str]]

    @model_validator(mode="after")
    def _stiffness_known(self) -> Self:
        if self.normal.stiffness is None and None in self.materials:
            names = " and ".join(f"{surface}_material" for surface in self.surfaces)
            raise ValueError(f"the contact stiffness is unknown: give {names}, or normal.stiffness")
        return self

    @property
    def radius(self) -> float:
        """Radius of the inner surface [m]."""
        return float(getattr(self, f"{self.surfaces[1]}_radius"))

    @property
    def materials(self) -> tuple[Material | None, Material | None]:
        """Of the outer and the inner surface."""
        outer, inner = (getattr(self, f"{surface}_material") for surface in self.surfaces)
        return outer, inner

    @property
    def shape(self) -> tuple[float, float]:
        """What else the kernels of its surfaces take."""
        return 0.0, 0.0


class _Clearance(_Contact):
    """What all clearance joints have; clearance: half the difference of the diameters."""

    clearance: Annotated[Length, Positive]


class ClearanceSpherical(_Clearance):
    """Ball in socket with radial clearance; between = [socket frame, ball frame].

    ball_radius: radius of the ball.  socket_material, ball_material: elastic constants, for the stiffness.
    wear: of both surfaces; absent means none.
    """

    surfaces = ("socket", "ball")
    type: Literal["clearance-spherical"]
    ball_radius: Annotated[Length, Positive]
    socket_material: Material | None = None
    ball_material: Material | None = None
    wear: Wear | None = None


class ClearanceRevolute(_Clearance):
    """Pin in journal with radial clearance; between = [journal frame, pin frame], axis = z of the journal's frame.

    length: of the bearing, along the axis.
    pin_radius: radius of the pin.  journal_material, pin_material: elastic constants, for the stiffness.
    wear: of both surfaces; absent means none.
    """

    surfaces = ("journal", "pin")
    type: Literal["clearance-revolute"]
    pin_radius: Annotated[Length, Positive]
    length: Annotated[Length, Positive]
    journal_material: Material | None = None
    pin_material: Material | None = None
    wear: Wear | None = None


class ClearanceSlot(_Clearance):
    """Pin in a straight slot with round ends; between = [slot frame, pin frame].

    The slot lies along x of its frame, whose z is the pin's axis; its middle is the frame's origin.
    clearance: half the slot's width less the pin's radius.  travel: of the pin's centre in the middle of the slot, from
    where the one end's half circle has its centre to the other's.  length: of the bearing, along the axis.
    pin_radius: radius of the pin.  slot_material, pin_material: elastic constants, for the stiffness.
    """

    surfaces = ("slot", "pin")
    type: Literal["clearance-slot"]
    travel: Annotated[Length, Positive]
    pin_radius: Annotated[Length, Positive]
    length: Annotated[Length, Positive]
    slot_material: Material | None = None
    pin_material: Material | None = None

    @property
    def shape(self) -> tuple[float, float]:
        """Half the length of the straight part [m]."""
        return 0.5 * self.travel, 0.0


class BallOnPlane(_Contact):
    """Ball above a plane without end; between = [plane frame, ball frame].

    The plane is that of x and y of its frame; the ball is on the side of z.

    ball_radius: radius of the ball.  plane_material, ball_material: elastic constants, for the stiffness.
    """

    surfaces = ("plane", "ball")
    type: Literal["ball-on-plane"]
    ball_radius: Annotated[Length, Positive]
    plane_material: Material | None = None
    ball_material: Material | None = None

    @property
    def clearance(self) -> float:
        """Way that counts as far [m]: there is no other wall."""
        return self.ball_radius


Clearance = ClearanceSpherical | ClearanceRevolute | ClearanceSlot | BallOnPlane
#: all of them
CONTACTS: tuple[Any, ...] = get_args(Clearance)

#: sizes that the bearing of a joint may have, and the one that it must have
SIZES: dict[str, tuple[set[str], set[str]]] = {
    "revolute": ({"radius", "length", "axial_radius"}, {"radius"}),
    "prismatic": ({"radius", "length"}, set()),
    "cylindrical": ({"radius", "length"}, {"radius"}),
    "universal": ({"radius", "length"}, {"radius"}),
    "spherical": ({"radius"}, {"radius"}),
}


class _Bearing(Part):
    """Where an ideal joint rubs; absent sizes mean that what they would turn into a pressure is not counted.

    radius: of the pin, the ball, or the pins of a universal joint's cross; of a prismatic joint the arm of the pads
    that hold moments about its axis.  length: between the two ends that carry moments across the axis; of a prismatic
    joint that of the slider, its middle at the second frame's origin.  axial_radius: of the collar that carries what a
    revolute joint is pushed along its axis; default: `radius`.  preload: normal force that is always there.
    """

    radius: Annotated[Length, Positive] | None = None
    length: Annotated[Length, Positive] | None = None
    axial_radius: Annotated[Length, Positive] | None = None
    preload: Annotated[Force, Field(ge=0.0)] = 0.0


def _rubbing(law: Any) -> Any:
    """The parameters of a friction law of contacts, and those of a bearing."""
    return create_model(f"{law.__name__}Bearing", __base__=(_Bearing, law), __doc__=law.__doc__, __module__=__name__)


if TYPE_CHECKING:
    JointFriction: TypeAlias = Any
else:
    JointFriction = Annotated[Union[tuple(_rubbing(law) for law in FRICTIONS)], Field(discriminator="law")]  # noqa: UP007


def require_fitting(kind: str, friction: Any) -> None:
    """ValueError for a joint type that does not rub, and for sizes that its bearing lacks or cannot have."""
    if kind not in SIZES:
        known = ", ".join(SIZES)
        raise ValueError(f"a joint of type '{kind}' has no friction of its own; those that have: {known}")
    possible, needed = SIZES[kind]
    given = {name for name in ("radius", "length", "axial_radius") if getattr(friction, name) is not None}
    for name in sorted(needed - given):
        raise ValueError(
            f"friction in a {kind} joint needs a {name}: its moment is the friction force times that; none is given"
        )
    for name in sorted(given - possible):
        may = ", ".join(sorted(possible))
        raise ValueError(f"the bearing of a {kind} joint has no {name}; sizes that it may have: {may}")
