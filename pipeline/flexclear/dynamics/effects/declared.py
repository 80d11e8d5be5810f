"""Declarations of all effects. Only `Effect` is imported, no code of an effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.dynamics.effects.effect import Effect
from flexclear.scene.films import films_of

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene


BUSHINGS = Effect(
    "bushings",
    lambda scene: () if any(load.type == "bushing" for load in scene.load.values()) else None,
)


TYPES = ("pid", "sampled-pid")
NUMBERS = ("reference", "proportional", "integral", "derivative", "limits", "tracking_time", "period")
CONTROLLERS = Effect(
    "controllers",
    lambda scene: () if any(load.type in TYPES for load in scene.load.values()) else None,
    changeable=tuple(f"load.{key}" for key in NUMBERS),
)


#: the force of a film is a load
FILMS = Effect("films", lambda scene: () if films_of(scene) else None)


GEARS = Effect(
    "gears",
    lambda scene: () if scene.gear else None,
    topology={"couplings": "first second"},  # gauges of two joint coordinates; the second follows the first
    numbers={"coupling_numbers": "ratio offset"},  # second coordinate = ratio * first + offset
)


#: kinds of bearings: a pin rotates, a slider slides, a sleeve does both, a ball rotates about every axis
PIN, SLIDER, SLEEVE, BALL = range(4)
#: by type of joint, for each bearing: kind, side (0: first frame, 1: second), axis of that frame along the bearing
BEARINGS: dict[str, tuple[tuple[int, int, int], ...]] = {
    "revolute": ((PIN, 0, 2),),
    "prismatic": ((SLIDER, 0, 2),),
    "cylindrical": ((SLEEVE, 0, 2),),
    "universal": ((PIN, 0, 0), (PIN, 1, 1)),
    "spherical": ((BALL, 0, 2),),
}


def _laws(scene: Scene) -> list[str]:
    return sorted(
        {joint.friction.kind for joint in scene.joints_with_friction().values() if joint.friction is not None}
    )


JOINT_FRICTION = Effect(
    "joint_friction",
    lambda scene: _laws(scene) or None,
    topology={
        # site_a, site_b: of its frames; link: the link whose inboard joint it is, or -1; reversed: 1 when that link is
        # on the side of the first frame; closure: its closure, or -1
        "rubbing": "site_a site_b link reversed closure bearing0 n_bearings",
        # bearings of these joints. kind: see `equations`; side, axis: of the frame; bristle: see CONTACTS
        "bearings": "joint kind law side axis bristle",
    },
    # radius: arm of the friction; lever: pairs of forces at the ends per moment; axial, torsion: normal forces per
    # force along the axis and per moment about it; preload: constant normal force; then the tables of their laws
    numbers={"bearing_numbers": "radius lever axial torsion preload law:6", "bearing_tables": "value"},
    work={
        # unit: wrench of its friction on the joint's second body per normal force, about the mechanism's origin; loss:
        # lost power per normal force [m/s]
        "bearing": ("n_bearings", "load slip loss unit_moment:3 unit_force:3"),
        # quantities with kinks of the friction where they reverse: sliding velocity, normal forces of the force along
        # the axis and of the moment about it, forces at both ends
        "bends": ("n_bearings", "sliding:3 along about one_end:2 other_end:2"),
        # joint reactions: without friction, then per normal force of each bearing; about the second frame's origin
        "reactions": ("n_rubbing+n_rubbing*n_bearings", "moment:3 force:3"),
    },
    ledger=True,
    guards=True,
)


STIFFENING = Effect(
    "stiffening",
    lambda scene: () if any(body.stiffening is not None for body in scene.flexible().values()) else None,
    topology={"stations": "flex data"},  # data: index in STATION_DATA of rotation and curvature (3n each)
    numbers={"station_stiffness": "matrix:6", "station_data": "value"},  # of twist and bending (xx yy zz xy xz yz)
)


STOPS = Effect(
    "stops",
    lambda scene: () if scene.stops() else None,
    touches=True,
)


#: sliding distance and load path are part of the state: steps and impacts are as exact for them as for the motion
WEAR = Effect(
    "wear",
    lambda scene: () if scene.wearing_joints() else None,
    # contacts with wear; outer0, inner0: first numbers of the profiles of worn surfaces. halvings, heights: of their
    # intervals of angle and height; -1: round, 0: of a pin
    topology={"worn": "contact outer0 inner0 halvings heights"},
    numbers={"profiles": "value"},
    changeable=tuple(f"joint.wear.{key}" for key in ("coefficient", "hardness", "sectors", "outer_share")),
    ledger=True,
)

#: in the order of their blocks in the ledger; to add one: its declaration above, and its name here
EFFECTS = (STIFFENING, STOPS, GEARS, BUSHINGS, CONTROLLERS, FILMS, JOINT_FRICTION, WEAR)
