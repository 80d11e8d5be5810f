"""Declaration of an effect: the only part of it that the rest of the program refers to.

A declaration is data. It names the effect's modules as texts, so that reading it imports neither them nor Numba. Only
scenes that have the effect import its modules and have them in the keys of their results.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

PACKAGE = "flexclear.dynamics.effects"


@dataclass(frozen=True)
class Effect:
    """An effect; it names functions of the modules in its folder as ``"module:function"``.

    name: of its folder.
    kinds: for a scene with the effect the kinds by which its code is composed, often none; None for other scenes.
    family: package below `dynamics` whose members these kinds are.
    named: family members that it names in a scene: family, name, and key path in the scene.
    topology, numbers: rows of its tables in h and f by table name (`memory`). A table in h adds a size ``n_<table>`` to
    the header, a ledger the size ``<name>_slot``.  work: likewise in w, each after the number of its rows.
    stretches: arrays in w, each with its length, as `memory` writes them.
    compose: arguments that it adds to generated files, or replaces, by the point in `compile.sources` where it does so.
    In their texts, ``<module.name>`` is a name in its folder, ``{file}`` the `compile.sources.Composition`, and
    ``{kinds}`` the tuple of the modules of its kinds.
    changeable: keys of a scene, as ``table.key``, that change only numbers of the effect (`model.refill`).
    touches: True when it has contacts, which open and close at events.
    fill: ``fill(filling)`` -> rows of the tables by name (`model.filling`).
    ledger: ``ledger(mechanism, energies, lengths)`` -> groups of its block of the ledger (`model.filling.blocks`).
    guards: ``guards(mechanism)`` -> rows of the table GUARDS, on which steps end.
    states: ``states(model, sites, internal)`` -> its internal states that follow from the frames of sites
    (`model.initial.of_effects`).
    samples: ``sampler(engine)`` -> ``sample(y, t)``, the state after a break of the run, from the state before.
    losses: ``losses(model)`` -> the variables of its ledger that are losses (`run.ledger.Losses`).
    refuses: ``refuse(model, trajectory, seen)``, which raises SolverError for an unusable run.
    explains: ``explanation(engine)`` -> the reason why the run stopped, in words, or None.
    records: ``series(model, seen)`` -> variables and coordinates of the run's dataset, by prefixes of the variables'
    names.
    acts: ``acting(model, seen)`` -> frames on which it acts, moments and forces (`record.wrenches`).
    warns: ``warnings(run)`` -> warnings about the results of a run.
    """

    name: str
    kinds: Callable[[Scene], Iterable[str] | None]
    family: str = ""
    named: Callable[[Scene], Iterable[tuple[str, str, str]]] = lambda scene: ()
    topology: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    work: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    stretches: tuple[str, ...] = ()
    compose: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    changeable: tuple[str, ...] = ()
    touches: bool = False
    fill: str = ""
    ledger: str = ""
    guards: str = ""
    states: str = ""
    samples: str = ""
    losses: str = ""
    refuses: str = ""
    explains: str = ""
    records: Mapping[tuple[str, ...], str] = field(default_factory=dict)
    acts: str = ""
    warns: str = ""

    @property
    def sizes(self) -> list[str]:
        """Names of the effect's sizes in the header."""
        return [*(f"n_{table}" for table in self.topology), *([f"{self.name}_slot"] if self.ledger else [])]

    @property
    def modules(self) -> set[str]:
        """Full names of the effect's modules whose functions it declares; they are not imported."""
        texts = [getattr(self, one.name) for one in fields(self) if one.type == "str"]
        functions = [text.split(":") for text in [*texts, *self.records.values()] if ":" in text]
        return {f"{PACKAGE}.{self.name}.{module}" for module, _ in functions}

    def load(self, function: str) -> Any:
        """Import and return a function of the effect's modules."""
        module, _, name = function.partition(":")
        return getattr(import_module(f"{PACKAGE}.{self.name}.{module}"), name)
