"""The declaration of friction of ideal joints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from flexclear.pipeline.dynamics.effects.effect import Effect

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene


def _named(scene: Scene) -> Iterator[tuple[str, str, str]]:
    for name, joint in scene.rubbing().items():
        if joint.friction is not None:
            yield "contact.friction", joint.friction.law, f"[joint.{name}.friction]"


JOINT_FRICTION = Effect(
    "joint_friction",
    lambda scene: sorted({law for _, law, _ in _named(scene)}) or None,
    "contact.friction",
    _named,
    wiring={
        # site_a, site_b: of its frames; link: whose inboard joint it is, or -1; reversed: whether that link is on the
        # side of the first frame; closure: that it is, or -1
        "rubbing": "site_a site_b link reversed closure entry0 n_entries momentum0 n_momenta column0 n_columns loop0 "
        "n_loops bearing0 n_bearings",
        # where such a joint rubs. kind: see `equations`; side, axis: of its frame; bristle: as of CONTACTS
        "bearings": "joint kind law side axis bristle",
        "rubbing_entries": "coordinate column sign",  # what moves it; prescribed coordinates after the free ones
        "reaction_terms": "coordinate column",  # free coordinates whose acceleration the joint of a link feels
        "reaction_loops": "closure sign part",  # closures that act beyond it
    },
    # radius: arm of the friction; lever: pairs of forces at the ends per moment; axial, torsion: normal forces per
    # force along the axis and per moment about it; preload: normal force that is always there
    numbers={"bearing_numbers": "radius lever axial torsion preload law:6"},
    work={
        # unit: wrench of its friction on the joint's second body per normal force, about the kernels' origin; loss:
        # what it takes per normal force [m/s]
        "bearing": ("n_bearings", "load slip loss unit_moment:3 unit_force:3"),
        # the search for the loads: part of the friction that is there, turns, last change, whether in strides
        "search": ("1", "share turns change strides"),
        # what bends its friction where it reverses: sliding velocity, force along the axis, moment about it and forces
        # at both ends as they press
        "bends": ("n_bearings", "sliding:3 along about one_end:2 other_end:2"),
        # of the joints: without friction, then per normal force of each bearing; about the second frame's origin
        "reactions": ("n_rubbing+n_rubbing*n_bearings", "moment:3 force:3"),
    },
    # of the bearings' loads: slopes of their equations, and residuals; of the closures: multipliers without friction
    stretches=(
        "bearing_slopes:n_bearings*n_bearings",
        "bearing_residuals:n_bearings",
        "smooth_multiplier:n_closure_rows*?n_bearings",
    ),
    compose={
        "evaluate": {
            "friction": "(<equations.make_joint_friction>({kinds}, {file.parts.closures}, {file.tree}), "
            "<equations.load_drives>)"
        },
        "observe closures": {"friction": "<equations.take_off_closures>"},
    },
    fill="model:fill",
    ledger="model:ledger",
    guards="model:guards",
    losses="run:losses",
    explains="run:explanation",
    records={("joint_bearing", "joint_sliding", "joint_friction_"): "record:friction_series"},
    warns="record:warnings",
)
