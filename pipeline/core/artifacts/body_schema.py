"""The part of the contract about bodies: stages 1 to 3."""

from __future__ import annotations

from flexclear.pipeline.core.scene.variable import Schema, Variable

_V = Variable

#: stage 1 of a solid: cells of one type, materials by region, frames tied to nodes
SOLID: Schema = {
    "node_position": _V(("node", "axis"), "m", "node position in the mesh frame"),
    "cell_node": _V(("cell", "corner"), "1", "node indices of each cell, in the order of VTK"),
    "cell_region": _V(("cell",), "1", "index of the cell's region among `region`"),
    "youngs_modulus": _V(("region",), "Pa", "Young's modulus"),
    "poisson": _V(("region",), "1", "Poisson's ratio"),
    "density": _V(("region",), "kg m-3", "mass density"),
    "frame_tie": _V(("frame",), "", "rigid: nodes follow the frame; mean: the frame follows the nodes"),
    "frame_position": _V(("frame", "axis"), "m", "origin of the named frame in the mesh frame"),
    "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, frame to mesh frame"),
    "tie_node": _V(("tie",), "1", "tied node"),
    "tie_weight": _V(("tie",), "1", "its weight in a mean"),
    "tie_frame": _V(("tie",), "1", "index of the frame that it is tied to among `frame`"),
    "patch_node": _V(("patch",), "1", "node of the boundary in a named region"),
    "patch_region": _V(("patch",), "1", "index of that region among `surface_region`"),
}

#: next to stage 3: what a rigid body made from a mesh needs
RIGID: Schema = {
    "mass": _V((), "kg", "mass"),
    "com": _V(("axis",), "m", "centre of mass in the mesh frame"),
    "inertia": _V(("axis", "axis2"), "kg m2", "inertia about the centre of mass, axes of the mesh frame"),
    "frame_position": _V(("frame", "axis"), "m", "origin of the named frame in the mesh frame"),
    "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, frame to mesh frame"),
}

#: stage 1 of a body that another code has assembled: matrices by their entries, and what the unknowns are
MATRICES: Schema = {
    "unknown_node": _V(("unknown",), "1", "number of the node"),
    "unknown_component": _V(("unknown",), "", "ux uy uz rx ry rz, or internal where rigid motion has no part"),
    "unknown_position": _V(("unknown", "axis"), "m", "position of the unknown in the mesh frame"),
    "stiffness_row": _V(("stiffness_entry",), "1", "row"),
    "stiffness_column": _V(("stiffness_entry",), "1", "column"),
    "stiffness_value": _V(
        ("stiffness_entry",), "J", "stiffness, per unit of row and of column: m for ux uy uz, rad for rx ry rz"
    ),
    "mass_row": _V(("mass_entry",), "1", "row"),
    "mass_column": _V(("mass_entry",), "1", "column"),
    "mass_value": _V(("mass_entry",), "kg m2", "mass, per unit of row and of column likewise"),
    "frame_position": _V(("frame", "axis"), "m", "origin of the named frame in the mesh frame"),
    "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, frame to mesh frame"),
    "tie_node": _V(("tie",), "1", "number of the node whose motion, or mean motion, is the frame's"),
    "tie_frame": _V(("tie",), "1", "index of the frame"),
    "body_mass": _V((), "kg", "mass", optional=True),
    "first_moment": _V(("axis",), "kg m", "integral of rho X", optional=True),
    "second_moment": _V(("axis", "axis2"), "kg m2", "integral of rho X X^T", optional=True),
    "unknown_first_moment": _V(("axis", "unknown"), "kg", "integral of rho S per unknown", optional=True),
    "unknown_position_moment": _V(
        ("axis", "axis2", "unknown"), "kg m", "integral of rho X_k S_l per unknown", optional=True
    ),
    "pair_axes": _V(("pair_entry",), "1", "3 k + l of an integral of rho S_k S_l, k <= l", optional=True),
    "pair_row": _V(("pair_entry",), "1", "unknown of S_k", optional=True),
    "pair_column": _V(("pair_entry",), "1", "unknown of S_l", optional=True),
    "pair_value": _V(("pair_entry",), "kg", "integral of rho S_k S_l", optional=True),
}

