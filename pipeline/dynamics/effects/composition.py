"""A generated file in the making: what it imports, and the arguments of what makes its function."""

from __future__ import annotations

from dataclasses import dataclass, field

from flexclear.pipeline.core.scene.registry import listed
from flexclear.pipeline.dynamics.effects import Parts

DYNAMICS = "flexclear.pipeline.dynamics"


@dataclass
class Composition:
    """A file for a mechanism's parts. imports: (module, name) each.  given: arguments of the maker by name."""

    parts: Parts
    imports: list[tuple[str, str]] = field(default_factory=list)
    given: dict[str, str] = field(default_factory=dict)

    def take(self, module: str, name: str) -> str:
        """Import a name, which is returned."""
        others = {known for package, known in self.imports if package != module}
        assert name not in others, f"two parts of one mechanism are called {name}"
        self.imports.append((module, name))
        return name

    def family(self, package: str, names: tuple[str, ...], table: str = "NAMES") -> list[str]:
        """Import the modules of a family's parts."""
        return [self.take(package, listed(package, name, where="parts", table=table)[0]) for name in names]

    def tree(self) -> str:
        """Import the module that factors the mass matrix."""
        return self.take(f"{DYNAMICS}.equations", "articulated" if self.parts.articulated else "composite")

    def add_effects(self, point: str) -> None:
        """Let every effect that the mechanism has add what it declares for a point of `compile.sources`."""
        for effect in self.parts.present:
            if point in effect.compose:
                effect.compose[point](self)


def tupled(names: list[str]) -> str:
    """The tuple of some names, as source."""
    return "(" + "".join(f"{name}, " for name in names) + ")"
