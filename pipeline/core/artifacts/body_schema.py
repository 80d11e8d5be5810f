"""The part of the contract about bodies: stages 1 to 3."""

from __future__ import annotations

from flexclear.pipeline.core.scene.variable import Schema, table

#: stage 1 of a solid: cells of one type, materials by region, frames tied to nodes
SOLID: Schema = table("""
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each cell, in the order of VTK
cell_region | cell | 1 | index of the cell's region among `region`
youngs_modulus | region | Pa | Young's modulus
poisson | region | 1 | Poisson's ratio
density | region | kg m-3 | mass density
frame_tie | frame | | rigid: nodes follow the frame; mean: the frame follows the nodes
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
tie_node | tie | 1 | tied node
tie_weight | tie | 1 | its weight in a mean
tie_frame | tie | 1 | index of the frame that it is tied to among `frame`
patch_node | patch | 1 | node of the boundary in a named region
patch_region | patch | 1 | index of that region among `surface_region`
""")

#: next to stage 3: what a rigid body made from a mesh needs
RIGID: Schema = table("""
mass | | kg | mass
com | axis | m | centre of mass in the mesh frame
inertia | axis axis2 | kg m2 | inertia about the centre of mass, axes of the mesh frame
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
""")

#: stage 1 of a body that another code has assembled: matrices by their entries, and what the unknowns are
MATRICES: Schema = table("""
unknown_node | unknown | 1 | number of the node
unknown_component | unknown | | ux uy uz rx ry rz, or internal where rigid motion has no part
unknown_position | unknown axis | m | position of the unknown in the mesh frame
stiffness_row | stiffness_entry | 1 | row
stiffness_column | stiffness_entry | 1 | column
stiffness_value | stiffness_entry | J | stiffness, per unit of row and of column: m for ux uy uz, rad for rx ry rz
mass_row | mass_entry | 1 | row
mass_column | mass_entry | 1 | column
mass_value | mass_entry | kg m2 | mass, per unit of row and of column likewise
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
tie_node | tie | 1 | number of the node whose motion, or mean motion, is the frame's
tie_frame | tie | 1 | index of the frame
body_mass? | | kg | mass
first_moment? | axis | kg m | integral of rho X
second_moment? | axis axis2 | kg m2 | integral of rho X X^T
unknown_first_moment? | axis unknown | kg | integral of rho S per unknown
unknown_position_moment? | axis axis2 unknown | kg m | integral of rho X_k S_l per unknown
pair_axes? | pair_entry | 1 | 3 k + l of an integral of rho S_k S_l, k <= l
pair_row? | pair_entry | 1 | unknown of S_k
pair_column? | pair_entry | 1 | unknown of S_l
pair_value? | pair_entry | kg | integral of rho S_k S_l
""")

#: stage 3 on request: what section forces and stresses follow from, of rods and of solids
STRESS: Schema = table("""
section_place? | section | m | position of the section along the rod; one at either end of each cell
section_position? | section axis | m | undeformed centre of the section, body frame
section_rotation? | section axis axis2 | 1 | rotation matrix, section to body frame, undeformed
section_translation_shape? | section axis mode | 1 | displacement of the section per modal coordinate, body axes
section_rotation_shape? | section axis mode | rad m-1 | rotation vector of the section per modal coordinate
slice_mass? | slice | kg | mass of a slice of the rod
slice_position? | slice axis | m | undeformed centre of mass of the slice, body frame
slice_spread? | slice axis axis2 | kg m2 | integral of rho r r^T about it, body axes
slice_translation_shape? | slice axis mode | 1 | displacement of the slice's centre per modal coordinate
slice_rotation_shape? | slice axis mode | rad m-1 | rotation vector of the slice per modal coordinate
slice_beyond? | section slice | 1 | one where the slice lies beyond the section
frame_beyond? | section frame | 1 | one where the named frame lies beyond the section
fibre_stress? | section fibre stress section_load | m-2, m-3 | axial stress and shear stress along y and z of a fibre
    per N, Qy, Qz, T, My, Mz
section_round? | section | 1 | one where the section is the same about every axis
stress_field? | node tensor field | Pa | stress at the node, body axes, per unit of the field's factor in SI
node_doubtful? | node | 1 | one where a cell of the node touches a rigidly tied frame
gauge_node? | gauge_entry | 1 | node of a gauge
gauge_index? | gauge_entry | 1 | index of that gauge among `gauge`
""")

#: stages 2 and 3: what the reduced body lacks next to the full model
DEFICITS: Schema = table("""
compliance_full? | frame frame_held direction | m N-1, rad N-1 m-1 | static compliance of a frame with another held
    (itself: with nothing held), full model, axes of the frame
compliance_share? | frame frame_held direction | 1 | fraction of that compliance which the modes have
error_bound? | frame direction bound_frequency | m N-1, rad N-1 m-1 | largest error of a frame's motion along a unit
    harmonic load on it, axes of the frame
effective_mass? | direction mode | kg, kg m2 | squared momentum of the mode per unit rigid motion about the centre of
    mass, over its modal mass
""")