#: stage 3 on request: what section forces and stresses follow from, of rods and of solids
STRESS: Schema = {
    "section_place": _V(
        ("section",), "m", "position of the section along the rod; one at either end of each cell", True
    ),
    "section_position": _V(("section", "axis"), "m", "undeformed centre of the section, body frame", True),
    "section_rotation": _V(
        ("section", "axis", "axis2"), "1", "rotation matrix, section to body frame, undeformed", True
    ),
    "section_translation_shape": _V(
        ("section", "axis", "mode"), "1", "displacement of the section per modal coordinate, body axes", True
    ),
    "section_rotation_shape": _V(
        ("section", "axis", "mode"), "rad m-1", "rotation vector of the section per modal coordinate", True
    ),
    "slice_mass": _V(("slice",), "kg", "mass of a slice of the rod", True),
    "slice_position": _V(("slice", "axis"), "m", "undeformed centre of mass of the slice, body frame", True),
    "slice_spread": _V(("slice", "axis", "axis2"), "kg m2", "integral of rho r r^T about it, body axes", True),
    "slice_translation_shape": _V(
        ("slice", "axis", "mode"), "1", "displacement of the slice's centre per modal coordinate", True
    ),
    "slice_rotation_shape": _V(
        ("slice", "axis", "mode"), "rad m-1", "rotation vector of the slice per modal coordinate", True
    ),
    "slice_beyond": _V(("section", "slice"), "1", "one where the slice lies beyond the section", True),
    "frame_beyond": _V(("section", "frame"), "1", "one where the named frame lies beyond the section", True),
    "fibre_stress": _V(
        ("section", "fibre", "stress", "section_load"),
        "m-2",
        "axial stress and shear stress along y and z of a fibre per N, Qy, Qz, T, My, Mz",
        True,
        turning="m-3",
    ),
    "section_round": _V(("section",), "1", "one where the section is the same about every axis", True),
    "stress_field": _V(
        ("node", "tensor", "field"), "Pa", "stress at the node, body axes, per unit of the field's factor in SI", True
    ),
    "node_doubtful": _V(("node",), "1", "one where a cell of the node touches a rigidly tied frame", True),
    "gauge_node": _V(("gauge_entry",), "1", "node of a gauge", True),
    "gauge_index": _V(("gauge_entry",), "1", "index of that gauge among `gauge`", True),
}

#: stages 2 and 3: what the reduced body lacks next to the full model
DEFICITS: Schema = {
    "compliance_full": _V(
        ("frame", "frame_held", "direction"),
        "m N-1",
        "static compliance of a frame with another held (itself: with nothing held), full model, axes of the frame",
        optional=True,
        turning="rad N-1 m-1",
    ),
    "compliance_share": _V(
        ("frame", "frame_held", "direction"), "1", "fraction of that compliance which the modes have", optional=True
    ),
    "error_bound": _V(
        ("frame", "direction", "bound_frequency"),
        "m N-1",
        "largest error of a frame's motion along a unit harmonic load on it, axes of the frame",
        optional=True,
        turning="rad N-1 m-1",
    ),
    "effective_mass": _V(
        ("direction", "mode"),
        "kg",
        "squared momentum of the mode per unit rigid motion about the centre of mass, over its modal mass",
        optional=True,
        turning="kg m2",
    ),
}

#: stage 1: nodes and two-node beam cells in the mesh frame
MESH: Schema = {
    "node_position": _V(("node", "axis"), "m", "node position in the mesh frame"),
    "cell_node": _V(("cell", "corner"), "1", "node indices of each cell, from start to end"),
    "area": _V(("cell",), "m2", "cross-section area"),
    "second_moment": _V(("cell", "axis"), "m4", "torsion constant and bending second moments (stiffness)"),
    "inertia_moment": _V(("cell", "axis"), "m4", "polar and bending second moments of area (mass)"),
    "youngs_modulus": _V(("cell",), "Pa", "Young's modulus"),
    "shear_modulus": _V(("cell",), "Pa", "shear modulus"),
    "density": _V(("cell",), "kg m-3", "mass density"),
    "frame_node": _V(("frame",), "1", "node to which the named frame is tied"),
    "frame_position": _V(("frame", "axis"), "m", "origin of the named frame in the mesh frame"),
    "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, frame to mesh frame"),
    "abscissa": _V(("node",), "m", "position of the node along the rod", optional=True),
    "rod_rotation": _V(
        ("axis", "axis2"), "1", "rotation matrix, rod axes (x along the rod) to mesh frame", optional=True
    ),
    "shear_coefficient": _V(
        ("cell", "axis"), "1", "fraction of the area that carries force along x, y and z of the rod", optional=True
    ),
    "product_moment": _V(("cell",), "m4", "integral of y z over the section (stiffness)", optional=True),
    "inertia_product": _V(("cell",), "m4", "integral of y z over the section (mass)", optional=True),
    "area_profile": _V(("cell", "point"), "1", "area at the Gauss points over that of the cell", optional=True),
    "second_moment_profile": _V(
        ("cell", "point", "axis"), "1", "second moments at the Gauss points over those of the cell", optional=True
    ),
    "inertia_moment_profile": _V(("cell", "point", "axis"), "1", "second moments of the mass likewise", optional=True),
    "shear_coefficient_profile": _V(("cell", "point", "axis"), "1", "shear coefficients likewise", optional=True),
    "lump_node": _V(("lump",), "1", "node that carries the lumped mass", optional=True),
    "lump_mass": _V(("lump",), "kg", "lumped mass", optional=True),
    "lump_offset": _V(("lump", "axis"), "m", "centre of the lumped mass seen from its node, mesh axes", optional=True),
    "lump_inertia": _V(
        ("lump", "axis", "axis2"), "kg m2", "inertia of the lumped mass about its centre, mesh axes", optional=True
    ),
}

