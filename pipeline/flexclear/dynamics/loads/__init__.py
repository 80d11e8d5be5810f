"""Loads. To add one: a module here, a line in the table, and its parameters in scene/loads; a film is declared in
its joint (scene/films).

Each module has

- ``row(load, place)`` or, on a joint coordinate, ``row(load, place, coordinate)``: the row of the load (see `row.Row`);
  raises ValueError, in words, for invalid values;
- ``apply(given)``, and for loads of several structures ``apply(given, structure)``: what the load does (`given`);
- ``STATES``, if it has internal states: their number.
"""

from __future__ import annotations

from flexclear.dynamics.loads import (
    bushing,
    film,
    joint_expression,
    joint_force,
    joint_friction,
    joint_spring,
    line_expression,
    pid,
    point_expression,
    point_force,
    point_torque,
    sampled_pid,
    spring_damper,
)

LOADS = {
    "point-force": point_force,
    "point-torque": point_torque,
    "spring-damper": spring_damper,
    "joint-force": joint_force,
    "joint-expression": joint_expression,
    "line-expression": line_expression,
    "point-expression": point_expression,
    "joint-spring": joint_spring,
    "joint-friction": joint_friction,
    "bushing": bushing,
    "film": film,
    "pid": pid,
    "sampled-pid": sampled_pid,
}