#: stage 1: nodes and two-node beam cells in the mesh frame
MESH: Schema = table("""
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each cell, from start to end
area | cell | m2 | cross-section area
second_moment | cell axis | m4 | torsion constant and bending second moments (stiffness)
inertia_moment | cell axis | m4 | polar and bending second moments of area (mass)
youngs_modulus | cell | Pa | Young's modulus
shear_modulus | cell | Pa | shear modulus
density | cell | kg m-3 | mass density
frame_node | frame | 1 | node to which the named frame is tied
frame_position | frame axis | m | origin of the named frame in the mesh frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, frame to mesh frame
abscissa? | node | m | position of the node along the rod
rod_rotation? | axis axis2 | 1 | rotation matrix, rod axes (x along the rod) to mesh frame
shear_coefficient? | cell axis | 1 | fraction of the area that carries force along x, y and z of the rod
product_moment? | cell | m4 | integral of y z over the section (stiffness)
inertia_product? | cell | m4 | integral of y z over the section (mass)
area_profile? | cell point | 1 | area at the Gauss points over that of the cell
second_moment_profile? | cell point axis | 1 | second moments at the Gauss points over those of the cell
inertia_moment_profile? | cell point axis | 1 | second moments of the mass likewise
shear_coefficient_profile? | cell point axis | 1 | shear coefficients likewise
lump_node? | lump | 1 | node that carries the lumped mass
lump_mass? | lump | kg | lumped mass
lump_offset? | lump axis | m | centre of the lumped mass seen from its node, mesh axes
lump_inertia? | lump axis axis2 | kg m2 | inertia of the lumped mass about its centre, mesh axes
""")

#: stage 2: frequencies and shapes under one reference condition, all FE degrees of freedom
MODES: Schema = DEFICITS | table("""
frequency | mode | Hz | natural frequency of the retained coordinate in the reduced basis
shape | node dof mode | 1 | mass-normalised shape: ux uy uz rx ry rz per unit modal coordinate
node_position | node axis | m | node position in the mesh frame
cell_node | cell corner | 1 | node indices of each drawn cell
vector | unknown mode | 1 | mass-normalised shape, every unknown of the model
rigid_frequency? | rigid_mode | Hz | frequencies of the removed rigid-body modes
kind | mode | | bending, torsion or axial by fraction of kinetic energy
exact_euler_bernoulli? | mode | Hz | exact frequency of the uniform rod, Euler-Bernoulli bending
exact_rayleigh? | mode | Hz | exact frequency of the uniform rod, bending with rotary inertia
exact_timoshenko? | mode | Hz | exact frequency of the uniform rod, bending with rotary inertia and shear
""")

#: stage 3: all that the dynamics needs of a flexible body, in its body frame
BUNDLE: Schema = (
    DEFICITS
    | STRESS
    | table("""
mass | | kg | mass
first_moment | axis | kg m | integral of rho X
second_moment | axis axis2 | kg m2 | integral of rho X X^T
modal_first_moment | axis mode | kg | integral of rho S
position_mode_moment | axis axis2 mode | kg m | integral of rho X_k S_lj
mode_mode_moment | axis axis2 mode mode2 | kg | integral of rho S_ki S_lj
modal_mass | mode mode2 | kg | modal mass matrix
modal_stiffness | mode mode2 | N m-1 | modal stiffness matrix
frequency | mode | Hz | natural frequency of the coordinate
frame_position | frame axis | m | undeformed origin of the named frame in the body frame
frame_rotation | frame axis axis2 | 1 | rotation matrix, named frame to body frame, undeformed
frame_translation_shape | frame axis mode | 1 | displacement of the frame per modal coordinate, body axes
frame_rotation_shape | frame axis mode | rad m-1 | rotation vector of the frame per modal coordinate, body axes
shortening_first_moment? | mode mode2 | kg m-1 | integral of rho times the displacement along x that bending causes,
    second derivative
shortening_second_moment? | mode mode2 | kg | integral of rho x times the displacement along x that bending causes,
    second derivative
frame_shortening? | frame mode mode2 | m-1 | displacement of the frame along x that bending causes, second derivative
    by modal coordinates
node_position | node axis | m | undeformed node position in the body frame
cell_node | cell corner | 1 | node indices of each cell
shape_translation | node axis mode | 1 | node displacement per modal coordinate, body axes
shape_rotation | node axis mode | rad m-1 | node rotation vector per modal coordinate, body axes
radius | cell | m | radius of the drawn section
outline? | cell around axis | m | from a rod's centre line to points around its section, body axes, the first again
    last; not of round ones
""")
)
