"""The schema of runs. Names of quantities are derived from it, so it does not import NumPy."""

from __future__ import annotations

from flexclear.scene.event_kinds import CHANGES, EVENT_KINDS
from flexclear.scene.output import VARIABLES, Schema, table

#: stage 4: one run
RUN: Schema = table(f"""
position | time body axis | m | centre of mass, world axes
quaternion | time body quat | 1 | unit quaternion, body to world
velocity | time body axis | m s-1 | velocity of the centre of mass, world axes
angular_velocity | time body axis | rad s-1 | angular velocity, world axes
acceleration | time body axis | m s-2 | acceleration of the centre of mass, world axes
angular_acceleration | time body axis | rad s-2 | angular acceleration, world axes
frame_position | time frame axis | m | origin of the named frame, world axes
joint_force | time joint axis | N | force on the joint's second body at its frame's origin, world axes
joint_moment | time joint axis | N m | moment on the joint's second body at its frame's origin, world axes
joint_bearing_load? | time rubbing | N | normal force in the bearings of a joint with friction
joint_sliding_speed? | time rubbing | m s-1 | largest sliding speed in the joint
joint_friction_power? | time rubbing | W | power of the joint's friction, <= 0
joint_friction_loss? | time rubbing | J | energy lost to the friction of the joint since the start
joint_friction_force? | time rubbing axis | N | friction's part of joint_force, world axes
joint_friction_moment? | time rubbing axis | N m | friction's part of joint_moment, world axes
modal_coordinate? | time mode | m | modal coordinate, for a modal mass of 1 kg
modal_velocity? | time mode | m s-1 | rate of the modal coordinate
drive_force? | time drive | N, N m | force or torque of the drive along its coordinate
drive_position? | time drive | m, rad | prescribed coordinate
joint_position? | time coordinate | m, rad | joint coordinate of the second frame against the first
joint_velocity? | time coordinate | m s-1, rad s-1 | rate of the joint coordinate
joint_acceleration? | time coordinate | m s-2, rad s-2 | second rate of the joint coordinate
load_force? | time load axis | N | force of the load on its frame, or its second one, world axes
load_moment? | time load axis | N m | moment of the load on the frame, about the frame's origin, world axes
load_length? | time load | m, rad | length of a spring, or joint coordinate that a load acts along
bushing_displacement? | time bushing axis | m | second frame's origin in the first one's axes
bushing_rotation? | time bushing axis | rad | rotation vector from the first frame to the second
film_force? | time film axis | N | film's part of joint_force, world axes
film_moment? | time film axis | N m | film's part of joint_moment, world axes
film_power? | time film | W | power of the film on the mechanism, <= 0
film_thickness? | time film | m | clearance minus eccentricity
load_power? | time load | W | power of the load on the mechanism, stored energy included
controller_force? | time controller | N, N m | force of the controller along the coordinate it pushes
controller_integral? | time controller | N, N m | integral part of that force
gear_force? | time gear | N, N m | force of the gear along its second coordinate, on its second body
contact_gap? | time contact | m, rad | clearance minus eccentricity; negative in contact
contact_penetration? | time contact | m, rad | max(0, -gap)
contact_rate? | time contact | m s-1, rad s-1 | rate of penetration
contact_force? | time contact axis | N, N m | force, or torque of an angle's end, on the ball or second body, world axes
contact_normal_force? | time contact | N, N m | normal contact force, >= 0
contact_friction_power? | time contact | W | minus the power that friction takes, <= 0
contact_sliding_speed? | time contact | m s-1 | sliding speed at the contact; 0 without friction or contact
contact_elastic? | time contact | J | energy stored in the contact and its bristles
contact_damping_loss? | time contact | J | energy lost to the normal damping of the contact since the start
contact_impulse? | time contact | N s, N m s | impulse of the normal force since the start
contact_friction_loss? | time contact | J | energy lost to the friction of the contact since the start
contact_delivered_restitution?~ | contact | 1 | rebound over approach speed that the contact's law gives a free
  impact, NaN where the law depends on a mass that is unknown
wear_sliding_distance? | time worn | m | distance that the surfaces in contact have slid on each other
wear_load_path? | time worn | N m | time integral of normal force times sliding speed since the start
wear_direction_outer? | time worn axis | 1 | direction from the socket's centre to the contact, socket axes
wear_direction_inner? | time worn axis | 1 | direction from the centre of ball or pin to the contact, its axes
load_loss? | time | J | energy lost to the loads since the start
modal_damping_loss? | time | J | energy lost to modal damping since the start
internal_state? | time internal | 1 | internal state of a controller, a bushing, or bristles of friction, SI units
contact_offset? | time contact axis | m, rad | ball centre relative to the socket centre, socket axes
kinetic | time | J | kinetic energy
potential | time | J | potential energy of the loads
elastic | time | J | energy stored in flexible bodies, springs and contacts
dissipated | time | J | energy dissipated since the start
drive_work | time | J | work supplied by the drives since the start
load_work? | time | J | work of forces and torques since the start
energy_error | time | J | kinetic + potential + elastic + dissipated - drive_work - load_work, minus its start value
constraint_error | time | m | largest violation of a loop closure, redundant rows included
mobility? | time | 1 | degrees of freedom, prescribed ones not counted
rank? | time | 1 | independent rows of the loop closures
condition? | time | 1 | condition number of the independent closure rows, lengths in units of 0.1 m
reaction_redundant? | joint | 1 | 1 where rigid bodies leave the joint's reaction undetermined
pass_time? | singular_pass | s | time of a pass through a singular pose
pass_condition? | singular_pass | 1 | condition number where the pass was located
pass_rank_loss? | singular_pass | 1 | closure rows that depend on others in that pose
horizon? | | s | predictability horizon: time up to which pointwise values mean something
separation? | separation_time | 1 | largest separation of a body from the same run started `separation_perturbation`
    of the clearance away, in the norm of the kinetic energy, as a fraction of its largest motion
event_time? | event | s | time of the event
event_contact? | event | | name of the contact, or of the scene's event
event_kind? | event | | one of {", ".join(EVENT_KINDS)}; of a scene's event {", ".join(CHANGES)}
event_approach_speed? | event | m s-1, rad s-1 | rate of penetration at a closing, minus it at an opening, 0 at
    compression
event_peak_force? | event | N, N m | largest normal force of the contact that this closing begins
event_peak_penetration? | event | m, rad | largest penetration of that contact
event_duration? | event | s | duration of that contact
event_energy_loss? | event | J | energy that the event removes from the mechanism, including that
    stored in released parts
event_impulse? | event | N s, N m s | impulse along the coordinate that a scene's event holds or drives
""") | {name: variable for requested in VARIABLES.values() for name, variable in requested.items()}