#: stage 2: frequencies and shapes under one reference condition, all FE degrees of freedom
MODES: Schema = DEFICITS | {
    "frequency": _V(("mode",), "Hz", "natural frequency of the retained coordinate in the reduced basis"),
    "shape": _V(("node", "dof", "mode"), "1", "mass-normalised shape: ux uy uz rx ry rz per unit modal coordinate"),
    "node_position": _V(("node", "axis"), "m", "node position in the mesh frame"),
    "cell_node": _V(("cell", "corner"), "1", "node indices of each drawn cell"),
    "vector": _V(("unknown", "mode"), "1", "mass-normalised shape, every unknown of the model"),
    "rigid_frequency": _V(("rigid_mode",), "Hz", "frequencies of the removed rigid-body modes", optional=True),
    "kind": _V(("mode",), "", "bending, torsion or axial by fraction of kinetic energy"),
    "exact_euler_bernoulli": _V(
        ("mode",), "Hz", "exact frequency of the uniform rod, Euler-Bernoulli bending", optional=True
    ),
    "exact_rayleigh": _V(
        ("mode",), "Hz", "exact frequency of the uniform rod, bending with rotary inertia", optional=True
    ),
    "exact_timoshenko": _V(
        ("mode",), "Hz", "exact frequency of the uniform rod, bending with rotary inertia and shear", optional=True
    ),
}

#: stage 3: all that the dynamics needs of a flexible body, in its body frame
BUNDLE: Schema = (
    DEFICITS
    | STRESS
    | {
        "mass": _V((), "kg", "mass"),
        "first_moment": _V(("axis",), "kg m", "integral of rho X"),
        "second_moment": _V(("axis", "axis2"), "kg m2", "integral of rho X X^T"),
        "modal_first_moment": _V(("axis", "mode"), "kg", "integral of rho S"),
        "position_mode_moment": _V(("axis", "axis2", "mode"), "kg m", "integral of rho X_k S_lj"),
        "mode_mode_moment": _V(("axis", "axis2", "mode", "mode2"), "kg", "integral of rho S_ki S_lj"),
        "modal_mass": _V(("mode", "mode2"), "kg", "modal mass matrix"),
        "modal_stiffness": _V(("mode", "mode2"), "N m-1", "modal stiffness matrix"),
        "frequency": _V(("mode",), "Hz", "natural frequency of the coordinate"),
        "frame_position": _V(("frame", "axis"), "m", "undeformed origin of the named frame in the body frame"),
        "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, named frame to body frame, undeformed"),
        "frame_translation_shape": _V(
            ("frame", "axis", "mode"), "1", "displacement of the frame per modal coordinate, body axes"
        ),
        "frame_rotation_shape": _V(
            ("frame", "axis", "mode"), "rad m-1", "rotation vector of the frame per modal coordinate, body axes"
        ),
        "shortening_first_moment": _V(
            ("mode", "mode2"),
            "kg m-1",
            "integral of rho times the displacement along x that bending causes, second derivative",
            optional=True,
        ),
        "shortening_second_moment": _V(
            ("mode", "mode2"),
            "kg",
            "integral of rho x times the displacement along x that bending causes, second derivative",
            optional=True,
        ),
        "frame_shortening": _V(
            ("frame", "mode", "mode2"),
            "m-1",
            "displacement of the frame along x that bending causes, second derivative by modal coordinates",
            optional=True,
        ),
        "node_position": _V(("node", "axis"), "m", "undeformed node position in the body frame"),
        "cell_node": _V(("cell", "corner"), "1", "node indices of each cell"),
        "shape_translation": _V(("node", "axis", "mode"), "1", "node displacement per modal coordinate, body axes"),
        "shape_rotation": _V(
            ("node", "axis", "mode"), "rad m-1", "node rotation vector per modal coordinate, body axes"
        ),
        "radius": _V(("cell",), "m", "radius of the drawn section"),
        "outline": _V(
            ("cell", "around", "axis"),
            "m",
            "from a rod's centre line to points around its section, body axes, the first again last; not of round ones",
            optional=True,
        ),
    }
)
