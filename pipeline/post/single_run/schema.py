"""What the post stage derives from one run: dimensions, units and meaning (artifact `post`)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from flexclear.pipeline.core.artifacts.schema import RUN, Schema, Variable

_V = Variable
#: of what some runs do not have
_O = partial(Variable, optional=True)

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
    mean = _O(dims, units, f"ensemble mean of the {words}", turning=turning)
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
    "peak_drive_force": _O(("drive",), "N", "largest magnitude of what the drive supplies", turning="N m"),
    "peak_drive_force_time": _O(("drive",), "s", "time of that magnitude"),
    "peak_stress": _O(("gauge",), "Pa", "largest von Mises stress of the gauge"),
    "peak_stress_time": _O(("gauge",), "s", "time of that stress"),
    "peak_stress_position": _O(
        ("gauge", "axis"), "m", "undeformed position of that stress, body frame; of a rod its section's"
    ),
    "eccentricity": _O(("time", "contact"), "m", "distance of ball and socket centres", turning="rad"),
    "clearance": _O(("contact",), "m", "radial clearance; of a plane without meaning", turning="rad"),
    "impact_time": _O(("impact",), "s", "time of a closing above the impact threshold"),
    "impact_contact": _O(("impact",), "", "name of the contact"),
    "impact_approach_speed": _O(("impact",), "m s-1", "rate of penetration at the closing", turning="rad s-1"),
    "impact_separation_speed": _O(
        ("impact",), "m s-1", "rate of separation at the opening that follows", turning="rad s-1"
    ),
    "impact_peak_force": _O(("impact",), "N", "largest normal force of the contact", turning="N m"),
    "impact_duration": _O(("impact",), "s", "duration of the contact"),
    "impact_count": _O(("contact",), "1", "closings above the impact threshold, ended or not"),
    "impact_impulse": _O(("impact",), "N s", "impulse of the normal force in the contact", turning="N m s"),
    "impact_damping_loss": _O(("impact",), "J", "energy lost to the contact's damping in it"),
    "impact_friction_loss": _O(("impact",), "J", "energy lost to the contact's friction in it"),
    "peak_force": _O(("contact",), "N", "largest normal contact force of the run", turning="N m"),
    "peak_force_time": _O(("contact",), "s", "time of that force"),
    "peak_penetration": _O(("contact",), "m", "largest penetration of the run", turning="rad"),
    "peak_penetration_time": _O(("contact",), "s", "time of that penetration"),
    "wear_volume": _O(("worn",), "m3", "volume that the contact has worn, of both surfaces together"),
    "wear_distance": _O(("worn",), "m", "sliding distance of the contact"),
    "wear_sectors": _O(("worn",), "1", "sectors in use, around z of the frames"),
    **{
        f"wear_{what}_{side}": _O(("worn", "band", "sector"), units, f"{words} {surface}, by sector")
        for side, surface in (("outer", "socket or journal"), ("inner", "ball or pin"))
        for what, units, words in (
            ("depth", "m", "depth if all wear were on the"),
            ("impulse", "N s", "impulse on the"),
        )
    },
    "wear_deepest_outer": _O(("worn",), "m", "largest of these depths on the socket or journal"),
    "wear_deepest_inner": _O(("worn",), "m", "largest of these depths on the ball or pin"),
    "contact_time_share": _O(("contact",), "1", "fraction of the run spent in contact"),
    "horizon": replace(RUN["horizon"], optional=False),  # where the run says none, its end
    "ensemble_horizon": _O((), "s", "where the members of the ensemble part"),
    "spread": _O(("ensemble_time",), "m s-1", "largest distance of a member's velocity from the mean"),
}
for _name, _declared in _OF_MEMBERS.items():
    POST |= _of_members(_name, *_declared)
