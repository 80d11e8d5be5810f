"""Loads. To add one: a module here, a line below, its parameters in core/scene/loads.

Each module but that of gravity, which is a field, holds one class with
- ``row(load, place)`` or, on a joint coordinate, ``row(load, place, coordinate)``: what it acts on
  and with (see `row.Row`); ValueError, in words, for values that cannot be;
- ``apply(h, f, w, k)``: kernel that applies load k by `fields.act`.
"""

KIND = "load"
NAMES = {
    "gravity": "gravity:field",
    "point-force": "point_force:PointForce",
    "point-torque": "point_torque:PointTorque",
    "spring-damper": "spring_damper:SpringDamper",
    "joint-force": "joint_force:JointForce",
    "joint-spring": "joint_spring:JointSpring",
    "joint-friction": "joint_friction:JointFriction",
}
