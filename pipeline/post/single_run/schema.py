"""What the post stage derives from one run: dimensions, units and meaning (artifact `post`)."""

from __future__ import annotations

from dataclasses import replace

from flexclear.pipeline.core.artifacts.schema import RUN, Schema, Variable

_V = Variable

_KEPT, _PER_AXIS = ("ensemble_time", "ensemble_body"), ("ensemble_time", "ensemble_body", "axis")
#: the message about an ensemble by mean, standard deviation and quantiles: dimensions, units, units of what turns
_OF_MEMBERS: dict[str, tuple] = {
    "rotation_y": (_KEPT, "rad"),
    "displacement": (_PER_AXIS, "m"),
    "velocity": (_PER_AXIS, "m s-1"),
    "acceleration": (_PER_AXIS, "m s-2"),
    "normal_force": (("ensemble_time", "contact"), "N", "N m"),
    "impact_count": (("contact",), "1"),
    "peak_force": (("contact",), "N", "N m"),
    "contact_time_share": (("contact",), "1"),
    "peak_acceleration": (("ensemble_body", "axis"), "m s-2"),
}


def _of_members(name: str, dims: tuple[str, ...], units: str, turning: str = "") -> Schema:
    words = name.replace("_", " ")
    mean = _V(dims, units, f"ensemble mean of the {words}", optional=True, turning=turning)
    deviation = replace(mean, long_name=f"ensemble standard deviation of the {words}")
    quantiles = replace(mean, dims=("quantile", *dims), long_name=f"quantiles of the {words} over the members")
    return {f"{name}_mean": mean, f"{name}_std": deviation, f"{name}_quantile": quantiles}


#: stage 5: series and tables of one run, and of its ensemble where the scene has one
POST: Schema = {
    "rotation_y": _V(("time", "body"), "rad", "angle about the world's y axis, asin(R_WB[0, 2])"),
    "rotation": _V(("time", "body"), "rad", "total rotation from the first pose"),
    "displacement": _V(("time", "body", "axis"), "m", "centre of mass, minus its first position, world axes"),
    "reaction": _V(
        ("time", "joint"), "N", "magnitude of the joint force; of the contact force where the joint has clearance"
    ),
    "peak_reaction": _V(("joint",), "N", "largest reaction, of outputs and events"),
    "peak_reaction_time": _V(("joint",), "s", "time of the largest reaction"),
    "peak_acceleration": _V(
        ("body", "axis"), "m s-2", "largest magnitude of each component of the acceleration, of outputs and events"
    ),
    "peak_acceleration_time": _V(("body", "axis"), "s", "time of that magnitude"),
    "peak_drive_force": _V(
        ("drive",), "N", "largest magnitude of what the drive supplies", optional=True, turning="N m"
    ),
    "peak_drive_force_time": _V(("drive",), "s", "time of that magnitude", optional=True),
    "peak_stress": _V(("gauge",), "Pa", "largest von Mises stress of the gauge", optional=True),
    "peak_stress_time": _V(("gauge",), "s", "time of that stress", optional=True),
    "peak_stress_position": _V(
        ("gauge", "axis"), "m", "undeformed position of that stress, body frame; of a rod its section's", optional=True
    ),
    "eccentricity": _V(("time", "contact"), "m", "distance of ball and socket centres", optional=True, turning="rad"),
    "clearance": _V(("contact",), "m", "radial clearance; of a plane without meaning", optional=True, turning="rad"),
    "impact_time": _V(("impact",), "s", "time of a closing above the impact threshold", optional=True),
    "impact_contact": _V(("impact",), "", "name of the contact", optional=True),
    "impact_approach_speed": _V(
        ("impact",), "m s-1", "rate of penetration at the closing", optional=True, turning="rad s-1"
    ),
    "impact_separation_speed": _V(
        ("impact",), "m s-1", "rate of separation at the opening that follows", optional=True, turning="rad s-1"
    ),
    "impact_peak_force": _V(("impact",), "N", "largest normal force of the contact", optional=True, turning="N m"),
    "impact_duration": _V(("impact",), "s", "duration of the contact", optional=True),
    "impact_count": _V(("contact",), "1", "closings above the impact threshold, ended or not", optional=True),
    "impact_impulse": _V(
        ("impact",), "N s", "impulse of the normal force in the contact", optional=True, turning="N m s"
    ),
    "impact_damping_loss": _V(("impact",), "J", "energy lost to the contact's damping in it", optional=True),
    "impact_friction_loss": _V(("impact",), "J", "energy lost to the contact's friction in it", optional=True),
    "peak_force": _V(("contact",), "N", "largest normal contact force of the run", optional=True, turning="N m"),
    "peak_force_time": _V(("contact",), "s", "time of that force", optional=True),
    "peak_penetration": _V(("contact",), "m", "largest penetration of the run", optional=True, turning="rad"),
    "peak_penetration_time": _V(("contact",), "s", "time of that penetration", optional=True),
    "wear_volume": _V(("worn",), "m3", "volume that the contact has worn, of both surfaces together", optional=True),
    "wear_distance": _V(("worn",), "m", "sliding distance of the contact", optional=True),
    "wear_sectors": _V(("worn",), "1", "sectors in use, around z of the frames", optional=True),
    **{
        f"wear_{what}_{side}": _V(("worn", "band", "sector"), units, f"{words} {surface}, by sector", optional=True)
        for side, surface in (("outer", "socket or journal"), ("inner", "ball or pin"))
        for what, units, words in (
            ("depth", "m", "depth if all wear were on the"),
            ("impulse", "N s", "impulse on the"),
        )
    },
    "wear_deepest_outer": _V(("worn",), "m", "largest of these depths on the socket or journal", optional=True),
    "wear_deepest_inner": _V(("worn",), "m", "largest of these depths on the ball or pin", optional=True),
    "contact_time_share": _V(("contact",), "1", "fraction of the run spent in contact", optional=True),
    "horizon": replace(RUN["horizon"], optional=False),  # where the run says none, its end
    "ensemble_horizon": _V((), "s", "where the members of the ensemble part", optional=True),
    "spread": _V(("ensemble_time",), "m s-1", "largest distance of a member's velocity from the mean", optional=True),
}
for _name, _declared in _OF_MEMBERS.items():
    POST |= _of_members(_name, *_declared)
