"""Films of a viscous liquid in the gap of a joint with clearance, and as what acts between the joint's frames."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from flexclear.scene.fields import Length, Part, Positive, Viscosity

#: roughness of a film without one, as a fraction of the clearance; and the least one, to which films are computed
USUAL_ROUGHNESS, LEAST_ROUGHNESS = 1e-3, 1e-4


class Film(Part):
    """Film of a liquid between ball and socket, which resists a change of the gap."""

    viscosity: Annotated[Viscosity, Positive]
    """dynamic viscosity of the liquid"""
    roughness: Annotated[Length, Positive] | None = None
    """thickness of the film below which the surfaces touch as dry ones do; default: a thousandth of the clearance"""

    @property
    def kind(self) -> str:
        """Return the model by which code is composed."""
        return "ball"

    def height(self, clearance: float) -> float:
        """Return the roughness [m] in a gap; raise ValueError for one that the gap does not have."""
        height = USUAL_ROUGHNESS * clearance if self.roughness is None else self.roughness
        if not LEAST_ROUGHNESS * clearance <= height < clearance:
            raise ValueError(
                f"film.roughness = {1e3 * height:g} mm must be below the clearance, {1e3 * clearance:g} mm, and at "
                f"least {LEAST_ROUGHNESS:g} of it: at this thickness of the film the surfaces touch"
            )
        return height


class JournalFilm(Film):
    """Film of a liquid between pin and journal, which carries the pin and brakes its turning."""

    model: Literal["short", "long", "finite"] = "finite"
    """flow of the liquid: along the axis ('short', for lengths far below the diameter), around it ('long', for lengths
    far above it), or both"""
    cavitation: Literal["half-sommerfeld"] = "half-sommerfeld"
    """where the film carries: on the half of the journal that the pin approaches"""

    @property
    def kind(self) -> str:
        """Return the model by which code is composed."""
        return self.model


@dataclass(frozen=True)
class Squeeze:
    """Film of a joint, as a load between the frames of that joint, `gap`."""

    gap: Any
    place: str
    type: ClassVar[str] = "film"

    @property
    def film(self) -> Film:
        """The film's own keys."""
        film: Film = self.gap.film
        return film

    @property
    def kind(self) -> str:
        """Model by which code is composed."""
        return self.film.kind

    @property
    def between(self) -> tuple[str, str]:
        """Frames of the outer and the inner surface."""
        outer, inner = self.gap.between
        return outer, inner


def films_of(scene: Any) -> dict[str, Squeeze]:
    """Return the films of a scene's joints by the joint's name."""
    filled = {n: j for n, j in scene.joint.items() if getattr(j, "film", None) is not None}
    return {name: Squeeze(joint, f"joint.{name}.film") for name, joint in filled.items()}


def actions_of(scene: Any) -> dict[str, Any]:
    """Return what acts in a scene as a load does, by name: loads other than gravity, and films as ``A.film``."""
    forces: dict[str, Any] = scene.forces()
    return forces | {f"{name}.film": film for name, film in films_of(scene).items()}
