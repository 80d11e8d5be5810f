"""Declaration of the stiffening of flexible bodies."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

STIFFENING = Effect(
    "stiffening",
    lambda scene: () if any(body.stiffening is not None for body in scene.flexible().values()) else None,
    topology={"stations": "flex data"},  # data: index in STATION_DATA of rotation and curvature (3n each)
    numbers={"station_stiffness": "matrix:6", "station_data": "value"},  # of twist and bending (xx yy zz xy xz yz)
)
