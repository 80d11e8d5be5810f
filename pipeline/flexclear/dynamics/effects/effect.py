"""Declaration of an effect: what the memory layout holds for it. It imports no code of the effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene


@dataclass(frozen=True)
class Effect:
    """An effect.

    name: of its modules.
    kinds: for a scene with the effect the kinds by which its code is composed, often none; None for other scenes.
    topology, numbers: rows of its tables in h and f by table name (`memory`). A table in h adds a size ``n_<table>`` to
    the header, a ledger the size ``<name>_slot``.  work: likewise in w, each after the number of its rows.
    stretches: arrays in w, each with its length, as `memory` writes them.
    changeable: keys of a scene, as ``table.key``, that change only numbers of the effect (`model.refill`).
    touches: True when it has contacts, which open and close at events.
    ledger, guards: whether it has a block of the ledger, and rows of the table GUARDS, on which steps end
    (`model.of_effects`).
    """

    name: str
    kinds: Callable[[Scene], Iterable[str] | None]
    topology: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    work: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    stretches: tuple[str, ...] = ()
    changeable: tuple[str, ...] = ()
    touches: bool = False
    ledger: bool = False
    guards: bool = False

    @property
    def sizes(self) -> list[str]:
        """Names of the effect's sizes in the header."""
        return [*(f"n_{table}" for table in self.topology), *([f"{self.name}_slot"] if self.ledger else [])]
