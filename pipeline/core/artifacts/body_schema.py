"""The part of the contract about bodies that are no beams, and about what reduced bodies lack."""

from __future__ import annotations

from pipeline.core.artifacts.variable import Schema, Variable

_V = Variable

#: stage 1 of a solid: cells of one type, materials by region, frames tied to nodes
SOLID: Schema = {
    "node_position": _V(("node", "axis"), "m", "node position in the mesh frame"),
    "cell": _V(("cell", "corner"), "1", "node indices of each cell, in the order of VTK"),
    "cell_region": _V(("cell",), "1", "index of the cell's region"),
    "youngs_modulus": _V(("region",), "Pa", "Young's modulus"),
    "poisson": _V(("region",), "1", "Poisson's ratio"),
    "density": _V(("region",), "kg m-3", "mass density"),
    "frame_tie": _V(("frame",), "1", "rigid: nodes follow the frame; mean: the frame follows the nodes"),
    "frame_position": _V(("frame", "axis"), "m", "origin of the named frame in the mesh frame"),
    "frame_rotation": _V(("frame", "axis", "axis2"), "1", "rotation matrix, frame to mesh frame"),
    "tie_node": _V(("tie",), "1", "tied node"),
    "tie_weight": _V(("tie",), "1", "its weight in a mean"),
    "tie_frame": _V(("tie",), "1", "index of the frame that it is tied to"),
}

#: stage 1 of a body that another code has assembled: matrices by their entries, and what the unknowns are
MATRICES: Schema = {
    "unknown_node": _V(("unknown",), "1", "number of the node"),
    "unknown_component": _V(("unknown",), "1", "ux uy uz rx ry rz, or internal where rigid motion has no part"),
    "unknown_position": _V(("unknown", "axis"), "m", "place of the unknown in the mesh frame"),
    "stiffness_row": _V(("stiffness_entry",), "1", "row"),
    "stiffness_column": _V(("stiffness_entry",), "1", "column"),
    "stiffness_value": _V(("stiffness_entry",), "N m-1 or N or N m", "stiffness"),
    "mass_row": _V(("mass_entry",), "1", "row"),
    "mass_column": _V(("mass_entry",), "1", "column"),
    "mass_value": _V(("mass_entry",), "kg or kg m or kg m2", "mass"),
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

#: stage 3 on request: what section forces and stresses follow from
STRESS: Schema = {
    "section_place": _V(("section",), "m", "place of the section along the rod; one at either end of each cell", True),
    "section_position": _V(("section", "axis"), "m", "undeformed centre of the section, body frame", True),
    "section_rotation": _V(
        ("section", "axis", "axis2"), "1", "rotation matrix, section to body frame, undeformed", True
    ),
    "section_translation_shape": _V(
        ("section", "axis", "mode"), "kg-0.5", "displacement of the section per modal coordinate, body axes", True
    ),
    "section_rotation_shape": _V(
        ("section", "axis", "mode"), "kg-0.5 m-1", "rotation vector of the section per modal coordinate", True
    ),
    "slice_mass": _V(("slice",), "kg", "mass of a slice of the rod", True),
    "slice_position": _V(("slice", "axis"), "m", "undeformed centre of mass of the slice, body frame", True),
    "slice_spread": _V(("slice", "axis", "axis2"), "kg m2", "integral of rho r r^T about it, body axes", True),
    "slice_translation_shape": _V(
        ("slice", "axis", "mode"), "kg-0.5", "displacement of the slice's centre per modal coordinate", True
    ),
    "slice_rotation_shape": _V(
        ("slice", "axis", "mode"), "kg-0.5 m-1", "rotation vector of the slice per modal coordinate", True
    ),
    "slice_beyond": _V(("section", "slice"), "1", "one where the slice lies beyond the section", True),
    "frame_beyond": _V(("section", "frame"), "1", "one where the named frame lies beyond the section", True),
    "fibre_stress": _V(
        ("section", "fibre", "stress", "section_load"),
        "m-2 or m-3",
        "axial stress and shear stress along y and z of a fibre per N, Qy, Qz, T, My, Mz",
        True,
    ),
    "section_round": _V(("section",), "1", "one where the section is the same about every axis", True),
}

#: stages 2 and 3: what the reduced body lacks beside the full model
DEFICITS: Schema = {
    "compliance_full": _V(
        ("frame", "frame_held", "direction"),
        "m N-1 or rad N-1 m-1",
        "static compliance of a frame with another held (itself: with nothing held), full model, axes of the frame",
        optional=True,
    ),
    "compliance_share": _V(
        ("frame", "frame_held", "direction"), "1", "share of that compliance which the modes have", optional=True
    ),
    "error_bound": _V(
        ("frame", "direction", "bound_frequency"),
        "m N-1 or rad N-1 m-1",
        "largest error of a frame's motion along a unit harmonic load on it, axes of the frame",
        optional=True,
    ),
    "effective_mass": _V(
        ("direction", "mode"),
        "kg or kg m2",
        "squared momentum of the mode per unit rigid motion about the centre of mass",
        optional=True,
    ),
}
