"""Recorded films: force and moment on pins and balls, power, least thickness."""

from __future__ import annotations

from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.loads import record_loads
from flexclear.scene.films import Squeeze, actions_of, films_of


def film_series(model: Model, seen: Observed) -> Series:
    """Return force [N] and moment [N m] on the second frame, power [W] and least thickness [m] of every film."""
    films, dims = films_of(model.scene), ("time", "film")
    values = record_loads(
        model, seen, [name for name, one in actions_of(model.scene).items() if isinstance(one, Squeeze)]
    )
    return {
        "film_force": ((*dims, "axis"), values["force"]),
        "film_moment": ((*dims, "axis"), values["moment"]),
        "film_power": (dims, values["power"]),
        "film_thickness": (dims, [one.gap.clearance for one in films.values()] - values["length"]),
    }, {"film": list(films)}
