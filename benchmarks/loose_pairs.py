"""One body whose only joint is loose, for each kind of contact, and two wheels whose teeth have play."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.mechanisms import Mechanism
from flexclear.scene.schema import Scene

Table = dict[str, Any]
LAW = {"law": "flores", "restitution": 0.5, "stiffness": 1e9}
PIN: Table = {"type": "clearance-revolute", "clearance": 1e-4, "pin_radius": 0.01, "length": 0.03, "normal": LAW}
BALL: Table = {"type": "clearance-spherical", "clearance": 1e-4, "ball_radius": 0.01, "normal": LAW}
GUIDE: Table = {"type": "clearance-prismatic", "clearance": 1e-4, "length": 0.1, "height": 0.05, "normal": LAW}
SPACE: Table = {"width": 0.06, "side_clearance": 1e-4}
TILTING: Table = PIN | {"axial_clearance": 1e-4}
OWN: Table = {
    "law": "expression",
    "force": "K*depth^1.5*(1 + a*rate/impact_rate)",
    "values": {"K": "1e9 N/m^1.5", "a": 0.4},
}


def oil(model: str) -> Table:
    """Return a film."""
    return {"film": {"viscosity": 1e-3, "model": model}}


def worn() -> Table:
    """Return wear with a profile of 36 sectors, a groove of 10 um in the journal."""
    angle = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
    groove = (1e-5 * np.exp(-(np.minimum(angle, 2.0 * np.pi - angle) ** 2))).tolist()
    shapes = {"radii": [0.0101, 0.01], "outer": [groove], "inner": [[0.0] * 36]}
    return {"wear": {"coefficient": 1e-4, "hardness": 2e9, "profile": "wear.nc", "shapes": {"pair": shapes}}}


#: name -> the joint between ground and body, None without one
JOINTS: dict[str, Table | None] = {
    "none": None,
    "ball in socket": BALL,
    "pin held in its plane": PIN,
    "the same, law by an expression": PIN | {"normal": OWN},
    "the same, worn profile": PIN | worn(),
    "the same, short film": PIN | oil("short"),
    "the same, finite film": PIN | oil("finite"),
    "ball in socket, film": BALL | {"film": {"viscosity": 1e-3}},
    "corners, in a plane": GUIDE,
    "corners, in space": GUIDE | SPACE,
    "corners, bounded faces": GUIDE | {"faces": "bounded", "guide_length": 0.15},
    "tilting pin": PIN | {"type": "clearance-cylindrical"},
    "tilting pin, crowned collars": TILTING,
    "tilting pin, flat collars": TILTING | {"collar_radius": 0.02},
}
TEETH = {"backlash": 1e-3, "stiffness": 1e5}
GEARS: dict[str, Table] = {"wheels, rigid teeth": {}, "wheels, backlash": TEETH}
NAMES = (*JOINTS, *GEARS)


def loose_pair(name: str) -> Mechanism:
    """Return the mechanism of a name, for a run of several impacts."""
    return Mechanism(name, _wheels(GEARS[name]) if name in GEARS else _body(JOINTS[name]), {})


def _rigid(**more: Any) -> Table:
    return {"type": "rigid", "mass": 0.5, "inertia": [6e-4, 4e-4, 2e-4], "frames": {"F": {}}, **more}


def _body(joint: Table | None) -> Scene:
    """Return a body that moves along x and turns about z, as far as the joint between it and the ground lets it."""
    flat = joint is not None and joint["type"] == "clearance-prismatic" and "width" not in joint
    body = _rigid(pose={}, velocity=[0.1, 0.0, 0.0], angular_velocity=[0.0, 0.0, 0.0 if flat else 1.0])
    made = {} if joint is None else {"pair": {"between": ["ground.F", "body.F"], **joint}}
    return _scene({"ground": {"type": "ground", "frames": {"F": {}}}, "body": body}, made)


def _wheels(teeth: Table) -> Scene:
    """Return two wheels on bearings with a gear between them, of which one turns where the teeth have play."""
    ground = {"type": "ground", "frames": {"A": {}, "B": {"position": [0.3, 0.0, 0.0]}}}
    bodies = {"ground": ground, "A": _rigid(angular_velocity=[0.0, 0.0, 1.0])}
    bodies["B"] = _rigid(pose={"position": [0.3, 0.0, 0.0]}, angular_velocity=[0.0, 0.0, 0.0 if teeth else -1.0])
    joints = {name: {"type": "revolute", "between": [f"ground.{name}", f"{name}.F"]} for name in "AB"}
    return _scene(bodies, joints, gear={"teeth": {"first": "A", "second": "B", "ratio": -1.0, **teeth}})


def _scene(body: Table, joint: Table, **more: Any) -> Scene:
    times = {"time": {"end": 0.01}, "output": {"interval": 2e-5}, "solver": {"integrator": "dop853", "rtol": 1e-8}}
    return Scene.model_validate({"title": "pair", "body": body, "joint": joint, **times, **more})
