"""Contacts in a scene: geometry, materials, normal law, friction law.

The friction law 'modified-coulomb' is described in `dynamics.contact.friction.modified_coulomb`.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from flexclear.scene.fields import Length, Mass, Number, Part, Positive, Pressure, Speed
from flexclear.scene.law_expressions import FrictionExpression, NormalExpression
from flexclear.scene.worn_profile import read_profile

Share = Field(ge=0.0, le=1.0)
#: depths of a surface [m], by band and sector
Depths = tuple[tuple[float, ...], ...]


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
        """Form of a tight fit, or structure of an expression; empty for laws whose code has none."""
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
        """Return the form of a tight fit."""
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


NormalLaw = Annotated[Hertz | Hysteretic | KelvinVoigt | NormalExpression, Field(discriminator="law")]
#: all kinds of normal laws
NORMALS: tuple[Any, ...] = get_args(get_args(NormalLaw)[0])


class _Friction(Part):
    """What all friction laws have; `kind`: by which code is composed."""

    @property
    def kind(self) -> str:
        """Return the name of the law, with the structure of its expression."""
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


Friction = Annotated[ModifiedCoulomb | Ambrosio | LuGre | FrictionExpression, Field(discriminator="law")]
#: all friction laws
FRICTIONS: tuple[Any, ...] = get_args(get_args(Friction)[0])


def _not_above(dynamic: float, static: float) -> None:
    if dynamic > static:
        raise ValueError(
            "dynamic must not exceed static, as friction does not grow when sliding begins; "
            f"dynamic = {dynamic:g} exceeds static = {static:g}"
        )


class Shapes(Part):
    """Worn surfaces of a joint, outer and inner: unworn radii [m], and depths [m] by band and sector."""

    radii: tuple[Length, Length]
    """radii without wear"""
    outer: Depths
    """depths of the socket or journal; a pin's journal has one band"""
    inner: Depths
    """depths of the ball or pin"""

    @model_validator(mode="after")
    def _check_depths(self) -> Self:
        sizes = {len(row) for side in (self.outer, self.inner) for row in side}
        if len(sizes) != 1 or min(sizes) < 4 or len(self.outer) != len(self.inner) or not self.outer:
            raise ValueError("a profile has the same number of sectors, at least four, in every band of both surfaces")
        return self


class Wear(Part):
    """Archard's wear of a contact: depth = coefficient * normal force * sliding distance / (hardness * area)."""

    coefficient: Annotated[Number, Positive]
    """wear coefficient k [-] of the pair of surfaces"""
    hardness: Annotated[Pressure, Positive]
    """hardness of the softer surface"""
    sectors: Annotated[int, Field(ge=4, le=720)] = 36
    """number of sectors about their axis into which both surfaces are divided for the map of depths; a ball and its
    socket also into bands of equal area"""
    outer_share: Annotated[Number, Share] = 0.5
    """fraction of the worn volume that `flexclear wear` takes from the socket or journal; the rest from ball or pin"""
    profile: str | None = None
    """file of worn surfaces, `wear.nc` of `flexclear wear`, whose last row shapes this joint; default: round ones"""
    shapes: dict[str, Shapes] = Field(default_factory=dict)
    """the worn surfaces read from that file, by joint; not written in a scene"""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        """Read the profile unless its numbers are given; afterwards only its name is stored."""
        if not isinstance(data, dict) or data.get("shapes") or not isinstance(data.get("profile"), str):
            return data
        path = Path(data["profile"])
        return {**data, "profile": path.name, "shapes": read_profile(path)}
