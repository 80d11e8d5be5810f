"""Declaration of friction of ideal joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.dynamics.effects.effect import Effect

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

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
        # unit: wrench of its friction on the joint's second body per normal force, about the kernels' origin; loss:
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
