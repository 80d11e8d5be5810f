"""Schema of the post stage's results from one run: dimensions, units and meaning (artifact `post`)."""

from __future__ import annotations

from dataclasses import replace

from flexclear.artifacts.schema import RUN, Schema
from flexclear.scene.output import table

#: variables of an ensemble with mean, standard deviation and quantiles over its members
_OF_MEMBERS = table("""
rotation_y? | ensemble_time ensemble_body | rad | rotation y
displacement? | ensemble_time ensemble_body axis | m | displacement
velocity? | ensemble_time ensemble_body axis | m s-1 | velocity
acceleration? | ensemble_time ensemble_body axis | m s-2 | acceleration
normal_force? | ensemble_time contact | N, N m | normal force
impact_count? | contact | 1 | impact count
peak_force? | contact | N, N m | peak force
contact_time_share? | contact | 1 | contact time share
peak_acceleration? | ensemble_body axis | m s-2 | peak acceleration
""")

#: stage 5: series and tables of one run, and of its ensemble where the scene has one
POST: Schema = table(f"""
rotation_y | time body | rad | angle about the world's y axis, asin(R_WB[0, 2])
rotation | time body | rad | total rotation from the first pose
displacement | time body axis | m | centre of mass, minus its first position, world axes
reaction | time joint | N | magnitude of the joint force; of the contact force where the joint has clearance
peak_reaction | joint | N | largest reaction, of outputs and events
peak_reaction_time | joint | s | time of the largest reaction
peak_acceleration | body axis | m s-2 | largest magnitude of each component of the acceleration, of outputs and events
peak_acceleration_time | body axis | s | time of that magnitude
peak_drive_force? | drive | N, N m | largest magnitude of the drive's force or torque
peak_drive_force_time? | drive | s | time of that magnitude
peak_stress? | gauge | Pa | largest von Mises stress of the gauge
peak_stress_time? | gauge | s | time of that stress
peak_stress_position? | gauge axis | m | undeformed position of that stress, body frame; of a rod its section's
eccentricity? | time contact | m, rad | distance of ball and socket centres
clearance? | contact | m, rad | radial clearance; of a plane without meaning
impact_time? | impact | s | time of a closing above the impact threshold
impact_contact? | impact | | name of the contact
impact_approach_speed? | impact | m s-1, rad s-1 | rate of penetration at the closing
impact_separation_speed? | impact | m s-1, rad s-1 | rate of separation at the opening that follows
impact_peak_force? | impact | N, N m | largest normal force of the contact
impact_duration? | impact | s | duration of the contact
impact_count? | contact | 1 | closings above the impact threshold, ended or not
impact_impulse? | impact | N s, N m s | impulse of the normal force in the contact
impact_damping_loss? | impact | J | energy lost to the contact's damping in it
impact_friction_loss? | impact | J | energy lost to the contact's friction in it
peak_force? | contact | N, N m | largest normal contact force of the run
peak_force_time? | contact | s | time of that force
peak_penetration? | contact | m, rad | largest penetration of the run
peak_penetration_time? | contact | s | time of that penetration
wear_volume? | worn | m3 | volume that the contact has worn, of both surfaces together
wear_distance? | worn | m | sliding distance of the contact
wear_sectors? | worn | 1 | sectors in use, around z of the frames
wear_depth_outer? | worn band sector | m | depth if all wear were on the socket or journal, by sector
wear_impulse_outer? | worn band sector | N s | impulse on the socket or journal, by sector
wear_depth_inner? | worn band sector | m | depth if all wear were on the ball or pin, by sector
wear_impulse_inner? | worn band sector | N s | impulse on the ball or pin, by sector
wear_deepest_outer? | worn | m | largest of these depths on the socket or journal
wear_deepest_inner? | worn | m | largest of these depths on the ball or pin
contact_time_share? | contact | 1 | fraction of the run spent in contact
horizon | | s | {RUN["horizon"].long_name}
ensemble_horizon? | | s | where the members of the ensemble part
spread? | ensemble_time | m s-1 | largest distance of a member's velocity from the mean
""")
for _name, _one in _OF_MEMBERS.items():
    POST |= {
        f"{_name}_mean": replace(_one, long_name=f"ensemble mean of the {_one.long_name}"),
        f"{_name}_std": replace(_one, long_name=f"ensemble standard deviation of the {_one.long_name}"),
        f"{_name}_quantile": replace(
            _one, dims=("quantile", *_one.dims), long_name=f"quantiles of the {_one.long_name} over the members"
        ),
    }
