"""The part of the contract about runs; names of quantities are taken from it, so it needs no NumPy."""

from __future__ import annotations

from flexclear.pipeline.core.scene.event_kinds import CHANGES, EVENT_KINDS
from flexclear.pipeline.core.scene.output import VARIABLES
from flexclear.pipeline.core.scene.variable import Schema, Variable

_V = Variable

#: stage 4: one run
RUN: Schema = {
    "position": _V(("time", "body", "axis"), "m", "centre of mass, world axes"),
    "quaternion": _V(("time", "body", "quat"), "1", "unit quaternion, body to world"),
    "velocity": _V(("time", "body", "axis"), "m s-1", "velocity of the centre of mass, world axes"),
    "angular_velocity": _V(("time", "body", "axis"), "rad s-1", "angular velocity, world axes"),
    "acceleration": _V(("time", "body", "axis"), "m s-2", "acceleration of the centre of mass, world axes"),
    "angular_acceleration": _V(("time", "body", "axis"), "rad s-2", "angular acceleration, world axes"),
    "frame_position": _V(("time", "frame", "axis"), "m", "origin of the named frame, world axes"),
    "joint_force": _V(
        ("time", "joint", "axis"), "N", "force on the joint's second body at its frame's origin, world axes"
    ),
    "joint_moment": _V(
        ("time", "joint", "axis"), "N m", "moment on the joint's second body at its frame's origin, world axes"
    ),
    "joint_bearing_load": _V(
        ("time", "rubbing"), "N", "normal force in the bearings of a joint with friction", optional=True
    ),
    "joint_sliding_speed": _V(("time", "rubbing"), "m s-1", "sliding speed there, the largest", optional=True),
    "joint_friction_power": _V(("time", "rubbing"), "W", "power of the joint's friction, <= 0", optional=True),
    "joint_friction_loss": _V(
        ("time", "rubbing"), "J", "energy lost to the friction of the joint since the start", optional=True
    ),
    "joint_friction_force": _V(
        ("time", "rubbing", "axis"), "N", "friction's part of joint_force, world axes", optional=True
    ),
    "joint_friction_moment": _V(
        ("time", "rubbing", "axis"), "N m", "friction's part of joint_moment, world axes", optional=True
    ),
    "modal_coordinate": _V(("time", "mode"), "m", "modal coordinate, for a modal mass of 1 kg", optional=True),
    "modal_velocity": _V(("time", "mode"), "m s-1", "rate of the modal coordinate", optional=True),
    "drive_force": _V(
        ("time", "drive"), "N", "what the drive supplies along its coordinate", optional=True, turning="N m"
    ),
    "drive_position": _V(("time", "drive"), "m", "prescribed coordinate", optional=True, turning="rad"),
    "joint_position": _V(
        ("time", "coordinate"),
        "m",
        "joint coordinate of the second frame against the first",
        optional=True,
        turning="rad",
    ),
    "joint_velocity": _V(
        ("time", "coordinate"), "m s-1", "rate of the joint coordinate", optional=True, turning="rad s-1"
    ),
    "joint_acceleration": _V(
        ("time", "coordinate"), "m s-2", "second rate of the joint coordinate", optional=True, turning="rad s-2"
    ),
    "load_force": _V(
        ("time", "load", "axis"), "N", "force of the load on its frame, or its second one, world axes", optional=True
    ),
    "load_moment": _V(
        ("time", "load", "axis"),
        "N m",
        "moment of the load there, about that frame's origin, world axes",
        optional=True,
    ),
    "load_length": _V(
        ("time", "load"),
        "m",
        "length of a spring, or joint coordinate that a load acts along",
        optional=True,
        turning="rad",
    ),
    "bushing_displacement": _V(
        ("time", "bushing", "axis"), "m", "second frame's origin in the first one's axes", optional=True
    ),
    "bushing_rotation": _V(
        ("time", "bushing", "axis"), "rad", "rotation vector from the first frame to the second", optional=True
    ),
    "load_power": _V(
        ("time", "load"), "W", "power of the load on the mechanism, stored energy included", optional=True
    ),
    "controller_force": _V(
        ("time", "controller"),
        "N",
        "force of the controller along the coordinate it pushes",
        optional=True,
        turning="N m",
    ),
    "controller_integral": _V(("time", "controller"), "N", "integral part of that force", optional=True, turning="N m"),
    "gear_force": _V(
        ("time", "gear"),
        "N",
        "force of the gear along its second coordinate, on its second body",
        optional=True,
        turning="N m",
    ),
    "contact_gap": _V(
        ("time", "contact"), "m", "clearance minus eccentricity; negative in contact", optional=True, turning="rad"
    ),
    "contact_penetration": _V(("time", "contact"), "m", "max(0, -gap)", optional=True, turning="rad"),
    "contact_rate": _V(("time", "contact"), "m s-1", "rate of penetration", optional=True, turning="rad s-1"),
    "contact_force": _V(
        ("time", "contact", "axis"), "N", "contact force on the ball, world axes", optional=True, turning="N m"
    ),
    "contact_normal_force": _V(("time", "contact"), "N", "normal contact force, >= 0", optional=True, turning="N m"),
    "contact_friction_power": _V(("time", "contact"), "W", "minus the power that friction takes, <= 0", optional=True),
    "contact_sliding_speed": _V(
        ("time", "contact"), "m s-1", "sliding speed at the contact; 0 without friction or contact", optional=True
    ),
    "contact_elastic": _V(("time", "contact"), "J", "energy stored in the contact and its bristles", optional=True),
    "contact_damping_loss": _V(
        ("time", "contact"), "J", "energy lost to the normal damping of the contact since the start", optional=True
    ),
    "contact_impulse": _V(
        ("time", "contact"), "N s", "impulse of the normal force since the start", optional=True, turning="N m s"
    ),
    "contact_friction_loss": _V(
        ("time", "contact"), "J", "energy lost to the friction of the contact since the start", optional=True
    ),
    "contact_delivered_restitution": _V(
        ("contact",), "1", "rebound over approach speed that the contact's law gives a free impact", optional=True
    ),
    "wear_sliding_distance": _V(
        ("time", "worn"), "m", "distance that the surfaces in contact have slid on each other", optional=True
    ),
    "wear_load_path": _V(
        ("time", "worn"), "N m", "time integral of normal force times sliding speed since the start", optional=True
    ),
    "wear_direction_outer": _V(
        ("time", "worn", "axis"), "1", "direction from the socket's centre to the contact, socket axes", optional=True
    ),
    "wear_direction_inner": _V(
        ("time", "worn", "axis"),
        "1",
        "direction from the centre of ball or pin to the contact, its axes",
        optional=True,
    ),
    "load_loss": _V(("time",), "J", "energy lost to the loads since the start", optional=True),
    "modal_damping_loss": _V(("time",), "J", "energy lost to modal damping since the start", optional=True),
    "contact_offset": _V(
        ("time", "contact", "axis"),
        "m",
        "ball centre relative to the socket centre, socket axes",
        optional=True,
        turning="rad",
    ),
    "kinetic": _V(("time",), "J", "kinetic energy"),
    "potential": _V(("time",), "J", "potential energy of the loads"),
    "elastic": _V(("time",), "J", "energy stored in flexible bodies, springs and contacts"),
    "dissipated": _V(("time",), "J", "energy dissipated since the start"),
    "drive_work": _V(("time",), "J", "work supplied by the drives since the start"),
    "load_work": _V(("time",), "J", "work of forces and torques since the start", optional=True),
    "energy_error": _V(
        ("time",), "J", "kinetic + potential + elastic + dissipated - drive_work - load_work, minus its start value"
    ),
    "constraint_error": _V(("time",), "m", "largest violation of a loop closure, redundant rows included"),
    "mobility": _V(("time",), "1", "degrees of freedom, prescribed ones not counted", optional=True),
    "rank": _V(("time",), "1", "independent rows of the loop closures", optional=True),
    "condition": _V(
        ("time",), "1", "condition number of the independent closure rows, lengths in units of 0.1 m", optional=True
    ),
    "reaction_redundant": _V(
        ("joint",), "1", "1 where rigid bodies leave the joint's reaction undetermined", optional=True
    ),
    "pass_time": _V(("singular_pass",), "s", "time of a pass through a singular pose", optional=True),
    "pass_condition": _V(("singular_pass",), "1", "condition number where the pass was located", optional=True),
    "pass_rank_loss": _V(("singular_pass",), "1", "closure rows that depend on others in that pose", optional=True),
    "horizon": _V((), "s", "predictability horizon: time up to which pointwise values mean something", optional=True),
    "separation": _V(
        ("separation_time",),
        "1",
        "largest separation of a body from the same run started `separation_perturbation` of the clearance away, in "
        "the norm of the kinetic energy, as a fraction of its largest motion",
        optional=True,
    ),
    "event_time": _V(("event",), "s", "time of the event", optional=True),
    "event_contact": _V(("event",), "", "name of the contact, or of the scene's event", optional=True),
    "event_kind": _V(
        ("event",), "", f"one of {', '.join(EVENT_KINDS)}; of a scene's event {', '.join(CHANGES)}", optional=True
    ),
    "event_approach_speed": _V(
        ("event",),
        "m s-1",
        "rate of penetration at a closing, minus it at an opening, 0 at compression",
        optional=True,
        turning="rad s-1",
    ),
    "event_peak_force": _V(
        ("event",), "N", "largest normal force of the contact that this closing begins", optional=True, turning="N m"
    ),
    "event_peak_penetration": _V(("event",), "m", "largest penetration of that contact", optional=True, turning="rad"),
    "event_duration": _V(("event",), "s", "duration of that contact", optional=True),
    "event_energy_loss": _V(
        ("event",),
        "J",
        "energy that a scene's event takes from the mechanism, also what released parts had stored",
        optional=True,
    ),
    "event_impulse": _V(
        ("event",),
        "N s",
        "impulse along the coordinate that a scene's event holds or drives",
        optional=True,
        turning="N m s",
    ),
    **{name: variable for requested in VARIABLES.values() for name, variable in requested.items()},
}
