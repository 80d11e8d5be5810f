"""What an effect declares: all by which the rest of the program knows of it.

A declaration is data. It names the effect's modules in texts, so that to read it imports none of them and no Numba:
they are imported for scenes that have the effect, and are in the keys of these scenes' results alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene

PACKAGE = "flexclear.pipeline.dynamics.effects"


@dataclass(frozen=True)
class Effect:
    """An effect; functions of its modules as ``"module:function"``, of a module in its folder.

    name: of its folder.
    kinds: for a scene with the effect the kinds by which its code is composed, often none; None for other scenes.
    family: whose parts these kinds are, below `dynamics`.
    named: parts of families that it names in a scene: family, name, and where the scene says so.
    wiring, numbers: rows of its tables in h and f by their names (`memory`). A table in h adds a size ``n_<table>`` to
    the header, a ledger the size ``<name>_slot``.  work: the same in w, each after how many rows there are.
    stretches: of w, each with its length; both as `memory` writes them.
    compose: arguments that it adds to generated files, or replaces there, by the point in `compile.sources` at which
    it does.  In their texts, ``<module.name>`` is a name in its folder, ``{file}`` the `compile.sources.Composition`,
    and ``{kinds}`` the tuple of the modules of its kinds.
    changeable: keys of a scene, as ``table.key``, that decide none but numbers of the effect (`model.refill`).
    touches: whether it has contacts, which open and close at events.
    fill: ``fill(filling)`` -> rows of the tables by name (`model.filling`).
    ledger: ``ledger(mechanism, energies, lengths)`` -> groups of its block of the ledger (`model.filling.blocks`).
    guards: ``guards(mechanism)`` -> rows of the table GUARDS, on which steps end.
    states: ``states(model, sites, internal)`` -> its internal states that follow from the frames of sites
    (`model.initial.of_effects`).
    samples: ``sampler(engine)`` -> ``sample(y, t)``, the state after a break of the run, from that before.
    losses: ``losses(model)`` -> which variables of its ledger are losses (`run.ledger.Losses`).
    refuses: ``refuse(model, trajectory, seen)``, which raises SolverError for a run that it makes worthless.
    explains: ``explanation(engine)`` -> why the run stopped, in words, or None.
    records: ``series(model, seen)`` -> variables and coordinates of the run's dataset, by the beginnings of the
    variables' names.
    acts: ``acting(model, seen)`` -> frames on which it acts, moments and forces (`record.wrenches`).
    warns: ``warnings(run)`` -> sentences about what a run is to be doubted for.
    """

    name: str
    kinds: Callable[[Scene], Iterable[str] | None]
    family: str = ""
    named: Callable[[Scene], Iterable[tuple[str, str, str]]] = lambda scene: ()
    wiring: Mapping[str, str] = field(default_factory=dict)
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
        """Names of its sizes in the header."""
        return [*(f"n_{table}" for table in self.wiring), *([f"{self.name}_slot"] if self.ledger else [])]

    @property
    def modules(self) -> set[str]:
        """Full names of its modules that functions are named of, which are not imported."""
        texts = [getattr(self, one.name) for one in fields(self) if one.type == "str"]
        functions = [text.split(":") for text in [*texts, *self.records.values()] if ":" in text]
        return {f"{PACKAGE}.{self.name}.{module}" for module, _ in functions}

    def load(self, function: str) -> Any:
        """A function of its modules, imported now."""
        module, _, name = function.partition(":")
        return getattr(import_module(f"{PACKAGE}.{self.name}.{module}"), name)
