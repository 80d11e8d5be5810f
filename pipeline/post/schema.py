"""What the post stage derives from one run: dimensions, units and meaning (artifact `post`)."""

from __future__ import annotations

from pipeline.core.artifacts.schema import Schema, Variable

_V = Variable

#: stage 5: series and tables of one run, and of its ensemble where the scene has one
POST: Schema = {
    "rotation_y": _V(("time", "body"), "rad", "angle about the world's y axis, asin(R_WB[0, 2])"),
    "rotation": _V(("time", "body"), "rad", "total rotation from the first pose"),
    "displacement": _V(("time", "body", "axis"), "m", "centre of mass, minus its first position, world axes"),
    "reaction": _V(
        ("time", "joint"), "N", "magnitude of the joint force; of the contact force where the joint has clearance"
    ),
    "eccentricity": _V(("time", "contact"), "m", "distance of ball and socket centres", optional=True),
    "clearance": _V(("contact",), "m", "radial clearance", optional=True),
    "impact_time": _V(("impact",), "s", "time of a closing above the impact threshold", optional=True),
    "impact_contact": _V(("impact",), "1", "index of the contact", optional=True),
    "impact_approach_speed": _V(("impact",), "m s-1", "rate of penetration at the closing", optional=True),
    "impact_separation_speed": _V(
        ("impact",), "m s-1", "rate of separation at the opening that follows", optional=True
    ),
    "impact_peak_force": _V(("impact",), "N", "largest normal force of the contact", optional=True),
    "impact_duration": _V(("impact",), "s", "duration of the contact", optional=True),
    "impact_count": _V(("contact",), "1", "closings above the impact threshold, ended or not", optional=True),
    "peak_force": _V(("contact",), "N", "largest normal contact force of the run", optional=True),
    "contact_time_share": _V(("contact",), "1", "share of the run spent in contact", optional=True),
    "horizon": _V((), "s", "time up to which pointwise values mean something"),
    "spread": _V(("ensemble_time",), "m s-1", "largest distance of a member's velocity from the mean", optional=True),
    "rotation_y_mean": _V(("ensemble_time", "kept"), "rad", "ensemble mean of rotation_y", optional=True),
    "rotation_y_std": _V(("ensemble_time", "kept"), "rad", "ensemble standard deviation of rotation_y", optional=True),
    "displacement_mean": _V(("ensemble_time", "kept", "axis"), "m", "ensemble mean of displacement", optional=True),
    "displacement_std": _V(
        ("ensemble_time", "kept", "axis"), "m", "ensemble standard deviation of displacement", optional=True
    ),
    "velocity_mean": _V(("ensemble_time", "kept", "axis"), "m s-1", "ensemble mean of velocity", optional=True),
    "velocity_std": _V(
        ("ensemble_time", "kept", "axis"), "m s-1", "ensemble standard deviation of velocity", optional=True
    ),
    "acceleration_mean": _V(("ensemble_time", "kept", "axis"), "m s-2", "ensemble mean of acceleration", optional=True),
    "acceleration_std": _V(
        ("ensemble_time", "kept", "axis"), "m s-2", "ensemble standard deviation of acceleration", optional=True
    ),
    "normal_force_mean": _V(
        ("ensemble_time", "contact"), "N", "ensemble mean of the normal contact force", optional=True
    ),
    "normal_force_std": _V(("ensemble_time", "contact"), "N", "ensemble standard deviation of it", optional=True),
}
